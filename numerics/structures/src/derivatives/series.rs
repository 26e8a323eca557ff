//! Power series in time of a motion and its changes within a step.

use nalgebra::{DMatrix, DVector};

use super::equations::MORE;
use super::setting::Sloped;

/// Terms of a series after the first: over a step of half a radian of the fastest rate the next one is 0.5¹⁷/17! = 10⁻²⁰.
const TERMS: usize = 16;

/// Halvings of an interval with a turning point.
const HALVINGS: u32 = 60;

/// w and its changes over a step, as series in the share of the step.
pub(super) struct Series {
    w: Vec<DVector<f64>>,
    s: Vec<DMatrix<f64>>,
    /// Columns of s that belong to quantities.
    quantities: usize,
}

impl Series {
    /// Longest step, as an angle of the fastest rate, rad.
    pub const REACH: f64 = 0.5;

    /// Under `w′ = A w` and `s′ = A s + δA w`, of the columns of quantities; `length_s`: the step.
    pub fn new(
        (a, changes): (&DMatrix<f64>, &[&DMatrix<f64>]),
        (w, s): (&DVector<f64>, &DMatrix<f64>),
        length_s: f64,
    ) -> Self {
        let (mut of_w, mut of_s) = (vec![w.clone()], vec![s.clone()]);
        for k in 0..TERMS {
            let factor = length_s / (k + 1) as f64;
            let (w, s) = (&of_w[k], &of_s[k]);
            let mut next = a * s;
            for (column, change) in changes.iter().enumerate() {
                next.column_mut(column).gemv(1.0, change, w, 1.0);
            }
            let next_w = a * w * factor;
            of_w.push(next_w);
            of_s.push(next * factor);
        }
        Self { w: of_w, s: of_s, quantities: changes.len() }
    }

    /// w and its changes at a share of the step.
    pub fn at(&self, share: f64) -> (DVector<f64>, DMatrix<f64>) {
        let (mut w, mut s) = (self.w[TERMS].clone(), self.s[TERMS].clone());
        for k in (0..TERMS).rev() {
            w = w * share + &self.w[k];
            s = s * share + &self.s[k];
        }
        (w, s)
    }

    /// The coefficients of a row.
    pub fn values(&self, row: &DVector<f64>) -> Vec<f64> {
        self.w.iter().map(|w| row.dot(w)).collect()
    }

    /// The coefficients of a row and of its changes.
    pub fn row(&self, (row, changes): &(DVector<f64>, Vec<DVector<f64>>)) -> (Vec<f64>, Vec<DVector<f64>>) {
        let values = self.w.iter().map(|w| row.dot(w)).collect();
        let slopes = self.w.iter().zip(&self.s).map(|(w, s)| {
            let mut slopes = s.tr_mul(row);
            slopes.iter_mut().take(self.quantities).zip(changes).for_each(|(slope, change)| *slope += change.dot(w));
            slopes
        });
        (values, slopes.collect())
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

/// A bound of the fastest rate of `w′ = A w` with these masses of the bodies, rad/s.
pub(super) fn rate_per_s(a: &DMatrix<f64>, mass: &[f64]) -> f64 {
    let bodies = mass.len();
    let more = a.nrows() - MORE;
    // In displacements times the root of the mass.
    let sum = |i: usize, from: usize| -> f64 {
        (0..bodies).map(|j| a[(bodies + i, from + j)].abs() * (mass[i] / mass[j]).sqrt()).sum()
    };
    let most = |from: usize| (0..bodies).map(|i| sum(i, from)).fold(0.0, f64::max);
    let (square, damping) = (most(0), most(bodies));
    let turning = a[(more, more + 1)].abs();
    (square.sqrt() + damping).max(turning)
}
