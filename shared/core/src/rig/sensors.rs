//! What goes into a tick and what comes out of it: what the blocks of samples come to, and actuator values.
//!
//! Displacements and the spring's force are reduced here from what the converters took since the last tick, as counts on a
//! board ([`CountedBlock`]) and as numbers from a simulated plant ([`Reading::of`]); the wall forces go in sample by sample.

use crate::control::friction_spring::Drive as Motor;
use crate::measure::impacts::{ForceScale, Pair};

/// Control ticks per second.
pub const TICK_HZ: f32 = 1000.0;

/// Samples per tick of displacements and spring force: their converters run at 10 kHz.
pub const SUBSAMPLES: usize = 10;

/// Samples per tick and wall: their converter runs at 50 kHz, so that a block carries a pulse's peak.
pub const WALL_SUBSAMPLES: usize = 50;

/// What the sensors tell since the last tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Displacements and the spring's force.
    pub readings: Readings,
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
            readings: Readings { x: Reading::still(0.0), z: Reading::still(0.0), spring_n: 0.0 },
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
    /// Of a block of equal samples.
    #[must_use]
    pub const fn still(sample_m: f32) -> Self {
        Self { mean_m: sample_m, peak_m: f32::from_bits(sample_m.to_bits() & 0x7fff_ffff), still_at: Some(sample_m) }
    }

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
    /// Of one tick's blocks, oldest first: displacements, m, and the spring's force as read, compression positive, N.
    #[must_use]
    pub fn of(x_m: &[f32; SUBSAMPLES], z_m: &[f32; SUBSAMPLES], spring_n: &[f32; SUBSAMPLES]) -> Self {
        let mut spring = 0.0;
        for sample in spring_n {
            spring += sample;
        }
        Self { x: Reading::of(x_m), z: Reading::of(z_m), spring_n: spring * (1.0 / SUBSAMPLES as f32) }
    }
}

/// A block of a converter's counts as far as it has been looked at.
#[derive(Clone, Copy, Debug)]
pub struct CountedBlock {
    sum: u32,
    low: u16,
    high: u16,
}

impl Default for CountedBlock {
    fn default() -> Self {
        Self { sum: 0, low: u16::MAX, high: 0 }
    }
}

impl CountedBlock {
    /// Of one of the channels that a converter takes one after the other.
    #[must_use]
    pub fn of<const CHANNELS: usize>(block: &[[u16; CHANNELS]; SUBSAMPLES], channel: usize) -> Self {
        let mut counted = Self::default();
        block.iter().filter_map(|samples| samples.get(channel)).for_each(|counts| counted.push(*counts));
        counted
    }

    /// Takes the next of [`SUBSAMPLES`] samples.
    #[inline]
    pub fn push(&mut self, counts: u16) {
        self.sum += u32::from(counts);
        self.low = self.low.min(counts);
        self.high = self.high.max(counts);
    }

    /// The displacement that it means, where `zero_counts` mean none and a count `per_count` m.
    #[must_use]
    pub fn reading(&self, zero_counts: f32, per_count: f32) -> Reading {
        let at = |counts: u16| (f32::from(counts) - zero_counts) * per_count;
        let (low, high) = (at(self.low), at(self.high));
        let (below, above) = (if low < 0.0 { -low } else { low }, if high < 0.0 { -high } else { high });
        Reading {
            mean_m: (self.sum as f32 * (1.0 / SUBSAMPLES as f32) - zero_counts) * per_count,
            peak_m: if below > above { below } else { above },
            still_at: (self.low == self.high).then_some(low),
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
    fn counts_come_to_what_their_numbers_come_to() {
        let (zero_counts, per_count) = (32_760.0, 2.5e-6);
        for block in [[32_000, 33_000, 40, 65_520, 32_760, 9, 8, 7, 6, 5], [32_761; SUBSAMPLES], [12; SUBSAMPLES]] {
            let mut counted = CountedBlock::default();
            block.iter().for_each(|counts| counted.push(*counts));
            let numbers = Reading::of(&block.map(|counts| (f32::from(counts) - zero_counts) * per_count));
            let reading = counted.reading(zero_counts, per_count);
            assert_eq!((reading.peak_m, reading.still_at), (numbers.peak_m, numbers.still_at));
            // Ten roundings of a sum at half the span, against one.
            assert!((reading.mean_m - numbers.mean_m).abs() <= 10.0 * f32::EPSILON * 0.08, "{reading:?}, {numbers:?}");
        }
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
