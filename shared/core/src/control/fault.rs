//! Faults: the cause that ended a drive or stopped the friction damper's spring, its tick, the value and the limit.

use crate::io::Sensor;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A latched fault: it stays until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Fault {
    /// What went wrong.
    pub cause: FaultCause,
    /// The tick in which it was found.
    pub tick: u32,
    /// The value that broke the limit, in the cause's unit.
    pub value: f32,
    /// The limit.
    pub limit: f32,
}

/// What ended a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum FaultCause {
    /// The emergency stop is pressed.
    EmergencyStop,
    /// A sample of this sensor is not a number.
    SensorInvalid(Sensor),
    /// This sensor is at a rail of its converter (m or N).
    SensorAtRail(Sensor),
    /// This sensor does not change (s).
    SensorFrozen(Sensor),
    /// This sensor's zero is off its calibration by more than may be followed (N).
    SensorDrifted(Sensor),
    /// |z| reached its limit (m).
    BaseDisplacement,
    /// |x| reached its limit (m).
    StructureDisplacement,
    /// |x| would reach its limit within a few half-cycles (m).
    StructureForeseen,
    /// A wall's force reached its limit (N).
    WallForce,
    /// The drive was at its limit for too long (s).
    DriveSaturated,
    /// Nothing was heard of the host for too long (s).
    HostSilent,
    /// The structure did not come to rest in the time given (m).
    RestTimeout,
    /// The closed loop of the base amplitude swung up (m).
    BaseRunaway,
    /// z is far below the demanded amplitude though the base is driven (m).
    BaseStill,
    /// z is far above the demanded amplitude (m).
    BaseOverdriven,
    /// The friction damper's spring faulted while the rig was driven.
    Spring(SpringFaultCause),
    /// Nobody released the structure for a free vibration in the time given (m).
    ReleaseTimeout,
}

/// A text that names the sensor.
macro_rules! naming {
    ($sensor:expr, $before:literal, $after:literal) => {
        match $sensor {
            Sensor::X => concat!($before, "the x sensor", $after),
            Sensor::Z => concat!($before, "the z sensor", $after),
            Sensor::SpringForce => concat!($before, "the spring force sensor", $after),
            Sensor::WallLow => concat!($before, "the force sensor of the wall at −d", $after),
            Sensor::WallHigh => concat!($before, "the force sensor of the wall at +d", $after),
        }
    };
}

impl FaultCause {
    /// In words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::EmergencyStop => "the emergency stop is pressed",
            Self::SensorInvalid(sensor) => naming!(sensor, "a block of samples was lost, ", " gives no number"),
            Self::SensorAtRail(sensor) => {
                naming!(sensor, "", " reads an end of its span: check its cable, supply and distance")
            }
            Self::SensorFrozen(sensor) => {
                naming!(sensor, "", " does not change while the rig is driven: check its supply")
            }
            Self::SensorDrifted(sensor) => {
                naming!(sensor, "the zero of ", " has drifted beyond impacts.offset_limit_n: check its amplifier")
            }
            Self::BaseDisplacement => "the base reached its displacement limit",
            Self::StructureDisplacement => "the structure reached its displacement limit",
            Self::StructureForeseen => "the structure's growing vibration would have passed its limit",
            Self::WallForce => "the force on a wall reached its limit",
            Self::DriveSaturated => "the drive was at its limit for too long: ask for less",
            Self::HostSilent => "nothing was heard of the host for too long",
            Self::RestTimeout => "the structure did not come to rest in time",
            Self::BaseRunaway => {
                "the base ran away from its demanded amplitude: check the signs of drive and z, and the calibration"
            }
            Self::BaseStill => {
                "the base hardly moves though it is driven: check the amplifier, the relay and the z sensor"
            }
            Self::BaseOverdriven => {
                "the base moves much further than it was asked to: check the calibration of drive and z, and the gain"
            }
            Self::Spring(cause) => cause.text(),
            Self::ReleaseTimeout => "the structure was not held beyond the level and released in time",
        }
    }

    /// The drive stops within the tick: a fade would go on with what is already wrong.
    #[must_use]
    pub fn cuts_at_once(self) -> bool {
        matches!(self, Self::EmergencyStop | Self::BaseDisplacement | Self::BaseRunaway | Self::BaseOverdriven)
    }
}

/// What ended the work of the friction damper's spring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SpringFaultCause {
    /// The limit switch was not found within the travel (value, limit: m).
    SwitchNotFound,
    /// The limit switch stays closed though the seat should have left it (m).
    SwitchStuck,
    /// The limit switch closed, or the end of the travel came, where it should not (m).
    LimitReached,
    /// The whole travel was made without a touch (m).
    NoTouch,
    /// The measured stiffness is not between half and twice the configured one (N/m).
    SpringImplausible,
    /// The settled force is off the spring's line: lost steps, a stall, or a slipped block (N).
    ForceDoesNotFollow,
    /// The force reached its limit (N).
    ForceAboveLargest,
    /// The force sensor is at a rail of its converter, or gives no number (N).
    SensorLost,
    /// The force rises while the seat moves away from the structure (N).
    WrongDirection,
    /// The force falls below the reading without contact: nothing pulls on the block (N).
    WrongSign,
}

/// What is done about a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SafePath {
    /// The position is still trusted: the block moves away, then the motor is switched off.
    Release,
    /// The position is not trusted: the motor stops at once and is switched off. The screw holds itself.
    SwitchOff,
}

impl SpringFaultCause {
    /// The way to the safe state.
    #[must_use]
    pub fn safe_path(self) -> SafePath {
        match self {
            Self::NoTouch | Self::SpringImplausible | Self::ForceAboveLargest | Self::SensorLost | Self::WrongSign => {
                SafePath::Release
            }
            Self::SwitchNotFound
            | Self::SwitchStuck
            | Self::LimitReached
            | Self::ForceDoesNotFollow
            | Self::WrongDirection => SafePath::SwitchOff,
        }
    }

    /// In words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::SwitchNotFound => "the limit switch was not found: check the motor, its direction and the switch",
            Self::SwitchStuck => "the limit switch stays closed: check the switch and its wiring",
            Self::LimitReached => "the end of the travel was reached unexpectedly: home again",
            Self::NoTouch => "the block met no structure within its travel: check the block and the force sensor",
            Self::SpringImplausible => {
                "the measured stiffness is far from the configured: check spring and sensor scale"
            }
            Self::ForceDoesNotFollow => "the force does not follow the position: lost steps or a stall; home again",
            Self::ForceAboveLargest => "the force reached its limit",
            Self::SensorLost => "the spring force sensor reads an end of its span: check its cable and supply",
            Self::WrongDirection => {
                "the force rises while the block moves away: check the motor's direction and the force sensor's sign"
            }
            Self::WrongSign => "the force falls while the block presses: check the sign of the force sensor",
        }
    }
}
