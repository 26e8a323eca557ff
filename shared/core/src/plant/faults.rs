//! Sensor faults for tests: what a broken sensor makes of the readings of a sound one.
//!
//! They act on the readings behind the converter, so that the rig sees what it would see on a board. No message of the
//! protocol sets them: see [`super::Plant::set_sensor_fault`].

use super::Noise;
use crate::io::{SENSORS, Sensor};

/// What is wrong with a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SensorFault {
    /// Its cable is out: the divider pulls the open input to 0 V, but for a residue of 3 mV with 1 mV of noise.
    Unplugged,
    /// It gives the same reading for ever.
    Stuck,
    /// It reads one end of the converter's span.
    AtRail(End),
    /// It has this much more white noise, RMS of a sample in the sensor's unit (m or N).
    Noisy(f32),
}

/// An end of a converter's span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
}

impl Faults {
    pub(super) fn new(seed: u64) -> Self {
        // Apart from the sensors' own noise, which stays what it is.
        Self { faults: [None; SENSORS], stuck_at: [None; SENSORS], noise: Noise::new(!seed, 0) }
    }

    pub(super) fn set(&mut self, sensor: Sensor, fault: Option<SensorFault>) {
        self.faults[sensor as usize] = fault;
        self.stuck_at[sensor as usize] = None;
    }

    /// Whether the sensor has a fault.
    pub(super) fn has(&self, sensor: Sensor) -> bool {
        self.faults[sensor as usize].is_some()
    }

    /// What becomes of a sample.
    pub(super) fn apply(&mut self, sensor: Sensor, sample: f32, span: Span) -> f32 {
        let Span { low, high, per_unit } = span;
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
