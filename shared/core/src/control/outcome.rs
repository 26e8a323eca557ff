//! The inputs and the outcome of one tick of an experiment, and its stage.

use super::fault::Fault;
use crate::io::{Readings, SensorSet};
use crate::measure::point::PointResult;
use crate::measure::transient::TransientResult;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Where an experiment, or a point of it, stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ExperimentStage {
    /// Waiting for the structure to come to rest.
    Rest,
    /// Driving, not yet measuring.
    Settle,
    /// Driving and measuring.
    Dwell,
    /// Waiting for a person to hold and release the structure.
    Hold,
}

/// What a tick of an experiment led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It goes on.
    Running,
    /// A point is complete.
    Point(PointResult),
    /// The last point is complete.
    Finished(PointResult),
    /// It cannot go on.
    Failed(Fault),
    /// A record or a free vibration is complete, and with it the experiment.
    Transient(TransientResult),
}

/// What a tick of an experiment looks at.
#[derive(Clone, Copy, Debug)]
pub struct TickInputs<'a> {
    /// The tick.
    pub tick: u32,
    /// Its readings.
    pub readings: &'a Readings,
    /// Impacts measured so far.
    pub impacts: u32,
    /// Sensors with a sample at a rail in this tick.
    pub clipped: SensorSet,
}
