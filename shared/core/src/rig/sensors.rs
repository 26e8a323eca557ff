//! What goes into a tick and what comes out of it: blocks of samples, what they come to, and actuator values.

use crate::control::friction_spring::Drive as Motor;
use crate::measure::impacts::{ForceScale, Pair};

/// Control ticks per second.
pub const TICK_HZ: f32 = 1000.0;

/// Samples per tick of displacements and spring force: their converters run at 10 kHz.
pub const SUBSAMPLES: usize = 10;

/// Samples per tick and wall: their converter runs at 50 kHz, so that a block carries a pulse's peak.
pub const WALL_SUBSAMPLES: usize = 50;

/// One tick's samples: the blocks that the converters took since the last tick, oldest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Structure displacement x, m.
    pub x_m: [f32; SUBSAMPLES],
    /// Base displacement z, m.
    pub z_m: [f32; SUBSAMPLES],
    /// Force in the friction damper's spring as read, compression positive, N.
    pub spring_n: [f32; SUBSAMPLES],
    /// Forces on the walls at −d and +d in the converter's counts, on the [`ForceScale`] that the rig has.
    pub walls: [Pair; WALL_SUBSAMPLES],
    /// The spring's limit switch is closed.
    pub at_limit: bool,
    /// The emergency stop is pressed.
    pub emergency_stop: bool,
}

impl Default for Sensors {
    /// Everything at rest.
    fn default() -> Self {
        let resting = ForceScale::default().zero_counts as u16;
        Self {
            x_m: [0.0; SUBSAMPLES],
            z_m: [0.0; SUBSAMPLES],
            spring_n: [0.0; SUBSAMPLES],
            walls: [Pair::new(resting, resting); WALL_SUBSAMPLES],
            at_limit: false,
            emergency_stop: false,
        }
    }
}

/// What a displacement's block comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Mean, m: the decimated value that control and lock-in use. No number if a sample is none.
    pub mean_m: f32,
    /// max |·|, m. No number if a sample is none.
    pub peak_m: f32,
    /// Every sample is this one.
    pub still_at: Option<f32>,
}

impl Reading {
    /// Looks at every sample once.
    #[must_use]
    pub fn of(block: &[f32; SUBSAMPLES]) -> Self {
        // Without the sign, numbers are in the order of their bits, and what is no number is above them all.
        let first = block[0].to_bits();
        let (mut sum, mut peak, mut differs) = (0.0, 0, 0);
        for sample in block {
            let bits = sample.to_bits();
            sum += sample;
            peak = (bits & 0x7fff_ffff).max(peak);
            differs |= bits ^ first;
        }
        Self {
            mean_m: sum * (1.0 / SUBSAMPLES as f32),
            peak_m: f32::from_bits(peak),
            still_at: (differs == 0).then_some(block[0]),
        }
    }
}

/// What a tick's blocks come to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readings {
    /// Structure displacement.
    pub x: Reading,
    /// Base displacement.
    pub z: Reading,
    /// Mean spring force, N.
    pub spring_n: f32,
}

impl Readings {
    /// Of one tick.
    #[must_use]
    pub fn of(sensors: &Sensors) -> Self {
        let mut spring = 0.0;
        for sample in &sensors.spring_n {
            spring += sample;
        }
        Self {
            x: Reading::of(&sensors.x_m),
            z: Reading::of(&sensors.z_m),
            spring_n: spring * (1.0 / SUBSAMPLES as f32),
        }
    }
}

/// One tick's actuator values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Actuators {
    /// Demanded base displacement, m; the board's calibration turns it into a drive voltage.
    pub drive_m: f32,
    /// The drive's relay may be closed.
    pub drive_enabled: bool,
    /// Steps of the friction damper's motor.
    pub motor: Motor,
    /// A simulated plant goes back to its start for the point of this place; a real one cannot.
    pub put_plant_back: Option<u16>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_comes_to_its_mean_and_its_farthest_sample() {
        let block = [1.0, -4.0, 2.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(Reading::of(&block), Reading { mean_m: 0.5, peak_m: 4.0, still_at: None });
        assert_eq!(Reading::of(&[-2.0; SUBSAMPLES]), Reading { mean_m: -2.0, peak_m: 2.0, still_at: Some(-2.0) });
    }

    #[test]
    fn a_sample_that_is_no_number_shows_in_mean_and_peak() {
        let mut block = [1.0; SUBSAMPLES];
        block[3] = f32::NAN;
        let reading = Reading::of(&block);
        assert!(reading.mean_m.is_nan() && reading.peak_m.is_nan());
        block[3] = f32::NEG_INFINITY;
        assert_eq!(Reading::of(&block).peak_m, f32::INFINITY);
    }
}
