//! The experiments that a rig can be given, and what they have in common: one is planned outside the tick, then
//! carried out a tick at a time.
//!
//! [`Experiment`] is what has been checked, [`Runner`] what is in progress; here is only the choice between the kinds.

use super::limits::Fault;
use super::stepped_sine;
use crate::measure::point::PointResult;
use crate::rig::Readings;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Where an experiment, or a point of it, stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Stage {
    /// Waiting for the structure to come to rest.
    Rest,
    /// Driving, not yet measuring.
    Settle,
    /// Driving and measuring.
    Dwell,
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
}

/// What a tick of an experiment looks at.
#[derive(Clone, Copy, Debug)]
pub struct Now<'a> {
    /// The tick.
    pub tick: u32,
    /// Its readings.
    pub readings: &'a Readings,
    /// Impacts measured so far.
    pub impacts: u32,
}

/// A checked experiment.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum Experiment {
    /// One frequency after another.
    SteppedSine(stepped_sine::Plan),
}

/// An experiment in progress. Its [`Experiment`] is the caller's: every call wants the same one.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)]
pub enum Runner {
    /// One frequency after another.
    SteppedSine(stepped_sine::Runner),
}

/// The same question to whichever runner it is.
macro_rules! ask {
    ($runner:expr, $own:ident => $answer:expr) => {
        match $runner {
            Runner::SteppedSine($own) => $answer,
        }
    };
}

impl Runner {
    /// At the beginning.
    #[must_use]
    pub fn new(experiment: &Experiment) -> Self {
        match experiment {
            Experiment::SteppedSine(plan) => Self::SteppedSine(stepped_sine::Runner::new(plan)),
        }
    }

    /// One tick: this tick's readings in, the demanded base displacement (m) out.
    #[inline]
    pub fn tick(&mut self, experiment: &Experiment, now: &Now) -> (f32, Outcome) {
        match (self, experiment) {
            (Self::SteppedSine(runner), Experiment::SteppedSine(plan)) => runner.tick(plan, now),
        }
    }

    /// The drive for this tick, m, without measuring: for the fade after a stop. What was measured before it is
    /// evaluated still.
    #[inline]
    pub fn fade(&mut self, experiment: &Experiment) -> (f32, Outcome) {
        match (self, experiment) {
            (Self::SteppedSine(runner), Experiment::SteppedSine(plan)) => runner.fade(plan),
        }
    }

    /// Where it stands.
    #[must_use]
    pub fn stage(&self) -> Stage {
        ask!(self, own => own.stage())
    }

    /// The present drive frequency, Hz; 0 where there is none.
    #[must_use]
    pub fn frequency_hz(&self) -> f32 {
        match self {
            Self::SteppedSine(own) => own.frequency_hz(),
        }
    }

    /// A cycle of the drive ended in the last tick.
    #[must_use]
    pub fn cycle_ended(&self) -> bool {
        match self {
            Self::SteppedSine(own) => own.cycle_ended(),
        }
    }

    /// What was measured waits for its evaluation.
    #[must_use]
    pub fn is_evaluating(&self) -> bool {
        ask!(self, own => own.is_evaluating())
    }

    /// The base is meant to move visibly.
    #[must_use]
    pub fn is_swinging(&self) -> bool {
        ask!(self, own => own.is_swinging())
    }

    /// The drive is on.
    #[must_use]
    pub fn is_driving(&self) -> bool {
        ask!(self, own => own.is_driving())
    }

    /// The drive was at its limit in the last tick.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        ask!(self, own => own.is_saturated())
    }

    /// A simulated plant should be put back to its start in this tick, for the point of this place.
    #[must_use]
    pub fn wants_plant_put_back(&self) -> Option<u16> {
        ask!(self, own => own.wants_plant_put_back())
    }

    /// Lets the drive fade out, whatever comes after.
    pub fn release_drive(&mut self) {
        ask!(self, own => own.release_drive());
    }

    /// The drive has faded out.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        ask!(self, own => own.is_silent())
    }
}
