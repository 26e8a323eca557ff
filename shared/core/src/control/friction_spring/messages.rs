//! Inputs, targets, commands, events and status of the friction-damper spring's controller.

use crate::control::fault::Fault;
use crate::control::safety::rails::SensorVerdict;
use crate::io::Invalid;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Inputs of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringInputs {
    /// Spring force as read, compression positive, N: the mean of the tick's block.
    pub force_n: f32,
    /// The tick.
    pub tick: u32,
    /// Verdict on the force sensor in this tick.
    pub force_sensor: SensorVerdict,
    /// The limit switch is closed.
    pub at_switch: bool,
    /// max |x| of the structure over the block, m.
    pub max_abs_x_m: f32,
    /// Measured base amplitude Z, m; `None` if it is not known.
    pub base_amplitude_m: Option<f32>,
    /// The emergency stop is pressed: the motor is switched off in every state.
    pub emergency_stop: bool,
}

/// A target of the spring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Target {
    /// Δs from the zero reading, m. The position is held, whatever the force.
    Deflection {
        /// Δs, m; 0 or greater.
        deflection_m: f32,
    },
    /// F_N, held by force feedback.
    Force {
        /// F_N, N; 0 or greater.
        force_n: f32,
    },
    /// γF = μe·F_N/(kZ), held by force feedback while the measured Z changes.
    FrictionRatio {
        /// γF; 0 or greater.
        ratio: f32,
    },
}

/// A command to the controller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum SpringCommand {
    /// Find the limit switch.
    Home,
    /// Find the zero reading, then stay there.
    TouchOff,
    /// Press with this target.
    Set(Target),
    /// Move the block away from the structure.
    Release,
    /// Stop at the present position.
    Halt,
    /// Clear a latched fault.
    ClearFault,
}

impl SpringCommand {
    /// Whether the command moves the spring towards the structure, or to a place that is still unknown.
    #[must_use]
    pub fn moves(&self) -> bool {
        matches!(self, Self::Home | Self::TouchOff | Self::Set(_))
    }
}

/// Stage of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SpringStage {
    /// The position is unknown; the motor is off.
    Unhomed,
    /// Searching for the limit switch.
    Homing,
    /// The position is known; the zero reading is not known.
    Homed,
    /// Searching for the zero reading.
    TouchingOff,
    /// The zero reading is known; there is no target.
    Ready,
    /// Moving to a target or settling there.
    Setting,
    /// On target and holding it.
    Holding,
    /// Moving the block away from the structure.
    Releasing,
    /// Stopped by a fault; the block may still be moving away.
    Faulted,
}

impl SpringStage {
    /// All stages; the index of each is its value in the signal `spring_stage`.
    pub const ALL: [Self; 9] = [
        Self::Unhomed,
        Self::Homing,
        Self::Homed,
        Self::TouchingOff,
        Self::Ready,
        Self::Setting,
        Self::Holding,
        Self::Releasing,
        Self::Faulted,
    ];

    /// The stage in words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Unhomed => "not homed",
            Self::Homing => "homing",
            Self::Homed => "homed, without a zero reading",
            Self::TouchingOff => "touching off",
            Self::Ready => "ready",
            Self::Setting => "moving to its target",
            Self::Holding => "holding its target",
            Self::Releasing => "releasing",
            Self::Faulted => "faulted",
        }
    }
}

/// Why a command was rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpringRejected {
    /// A parameter is out of range.
    Invalid(Invalid),
    /// The command is not possible at this stage.
    WrongStage {
        /// The stage.
        stage: SpringStage,
        /// What to do, in words.
        advice: &'static str,
    },
}

impl From<Invalid> for SpringRejected {
    fn from(invalid: Invalid) -> Self {
        Self::Invalid(invalid)
    }
}

/// Result of a touch-off: the zero reading with its standard error, and the measured stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ZeroReading {
    /// Seat position at which the force begins, m from the limit switch.
    pub zero_m: f32,
    /// Standard error of `zero_m`, m.
    pub zero_error_m: f32,
    /// Measured k_s, N/m.
    pub stiffness_n_per_m: f32,
}

/// An event of the spring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum SpringEvent {
    /// The spring is homed: the limit switch was found and left.
    Homed,
    /// The touch-off is complete: the zero reading is known.
    Touched(ZeroReading),
    /// The target is reached: the averaged force, N.
    OnTarget {
        /// F_N, N.
        force_n: f32,
    },
    /// A fault was latched.
    Fault(Fault),
}

/// Status of the spring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SpringStatus {
    /// The present stage.
    pub stage: SpringStage,
    /// Seat position from the limit switch, m.
    pub position_m: f32,
    /// Last averaged force above the reading without contact, N.
    pub force_n: f32,
    /// Present target force, N; 0 without a target.
    pub target_force_n: f32,
    /// The target demands more than the permitted force; the permitted force is applied.
    pub saturated: bool,
    /// A step is waiting for the structure to become quiet, or a ratio for a measured Z.
    pub waiting: bool,
    /// The zero reading.
    pub zero: Option<ZeroReading>,
    /// The latched fault.
    pub fault: Option<Fault>,
}
