//! Inputs, outcome and stage of an experiment in one tick.

use super::fault::Fault;
use crate::io::{Readings, SensorSet};
use crate::measure::point::PointResult;
use crate::measure::transient::TransientResult;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Stage of an experiment, or of one of its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ExperimentStage {
    /// Waiting for the structure to come to rest.
    Rest,
    /// Driving, not yet measuring.
    Settle,
    /// Driving and measuring.
    Dwell,
    /// Waiting for a person to deflect, hold and release the structure.
    Hold,
}

impl ExperimentStage {
    /// Every stage, at the index of its number.
    pub const ALL: [Self; 4] = [Self::Rest, Self::Settle, Self::Dwell, Self::Hold];

    /// The stage in words.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Rest => "coming to rest",
            Self::Settle => "settling",
            Self::Dwell => "measuring",
            Self::Hold => "waiting for a person",
        }
    }
}

/// How far an experiment is in its present point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageProgress {
    /// Time that the stage still takes at least, s; 0 while it waits for something or is held, and of experiments other than
    /// stepped sines.
    pub left_s: f32,
    /// Dwells of the present point that have begun, without those that a hold has ended.
    pub dwells: u16,
}

/// Outcome of one tick of an experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The experiment continues.
    Running,
    /// A point is complete.
    Point(PointResult),
    /// The last point is complete, and with it the experiment.
    Finished(PointResult),
    /// The experiment cannot continue.
    Failed(Fault),
    /// A record or a free vibration is complete, and with it the experiment.
    Transient(TransientResult),
}

/// Inputs of one tick of an experiment.
#[derive(Clone, Copy, Debug)]
pub struct TickInputs<'a> {
    /// The tick.
    pub tick: u32,
    /// Sensor readings of the tick.
    pub readings: &'a Readings,
    /// Impacts measured since the start.
    pub impacts: u32,
    /// Sensors with a sample at a rail in this tick.
    pub clipped: SensorSet,
}
