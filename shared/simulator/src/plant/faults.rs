//! Faults injected into the simulated rig: broken sensors, failed supplies, the emergency stop, a broken
//! friction-spring drive.
//!
//! Sensor faults act on the converter's output, so the rig sees what it would see on a board.
//! [`super::Plant::inject`] and [`ToSimulator::Inject`](crate::messages::ToSimulator::Inject) set them.

use super::Noise;
use super::spring::Breakage;
use damprig_core::io::{SENSORS, Sensor};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A fault to inject into the simulated rig, or to end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum InjectedFault {
    /// A sensor fault; `None` repairs the sensor.
    Sensor {
        /// The sensor.
        sensor: Sensor,
        /// The fault.
        fault: Option<SensorFault>,
    },
    /// A supply is on or off.
    Supply {
        /// The supply.
        supply: Supply,
        /// Whether it is on.
        on: bool,
    },
    /// The emergency stop is pressed or released.
    EmergencyStop {
        /// Whether it is pressed.
        pressed: bool,
    },
    /// Failures of the friction spring's drive; the default is none.
    SpringDrive(Breakage),
}

/// A supply of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Supply {
    /// Supply of all sensors. Without it their outputs are 0 V.
    Sensors,
    /// Supply of the shaker's amplifier. Without it the base is not driven.
    Amplifier,
}

/// A fault of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum SensorFault {
    /// The cable is disconnected: the divider pulls the open input to 0 V, with a residue of 3 mV and 1 mV RMS of
    /// noise.
    Unplugged,
    /// The sensor repeats the same reading.
    Stuck,
    /// The sensor reads one end of the converter's span.
    AtRail(End),
    /// Additional white noise, RMS of a sample in the sensor's unit (m or N).
    Noisy(f32),
}

/// An end of a converter's span.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum End {
    /// 0 counts.
    Low,
    /// Full scale.
    High,
}

/// Reading of an open input, and its RMS noise, as fractions of a span of 3.3 V.
const RESIDUE: f32 = 3e-3 / 3.3;
const RESIDUE_NOISE: f32 = 1e-3 / 3.3;

/// Range of a sensor's samples, and how many of their units make one of the sensor's (m or N).
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Lowest sample.
    pub low: f32,
    /// Highest sample.
    pub high: f32,
    /// Units of a sample per unit of the sensor.
    pub per_unit: f32,
}

/// The faults of every sensor and supply.
#[derive(Clone, Debug)]
pub struct Faults {
    faults: [Option<SensorFault>; SENSORS],
    /// Value that a stuck sensor repeats.
    stuck_at: [Option<f32>; SENSORS],
    noise: Noise,
    /// The sensors have no supply.
    sensors_off: bool,
    /// The shaker's amplifier has no supply.
    pub amplifier_off: bool,
    /// The emergency stop is pressed.
    pub emergency_stop: bool,
}

impl Faults {
    /// No fault; `seed` is that of the faulty sensors' noise.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        // Apart from the sensors' own noise, which stays what it is.
        Self {
            faults: [None; SENSORS],
            stuck_at: [None; SENSORS],
            noise: Noise::new(!seed, 0),
            sensors_off: false,
            amplifier_off: false,
            emergency_stop: false,
        }
    }

    /// Injects a fault, or ends it. Returns the new state of the friction damper's drive if that is what changes.
    pub fn inject(&mut self, fault: &InjectedFault) -> Option<Breakage> {
        match *fault {
            InjectedFault::Sensor { sensor, fault } => {
                self.faults[sensor as usize] = fault;
                self.stuck_at[sensor as usize] = None;
            }
            InjectedFault::Supply { supply: Supply::Sensors, on } => self.sensors_off = !on,
            InjectedFault::Supply { supply: Supply::Amplifier, on } => self.amplifier_off = !on,
            InjectedFault::EmergencyStop { pressed } => self.emergency_stop = pressed,
            InjectedFault::SpringDrive(broken) => return Some(broken),
        }
        None
    }

    /// Whether the sensor's readings are wrong.
    #[must_use]
    pub fn has(&self, sensor: Sensor) -> bool {
        self.sensors_off || self.faults[sensor as usize].is_some()
    }

    /// The reading in place of a sound sample.
    pub fn apply(&mut self, sensor: Sensor, sample: f32, span: Span) -> f32 {
        let Span { low, high, per_unit } = span;
        if self.sensors_off {
            return low;
        }
        match self.faults[sensor as usize] {
            None => sample,
            Some(SensorFault::Unplugged) => {
                let share = RESIDUE + RESIDUE_NOISE * self.noise.next();
                low + (high - low) * share.max(0.0)
            }
            Some(SensorFault::Stuck) => *self.stuck_at[sensor as usize].get_or_insert(sample),
            Some(SensorFault::AtRail(End::Low)) => low,
            Some(SensorFault::AtRail(End::High)) => high,
            Some(SensorFault::Noisy(rms)) => (sample + rms * per_unit * self.noise.next()).max(low).min(high),
        }
    }
}
