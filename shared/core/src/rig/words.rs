//! What may be asked of the rig, and what it answers and reports.

use crate::control::experiment::Experiment;
use crate::control::fault::Fault;
use crate::control::friction_spring::{self as spring, SpringCommand, SpringSetUp, SpringStatus};
use crate::control::outcome::ExperimentStage;
use crate::control::safety::rails::SensorHealth;
use crate::control::safety::{ExperimentLimits, LimitsRejected, Looser, SafeStage};
use crate::io::{AboveLimit, Invalid, TICK_HZ};
use crate::measure::impacts::ImpactRecord;
use crate::measure::point::PointResult;
use crate::measure::transient::TransientResult;
use crate::twin::TwinPlan;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// What the rig is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum State {
    /// Nothing; the drive is off.
    Idle,
    /// An experiment, at this stage of its present point.
    Running(ExperimentStage),
    /// The drive is fading out after a stop or the last point.
    Stopping,
    /// Stopped by an interlock until the fault is cleared.
    Faulted,
}

impl State {
    /// In words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Running(ExperimentStage::Rest) => "waiting for rest",
            Self::Running(ExperimentStage::Settle) => "settling",
            Self::Running(ExperimentStage::Dwell) => "measuring",
            Self::Running(ExperimentStage::Hold) => "waiting for the structure's release",
            Self::Stopping => "stopping",
            Self::Faulted => "faulted",
        }
    }
}

/// What a host may ask of the rig. Settings come checked and made, so that taking them is a move: the tick that takes one
/// has no time to look at it.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum Command {
    /// Tighten limits for the configured experiment, from its start until the rig is idle again. Idle only.
    SetLimits(ExperimentLimits),
    /// Describe the friction damper's spring of the set-up until the end of its experiment; it has to be homed again. Idle
    /// only.
    SetSpring(SpringSetUp),
    /// Let a twin run along, or none. Idle only.
    SetTwin(Option<TwinPlan>),
    /// Set the experiment, or none; it starts under the board's limits unless some are tightened. Idle only.
    Configure(Option<Experiment>),
    /// Begin the configured experiment at tick 0. Idle only.
    Start,
    /// End the experiment: the drive fades out.
    Stop,
    /// Forget a latched fault, once the rig is safe.
    ClearFault,
    /// For the friction damper's spring.
    Spring(SpringCommand),
    /// Record the shape of the next impact.
    ArmSnippet,
}

/// Why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// A parameter is out of range.
    Invalid(Invalid),
    /// A limit of an experiment is looser than the board's.
    Looser(Looser),
    /// The command makes no sense in this state.
    WrongState {
        /// The state.
        state: State,
        /// What to do, in words.
        advice: &'static str,
    },
    /// The command makes no sense at this stage of the friction damper's spring.
    WrongStage {
        /// The stage.
        stage: spring::SpringStage,
        /// What to do, in words.
        advice: &'static str,
    },
    /// This board cannot do it; why, in words.
    NotHere(&'static str),
    /// A value is above a limit of the board's settings.
    AboveLimit(AboveLimit),
}

impl From<AboveLimit> for Refusal {
    fn from(above: AboveLimit) -> Self {
        Self::AboveLimit(above)
    }
}

impl From<Invalid> for Refusal {
    fn from(invalid: Invalid) -> Self {
        Self::Invalid(invalid)
    }
}

impl From<LimitsRejected> for Refusal {
    fn from(rejected: LimitsRejected) -> Self {
        match rejected {
            LimitsRejected::Looser(looser) => Self::Looser(looser),
            LimitsRejected::Invalid(invalid) => Self::Invalid(invalid),
        }
    }
}

impl From<spring::SpringRejected> for Refusal {
    fn from(refusal: spring::SpringRejected) -> Self {
        match refusal {
            spring::SpringRejected::Invalid(invalid) => Self::Invalid(invalid),
            spring::SpringRejected::WrongStage { stage, advice } => Self::WrongStage { stage, advice },
        }
    }
}

/// The friction damper as a brake after a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Brake {
    /// It is not wanted.
    Open,
    /// It is wanted and cannot close: the spring has no zero reading or a fault, or has not ended what it was doing.
    Waits,
    /// It closes.
    Closes,
    /// It presses with its force.
    Holds,
}

/// What a host should hear of without asking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A point is complete.
    Point(PointResult),
    /// The experiment is complete and the drive is silent.
    Finished {
        /// Points completed.
        points: u16,
    },
    /// An interlock ended the experiment.
    Fault(Fault),
    /// The friction damper's spring has something to tell.
    Spring(spring::SpringEvent),
    /// The particle hit a wall.
    Impact(ImpactRecord),
    /// A record or a free vibration is complete.
    Transient(TransientResult),
}

/// A summary of the state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Status {
    /// What the rig is doing.
    pub state: State,
    /// Ticks since the last start.
    pub tick: u32,
    /// Points completed since the last start.
    pub points: u16,
    /// The latched fault.
    pub fault: Option<Fault>,
    /// How far the way to the safe state has been gone.
    pub safe: SafeStage,
    /// Which sensors are lost, also while the rig is idle, and which were clipped.
    pub sensors: SensorHealth,
    /// The friction damper as a brake.
    pub brake: Brake,
    /// The friction damper's spring.
    pub spring: SpringStatus,
    /// Events that found no room, since power-on.
    pub events_lost: u32,
}

impl Status {
    /// Time since the last start, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        f64::from(self.tick) / f64::from(TICK_HZ)
    }
}
