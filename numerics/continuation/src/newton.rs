//! Newton's method for the boundary value problem and its extensions.

use nalgebra::{DMatrix, DVector};

/// Most Newton steps.
const MAX_STEPS: u32 = 25;

/// A step below this, relative to the unknowns, is rounding.
const ROUNDING: f64 = 1e-13;

/// The residual that may remain when steps no longer get shorter, relative to the unknowns.
const FLOOR: f64 = 1e-9;

/// A solution.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The unknowns.
    pub unknowns: DVector<f64>,
    /// Steps that were needed.
    pub steps: u32,
    /// Size of the last step, relative to the unknowns: the error is of its square, or rounding.
    pub last_step: f64,
}

/// Newton's method from `guess`. `system` gives the residual and its derivatives, a square matrix.
pub fn solve(
    guess: DVector<f64>,
    mut system: impl FnMut(&DVector<f64>) -> (DVector<f64>, DMatrix<f64>),
) -> Option<Solution> {
    let mut unknowns = guess;
    let mut last = f64::INFINITY;
    for steps in 1..=MAX_STEPS {
        let (residual, derivatives) = system(&unknowns);
        if !residual.iter().all(|value| value.is_finite()) {
            return None;
        }
        let step = derivatives.lu().solve(&residual)?;
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        let size = 1.0 + unknowns.norm();
        let relative = step.norm() / size;
        // A far step leaves the range in which the events keep their order.
        if relative > 10.0 {
            return None;
        }
        unknowns -= &step;
        if relative <= ROUNDING || (relative <= FLOOR && relative >= 0.25 * last) {
            return Some(Solution { unknowns, steps, last_step: relative });
        }
        last = relative;
    }
    None
}
