//! Commands to the rig, and its state, status and events.

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

/// State of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum RigState {
    /// No experiment; the drive is off.
    Idle,
    /// An experiment is running, at this stage of its present point.
    Running(ExperimentStage),
    /// The drive is fading out after a stop or the last point.
    Stopping,
    /// Stopped by an interlock until the fault is cleared.
    Faulted,
}

impl RigState {
    /// The state in words, for people.
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
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub enum Command {
    /// Tighten limits for the configured experiment, from its start until the rig is idle again. Idle only.
    SetLimits(ExperimentLimits),
    /// Set the properties of the friction damper's spring until the end of its experiment. The spring must then be
    /// homed again. Idle only.
    SetSpring(SpringSetUp),
    /// Set or remove the twin. Idle only.
    SetTwin(Option<TwinConfig>),
    /// Set the experiment. It starts under the board's limits unless some are tightened. Idle only.
    Configure(Experiment),
    /// Adopt these settings of the board. Allowed when idle, and when faulted with the drive off, because a wrong limit
    /// may have latched the fault. With other settings of its drive, the friction damper must be homed again.
    SetSettings(Settings),
    /// Set the position of the friction damper's drive to unknown, because the drive was replaced, for example with a
    /// new simulated plant. Idle only.
    ReplaceSpring,
    /// Start the configured experiment at tick 0. Idle only.
    Start,
    /// End the experiment; the drive fades out.
    Stop,
    /// Hold a running stepped sine at its present point (`true`), or release it. Nothing is measured while held; after the
    /// release the point is measured from the beginning. A stop or a fault ends the hold.
    Hold(bool),
    /// Clear a latched fault. The rig must be safe.
    ClearFault,
    /// A command to the friction damper's spring.
    Spring(SpringCommand),
    /// Record the shape of the next impact.
    ArmSnippet,
}

/// State of the friction damper as a brake after a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Brake {
    /// No brake is required.
    Open,
    /// The brake is required but cannot close: the spring has no zero reading, has a fault, or is still busy.
    Waits,
    /// The brake is closing.
    Closes,
    /// The brake presses with its force.
    Holds,
}

/// An event that the rig reports on its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Event {
    /// A point is complete.
    Point(PointResult),
    /// The experiment is complete and the drive has faded out.
    Finished {
        /// Points completed.
        points: u16,
        /// Telemetry rows dropped since the start. The rig leaves it 0; the controller, which queues the rows, sets it.
        rows_dropped: u32,
    },
    /// An interlock ended the experiment.
    Fault(Fault),
    /// An event of the friction damper's spring.
    Spring(spring::SpringEvent),
    /// The particle hit a wall.
    Impact(ImpactRecord),
    /// A record or a free vibration is complete.
    Transient(TransientResult),
}

/// Status of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Status {
    /// State of the rig.
    pub state: RigState,
    /// Ticks since the last start.
    pub tick: u32,
    /// Points completed since the last start.
    pub points: u16,
    /// A stepped sine is held at its present point.
    pub held: bool,
    /// The latched fault.
    pub fault: Option<Fault>,
    /// Stage of the sequence to the safe state.
    pub safe: SafeStage,
    /// Sensors that are lost (also detected while the rig is idle), and sensors that were clipped.
    pub sensors: SensorHealth,
    /// State of the friction damper as a brake.
    pub brake: Brake,
    /// Status of the friction damper's spring.
    pub spring: SpringStatus,
    /// Events dropped since power-on because the queue was full.
    pub events_lost: u32,
}

impl Status {
    /// Time since the last start, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        f64::from(self.tick) / f64::from(TICK_HZ)
    }
}
