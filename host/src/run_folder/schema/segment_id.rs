//! Identifies a segment: one start of the device in an experiment on a set-up.

use serde::{Deserialize, Serialize};

/// A segment.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct SegmentId {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// How many times the experiment had been started on the set-up before.
    pub segment: u32,
}
