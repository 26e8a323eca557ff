//! What goes into a tick and what comes out of it: what the blocks of samples come to, and actuator values.
//!
//! Displacements and the spring's force are reduced here from what the converters took since the last tick, as counts on a
//! board ([`CountedBlock`]) and as numbers from a simulated plant ([`Reading::of`]); the wall forces go in sample by sample.

use super::calibration::SLOW_USABLE;
use super::channels::{Rail, Usable};
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
            readings: Readings { x: Reading::still(0.0), z: Reading::still(0.0), ..Readings::default() },
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
    /// max |·| of the samples that are not at a rail, m; 0 if all are.
    pub inside_peak_m: f32,
    /// Every sample is this one.
    pub still_at: Option<f32>,
    /// What is at a rail.
    pub rail: Rail,
}

impl Reading {
    /// Of a block of equal samples, none at a rail.
    #[must_use]
    pub const fn still(sample_m: f32) -> Self {
        let peak_m = f32::from_bits(sample_m.to_bits() & 0x7fff_ffff);
        Self { mean_m: sample_m, peak_m, inside_peak_m: peak_m, still_at: Some(sample_m), rail: Rail::Clear }
    }

    /// Looks at every sample once; none is at a rail.
    #[must_use]
    pub fn of(block: &[f32; SUBSAMPLES]) -> Self {
        Self::within(block, &Usable { low: f32::NEG_INFINITY, high: f32::INFINITY })
    }

    /// Looks at every sample of a sensor with this usable span once.
    #[must_use]
    pub fn within(block: &[f32; SUBSAMPLES], usable: &Usable<f32>) -> Self {
        // Without the sign, numbers are in the order of their bits, and what is no number is above them all.
        let first = block[0].to_bits();
        let (mut sum, mut peak, mut inside, mut differs, mut at_rail) = (0.0, 0, 0, 0, 0);
        for sample in block {
            let bits = sample.to_bits();
            sum += sample;
            peak = (bits & 0x7fff_ffff).max(peak);
            differs |= bits ^ first;
            if usable.is_at_rail(*sample) {
                at_rail += 1;
            } else {
                inside = (bits & 0x7fff_ffff).max(inside);
            }
        }
        let mean_m = sum * (1.0 / SUBSAMPLES as f32);
        Self {
            mean_m,
            peak_m: f32::from_bits(peak),
            inside_peak_m: f32::from_bits(inside),
            still_at: (differs == 0).then_some(block[0]),
            rail: usable.rail(at_rail, SUBSAMPLES, mean_m),
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
    /// What of the spring force's block is at a rail.
    pub spring_rail: Rail,
}

impl Readings {
    /// Of the displacements' readings and a block of the spring's force as read, oldest first, compression positive, N.
    #[must_use]
    pub fn new(x: Reading, z: Reading, spring_n: &[f32; SUBSAMPLES], usable_spring: &Usable<f32>) -> Self {
        let (mut sum, mut at_rail) = (0.0, 0);
        for sample in spring_n {
            sum += sample;
            at_rail += usize::from(usable_spring.is_at_rail(*sample));
        }
        let spring_n = sum * (1.0 / SUBSAMPLES as f32);
        Self { x, z, spring_n, spring_rail: usable_spring.rail(at_rail, SUBSAMPLES, spring_n) }
    }
}

/// A block of a slow channel's counts as far as it has been looked at.
#[derive(Clone, Copy, Debug)]
pub struct CountedBlock {
    sum: u32,
    low: u16,
    high: u16,
    /// Of the samples that are not at a rail.
    inside: [u16; 2],
    at_rail: u8,
}

impl Default for CountedBlock {
    fn default() -> Self {
        Self { sum: 0, low: u16::MAX, high: 0, inside: [u16::MAX, 0], at_rail: 0 }
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
        if SLOW_USABLE.is_at_rail(counts) {
            self.at_rail += 1;
        } else {
            self.inside = [self.inside[0].min(counts), self.inside[1].max(counts)];
        }
    }

    fn mean(&self) -> f32 {
        self.sum as f32 * (1.0 / SUBSAMPLES as f32)
    }

    fn rail(&self, mean: f32, to_si: impl Fn(u16) -> f32) -> Rail {
        SLOW_USABLE.map(to_si).rail(usize::from(self.at_rail), SUBSAMPLES, mean)
    }

    /// The displacement that it means, where `zero_counts` mean none and a count `per_count` m.
    #[must_use]
    pub fn reading(&self, zero_counts: f32, per_count: f32) -> Reading {
        let at = |counts: u16| (f32::from(counts) - zero_counts) * per_count;
        let farthest = |low: u16, high: u16| {
            let (low, high) = (libm::fabsf(at(low)), libm::fabsf(at(high)));
            if low > high { low } else { high }
        };
        let mean_m = (self.mean() - zero_counts) * per_count;
        let [low, high] = self.inside;
        Reading {
            mean_m,
            peak_m: farthest(self.low, self.high),
            inside_peak_m: if low <= high { farthest(low, high) } else { 0.0 },
            still_at: (self.low == self.high).then_some(at(self.low)),
            rail: self.rail(mean_m, at),
        }
    }

    /// The mean force that it means, N, and what of it is at a rail.
    #[must_use]
    pub fn force(&self, scale: &ForceScale) -> (f32, Rail) {
        let mean_n = scale.to_force_n(self.mean());
        (mean_n, self.rail(mean_n, |counts| scale.to_force_n(f32::from(counts))))
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
        let expected = Reading { mean_m: 0.5, peak_m: 4.0, inside_peak_m: 4.0, still_at: None, rail: Rail::Clear };
        assert_eq!(Reading::of(&block), expected);
        assert_eq!(Reading::of(&[-2.0; SUBSAMPLES]), Reading::still(-2.0));
        let usable = Usable::of_span(-4.0, 4.0);
        let clipped = Reading::within(&block, &usable);
        assert_eq!(clipped, Reading { inside_peak_m: 2.0, rail: Rail::Some, ..expected });
        let lost = Reading::within(&[-4.0; SUBSAMPLES], &usable);
        assert_eq!((lost.inside_peak_m, lost.rail.is_all()), (0.0, true));
    }

    #[test]
    fn counts_come_to_what_their_numbers_come_to() {
        let (zero_counts, per_count) = (32_760.0, 2.5e-6);
        let to_si = |counts: u16| (f32::from(counts) - zero_counts) * per_count;
        let usable = SLOW_USABLE.map(to_si);
        for block in [[32_000, 33_000, 40, 65_520, 32_760, 9, 8, 7, 6, 5], [32_761; SUBSAMPLES], [12; SUBSAMPLES]] {
            let mut counted = CountedBlock::default();
            block.iter().for_each(|counts| counted.push(*counts));
            let numbers = Reading::within(&block.map(to_si), &usable);
            let reading = counted.reading(zero_counts, per_count);
            let same = |reading: &Reading| (reading.peak_m, reading.inside_peak_m, reading.still_at);
            assert_eq!(same(&reading), same(&numbers));
            assert_eq!((reading.rail.is_all(), reading.rail), (numbers.rail.is_all(), rail_at(&reading, numbers.rail)));
            // Ten roundings of a sum at half the span, against one.
            assert!((reading.mean_m - numbers.mean_m).abs() <= 10.0 * f32::EPSILON * 0.08, "{reading:?}, {numbers:?}");
        }
    }

    /// The same rail, with the mean of the reading: the two round differently.
    fn rail_at(reading: &Reading, rail: Rail) -> Rail {
        match rail {
            Rail::All { edge, .. } => Rail::All { reading: reading.mean_m, edge },
            other => other,
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
