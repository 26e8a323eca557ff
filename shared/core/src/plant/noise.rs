//! White noise with a seed, the same bits everywhere.

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro128PlusPlus;

/// White noise of unit variance: the sum of four uniform 16-bit numbers, so within ±3.46 and nearly normal
/// (excess kurtosis −0.3).
#[derive(Clone, Debug)]
pub(super) struct Noise(Xoshiro128PlusPlus);

impl Noise {
    /// Stream `stream` of `seed`: neighbours of either are independent.
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_has_unit_variance_and_no_mean() {
        let mut noise = Noise::new(7, 0);
        let n = 100_000;
        let values: heapless::Vec<f64, 100_000> = (0..n).map(|_| f64::from(noise.next())).collect();
        let mean = values.iter().sum::<f64>() / f64::from(n);
        let variance = values.iter().map(|v| v * v).sum::<f64>() / f64::from(n);
        // Standard errors: 1/√n = 0.0032, and about √(1.7/n) = 0.0041.
        assert!(mean.abs() < 0.013 && (variance - 1.0).abs() < 0.017, "{mean} {variance}");
    }
}
