//! Reduction of one tick's block of samples to its mean, its peak and its rails.
//!
//! A simulated plant supplies SI values ([`Reading::within`]); a board supplies the converter's counts
//! ([`super::CountedBlock`]).

use super::rail::{Rail, Usable};
use super::rate::SUBSAMPLES;

/// One tick's block of a displacement, reduced.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Mean, m: the decimated value that control and lock-in use. NaN if a sample is NaN.
    pub mean_m: f32,
    /// max |·|, m. NaN if a sample is NaN.
    pub peak_m: f32,
    /// max |·| of the samples that are not at a rail, m; 0 if every sample is at a rail.
    pub inside_peak_m: f32,
    /// The common value of all samples, if they are identical.
    pub still_at: Option<f32>,
    /// How much of the block is at a rail.
    pub rail: Rail,
}

impl Reading {
    /// The reading of a block of identical samples, none at a rail.
    #[must_use]
    pub const fn still(sample_m: f32) -> Self {
        let peak_m = f32::from_bits(sample_m.to_bits() & 0x7fff_ffff);
        Self { mean_m: sample_m, peak_m, inside_peak_m: peak_m, still_at: Some(sample_m), rail: Rail::Clear }
    }

    /// Reduces a block; no sample counts as at a rail.
    #[must_use]
    pub fn of(block: &[f32; SUBSAMPLES]) -> Self {
        Self::within(block, &Usable { low: f32::NEG_INFINITY, high: f32::INFINITY })
    }

    /// Reduces a block of a sensor with this usable span.
    #[must_use]
    pub fn within(block: &[f32; SUBSAMPLES], usable: &Usable<f32>) -> Self {
        // Without the sign bit, floats sort in the order of their bits, and NaN sorts above every number.
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

/// One tick's blocks, reduced.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readings {
    /// Structure displacement.
    pub x: Reading,
    /// Base displacement.
    pub z: Reading,
    /// Mean spring force, N.
    pub spring_n: f32,
    /// How much of the spring force's block is at a rail.
    pub spring_rail: Rail,
}

impl Readings {
    /// Combines the displacement readings with a block of the spring force as read, oldest first, compression positive,
    /// N.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_reduced_to_its_mean_and_its_largest_magnitude() {
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
    fn a_nan_sample_makes_mean_and_peak_nan() {
        let mut block = [1.0; SUBSAMPLES];
        block[3] = f32::NAN;
        let reading = Reading::of(&block);
        assert!(reading.mean_m.is_nan() && reading.peak_m.is_nan());
        block[3] = f32::NEG_INFINITY;
        assert_eq!(Reading::of(&block).peak_m, f32::INFINITY);
    }
}
