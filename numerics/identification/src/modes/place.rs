//! The measured lines of a place, and the constants of modes and residual terms that fit them best.

use std::f64::consts::TAU;

use damprig_fourier::Complex;
use nalgebra::{DMatrix, DVector};

use super::C64;
use crate::modal::{FrequencyResponse, ResponseLine};
use crate::statistics::variance_parts;

/// Powers of f/f₀ of the residual terms; the last of either end show what further ones would change.
const POWERS: [i32; 5] = [0, -2, 2, -4, 4];

/// Least standard deviation of a line as a share of the median |H|.
const MIN_DEVIATION: f64 = 1e-7;

/// The measured lines of a place.
pub(super) struct Place {
    pub lines: Vec<ResponseLine>,
    /// What multiplies receptances.
    factors: Vec<C64>,
    middle_hz: f64,
    pub median: f64,
    /// Residual terms.
    pub terms: usize,
}

/// Frequencies and damping ratios in turn.
pub(super) type Poles = [f64];

impl Place {
    pub fn new(response: &FrequencyResponse, lines: Vec<ResponseLine>, middle_hz: f64) -> Self {
        let factors = lines.iter().map(|line| response.quantity.of_receptance(TAU * line.frequency_hz).1).collect();
        let mut all: Vec<f64> = lines.iter().map(|line| line.h.norm()).collect();
        all.sort_by(f64::total_cmp);
        let median = all[all.len() / 2];
        Self { lines, factors, middle_hz, median, terms: POWERS.len() }
    }

    /// What multiplies A of each mode and each B at each line.
    pub fn columns(&self, poles: &Poles) -> DMatrix<C64> {
        let count = poles.len() / 2;
        DMatrix::from_fn(self.lines.len(), count + self.terms, |n, k| {
            let hz = self.lines[n].frequency_hz;
            self.factors[n]
                * match k.checked_sub(count) {
                    None => {
                        let (natural, omega) = (TAU * poles[2 * k], TAU * hz);
                        Complex::new(natural * natural - omega * omega, 2.0 * poles[2 * k + 1] * natural * omega).inv()
                    }
                    Some(term) => C64::from((hz / self.middle_hz).powi(POWERS[term])),
                }
        })
    }

    /// A of each mode and B that fit best.
    pub fn constants(&self, poles: &Poles, deviations: &[f64]) -> Option<Constants> {
        let columns = self.columns(poles);
        let mut weighted = columns.clone();
        for (mut row, deviation) in weighted.row_iter_mut().zip(deviations) {
            row /= C64::from(*deviation);
        }
        let target =
            DVector::from_iterator(self.lines.len(), self.lines.iter().zip(deviations).map(|(line, d)| line.h / *d));
        // Columns of one size, so that their normal matrix is well conditioned.
        let scale: Vec<f64> = weighted.column_iter().map(|own| own.norm().recip()).collect();
        for (mut column, scale) in weighted.column_iter_mut().zip(&scale) {
            column *= C64::from(*scale);
        }
        let mut inverse = (weighted.adjoint() * &weighted).cholesky()?.inverse();
        for i in 0..scale.len() {
            for j in 0..scale.len() {
                inverse[(i, j)] *= C64::from(scale[i] * scale[j]);
            }
        }
        for (mut column, scale) in weighted.column_iter_mut().zip(&scale) {
            column /= C64::from(*scale);
        }
        let constants = &inverse * (weighted.adjoint() * target);
        let is_finite = constants.iter().all(|value| value.is_finite());
        is_finite.then_some(Constants { columns, values: constants, variances: inverse.diagonal().map(|own| own.re) })
    }

    /// H that fits best.
    pub fn fitted(&self, poles: &Poles, deviations: &[f64]) -> Option<Vec<C64>> {
        Some(self.constants(poles, deviations)?.fitted())
    }

    /// Standard deviations of the parts of each line, from what a fit leaves.
    pub fn deviations(&self, fitted: &[C64], parameters: usize) -> Vec<f64> {
        let count = self.lines.len();
        // The fit takes a share of the noise.
        let taken = 2.0 * count as f64 / (2 * count - parameters.min(2 * count - 1)) as f64;
        let power =
            |(line, fitted): (&ResponseLine, &C64)| (0.5 * taken * (line.h - fitted).norm_sqr()).max(f64::MIN_POSITIVE);
        let powers: Vec<f64> = self.lines.iter().zip(fitted).map(power).collect();
        let shapes: Vec<[f64; 2]> = fitted.iter().map(|h| [self.median * self.median, h.norm_sqr()]).collect();
        let parts = variance_parts(&powers, |n| shapes[n], [1e-4; 2]);
        let least = (MIN_DEVIATION * self.median).powi(2);
        shapes.iter().map(|[a, b]| (parts[0] * a + parts[1] * b).max(least).sqrt()).collect()
    }
}

/// A of each mode and B of a place.
pub(super) struct Constants {
    /// What multiplies them at each line.
    pub columns: DMatrix<C64>,
    pub values: DVector<C64>,
    /// Variances of the real and of the imaginary part of each.
    pub variances: DVector<f64>,
}

impl Constants {
    pub fn fitted(&self) -> Vec<C64> {
        (&self.columns * &self.values).iter().copied().collect()
    }
}
