//! The noise that a fit over time leaves: white, and narrow at the resonance.
//!
//! Noise of the base's sensor and disturbances of the structure pass through the structure, so what they leave has the shape of |H|².
//! The spectrum of the residuals is taken as a + b·|H|²; a and b follow by Whittle's likelihood. With it the covariance of the
//! parameters is that of least squares under coloured noise: P·(JᵀRJ)·P, P = (JᵀJ)⁻¹, where JᵀRJ is a sum over the frequencies.

use damprig_fourier::{Complex, spectrum};
use nalgebra::DMatrix;

use crate::statistics::variance_parts;

/// White and resonant part of the residuals' spectrum, as variances per sample where |H| = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ResidualNoise {
    pub(super) white_m2: f64,
    pub(super) resonant_m2: f64,
    /// Lines that tell the resonant part, twice: its degrees of freedom.
    pub(super) degrees_of_freedom: f64,
}

impl ResidualNoise {
    /// Of residuals, with |H|² at the frequencies of [`spectrum`].
    pub(super) fn of(residuals_m: &[f64], h_squared: &[f64]) -> Self {
        let count = residuals_m.len() as f64;
        let powers: Vec<f64> = spectrum(residuals_m).iter().map(|r| r.norm_sqr() / count).collect();
        // The first line holds the offset, which is fitted.
        let lines = || powers.iter().zip(h_squared).skip(1);
        let total = powers.iter().skip(1).sum::<f64>() / (powers.len() - 1) as f64;
        let start = [total.max(f64::MIN_POSITIVE), total / lines().map(|(_, h)| *h).fold(1.0, f64::max)];
        let [white, resonant] = variance_parts(&powers[1..], |n| [1.0, h_squared[n + 1]], start);
        let told = lines().map(|(_, h)| (resonant * h / (white + resonant * h)).powi(2)).sum::<f64>();
        Self { white_m2: white, resonant_m2: resonant, degrees_of_freedom: (2.0 * told).max(2.0) }
    }

    /// Share of the noise's power that is at the resonance.
    pub(super) fn resonant_share(&self, h_squared: &[f64]) -> f64 {
        let resonant = self.resonant_m2 * h_squared.iter().sum::<f64>();
        resonant / (resonant + self.white_m2 * h_squared.len() as f64)
    }

    /// JᵀRJ of the sensitivities, whose spectra are given: the parts of the white and of the resonant noise.
    pub(super) fn seen_by(
        &self,
        sensitivities: &[Vec<Complex<f64>>],
        h_squared: &[f64],
        count: usize,
    ) -> [DMatrix<f64>; 2] {
        let size = sensitivities.len();
        let sum = |weight: &dyn Fn(f64) -> f64| {
            DMatrix::from_fn(size, size, |i, j| {
                let (a, b) = (&sensitivities[i], &sensitivities[j]);
                let of = |n: usize| {
                    // Each line stands for its negative frequency too, except the first.
                    let sides = if n == 0 { 1.0 } else { 2.0 };
                    sides * weight(h_squared[n]) * (a[n] * b[n].conj()).re
                };
                (0..a.len().min(b.len()).min(h_squared.len())).map(of).sum::<f64>() / count as f64
            })
        };
        [sum(&|_| self.white_m2), sum(&|h| self.resonant_m2 * h)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise made in the frequency domain from both parts.
    #[test]
    fn both_parts_of_a_noise_are_told_apart() {
        let count = 4096;
        let h_squared: Vec<f64> = (0..=count / 2)
            .map(|n| {
                let r = n as f64 / 200.0;
                (1.0 + (0.02 * r).powi(2)) / ((1.0 - r * r).powi(2) + (0.02 * r).powi(2))
            })
            .collect();
        let mut random = fastrand::Rng::with_seed(5);
        let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let (white, resonant) = (4.0f64, 0.5f64);
        let mut spectrum: Vec<Complex<f64>> = h_squared
            .iter()
            .map(|h| Complex::new(normal(), normal()) * ((white + resonant * h) * count as f64 / 2.0).sqrt())
            .collect();
        (spectrum[0], spectrum[count / 2]) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
        let mut values = damprig_fourier::Transform::new(count).inverse(spectrum);
        values.iter_mut().for_each(|v| *v /= count as f64);
        let noise = ResidualNoise::of(&values, &h_squared);
        // 2000 lines tell the white part to 2 %, some 100 the other to 10 %.
        assert!((noise.white_m2 / white - 1.0).abs() < 0.1, "{noise:?}");
        assert!((noise.resonant_m2 / resonant - 1.0).abs() < 0.4, "{noise:?}");
    }
}
