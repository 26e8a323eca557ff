//! Weighted least squares of complex values, and what further columns would explain.

use damprig_fourier::Complex;
use nalgebra::{DMatrix, DVector};

/// The factors of complex columns that fit `target` best, with a weight for each place; `None` where they do not determine it.
pub(super) fn solve(
    columns: &[Vec<Complex<f64>>],
    target: &[Complex<f64>],
    weights: &[f64],
) -> Option<Vec<Complex<f64>>> {
    let product = |a: &[Complex<f64>], b: &[Complex<f64>]| -> Complex<f64> {
        a.iter().zip(b).zip(weights).map(|((a, b), w)| a.conj() * b * *w).sum()
    };
    let scale: Vec<f64> = columns.iter().map(|own| 1.0 / product(own, own).re.sqrt().max(f64::MIN_POSITIVE)).collect();
    let count = columns.len();
    let normal = DMatrix::from_fn(count, count, |i, j| product(&columns[i], &columns[j]) * scale[i] * scale[j]);
    let right = DVector::from_fn(count, |i, _| product(&columns[i], target) * scale[i]);
    let solution = normal.cholesky()?.solve(&right);
    let factors: Vec<Complex<f64>> = solution.iter().zip(&scale).map(|(value, scale)| value * *scale).collect();
    factors.iter().all(|value| value.is_finite()).then_some(factors)
}

/// Real and imaginary parts, each over its standard deviation: the first half the real ones.
pub(super) fn parts(values: &[Complex<f64>], deviations: &[f64]) -> DVector<f64> {
    let count = values.len();
    DVector::from_fn(2 * count, |n, _| {
        let (value, deviation) = (values[n % count], deviations[n % count]);
        if n < count { value.re / deviation } else { value.im / deviation }
    })
}

/// Sensitivities of a fit: an orthogonal base of their columns, and the triangle that makes the columns of it.
pub(super) struct Sensitivities {
    base: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

/// Share of a column's square beyond the others that is left to rounding.
const MIN_SHARE: f64 = 1e-6;

impl Sensitivities {
    /// Of complex columns, one a real parameter; `None` where they depend on each other.
    pub(super) fn new(columns: &[Vec<Complex<f64>>], deviations: &[f64]) -> Option<Self> {
        let columns: Vec<DVector<f64>> = columns.iter().map(|column| parts(column, deviations)).collect();
        let scale: Vec<f64> = columns.iter().map(|column| column.norm()).collect();
        if scale.iter().any(|norm| !(norm.is_finite() && *norm > 0.0)) {
            return None;
        }
        let scaled: Vec<DVector<f64>> = columns.iter().zip(&scale).map(|(column, norm)| column / *norm).collect();
        let qr = DMatrix::from_columns(&scaled).qr();
        let mut inverse = qr.r().try_inverse()?;
        for (mut row, norm) in inverse.row_iter_mut().zip(&scale) {
            row /= *norm;
        }
        inverse.iter().all(|value| value.is_finite()).then(|| Self { base: qr.q(), inverse })
    }

    /// How much each place of [`parts`] changes a parameter.
    pub(super) fn influence(&self, parameter: usize) -> DVector<f64> {
        &self.base * self.inverse.row(parameter).transpose()
    }

    /// Share of each place's deviation that the fit takes, 0 to 1.
    pub(super) fn leverages(&self) -> Vec<f64> {
        self.base.row_iter().map(|row| row.norm_squared()).collect()
    }

    /// What further columns explain of residuals, which the fit has left: by how much the sum of their squares falls, and by how much the first
    /// four parameters change. Columns that the fit's own ones make are left out.
    pub(super) fn explained(&self, residuals: &DVector<f64>, further: &[DVector<f64>]) -> Explained {
        let mut free: Vec<DVector<f64>> = Vec::new();
        let mut taken: Vec<DVector<f64>> = Vec::new();
        for column in further {
            let whole = column.norm_squared();
            let own = self.base.tr_mul(column);
            let mut left = column - &self.base * &own;
            let mut of_fit = &self.inverse * own;
            for (other, of_other) in free.iter().zip(&taken) {
                let share = other.dot(&left);
                left -= other * share;
                of_fit -= of_other * share;
            }
            let size = left.norm();
            if size * size > MIN_SHARE * whole && size > 0.0 {
                free.push(left / size);
                taken.push(of_fit / size);
            }
        }
        let factors: Vec<f64> = free.iter().map(|column| column.dot(residuals)).collect();
        let shift = |place: usize| taken.iter().zip(&factors).map(|(of_fit, factor)| -of_fit[place] * factor).sum();
        let left = free.iter().zip(&factors).fold(residuals.clone(), |left, (column, factor)| left - column * *factor);
        Explained {
            count: free.len(),
            fall: factors.iter().map(|factor| factor * factor).sum(),
            shift: [0, 1, 2, 3].map(shift),
            left,
        }
    }
}

/// What further columns explain.
pub(super) struct Explained {
    /// Number of columns that count.
    pub(super) count: usize,
    /// Fall of the sum of squares.
    pub(super) fall: f64,
    /// Change of the first four parameters.
    pub(super) shift: [f64; 4],
    /// Residuals that are left.
    pub(super) left: DVector<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_of_columns_are_found_and_a_further_column_explains_what_it_made() {
        let count = 40;
        let x = |n: usize| n as f64 / count as f64 - 0.5;
        let column = |power: i32| (0..count).map(|n| Complex::new(x(n).powi(power), 0.3 * x(n))).collect::<Vec<_>>();
        let columns = [column(0), column(1), column(2)];
        let factors = [Complex::new(2.0, -1.0), Complex::new(0.5, 3.0), Complex::new(-4.0, 0.25)];
        let at = |n: usize, count: usize| (0..count).map(|k| columns[k][n] * factors[k]).sum::<Complex<f64>>();
        let weights: Vec<f64> = (0..count).map(|n| 1.0 + n as f64).collect();
        let target: Vec<Complex<f64>> = (0..count).map(|n| at(n, 3)).collect();
        let found = solve(&columns, &target, &weights).unwrap();
        assert!(found.iter().zip(factors).all(|(a, b)| (a - b).norm() < 1e-9), "{found:?}");
        // Without the third column: its factor, and the change of the first two, follow from the residuals.
        let deviations: Vec<f64> = weights.iter().map(|w| 1.0 / w.sqrt()).collect();
        let two = solve(&columns[..2], &target, &weights).unwrap();
        let left: Vec<Complex<f64>> =
            (0..count).map(|n| target[n] - columns[0][n] * two[0] - columns[1][n] * two[1]).collect();
        let turned = |column: &[Complex<f64>]| column.iter().map(|c| c * Complex::i()).collect::<Vec<_>>();
        let own = [columns[0].clone(), turned(&columns[0]), columns[1].clone(), turned(&columns[1])];
        let sensitivities = Sensitivities::new(&own, &deviations).unwrap();
        let further = [parts(&columns[2], &deviations), parts(&turned(&columns[2]), &deviations)];
        let explained = sensitivities.explained(&parts(&left, &deviations), &further);
        assert_eq!(explained.count, 2);
        assert!(explained.left.norm() < 1e-9);
        let shift = factors[0] - two[0];
        assert!((explained.shift[0] - shift.re).abs() < 1e-9 && (explained.shift[1] - shift.im).abs() < 1e-9);
        // A column of the fit's own explains nothing.
        let again = sensitivities.explained(&parts(&left, &deviations), &[parts(&columns[1], &deviations)]);
        assert_eq!(again.count, 0);
    }
}
