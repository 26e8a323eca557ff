//! What a viewer may ask for, as its messages say it, and what that means to a simulated rig.

use damprig_core::io::Sensor;
use damprig_simulator::plant::InjectedFault;
use damprig_simulator::plant::faults::{SensorFault, Supply};
use serde::Deserialize;

/// A message of a viewer.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Request {
    /// Its number, repeated in the answer.
    #[serde(default)]
    pub id: u64,
    /// The token printed at the start.
    #[serde(default)]
    pub token: String,
    /// What to do.
    #[serde(flatten)]
    pub action: Action,
}

/// What a viewer can ask for. All but [`Action::Replay`] need the token.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Action {
    /// End the run, or stop the rig's experiment.
    Stop,
    /// Turn the drive off until the run is resumed; the interrupted point is repeated.
    Pause,
    /// Go on after a pause.
    Resume,
    /// Stay at the present point.
    Hold,
    /// Go on after a hold.
    Release,
    /// Clear a latched fault.
    ClearFault,
    /// Press the friction spring with a force; 0 releases it.
    SetSpring {
        /// The force, N.
        force_n: f32,
    },
    /// Inject a fault into a simulated rig, or end it.
    Inject {
        /// The fault.
        fault: Injection,
    },
    /// Move a replay.
    Replay {
        /// Rig seconds per second.
        speed: Option<f64>,
        /// Whether it stands.
        paused: Option<bool>,
        /// The time to show, s.
        to_s: Option<f64>,
    },
}

/// A fault to inject.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Injection {
    /// A fault of a sensor; none repairs it.
    Sensor {
        /// The sensor.
        sensor: SensorName,
        /// The fault.
        how: Option<SensorTrouble>,
    },
    /// The emergency stop.
    EmergencyStop {
        /// Whether it is pressed.
        on: bool,
    },
    /// The cable between host and rig.
    Cable {
        /// Whether it is pulled.
        on: bool,
    },
    /// A supply.
    Supply {
        /// The supply.
        supply: SupplyName,
        /// Whether it is on.
        on: bool,
    },
}

impl Injection {
    /// The fault as the simulator takes it; none for the cable, which is no part of the rig.
    #[must_use]
    pub fn to_simulator(&self) -> Option<InjectedFault> {
        Some(match self {
            Self::Sensor { sensor, how } => {
                InjectedFault::Sensor { sensor: sensor.sensor(), fault: how.map(|how| how.fault(sensor.sensor())) }
            }
            Self::EmergencyStop { on } => InjectedFault::EmergencyStop { pressed: *on },
            Self::Supply { supply: SupplyName::Sensors, on } => {
                InjectedFault::Supply { supply: Supply::Sensors, on: *on }
            }
            Self::Supply { supply: SupplyName::Amplifier, on } => {
                InjectedFault::Supply { supply: Supply::Amplifier, on: *on }
            }
            Self::Cable { .. } => return None,
        })
    }

    /// What it acts on, and the fault in words; none when it repairs.
    #[must_use]
    pub fn in_words(&self) -> (&'static str, Option<&'static str>) {
        match self {
            Self::Sensor { sensor, how } => (sensor.text(), how.map(SensorTrouble::text)),
            Self::EmergencyStop { on } => ("the emergency stop", on.then_some("pressed")),
            Self::Cable { on } => ("the cable", on.then_some("pulled")),
            Self::Supply { supply: SupplyName::Sensors, on } => ("the supply of the sensors", (!on).then_some("off")),
            Self::Supply { supply: SupplyName::Amplifier, on } => {
                ("the supply of the amplifier", (!on).then_some("off"))
            }
        }
    }
}

/// A sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum SensorName {
    X,
    Z,
    Spring,
    WallLow,
    WallHigh,
}

/// A fault of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorTrouble {
    /// Its cable is disconnected.
    Unplugged,
    /// It repeats one reading.
    Stuck,
    /// It has additional noise.
    Noisy,
}

/// A supply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum SupplyName {
    Sensors,
    Amplifier,
}

/// RMS of a noisy sensor's additional noise.
const NOISE_M: f32 = 1e-3;
const NOISE_N: f32 = 20.0;

impl SensorName {
    fn sensor(self) -> Sensor {
        match self {
            Self::X => Sensor::X,
            Self::Z => Sensor::Z,
            Self::Spring => Sensor::SpringForce,
            Self::WallLow => Sensor::WallLow,
            Self::WallHigh => Sensor::WallHigh,
        }
    }

    fn text(self) -> &'static str {
        match self {
            Self::X => "the x sensor",
            Self::Z => "the z sensor",
            Self::Spring => "the spring force sensor",
            Self::WallLow => "the force sensor of the wall at −d",
            Self::WallHigh => "the force sensor of the wall at +d",
        }
    }
}

impl SensorTrouble {
    fn fault(self, sensor: Sensor) -> SensorFault {
        match self {
            Self::Unplugged => SensorFault::Unplugged,
            Self::Stuck => SensorFault::Stuck,
            Self::Noisy if matches!(sensor, Sensor::X | Sensor::Z) => SensorFault::Noisy(NOISE_M),
            Self::Noisy => SensorFault::Noisy(NOISE_N),
        }
    }

    fn text(self) -> &'static str {
        match self {
            Self::Unplugged => "unplugged",
            Self::Stuck => "stuck",
            Self::Noisy => "noisy",
        }
    }
}
