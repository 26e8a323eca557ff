//! Seeded white noise, with the same bits on every platform.

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro128PlusPlus;

/// White noise of unit variance: the sum of four uniform 16-bit numbers, so within ±3.46 and nearly normal
/// (excess kurtosis −0.3).
#[derive(Clone, Debug)]
pub(super) struct Noise(Xoshiro128PlusPlus);

impl Noise {
    /// Makes stream `stream` of `seed`. Neighbouring seeds and streams are independent.
    pub(super) fn new(seed: u64, stream: u16) -> Self {
        // The seed is hashed (SplitMix64) on its way into the state.
        Self(Xoshiro128PlusPlus::seed_from_u64(seed.wrapping_add(u64::from(stream) << 48)))
    }

    pub(super) fn next(&mut self) -> f32 {
        let (a, b) = (self.0.next_u32(), self.0.next_u32());
        let sum = ((a & 0xffff) + (a >> 16) + (b & 0xffff) + (b >> 16)) as i32 - 2 * 65_535;
        // Variance of the sum: 4 · (65536² − 1)/12.
        const SCALE: f32 = 1.0 / 37_837.227;
        sum as f32 * SCALE
    }

    /// Two numbers of a coarser noise of unit variance at a third of the cost: each the sum of two uniform 8-bit numbers,
    /// so within ±2.45.
    pub(super) fn next_pair(&mut self) -> [f32; 2] {
        let bits = self.0.next_u32();
        // Variance of the sum: 2 · (256² − 1)/12.
        const SCALE: f32 = 1.0 / 104.511_56;
        let of = |bits: u32| ((bits & 0xff) + (bits >> 8 & 0xff)) as f32 * SCALE - 255.0 * SCALE;
        [of(bits), of(bits >> 16)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_noises_have_unit_variance_and_zero_mean() {
        let mut noise = Noise::new(7, 0);
        check(|| noise.next());
        let mut pairs = Noise::new(8, 0);
        check(|| pairs.next_pair()[0]);
        check(|| pairs.next_pair()[1]);
    }

    fn check(mut next: impl FnMut() -> f32) {
        let n = 100_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let value = f64::from(next());
            (sum, squares) = (sum + value, squares + value * value);
        }
        let (mean, variance) = (sum / f64::from(n), squares / f64::from(n));
        // Standard errors: 1/√n = 0.0032, and about √(1.7/n) = 0.0041.
        assert!(mean.abs() < 0.013 && (variance - 1.0).abs() < 0.017, "{mean} {variance}");
    }
}
