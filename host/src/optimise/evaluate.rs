//! The objective and the constraints at a point: the metrics of a study over the band and over the starts.

use super::cases::Cases;
use super::file::Optimisation;
use crate::input::Refusal;
use crate::simulation::Case;
use crate::study::axis::{Axis, Value};
use crate::study::evaluate::{quantile, reduce_over, started_at};
use crate::study::metric::Metric;
use crate::study::simulate::{GoOn, Halt, metrics_of_all};

/// What an evaluated point gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluated {
    /// Place of each variable in its range, 0 to 1.
    pub shares: Vec<f64>,
    /// Value of each variable.
    pub values: Vec<f64>,
    /// The objective; not a number if it does not exist.
    pub objective: f64,
    /// Point of the band that gives the objective; 0 for a mean, and for the first start where there are several.
    pub band_point: usize,
    /// For each constraint its metric where it is kept least.
    pub constraints: Vec<f64>,
    /// Sum of the constraints' violations; 0 if all are kept.
    pub violation: f64,
    /// How often an event search was given up.
    pub unresolved: f64,
}

impl Evaluated {
    /// Whether it has an objective and keeps all constraints.
    #[must_use]
    pub fn is_feasible(&self) -> bool {
        self.violation == 0.0 && !self.objective.is_nan()
    }

    /// What the search makes small: the objective, or its negative, where the constraints are kept; beyond any objective and rising
    /// with the violation elsewhere.
    #[must_use]
    pub fn cost(&self, is_maximum: bool) -> f64 {
        match (self.objective.is_nan(), self.violation > 0.0) {
            (true, _) => 1e60,
            (_, true) => 1e30 * (1.0 + self.violation.min(1e20)),
            _ if is_maximum => -self.objective,
            _ => self.objective,
        }
    }
}

/// The metrics of some simulations: by metric, then by start, then by point of the band.
type Simulated = Vec<Vec<Vec<f64>>>;

/// Evaluates the point at these shares of the variables' ranges.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub fn at(optimisation: &Optimisation, shares: &[f64], go_on: GoOn) -> Result<Evaluated, Halt> {
    let number = |(axis, share): (&Axis, &f64)| match axis.value(0, *share) {
        Value::Number(number) => number,
        Value::Word(_) => f64::NAN,
    };
    let values: Vec<f64> = optimisation.variables().iter().zip(shares).map(number).collect();
    at_values(optimisation, values, shares.to_vec(), go_on)
}

/// Evaluates the point with these values of the variables.
///
/// # Errors
/// As [`at`].
pub fn at_values(
    optimisation: &Optimisation,
    values: Vec<f64>,
    shares: Vec<f64>,
    go_on: GoOn,
) -> Result<Evaluated, Halt> {
    let metrics: Vec<Metric> =
        [optimisation.objective].into_iter().chain(optimisation.constraints.iter().map(|c| c.metric)).collect();
    let starts = optimisation.starts.as_ref();
    let start_shares = starts.map(|starts| starts.shares.as_slice());
    let cases = Cases::at(optimisation, &values)?;
    let cases = |point: usize| cases.case(point);
    let (simulated, unresolved) = simulate_band(optimisation, &metrics, start_shares, &cases, go_on)?;
    let (objective, band_point) =
        over_starts(optimisation, &simulated[0], starts.map_or(1.0, |starts| starts.quantile));
    let mut constraints = Vec::new();
    for (constraint, of_metric) in optimisation.constraints.iter().zip(&simulated[1..]) {
        let limit = constraint.limit;
        let all = of_metric.iter().flatten().copied();
        constraints.push(all.reduce(|a, b| if limit.excess(b) > limit.excess(a) { b } else { a }).unwrap_or(f64::NAN));
    }
    let violation = optimisation.constraints.iter().zip(&constraints).map(|(c, value)| c.limit.violation(*value)).sum();
    Ok(Evaluated { shares, values, objective, band_point, constraints, violation, unresolved })
}

/// The objective from each of some starts, at these values of the variables.
///
/// # Errors
/// As [`at`].
pub fn from_starts(optimisation: &Optimisation, values: &[f64], starts: &[f64], go_on: GoOn) -> Result<Vec<f64>, Halt> {
    let cases = Cases::at(optimisation, values)?;
    let cases = |point: usize| cases.case(point);
    let (simulated, _) = simulate_band(optimisation, &[optimisation.objective], Some(starts), &cases, go_on)?;
    Ok(simulated[0].iter().map(|over_band| reduced(optimisation, over_band).0).collect())
}

/// A metric over the band of cases that are not the optimisation's own, from their own starts.
///
/// # Errors
/// A case that is refused, or that `go_on` said no.
pub fn over_band(
    optimisation: &Optimisation,
    metric: Metric,
    cases: &dyn Fn(usize) -> Result<Case, Refusal>,
    go_on: GoOn,
) -> Result<(f64, usize), Halt> {
    let (simulated, _) = simulate_band(optimisation, &[metric], None, cases, go_on)?;
    Ok(reduced(optimisation, &simulated[0][0]))
}

/// Simulates the case at each point of the band from each start (from its own without any).
fn simulate_band(
    optimisation: &Optimisation,
    metrics: &[Metric],
    starts: Option<&[f64]>,
    cases: &dyn Fn(usize) -> Result<Case, Refusal>,
    go_on: GoOn,
) -> Result<(Simulated, f64), Halt> {
    let points = optimisation.band_points();
    let count = starts.map_or(1, <[f64]>::len);
    let mut all = Vec::with_capacity(points * count);
    for point in 0..points {
        let case = cases(point)?;
        match starts {
            None => all.push(case),
            Some(shares) => all.extend(shares.iter().map(|share| started_at(&case, *share))),
        }
    }
    let mut simulated = vec![vec![Vec::with_capacity(points); count]; metrics.len()];
    let mut unresolved = 0.0;
    for (place, (values, given_up)) in
        metrics_of_all(&all, optimisation.record, metrics, go_on)?.into_iter().enumerate()
    {
        unresolved += given_up;
        for (value, of_metric) in values.into_iter().zip(&mut simulated) {
            of_metric[place % count].push(value);
        }
    }
    Ok((simulated, unresolved))
}

/// The values over the band as one, with the point of the band that has it.
fn reduced(optimisation: &Optimisation, values: &[f64]) -> (f64, usize) {
    let band: Vec<&Axis> = optimisation.band().iter().collect();
    reduce_over(&band, values)
}

/// The objective over the starts, with the point of the band of the start nearest to it.
fn over_starts(optimisation: &Optimisation, values: &[Vec<f64>], share: f64) -> (f64, usize) {
    let mut of_starts: Vec<(f64, usize)> = values.iter().map(|values| reduced(optimisation, values)).collect();
    of_starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let sorted: Vec<f64> = of_starts.iter().map(|(value, _)| *value).collect();
    let nearest = (share * (sorted.len() - 1) as f64).round() as usize;
    (quantile(&sorted, share), of_starts[nearest].1)
}
