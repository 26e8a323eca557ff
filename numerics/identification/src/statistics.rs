//! Least squares, and intervals of estimates.

use nalgebra::{DMatrix, DVector};

/// Standard uncertainties above which a quantity that may be absent counts as found: one of 740 that are absent exceeds them.
const FOUND: f64 = 3.0;

/// Quantile 0.95 of the normal distribution.
const ONE_SIDED_95: f64 = 1.644_853_627;

/// An estimate with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    /// The estimate.
    pub value: f64,
    /// Its standard uncertainty.
    pub standard_uncertainty: f64,
    /// Degrees of freedom of the uncertainty.
    pub degrees_of_freedom: f64,
}

impl Value {
    /// A quantity that is never negative, and its interval: where it is not found, at least 0, and from 0 to the one-sided limit, which
    /// covers the truth in 95 % or more.
    #[must_use]
    pub fn not_negative(&self) -> (f64, [f64; 2]) {
        if self.is_found() {
            return (self.value, self.interval_95());
        }
        let value = self.value.max(0.0);
        (value, [0.0, value + ONE_SIDED_95 * self.standard_uncertainty])
    }

    /// The 95 % interval by Student's distribution.
    #[must_use]
    pub fn interval_95(&self) -> [f64; 2] {
        let half = student_95(self.degrees_of_freedom) * self.standard_uncertainty;
        [self.value - half, self.value + half]
    }

    /// Whether a quantity that may be absent is found: above 3 standard uncertainties.
    #[must_use]
    pub fn is_found(&self) -> bool {
        self.value > FOUND * self.standard_uncertainty
    }

    /// The value of a function of it with this slope, to first order.
    #[must_use]
    pub fn mapped(&self, value: f64, slope: f64) -> Self {
        Self { value, standard_uncertainty: self.standard_uncertainty * slope.abs(), ..*self }
    }

    /// With a further part of its standard uncertainty, which is itself known; the degrees of freedom are those of Welch and
    /// Satterthwaite.
    #[must_use]
    pub fn widened(&self, by: f64) -> Self {
        let all = self.standard_uncertainty.hypot(by);
        let share = if all > 0.0 { self.standard_uncertainty / all } else { 1.0 };
        let degrees_of_freedom = self.degrees_of_freedom / share.powi(4).max(f64::MIN_POSITIVE);
        Self { standard_uncertainty: all, degrees_of_freedom: degrees_of_freedom.min(f64::MAX), ..*self }
    }

    /// The mean of independent values; `None` for fewer than two.
    #[must_use]
    pub fn mean(values: &[f64]) -> Option<Self> {
        let n = values.len() as f64;
        if values.len() < 2 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Some(Self { value: mean, standard_uncertainty: (variance / n).sqrt(), degrees_of_freedom: n - 1.0 })
    }
}

/// The factor of a 95 % interval for ν degrees of freedom: quantile 0.975 of Student's t. Abramowitz and Stegun 26.7.5, exact to
/// 0.2 % from ν = 3; closed forms below.
#[must_use]
pub fn student_95(nu: f64) -> f64 {
    const X: f64 = 1.959_963_984_540_054;
    if nu < 1.5 {
        return 12.706_204_736;
    }
    if nu < 2.5 {
        return 4.302_652_730;
    }
    let g = [
        X.powi(3) + X,
        5.0 * X.powi(5) + 16.0 * X.powi(3) + 3.0 * X,
        3.0 * X.powi(7) + 19.0 * X.powi(5) + 17.0 * X.powi(3) - 15.0 * X,
        79.0 * X.powi(9) + 776.0 * X.powi(7) + 1482.0 * X.powi(5) - 1920.0 * X.powi(3) - 945.0 * X,
    ];
    X + g[0] / (4.0 * nu) + g[1] / (96.0 * nu.powi(2)) + g[2] / (384.0 * nu.powi(3)) + g[3] / (92_160.0 * nu.powi(4))
}

/// The probability that Student's t with ν whole degrees of freedom exceeds `t` in magnitude. Abramowitz and Stegun 26.7.3 and 4.
#[must_use]
pub fn student_tail(t: f64, nu: u32) -> f64 {
    let nu = nu.max(1);
    let angle = (t.abs() / f64::from(nu).sqrt()).atan();
    let (sine, cosine) = angle.sin_cos();
    let is_odd = !nu.is_multiple_of(2);
    let (mut term, mut sum) = (if is_odd { cosine } else { 1.0 }, 0.0);
    let mut power = if is_odd { 1 } else { 0 };
    while power + 2 <= nu {
        sum += term;
        power += 2;
        // The coefficients are (1·3·5…)/(2·4·6…) and, for odd ν, (2·4…)/(3·5…).
        term *= cosine * cosine * f64::from(power - 1) / f64::from(power);
    }
    let inside = if is_odd { std::f64::consts::FRAC_2_PI * (angle + sine * sum) } else { sine * sum };
    (1.0 - inside).clamp(0.0, 1.0)
}

/// Intercept and slope of a straight line, and their covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// The value at 0.
    pub intercept: Value,
    /// The slope.
    pub slope: Value,
}

/// The line through points of these weights by least squares; `None` for fewer than three points or a single abscissa.
#[must_use]
pub fn line(x: &[f64], y: &[f64], weight: impl Fn(usize) -> f64) -> Option<Line> {
    let nu = x.len().checked_sub(2).filter(|nu| *nu > 0)? as f64;
    let sum = |of: &dyn Fn(usize) -> f64| (0..x.len()).map(|i| weight(i) * of(i)).sum::<f64>();
    let total = sum(&|_| 1.0);
    let (mean_x, mean_y) = (sum(&|i| x[i]) / total, sum(&|i| y[i]) / total);
    let xx = sum(&|i| (x[i] - mean_x).powi(2));
    if xx.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
        return None;
    }
    let slope = sum(&|i| (x[i] - mean_x) * (y[i] - mean_y)) / xx;
    let intercept = mean_y - slope * mean_x;
    let variance = sum(&|i| (y[i] - intercept - slope * x[i]).powi(2)) / nu;
    let value = |value, variance: f64| Value { value, standard_uncertainty: variance.sqrt(), degrees_of_freedom: nu };
    Some(Line {
        intercept: value(intercept, variance * (1.0 / total + mean_x.powi(2) / xx)),
        slope: value(slope, variance / xx),
    })
}

/// A model fitted by least squares.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The parameters.
    pub parameters: Vec<f64>,
    /// Their covariance for residuals of unit variance.
    pub shape: DMatrix<f64>,
    /// Measured less fitted.
    pub residuals: Vec<f64>,
}

impl Fit {
    /// Observations less parameters.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> f64 {
        self.residuals.len() as f64 - self.parameters.len() as f64
    }

    /// Variance of a residual.
    #[must_use]
    pub fn variance(&self) -> f64 {
        self.residuals.iter().map(|r| r * r).sum::<f64>() / self.degrees_of_freedom()
    }

    /// A parameter, with residuals of this variance.
    #[must_use]
    pub fn value(&self, index: usize, variance: f64) -> Value {
        Value {
            value: self.parameters[index],
            standard_uncertainty: (self.shape[(index, index)] * variance).sqrt(),
            degrees_of_freedom: self.degrees_of_freedom(),
        }
    }
}

/// Steps of the fit at most.
const MAX_STEPS: usize = 60;

/// Fits `model` to `measured` by the method of Levenberg and Marquardt with numerical derivatives. `steps` are the parameters'
/// steps for them. The observations are few numbers per row, so the normal equations are summed here and nalgebra solves them.
/// `None` when it does not converge, or a parameter has no influence.
pub fn fit(measured: &[f64], start: &[f64], steps: &[f64], model: impl Fn(&[f64], &mut Vec<f64>)) -> Option<Fit> {
    let count = start.len();
    if measured.len() <= count {
        return None;
    }
    let residuals_at = |parameters: &[f64]| {
        let mut out = Vec::with_capacity(measured.len());
        model(parameters, &mut out);
        let residuals: Vec<f64> = measured.iter().zip(&out).map(|(m, f)| m - f).collect();
        let cost = residuals.iter().map(|r| r * r).sum::<f64>();
        (residuals, cost)
    };
    let mut parameters = start.to_vec();
    let (mut residuals, mut cost) = residuals_at(&parameters);
    let mut damping = 1e-3;
    let mut small_steps = 0;
    let (mut normal, mut gradient) = normal_equations(&parameters, steps, &residuals, &model);
    for _ in 0..MAX_STEPS {
        let mut damped = normal.clone();
        for i in 0..count {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&gradient);
        let next: Vec<f64> = parameters.iter().zip(step.iter()).map(|(p, s)| p + s).collect();
        let (next_residuals, next_cost) = residuals_at(&next);
        if next_cost.is_finite() && next_cost <= cost {
            // Gain in units of the variance: below 1e-6 the step is a thousandth of the uncertainty.
            let variance = (next_cost / (measured.len() - count) as f64).max(f64::MIN_POSITIVE);
            let is_small = (cost - next_cost) / variance < 1e-6;
            (parameters, residuals, cost) = (next, next_residuals, next_cost);
            (normal, gradient) = normal_equations(&parameters, steps, &residuals, &model);
            damping = (damping * 0.1).max(1e-12);
            small_steps = if is_small { small_steps + 1 } else { 0 };
            if small_steps == 2 {
                break;
            }
        } else {
            damping *= 10.0;
            // Rounding: no step lowers the sum any more.
            if damping > 1e6 {
                break;
            }
        }
    }
    let shape = normal.cholesky()?.inverse();
    (cost.is_finite() && shape.iter().all(|v| v.is_finite())).then_some(Fit { parameters, shape, residuals })
}

/// JᵀJ and Jᵀr, by central differences.
fn normal_equations(
    parameters: &[f64],
    steps: &[f64],
    residuals: &[f64],
    model: &impl Fn(&[f64], &mut Vec<f64>),
) -> (DMatrix<f64>, DVector<f64>) {
    let count = parameters.len();
    let columns: Vec<Vec<f64>> = (0..count)
        .map(|i| {
            let at = |sign: f64| {
                let mut moved = parameters.to_vec();
                moved[i] += sign * steps[i];
                let mut out = Vec::with_capacity(residuals.len());
                model(&moved, &mut out);
                out
            };
            let (above, below) = (at(1.0), at(-1.0));
            above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * steps[i])).collect()
        })
        .collect();
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut normal = DMatrix::zeros(count, count);
    for i in 0..count {
        for j in 0..=i {
            let sum = product(&columns[i], &columns[j]);
            normal[(i, j)] = sum;
            normal[(j, i)] = sum;
        }
    }
    let gradient = DVector::from_iterator(count, columns.iter().map(|column| product(column, residuals)));
    (normal, gradient)
}

/// By how much the variance of a mean over `block` neighbours exceeds that of independent residuals; at least 1. A model that
/// misses something, and noise that is not white, widen the uncertainty by it.
#[must_use]
pub fn inflation(residuals: &[f64], block: usize) -> f64 {
    correlation(residuals, block).map_or(1.0, |ratio| ratio.max(1.0))
}

/// Variance of a mean over `block` neighbours over that of independent residuals; `None` for too few of them.
#[must_use]
pub fn correlation(residuals: &[f64], block: usize) -> Option<f64> {
    let blocks = residuals.len() / block.max(1);
    if blocks < 8 || block < 2 {
        return None;
    }
    let variance = residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64;
    let of_means =
        residuals.chunks_exact(block).map(|chunk| (chunk.iter().sum::<f64>() / block as f64).powi(2)).sum::<f64>()
            / blocks as f64;
    (variance > 0.0).then(|| of_means * block as f64 / variance)
}

/// Steps to the largest likelihood; a hundred leave less than a thousandth of each part.
const ROUNDS: usize = 200;

/// Parts of a variance that goes with known shapes: `powers[n]` is a draw of `Σ part·shape[n]`, of an exponential distribution or a sum of such. By
/// multiplicative steps from `start` that never lower the likelihood (Févotte and others 2009).
#[must_use]
pub fn variance_parts<const PARTS: usize>(
    powers: &[f64],
    shape: impl Fn(usize) -> [f64; PARTS],
    start: [f64; PARTS],
) -> [f64; PARTS] {
    let mut parts = start;
    for _ in 0..ROUNDS {
        let (mut upper, mut lower) = ([0.0; PARTS], [0.0; PARTS]);
        for (n, power) in powers.iter().enumerate() {
            let shape = shape(n);
            let modelled: f64 = parts.iter().zip(shape).map(|(part, shape)| part * shape).sum();
            for k in 0..PARTS {
                upper[k] += shape[k] * (power / (modelled * modelled));
                lower[k] += shape[k] * (1.0 / modelled);
            }
        }
        for k in 0..PARTS {
            parts[k] *= (upper[k] / lower[k]).sqrt();
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_is_the_tabulated_quantile() {
        for (nu, expected) in [(1.0, 12.706), (2.0, 4.303), (3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (1e6, 1.960)] {
            let factor = student_95(nu);
            assert!((factor / expected - 1.0).abs() < 3e-3, "{nu}: {factor}");
        }
    }

    #[test]
    fn the_tail_beyond_the_tabulated_quantile_is_five_percent() {
        for (nu, quantile) in [(1, 12.706), (2, 4.303), (3, 3.182), (4, 2.776), (5, 2.571), (10, 2.228), (31, 2.040)] {
            let tail = student_tail(quantile, nu);
            // The quantiles are rounded to a thousandth; beyond them the density is at most 0.06 on either side.
            assert!((tail - 0.05).abs() < 2.0 * 0.06 * 5e-4, "{nu}: {tail}");
            assert_eq!(student_tail(-quantile, nu), tail);
        }
    }

    #[test]
    fn a_curved_model_is_fitted_with_the_covariance_of_linear_theory() {
        let t: Vec<f64> = (0..50).map(|n| f64::from(n) * 0.1).collect();
        let model = |p: &[f64], out: &mut Vec<f64>| out.extend(t.iter().map(|t| p[0] * (-p[1] * t).exp()));
        let mut noise = fastrand::Rng::with_seed(1);
        let measured: Vec<f64> = t.iter().map(|t| 2.0 * (-0.7 * t).exp() + 0.01 * (noise.f64() - 0.5)).collect();
        let fit = fit(&measured, &[1.0, 0.2], &[1e-6, 1e-6], model).expect("a fit");
        let variance = fit.variance();
        assert!((variance.sqrt() / (0.01 / 12f64.sqrt()) - 1.0).abs() < 0.3, "{}", variance.sqrt());
        for (index, truth) in [2.0, 0.7].into_iter().enumerate() {
            let value = fit.value(index, variance);
            assert!((value.value - truth).abs() < 4.0 * value.standard_uncertainty, "{value:?}");
        }
    }

    #[test]
    fn a_line_has_the_textbook_uncertainties() {
        // y = 1 + 2x with residuals ±1 in turn: variance 4/2 of four points, Σ(x − x̄)² = 5.
        let line = line(&[0.0, 1.0, 2.0, 3.0], &[2.0, 2.0, 4.0, 8.0], |_| 1.0).expect("a line");
        assert!((line.slope.value - 2.0).abs() < 1e-12 && (line.intercept.value - 1.0).abs() < 1e-12);
        assert!((line.slope.standard_uncertainty - (2.0f64 / 5.0).sqrt()).abs() < 1e-12);
        assert!((line.intercept.standard_uncertainty - (2.0f64 * (0.25 + 2.25 / 5.0)).sqrt()).abs() < 1e-12);
    }
}
