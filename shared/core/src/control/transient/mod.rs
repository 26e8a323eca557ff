//! Transient experiments: [`playback`] of an uploaded record, and [`free_vibration`].

pub mod free_vibration;
pub mod playback;

pub use free_vibration::FreeVibration;
pub use playback::Playback;

use crate::control::outcome::{Outcome, TickInputs};
use crate::io::{Invalid, SensorSet, TICK_HZ, require};
use crate::measure::transient::{Decay, TransientMeter};

/// Longest time of one part of such an experiment, s: 10⁹ ticks.
const LONGEST_S: f32 = 1e9 / TICK_HZ;

fn ticks(seconds: f32) -> u32 {
    // A cast saturates.
    (seconds * TICK_HZ + 0.5) as u32
}

/// The smallest value that a parameter greater than 0 may have.
const MIN: f32 = f32::MIN_POSITIVE;

/// A parameter's name, smallest and largest value, and what is allowed in words.
type ParameterLimit = (&'static str, f32, f32, &'static str);

/// Checks that every value is within its limits; NaN is rejected.
fn within(limits: &'static [ParameterLimit], values: &[f32]) -> Result<(), Invalid> {
    for ((parameter, least, most, allowed), value) in limits.iter().zip(values) {
        require((*least..=*most).contains(value), parameter, f64::from(*value), allowed)?;
    }
    Ok(())
}

/// A measurement that begins at a given tick.
#[derive(Clone, Copy, Debug, Default)]
struct Measuring {
    meter: TransientMeter,
    start_tick: u32,
    impacts_before: u32,
    clipped: SensorSet,
}

impl Measuring {
    fn from(now: &TickInputs) -> Self {
        Self { start_tick: now.tick, impacts_before: now.impacts, ..Self::default() }
    }

    /// Takes one tick: its readings and the demand, m.
    fn push(&mut self, now: &TickInputs, demand_m: f32) {
        self.meter.push(now.readings, demand_m);
        self.clipped.extend(now.clipped);
    }

    /// The result, with this tick as the last.
    fn end(&self, now: &TickInputs, index: u16, drive_saturated: bool, decay: &Decay) -> Outcome {
        let mut result = self.meter.result();
        result.index = index;
        (result.start_tick, result.end_tick) = (self.start_tick, now.tick + 1);
        result.impacts = now.impacts.wrapping_sub(self.impacts_before);
        result.drive_saturated = drive_saturated;
        result.clipped = self.clipped;
        result.decay = *decay;
        // The release of a free vibration is detected a little late.
        result.max_abs_x_m = result.max_abs_x_m.max(decay.start_m);
        Outcome::Transient(result)
    }
}
