//! Faults of the rig and of the friction damper's spring: cause, tick, value and limit.

use crate::io::Sensor;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A latched fault: it stays until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Fault {
    /// Cause of the fault.
    pub cause: FaultCause,
    /// The tick in which the fault was detected.
    pub tick: u32,
    /// The value that violated the limit, in the cause's unit.
    pub value: f32,
    /// The limit.
    pub limit: f32,
}

/// Cause of a fault. The unit of its value and limit is in brackets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum FaultCause {
    /// The emergency stop is pressed.
    EmergencyStop,
    /// A sample of this sensor is not a number.
    SensorInvalid(Sensor),
    /// This sensor is at a rail of its converter (m or N).
    SensorAtRail(Sensor),
    /// This sensor's samples do not change (s).
    SensorFrozen(Sensor),
    /// This sensor's zero has drifted from its calibration beyond the limit (N).
    SensorDrifted(Sensor),
    /// |z| reached its limit (m).
    BaseDisplacement,
    /// |x| reached its limit (m).
    StructureDisplacement,
    /// |x| is predicted to reach its limit within a few half-cycles (m).
    StructureForeseen,
    /// A wall's force reached its limit (N).
    WallForce,
    /// The drive was at its limit for too long (s).
    DriveSaturated,
    /// No message from the host for too long (s).
    HostSilent,
    /// The structure did not come to rest within the time allowed (m).
    RestTimeout,
    /// The closed loop of the base amplitude is unstable: z has grown far beyond the demanded amplitude (m).
    BaseRunaway,
    /// z is far below the demanded amplitude though the base is driven (m).
    BaseStill,
    /// z is far above the demanded amplitude (m).
    BaseOverdriven,
    /// The friction damper's spring had a fault while the rig was driven.
    Spring(SpringFaultCause),
    /// The structure was not released for a free vibration within the time allowed (m).
    ReleaseTimeout,
    /// The next drive of the response's loop would move the base to its limit (m).
    BaseForeseen,
}

/// A text that contains the sensor's name.
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
    /// The cause in words, for people.
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
            Self::BaseForeseen => "the response needs more of the base than its displacement limit: ask for less",
        }
    }

    /// The drive is cut within the tick: a fade would prolong these faults.
    #[must_use]
    pub fn cuts_at_once(self) -> bool {
        matches!(self, Self::EmergencyStop | Self::BaseDisplacement | Self::BaseRunaway | Self::BaseOverdriven)
    }
}

/// Cause of a fault of the friction damper's spring. The unit of its value and limit is in brackets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SpringFaultCause {
    /// The limit switch was not found within the travel (value, limit: m).
    SwitchNotFound,
    /// The limit switch stays closed although the seat should have left it (m).
    SwitchStuck,
    /// The limit switch closed, or the end of the travel was reached, unexpectedly (m).
    LimitReached,
    /// The seat covered the whole travel without a touch (m).
    NoTouch,
    /// The measured stiffness is not between half and twice the configured stiffness (N/m).
    SpringImplausible,
    /// The settled force is off the spring's line: lost steps, a stall or a slipped block (N).
    ForceDoesNotFollow,
    /// The force reached its limit (N).
    ForceAboveLargest,
    /// The force sensor is at a rail of its converter, or reads NaN (N).
    SensorLost,
    /// The force rises while the seat moves away from the structure (N).
    WrongDirection,
    /// The force falls below the reading without contact, although nothing can pull on the block (N).
    WrongSign,
}

/// Reaction of the friction damper's spring to a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SafePath {
    /// The position is still known: the block moves away, then the motor is switched off.
    Release,
    /// The position is unreliable: the motor stops at once and is switched off. The screw is self-locking.
    SwitchOff,
}

impl SpringFaultCause {
    /// The reaction to this fault.
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

    /// The cause in words, for people.
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
