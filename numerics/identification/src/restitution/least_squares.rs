//! Least squares of e over the speed, with the covariance of the measurement and the scatter from impact to impact.

use nalgebra::{DMatrix, DVector};

use super::law::{APART, Impacts, Power, two_digits};
use crate::statistics::{Value, student_tail};

/// All impacts with the covariance of their measurement.
pub(super) struct Joined {
    pub(super) e: DVector<f64>,
    pub(super) ln_v: DVector<f64>,
    /// Of e; of e with ln v; of ln v.
    covariance: [DMatrix<f64>; 3],
    /// For each file the number of its impacts, and the degrees of freedom of its covariance.
    freedoms: Vec<(usize, f64)>,
    /// The covariance is known up to a factor.
    is_relative: bool,
}

/// What is fitted to e.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum RestitutionModel {
    Constant,
    /// About this logarithm of the speed.
    Power(f64),
    /// The same, with an upper limit for so many of the slowest impacts.
    Limited(f64, usize),
}

/// Parts of the variance of e.
#[derive(Clone, Copy, Debug)]
struct Parts {
    /// Factor of the covariance of the measurement.
    measured: f64,
    /// Standard deviation from impact to impact.
    scatter: f64,
    freedom: f64,
}

/// Steps between the parts of a variance that are tried.
const SHARES: i32 = 12;

/// A generalised least-squares fit.
pub(super) struct Fitted {
    parameters: DVector<f64>,
    covariance: DMatrix<f64>,
    chi_square: f64,
    /// Logarithm of the determinant of the covariance of e.
    ln_determinant: f64,
    pub(super) scatter: f64,
    degrees_of_freedom: f64,
    /// Number of the impacts at the upper limit.
    slow: Option<usize>,
}

impl Fitted {
    pub(super) fn value(&self, place: usize) -> Value {
        Value {
            value: self.parameters[place],
            standard_uncertainty: self.covariance[(place, place)].max(0.0).sqrt(),
            degrees_of_freedom: self.degrees_of_freedom,
        }
    }
}

/// Chance, without an upper limit of e, of impacts that show one as clearly, below which there is one.
const LIMITED: f64 = 0.05;
/// Steps of a fit at most, and the change of a parameter that ends it.
const STEPS: usize = 50;
const SETTLED: f64 = 1e-10;
/// Scatter that rounding leaves.
const MIN_SCATTER: f64 = 1e-9;

impl Joined {
    pub(super) fn new(groups: &[Impacts]) -> Option<Self> {
        let count: usize = groups.iter().map(|group| group.all.len()).sum();
        let mut joined = Self::empty(count);
        let mut from = 0;
        for group in groups {
            let (own, length) = (Self::of(group), group.all.len());
            let parts = if group.is_absolute {
                Parts { measured: 1.0, scatter: 0.0, freedom: group.degrees_of_freedom }
            } else if groups.len() == 1 {
                Parts { measured: 1.0, scatter: 0.0, freedom: f64::INFINITY }
            } else {
                // A single impact shows no scatter of its own: that of all files is its uncertainty.
                own.parts().unwrap_or(Parts { measured: 0.0, scatter: 0.0, freedom: f64::INFINITY })
            };
            joined.e.rows_mut(from, length).copy_from(&own.e);
            joined.ln_v.rows_mut(from, length).copy_from(&own.ln_v);
            for (all, own) in joined.covariance.iter_mut().zip(own.covariance) {
                all.view_mut((from, from), (length, length)).copy_from(&(own * parts.measured));
            }
            for n in from..from + length {
                joined.covariance[0][(n, n)] += parts.scatter.powi(2);
            }
            joined.freedoms.push((length, parts.freedom));
            from += length;
        }
        joined.is_relative = groups.len() == 1 && !groups[0].is_absolute;
        (count > 1 || groups.iter().all(|group| group.is_absolute)).then_some(joined).filter(|_| count > 0)
    }

    fn empty(count: usize) -> Self {
        let matrix = || DMatrix::zeros(count, count);
        Self {
            e: DVector::zeros(count),
            ln_v: DVector::zeros(count),
            covariance: [matrix(), matrix(), matrix()],
            freedoms: Vec::new(),
            is_relative: false,
        }
    }

    fn of(group: &Impacts) -> Self {
        let n = group.all.len();
        let part = |row: usize, column: usize| group.covariance.view((row, column), (n, n)).into_owned();
        Self {
            e: DVector::from_iterator(n, group.all.iter().map(|impact| impact.coefficient)),
            ln_v: DVector::from_iterator(n, group.all.iter().map(|impact| impact.speed_m_per_s.ln())),
            covariance: [part(0, 0), part(0, n), part(n, n)],
            freedoms: vec![(n, f64::INFINITY)],
            is_relative: true,
        }
    }

    /// The parts of the variance of a file whose covariance is known up to a factor.
    fn parts(&self) -> Option<Parts> {
        let n = self.e.len();
        let differ = self.ln_v.max() - self.ln_v.min() > APART.ln();
        let power = if n > 3 && differ { self.likely(RestitutionModel::Power(self.ln_v.mean())) } else { None };
        power.or_else(|| self.likely(RestitutionModel::Constant)).map(|(_, parts)| parts)
    }

    /// The fit whose parts of the variance have the greatest restricted likelihood.
    fn likely(&self, model: RestitutionModel) -> Option<(Fitted, Parts)> {
        let n = self.e.len();
        let freedom = n as f64 - model.parameters() as f64;
        if freedom <= 0.0 {
            return None;
        }
        let usual = self.covariance[0].diagonal().mean().sqrt();
        let mut best: Option<(f64, Fitted, Parts)> = None;
        for step in 0..=SHARES {
            // From the measurement alone to the scatter alone, in even steps of the logarithm of their ratio between.
            let share = match step {
                0 => 0.0,
                SHARES => 1.0,
                _ => (1.0 + (8.0 - 16.0 * f64::from(step) / f64::from(SHARES)).exp()).recip(),
            };
            let mut shared =
                Self { freedoms: Vec::new(), e: self.e.clone(), ln_v: self.ln_v.clone(), ..Self::empty(0) };
            shared.covariance = self.covariance.clone().map(|part| part * (1.0 - share));
            let Some(mut fitted) = shared.least_squares(model, usual * share.sqrt()) else { continue };
            let variance =
                (fitted.chi_square / freedom).max(MIN_SCATTER.powi(2) / usual.powi(2).max(MIN_SCATTER.powi(2)));
            let unlikely = freedom * variance.ln() + fitted.ln_determinant - fitted.covariance.determinant().ln();
            if unlikely.is_finite() && best.as_ref().is_none_or(|(least, ..)| unlikely < *least) {
                let scatter = usual * (share * variance).sqrt();
                fitted.covariance *= variance;
                fitted.chi_square = freedom;
                fitted.scatter = scatter;
                fitted.degrees_of_freedom = freedom;
                best = Some((unlikely, fitted, Parts { measured: (1.0 - share) * variance, scatter, freedom }));
            }
        }
        best.map(|(_, fitted, parts)| (fitted, parts))
    }

    /// Logarithm of the middle speed, rounded to two digits of the speed.
    fn middle(&self) -> f64 {
        let speed = self.ln_v.mean().exp();
        let unit = 10f64.powf(speed.log10().floor() - 1.0);
        ((speed / unit).round() * unit).ln()
    }

    pub(super) fn power(&self) -> Option<(Power, f64)> {
        let middle = self.middle();
        let fitted = self.fit(RestitutionModel::Power(middle))?;
        // Only an e that falls has an upper limit that shows.
        let limited = if fitted.value(1).is_found() { self.limited(middle, &fitted) } else { None };
        let is_maximum_found = limited.is_some();
        let fitted = limited.unwrap_or(fitted);
        let exponent = fitted.value(1);
        let coefficient = fitted.value(0);
        let ends = [self.ln_v.min(), self.ln_v.max()].map(f64::exp);
        let mut power = Power::of(coefficient, two_digits(middle.exp()), exponent, fitted.covariance[(0, 1)], ends);
        if is_maximum_found {
            power = Power { maximum: fitted.value(2), is_maximum_found, ..power };
        }
        Some((power, fitted.scatter))
    }

    /// The fit with an upper limit, where it is significantly better.
    fn limited(&self, middle: f64, power: &Fitted) -> Option<Fitted> {
        if self.is_relative {
            // With both parts of the variance fixed the comparison is that of an absolute covariance.
            let mut fixed =
                Self { freedoms: self.freedoms.clone(), e: self.e.clone(), ln_v: self.ln_v.clone(), ..Self::empty(0) };
            let (_, parts) = self.likely(RestitutionModel::Power(middle))?;
            fixed.covariance = self.covariance.clone().map(|part| part * parts.measured);
            return fixed.limited(middle, power).and_then(|limited| {
                let slow = limited.slow?;
                self.likely(RestitutionModel::Limited(middle, slow)).map(|(fitted, _)| fitted)
            });
        }
        let n = self.e.len();
        let mut speeds: Vec<f64> = self.ln_v.iter().copied().collect();
        speeds.sort_by(f64::total_cmp);
        let mut best: Option<(f64, usize)> = None;
        // At least two impacts on either side, and one to show the scatter.
        let splits = 2..n.saturating_sub(2);
        let tried = splits.len() as f64;
        for slow in splits {
            if speeds[slow] - speeds[slow - 1] < 1e-3 {
                continue;
            }
            let Some(fitted) = self.least_squares(RestitutionModel::Limited(middle, slow), power.scatter) else {
                continue;
            };
            let corner = middle - (fitted.parameters[2] / fitted.parameters[0]).ln() / fitted.parameters[1];
            let is_between = (speeds[slow - 1]..=speeds[slow]).contains(&corner) && fitted.parameters[1] > 0.0;
            if is_between && best.is_none_or(|(least, _)| fitted.chi_square < least) {
                best = Some((fitted.chi_square, slow));
            }
        }
        let (chi_square, slow) = best?;
        let freedom = (n - 3) as f64;
        // Where the scatter of the power is the misfit itself, the ratio of both is what counts.
        let left = if power.scatter > 0.0 { chi_square / freedom } else { (chi_square / freedom).max(1.0) };
        let ratio = ((power.chi_square - chi_square) / left).max(0.0).sqrt();
        (tried * student_tail(ratio, freedom as u32) < LIMITED)
            .then(|| self.fit(RestitutionModel::Limited(middle, slow)))
            .flatten()
    }

    /// Fits with the scatter from impact to impact.
    pub(super) fn fit(&self, model: RestitutionModel) -> Option<Fitted> {
        if self.is_relative {
            return self.likely(model).map(|(fitted, _)| fitted);
        }
        let exact = self.least_squares(model, 0.0);
        let freedom = self.e.len() as f64 - model.parameters() as f64;
        let chi_square = |scatter: f64| self.least_squares(model, scatter).map(|fitted| fitted.chi_square);
        if freedom <= 0.0 || exact.as_ref().is_some_and(|fitted| fitted.chi_square <= freedom) {
            return exact.map(|fitted| self.with_freedom(fitted, freedom));
        }
        // χ² falls with the scatter; at the spread of e it is below its expectation.
        let spread = (self.e.max() - self.e.min()).max(MIN_SCATTER);
        let (mut low, mut high) = (MIN_SCATTER, 10.0 * spread);
        for _ in 0..60 {
            let middle = (low * high).sqrt();
            if chi_square(middle)? > freedom { low = middle } else { high = middle }
        }
        self.least_squares(model, high).map(|fitted| self.with_freedom(fitted, freedom))
    }

    /// With the degrees of freedom of measurement and scatter by Welch and Satterthwaite.
    fn with_freedom(&self, mut fitted: Fitted, freedom: f64) -> Fitted {
        let mut part = 0.0;
        let (mut measured, mut from) = (0.0, 0);
        for (length, own) in &self.freedoms {
            let variance = (from..from + length).map(|n| self.covariance[0][(n, n)]).sum::<f64>();
            measured += variance;
            part += variance * variance / own.max(1.0);
            from += length;
        }
        let scatter = fitted.scatter.powi(2) * self.e.len() as f64;
        part += scatter * scatter / freedom.max(1.0);
        fitted.degrees_of_freedom = ((measured + scatter).powi(2) / part.max(f64::MIN_POSITIVE)).clamp(1.0, 1e6);
        fitted
    }

    /// The fit with a known scatter, by Gauss and Newton.
    fn least_squares(&self, model: RestitutionModel, scatter: f64) -> Option<Fitted> {
        let n = self.e.len();
        let count = model.parameters();
        if n < count {
            return None;
        }
        let mut at = DVector::zeros(count);
        at[0] = self.e.mean();
        if count > 2 {
            at[1] = 0.1;
            at[2] = self.e.max();
        }
        let slowest = model.slowest(&self.ln_v);
        for step in 0..STEPS {
            let (predicted, slopes, by_speed) = model.at(&at, &self.ln_v, &slowest);
            let left = &self.e - predicted;
            let [of_e, of_both, of_speed] = &self.covariance;
            let mut covariance = DMatrix::from_fn(n, n, |i, j| {
                of_e[(i, j)] - by_speed[j] * of_both[(i, j)] - by_speed[i] * of_both[(j, i)]
                    + by_speed[i] * by_speed[j] * of_speed[(i, j)]
            });
            for i in 0..n {
                covariance[(i, i)] += scatter.powi(2) + (1e-3 * MIN_SCATTER).powi(2);
            }
            let weights = covariance.cholesky()?;
            let weighted = weights.solve(&slopes);
            let shape = (slopes.transpose() * &weighted).cholesky()?.inverse();
            let change = &shape * (weighted.transpose() * &left);
            if change.iter().all(|change| change.abs() < SETTLED) || step + 1 == STEPS {
                let chi_square = left.dot(&weights.solve(&left));
                let is_settled = change.iter().all(|change| change.abs() < 1e-4) && chi_square.is_finite();
                return is_settled.then_some(Fitted {
                    parameters: at,
                    covariance: shape,
                    chi_square,
                    ln_determinant: 2.0 * weights.l_dirty().diagonal().map(f64::ln).sum(),
                    scatter,
                    degrees_of_freedom: f64::INFINITY,
                    slow: if let RestitutionModel::Limited(_, slow) = model { Some(slow) } else { None },
                });
            }
            // A step of the exponent by more than 1 leaves the range in which the slope holds.
            let longest = change.iter().fold(0.0f64, |most, change| most.max(change.abs()));
            at += change * (0.5 / longest).min(1.0);
        }
        None
    }
}

impl RestitutionModel {
    fn parameters(self) -> usize {
        match self {
            Self::Constant => 1,
            Self::Power(_) => 2,
            Self::Limited(..) => 3,
        }
    }

    /// Which impacts are at the upper limit.
    fn slowest(self, ln_v: &DVector<f64>) -> Vec<bool> {
        let Self::Limited(_, slow) = self else { return vec![false; ln_v.len()] };
        let mut sorted: Vec<f64> = ln_v.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        ln_v.iter().map(|ln_v| *ln_v < sorted[slow]).collect()
    }

    /// e of each impact, its derivatives by the parameters, and by ln v.
    fn at(
        self,
        at: &DVector<f64>,
        ln_v: &DVector<f64>,
        slowest: &[bool],
    ) -> (DVector<f64>, DMatrix<f64>, DVector<f64>) {
        let n = ln_v.len();
        let (mut e, mut slopes, mut by_speed) =
            (DVector::from_element(n, at[0]), DMatrix::zeros(n, self.parameters()), DVector::zeros(n));
        for i in 0..n {
            match self {
                Self::Limited(..) if slowest[i] => {
                    e[i] = at[2];
                    slopes[(i, 2)] = 1.0;
                }
                Self::Constant => slopes[(i, 0)] = 1.0,
                Self::Power(middle) | Self::Limited(middle, _) => {
                    let ln = ln_v[i] - middle;
                    let factor = (-at[1] * ln).exp();
                    e[i] = at[0] * factor;
                    slopes[(i, 0)] = factor;
                    slopes[(i, 1)] = -at[0] * factor * ln;
                    by_speed[i] = -at[0] * factor * at[1];
                }
            }
        }
        (e, slopes, by_speed)
    }
}
