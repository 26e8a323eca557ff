//! Commands to the rig, its state, its status and its events.

use crate::control::experiment::Experiment;
use crate::control::fault::Fault;
use crate::control::friction_spring::{self as spring, SpringCommand, SpringSetUp, SpringStatus};
use crate::control::outcome::ExperimentStage;
use crate::control::safety::rails::SensorHealth;
use crate::control::safety::{ExperimentLimits, SafeStage};
use crate::io::TICK_HZ;
use crate::measure::impacts::ImpactRecord;
use crate::measure::point::PointResult;
use crate::measure::transient::TransientResult;
use crate::settings::Settings;
use crate::twin::TwinConfig;
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

/// A command to the rig.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum Command {
    /// Tighten limits for the configured experiment, from its start until the rig is idle again. Idle only.
    SetLimits(ExperimentLimits),
    /// Describe the friction damper's spring of the set-up until the end of its experiment; it has to be homed again. Idle
    /// only.
    SetSpring(SpringSetUp),
    /// Let a twin run along, or none. Idle only.
    SetTwin(Option<TwinConfig>),
    /// Set the experiment; it starts under the board's limits unless some are tightened. Idle only.
    Configure(Experiment),
    /// Use these settings of the board. Idle only, or faulted with the drive off: a limit that was set wrong may have latched the
    /// fault. A friction damper's drive with other settings has to be homed again.
    SetSettings(Settings),
    /// The friction damper's drive was replaced, as on a simulated plant that was set: its position is unknown. Idle only.
    ReplaceSpring,
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

/// What the rig reports by itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Event {
    /// A point is complete.
    Point(PointResult),
    /// The experiment is complete and the drive is silent.
    Finished {
        /// Points completed.
        points: u16,
        /// Telemetry rows that found no room since the start. The rig leaves it 0; the controller, which queues the rows, sets it.
        rows_dropped: u32,
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
