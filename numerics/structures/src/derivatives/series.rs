//! Power series in time of a motion and its changes within a step.

use nalgebra::{DMatrix, DVector};

use super::setting::{Known, Sloped};

/// Terms of a series after the first: over a step of half a radian of the fastest rate the next one is 0.5¹⁷/17! = 10⁻²⁰.
const TERMS: usize = 16;

/// Halvings of an interval with a turning point.
const HALVINGS: u32 = 60;

/// w and its changes over a step, as series in the share of the step.
pub(super) struct Series {
    w: Vec<DVector<f64>>,
    /// Of the changes of each number of w a column.
    s: Vec<DMatrix<f64>>,
}

impl Series {
    /// Longest step, as an angle of the fastest rate, rad.
    pub const REACH: f64 = 0.5;

    /// Products of the matrix with the changes in a step.
    pub const PRODUCTS: f64 = TERMS as f64;

    /// Over a step of `length_s` under the equations `w′ = A w` and `s′ = A s + δA w`, the latter of the changes with quantities.
    pub fn new(known: &Known, (w, s): (&DVector<f64>, &DMatrix<f64>), length_s: f64) -> Self {
        let (mut of_w, mut of_s) = (vec![w.clone()], vec![s.transpose()]);
        for k in 0..TERMS {
            let factor = length_s / (k + 1) as f64;
            let (w, s) = (&of_w[k], &of_s[k]);
            let (mut next_w, mut next) = (DVector::zeros(w.len()), DMatrix::zeros(s.nrows(), s.ncols()));
            for &(i, j, of) in &known.rates {
                let of = factor * of;
                next_w[i] += of * w[j];
                next.column_mut(i).iter_mut().zip(s.column(j).iter()).for_each(|(next, s)| *next += of * s);
            }
            for (quantity, change) in known.changes_of_rates.iter().enumerate() {
                for &(i, j, of) in change {
                    next[(quantity, i)] += factor * of * w[j];
                }
            }
            of_w.push(next_w);
            of_s.push(next);
        }
        Self { w: of_w, s: of_s }
    }

    /// w and its changes at a share of the step.
    pub fn at(&self, share: f64) -> (DVector<f64>, DMatrix<f64>) {
        let (mut w, mut s) = (self.w[TERMS].clone(), self.s[TERMS].clone());
        for k in (0..TERMS).rev() {
            w.iter_mut().zip(self.w[k].iter()).for_each(|(w, term)| *w = *w * share + term);
            s.iter_mut().zip(self.s[k].iter()).for_each(|(s, term)| *s = *s * share + term);
        }
        (w, s.transpose())
    }

    /// The coefficients of a row.
    pub fn values(&self, row: &DVector<f64>) -> Vec<f64> {
        self.w.iter().map(|w| row.dot(w)).collect()
    }

    /// The coefficients of a row and of its changes.
    pub fn row(&self, (row, changes): &(DVector<f64>, Vec<DVector<f64>>)) -> (Vec<f64>, Vec<DVector<f64>>) {
        let slopes = self.w.iter().zip(&self.s).map(|(w, s)| {
            let mut slopes = s * row;
            slopes.iter_mut().zip(changes).for_each(|(slope, change)| *slope += change.dot(w));
            slopes
        });
        (self.values(row), slopes.collect())
    }

    /// Adds ∫x² of a row over the step.
    pub fn add_square(to: &mut Sloped, (x, slopes): (&[f64], &[DVector<f64>]), length_s: f64) {
        for (j, x_j) in x.iter().enumerate() {
            for (k, slopes) in slopes.iter().enumerate() {
                let weight = length_s * x_j / (j + k + 1) as f64;
                to.value += weight * x[k];
                to.slopes.axpy(2.0 * weight, slopes, 1.0);
            }
        }
    }

    /// The share of the step at which the rate of a series is zero, if its rates at the ends are as `turns` says.
    pub fn turn(x: &[f64], turns: impl Fn(f64, f64) -> bool) -> Option<f64> {
        let rate = |share: f64| x.iter().enumerate().skip(1).rev().fold(0.0, |sum, (k, x)| sum * share + k as f64 * x);
        let (before, after) = (rate(0.0), rate(1.0));
        if !turns(before, after) {
            return None;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if rate(middle) * before > 0.0 { low = middle } else { high = middle }
        }
        Some(0.5 * (low + high))
    }
}
