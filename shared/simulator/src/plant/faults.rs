//! Faults injected into the simulated rig: broken sensors, failed supplies, the emergency stop, and a broken friction-damper drive.
//!
//! Sensor faults act on the readings behind the converter, so the rig sees what it would see on a board. Faults are set by
//! [`super::Plant::inject`] or [`ToSimulator::Inject`](crate::messages::ToSimulator::Inject).

use super::Noise;
use super::spring::Breakage;
use damprig_core::io::{SENSORS, Sensor};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A fault of the simulated rig, or its end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum InjectedFault {
    /// A sensor is broken; without a fault it is sound again.
    Sensor {
        /// Which.
        sensor: Sensor,
        /// How.
        fault: Option<SensorFault>,
    },
    /// A supply is on or off.
    Supply {
        /// Which.
        supply: Supply,
        /// Whether it is on.
        on: bool,
    },
    /// The emergency stop is pressed or released.
    EmergencyStop {
        /// Whether it is pressed.
        pressed: bool,
    },
    /// The friction damper's drive is broken in these ways; in none of them by default.
    SpringDrive(Breakage),
}

/// A supply of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Supply {
    /// All sensors': their outputs fall to 0 V.
    Sensors,
    /// The shaker amplifier's: the base gets no drive.
    Amplifier,
}

/// What is wrong with a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum SensorFault {
    /// Its cable is out: the divider pulls the open input to 0 V, but for a residue of 3 mV with 1 mV of noise.
    Unplugged,
    /// It repeats the same reading.
    Stuck,
    /// It reads one end of the converter's span.
    AtRail(End),
    /// It has this much more white noise, RMS of a sample in the sensor's unit (m or N).
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

/// An open input, and its noise, as shares of a span of 3.3 V.
const RESIDUE: f32 = 3e-3 / 3.3;
const RESIDUE_NOISE: f32 = 1e-3 / 3.3;

/// What a sensor's samples go from and to, and samples' units in a unit of the sensor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub low: f32,
    pub high: f32,
    pub per_unit: f32,
}

/// The faults of every sensor.
#[derive(Clone, Debug)]
pub(super) struct Faults {
    faults: [Option<SensorFault>; SENSORS],
    /// What a stuck sensor reads.
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
    pub(super) fn new(seed: u64) -> Self {
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

    pub(super) fn set(&mut self, sensor: Sensor, fault: Option<SensorFault>) {
        self.faults[sensor as usize] = fault;
        self.stuck_at[sensor as usize] = None;
    }

    pub(super) fn set_supply(&mut self, supply: Supply, on: bool) {
        match supply {
            Supply::Sensors => self.sensors_off = !on,
            Supply::Amplifier => self.amplifier_off = !on,
        }
    }

    /// Whether the sensor's readings are wrong.
    pub(super) fn has(&self, sensor: Sensor) -> bool {
        self.sensors_off || self.faults[sensor as usize].is_some()
    }

    /// The reading in place of a sound sample.
    pub(super) fn apply(&mut self, sensor: Sensor, sample: f32, span: Span) -> f32 {
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
