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
