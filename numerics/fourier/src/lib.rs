//! The discrete Fourier transform of real samples, X_k = Σ x_n e^(−2πikn/N).
//!
//! A crate of its own: the library's transforms are generic, and are compiled, optimised, once here.

use std::sync::Arc;

pub use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

/// The transform of a fixed number of samples, in both directions.
pub struct Transform {
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl Transform {
    /// Plans the transform of `count` samples, at least 1.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let mut planner = RealFftPlanner::new();
        Self { forward: planner.plan_fft_forward(count), inverse: planner.plan_fft_inverse(count) }
    }

    /// The lines 0 to N/2 of the spectrum; those of negative frequency are their conjugates.
    ///
    /// # Panics
    /// If there are not as many samples as planned.
    #[must_use]
    pub fn forward(&self, mut samples: Vec<f64>) -> Vec<Complex<f64>> {
        let mut spectrum = self.forward.make_output_vec();
        self.forward.process(&mut samples, &mut spectrum).expect("as many samples as planned");
        spectrum
    }

    /// N times the samples whose spectrum has these lines 0 to N/2. The first line, and the last one of an even number of samples, are real:
    /// an imaginary part of theirs is left out.
    ///
    /// # Panics
    /// If there are not N/2 + 1 lines.
    #[must_use]
    pub fn inverse(&self, mut spectrum: Vec<Complex<f64>>) -> Vec<f64> {
        spectrum[0].im = 0.0;
        if self.inverse.len().is_multiple_of(2) {
            spectrum[self.inverse.len() / 2].im = 0.0;
        }
        let mut samples = self.inverse.make_output_vec();
        self.inverse.process(&mut spectrum, &mut samples).expect("as many lines as planned");
        samples
    }
}

/// The lines 0 to N/2 of the spectrum of some samples, at least 1.
#[must_use]
pub fn spectrum(samples: &[f64]) -> Vec<Complex<f64>> {
    Transform::new(samples.len()).forward(samples.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_the_sums_that_define_them_and_lead_back_to_the_samples() {
        for count in [1, 2, 7, 12, 31] {
            let samples: Vec<f64> = (0..count).map(|n| ((n * n) as f64 + 0.3).sin()).collect();
            let lines = spectrum(&samples);
            assert_eq!(lines.len(), count / 2 + 1);
            for (k, line) in lines.iter().enumerate() {
                let turn = -std::f64::consts::TAU * k as f64 / count as f64;
                let sum: Complex<f64> =
                    samples.iter().enumerate().map(|(n, x)| Complex::from_polar(*x, turn * n as f64)).sum();
                // N additions of values up to 1, each rounded.
                assert!((line - sum).norm() < 4.0 * f64::EPSILON * (count * count) as f64, "{count} {k}");
            }
            let back = Transform::new(count).inverse(lines);
            for (back, sample) in back.iter().zip(&samples) {
                assert!((back / count as f64 - sample).abs() < 4.0 * f64::EPSILON * count as f64, "{count}");
            }
        }
    }
}
