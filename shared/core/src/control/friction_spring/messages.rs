//! What goes into the friction-damper spring's controller and what comes out of it.

use crate::control::fault::Fault;
use crate::control::safety::rails::Verdict;
use crate::io::Invalid;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// One tick's readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringInputs {
    /// Spring force as read, compression positive, N: the mean of the tick's block.
    pub force_n: f32,
    /// The tick.
    pub tick: u32,
    /// What the force sensor is worth in this tick.
    pub force_sensor: Verdict,
    /// The limit switch is closed.
    pub at_switch: bool,
    /// max |x| of the structure over the block, m.
    pub x_peak_m: f32,
    /// Measured base amplitude Z, m; `None` while there is none.
    pub base_amplitude_m: Option<f32>,
    /// The emergency stop is pressed: the motor is switched off, whatever it is doing.
    pub emergency_stop: bool,
}

/// What the spring is to be set to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Target {
    /// Δs from the zero reading, m. The position is kept, whatever the force does.
    Deflection {
        /// Δs, m; 0 or greater.
        deflection_m: f32,
    },
    /// F_N, kept by force feedback.
    Force {
        /// F_N, N; 0 or greater.
        force_n: f32,
    },
    /// γF = μe·F_N/(kZ), kept by force feedback while the measured Z changes.
    FrictionRatio {
        /// γF; 0 or greater.
        ratio: f32,
    },
}

/// What may be asked of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum SpringCommand {
    /// Find the limit switch.
    Home,
    /// Find the zero reading, then wait there.
    TouchOff,
    /// Press.
    Set(Target),
    /// Move the block away from the structure.
    Release,
    /// Stop where it is.
    Halt,
    /// Forget a latched fault.
    ClearFault,
}

/// What the controller is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SpringStage {
    /// The position is unknown; the motor is off.
    Unhomed,
    /// Looking for the limit switch.
    Homing,
    /// The position is known, the zero reading is not.
    Homed,
    /// Looking for the zero reading.
    TouchingOff,
    /// The zero reading is known; no target.
    Ready,
    /// On the way to a target or settling there.
    Setting,
    /// On target, and kept there.
    Holding,
    /// Moving the block away.
    Releasing,
    /// Stopped by a fault; the block may still be moving away.
    Faulted,
}

impl SpringStage {
    /// In words, for people.
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

/// Why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpringRejected {
    /// A parameter is out of range.
    Invalid(Invalid),
    /// It makes no sense at this stage.
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

/// The zero reading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ZeroReading {
    /// Where the force begins, m from the limit switch.
    pub zero_m: f32,
    /// Standard error of `zero_m`, m.
    pub zero_error_m: f32,
    /// Measured k_s, N/m.
    pub stiffness_n_per_m: f32,
}

/// What is worth telling.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum SpringEvent {
    /// The limit switch was found and left.
    Homed,
    /// The zero reading is known.
    Touched(ZeroReading),
    /// The target is met: the averaged force, N.
    OnTarget {
        /// F_N, N.
        force_n: f32,
    },
    /// A fault was latched.
    Fault(Fault),
}

/// A summary.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SpringStatus {
    /// What it is doing.
    pub stage: SpringStage,
    /// Seat position from the limit switch, m.
    pub position_m: f32,
    /// Last averaged force above the reading without contact, N.
    pub force_n: f32,
    /// Force asked for at present, N; 0 without a target.
    pub target_force_n: f32,
    /// The target asks for more than may be given, and gets what may.
    pub saturated: bool,
    /// A step waits for the structure to become quiet, or a ratio for a measured Z.
    pub waiting: bool,
    /// The zero reading.
    pub zero: Option<ZeroReading>,
    /// The latched fault.
    pub fault: Option<Fault>,
}
