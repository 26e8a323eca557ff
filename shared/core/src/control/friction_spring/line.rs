//! Least-squares line of force over position through the points of a touch-off.

use crate::scalar::Scalar;

/// Number of points in a touch-off.
pub const POINTS: usize = 8;

/// The line of force over position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// The zero reading: the position where the force begins, in the unit of the positions.
    pub zero: f32,
    /// Force per position.
    pub slope: f32,
    /// Standard error of `zero`, from the scatter about the line.
    pub zero_error: f32,
}

/// Least-squares fit through (position, force). Sums are taken about the means, so `f32` loses no precision. `None` if
/// all positions or all forces are equal.
#[must_use]
pub fn fit(points: &[(f32, f32); POINTS]) -> Option<Line> {
    let n = POINTS as f32;
    let (mut position, mut force) = (0.0, 0.0);
    for (p, f) in points {
        position += p / n;
        force += f / n;
    }
    let (mut spread, mut covariance) = (0.0, 0.0);
    for (p, f) in points {
        spread += (p - position) * (p - position);
        covariance += (p - position) * (f - force);
    }
    if spread <= 0.0 || covariance == 0.0 {
        return None;
    }
    let slope = covariance / spread;
    let mut squares = 0.0;
    for (p, f) in points {
        let residual = f - force - slope * (p - position);
        squares += residual * residual;
    }
    let reach = force / slope;
    let variance = squares / (n - 2.0) / (slope * slope) * (1.0 / n + reach * reach / spread);
    Some(Line { zero: position - reach, slope, zero_error: Scalar::sqrt(variance) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_line_are_fitted_exactly() {
        let points = core::array::from_fn(|n| {
            let position = 20e-3 + 1e-4 * n as f32;
            (position, 500.0 * (position - 19.5e-3))
        });
        let line = fit(&points).unwrap();
        // Positions are known to 2e-9 m in f32, and the slope from 0.7 mm of them.
        assert!((line.zero - 19.5e-3).abs() < 2e-8 && (line.slope / 500.0 - 1.0).abs() < 2e-5, "{line:?}");
        assert!(line.zero_error < 2e-8);
    }

    #[test]
    fn the_error_is_the_closed_form_of_the_scatter() {
        // Residuals ±1 in a pattern orthogonal to constant and slope.
        let pattern = [1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0];
        let points = core::array::from_fn(|n| (n as f32 + 10.0, 2.0 * (n as f32 + 10.0 - 4.0) + 0.01 * pattern[n]));
        let line = fit(&points).unwrap();
        // s = 0.01 √(8/6); mean position 13.5, reach 9.5, spread 42.
        let expected = 0.01 * (8.0f32 / 6.0).sqrt() / 2.0 * (1.0 / 8.0 + 9.5 * 9.5 / 42.0f32).sqrt();
        assert!((line.zero_error / expected - 1.0).abs() < 1e-2, "{line:?} {expected}");
        assert!((line.zero - 4.0).abs() < 1e-4);
    }

    #[test]
    fn a_flat_force_has_no_zero() {
        assert_eq!(fit(&core::array::from_fn(|n| (n as f32, 0.3))), None);
        assert_eq!(fit(&[(1.0, 0.3); POINTS]), None);
    }
}
