//! The objective and the constraints at a point: the metrics of a study over the band, between the values of its grid too, and over the
//! starts.

use super::cases::Cases;
use super::file::{Constraint, Optimisation};
use crate::input::Refusal;
use crate::quantity::Quantity;
use crate::simulation::Case;
use crate::study::axis::{Axis, Value};
use crate::study::band::{Band, Effort, Reduced};
use crate::study::evaluate::quantile;
use crate::study::simulate::{Halt, metrics_of_all};

/// What an evaluated point gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluated {
    /// Place of each variable in its range, 0 to 1.
    pub shares: Vec<f64>,
    /// Value of each variable.
    pub values: Vec<f64>,
    /// The objective; not a number if it does not exist.
    pub objective: f64,
    /// Values of the band's axes where the objective is; the first ones for a mean.
    pub band: Vec<Value>,
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

/// Told how many simulations have ended since the last call, also inside a simulation; answers whether to go on.
pub type GoOn<'a> = &'a (dyn Fn(u64) -> bool + Sync);

/// The metrics of some simulations: by metric, then by start, then by point of the band.
type Simulated = Vec<Vec<Vec<f64>>>;

/// How thoroughly a point is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Care {
    /// How the band is searched between its grid's values,
    pub effort: Effort,
    /// unless the point costs more than this on the grid already: it is no better between its values.
    pub up_to_cost: f64,
}

impl Care {
    /// A point that is searched whatever it costs.
    #[must_use]
    pub const fn of(effort: Effort) -> Self {
        Self { effort, up_to_cost: f64::INFINITY }
    }
}

/// Evaluates the point at these shares of the variables' ranges.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub fn at(optimisation: &Optimisation, shares: &[f64], care: Care, go_on: GoOn) -> Result<Evaluated, Halt> {
    let values = values(optimisation, shares);
    Ok(Evaluated { shares: shares.to_vec(), ..at_values(optimisation, values, care, go_on)? })
}

/// The values of the variables at these shares of their ranges.
#[must_use]
pub fn values(optimisation: &Optimisation, shares: &[f64]) -> Vec<f64> {
    let number = |(axis, share): (&Axis, &f64)| match axis.value(0, *share) {
        Value::Number(number) => number,
        Value::Word(_) => f64::NAN,
    };
    optimisation.variables().iter().zip(shares).map(number).collect()
}

/// Evaluates the point with these values of the variables; it has no shares.
///
/// # Errors
/// As [`at`].
pub fn at_values(optimisation: &Optimisation, values: Vec<f64>, care: Care, go_on: GoOn) -> Result<Evaluated, Halt> {
    let metrics: Vec<Quantity> =
        [optimisation.objective].into_iter().chain(optimisation.constraints.iter().map(|c| c.metric)).collect();
    let starts = optimisation.starts.as_ref();
    let cases = Cases::at(optimisation, &values)?;
    let case = |at: &[Value]| cases.case(at);
    let mut point = Simulations { optimisation, case: &case, go_on, unresolved: 0.0 };
    let simulated = point.grid(&metrics, starts.map(|starts| starts.shares.as_slice()))?;
    let mut evaluated = point.evaluated(&simulated, Effort::Grid)?;
    let can_improve = optimisation.can_improve_between();
    if care.effort != Effort::Grid && (can_improve || evaluated.cost(optimisation.is_maximum) <= care.up_to_cost) {
        evaluated = point.evaluated(&simulated, care.effort)?;
    }
    Ok(Evaluated { values, ..evaluated })
}

/// The objective from each of some starts, at these values of the variables.
///
/// # Errors
/// As [`at`].
pub fn from_starts(
    optimisation: &Optimisation,
    values: &[f64],
    starts: &[f64],
    effort: Effort,
    go_on: GoOn,
) -> Result<Vec<f64>, Halt> {
    let cases = Cases::at(optimisation, values)?;
    let case = |at: &[Value]| cases.case(at);
    let mut point = Simulations { optimisation, case: &case, go_on, unresolved: 0.0 };
    let simulated = point.grid(&[optimisation.objective], Some(starts))?;
    let of_start = |(share, over_band): (&f64, &Vec<f64>)| {
        Ok(point.reduced(&optimisation.reduced_band, over_band, Some(*share), effort)?.value)
    };
    starts.iter().zip(&simulated[0]).map(of_start).collect()
}

/// The objective of cases that are not the optimisation's own, from their own starts, over the band: `case` makes one from values of the
/// band's axes.
///
/// # Errors
/// A case that is refused, or that `go_on` said no.
pub fn over_band(
    optimisation: &Optimisation,
    case: &dyn Fn(&[Value]) -> Result<Case, Refusal>,
    go_on: GoOn,
) -> Result<f64, Halt> {
    let mut point = Simulations { optimisation, case, go_on, unresolved: 0.0 };
    let simulated = point.grid(&[optimisation.objective], None)?;
    Ok(point.reduced(&optimisation.reduced_band, &simulated[0][0], None, Effort::Scan)?.value)
}

/// The simulations of a point.
struct Simulations<'a> {
    optimisation: &'a Optimisation,
    /// The case with values of the band's axes.
    case: &'a dyn Fn(&[Value]) -> Result<Case, Refusal>,
    go_on: GoOn<'a>,
    /// How often an event search was given up.
    unresolved: f64,
}

impl Simulations<'_> {
    /// Simulates the case at each point of the band's grid from each start (from its own without any).
    fn grid(&mut self, metrics: &[Quantity], starts: Option<&[f64]>) -> Result<Simulated, Halt> {
        let points = self.optimisation.band_points();
        let count = starts.map_or(1, <[f64]>::len);
        let mut all = Vec::with_capacity(points * count);
        for point in 0..points {
            let case = (self.case)(&self.optimisation.band_values(point))?;
            match starts {
                None => all.push(case),
                Some(shares) => all.extend(shares.iter().map(|share| case.started_at(*share))),
            }
        }
        let mut simulated = vec![vec![Vec::with_capacity(points); count]; metrics.len()];
        for (place, values) in self.metrics(&all, metrics)?.into_iter().enumerate() {
            for (value, of_metric) in values.into_iter().zip(&mut simulated) {
                of_metric[place % count].push(value);
            }
        }
        Ok(simulated)
    }

    fn metrics(&mut self, cases: &[Case], metrics: &[Quantity]) -> Result<Vec<Vec<f64>>, Halt> {
        let simulated = metrics_of_all(cases, self.optimisation.record, metrics, &|| (self.go_on)(0))?;
        (self.go_on)(cases.len() as u64);
        self.unresolved += simulated.iter().map(|(_, given_up)| given_up).sum::<f64>();
        Ok(simulated.into_iter().map(|(values, _)| values).collect())
    }

    /// A metric at points of the band from a start.
    fn at(&mut self, points: &[Vec<Value>], share: Option<f64>, metric: Quantity) -> Result<Vec<f64>, Halt> {
        let case = |at: &Vec<Value>| {
            let case = (self.case)(at)?;
            Ok(share.map_or_else(|| case.clone(), |share| case.started_at(share)))
        };
        let cases = points.iter().map(case).collect::<Result<Vec<Case>, Refusal>>()?;
        Ok(self.metrics(&cases, &[metric])?.into_iter().flatten().collect())
    }

    /// The objective over the band from a start.
    fn reduced(&mut self, band: &Band, grid: &[f64], share: Option<f64>, effort: Effort) -> Result<Reduced, Halt> {
        let metric = self.optimisation.objective;
        band.reduce(grid, effort, &mut |points| self.at(points, share, metric))
    }

    /// The metric of a constraint where it is kept least over the band, from a start.
    fn least_kept(
        &mut self,
        constraint: &Constraint,
        grid: &[f64],
        share: Option<f64>,
        effort: Effort,
    ) -> Result<f64, Halt> {
        let excess = |value: &f64| constraint.limit.excess(*value);
        let worse = |a: f64, b: f64| if excess(&b) > excess(&a) { b } else { a };
        let mut worst = grid.iter().copied().reduce(worse).unwrap_or(f64::NAN);
        let band = &self.optimisation.constraint_band;
        let excesses: Vec<f64> = grid.iter().map(excess).collect();
        band.reduce(&excesses, effort, &mut |points| {
            let values = self.at(points, share, constraint.metric)?;
            worst = values.iter().copied().fold(worst, worse);
            Ok(values.iter().map(excess).collect())
        })?;
        Ok(worst)
    }

    /// What a point gives from what its grid gave; it has no values and shares.
    fn evaluated(&mut self, simulated: &Simulated, effort: Effort) -> Result<Evaluated, Halt> {
        let optimisation = self.optimisation;
        let starts = optimisation.starts.as_ref();
        let share_of = |place: usize| starts.map(|starts| starts.shares[place]);
        let mut of_starts: Vec<Reduced> = Vec::new();
        for (place, grid) in simulated[0].iter().enumerate() {
            of_starts.push(self.reduced(&optimisation.reduced_band, grid, share_of(place), effort)?);
        }
        // The objective over the starts, with the place in the band of the start nearest to it.
        of_starts.sort_by(|a, b| a.value.total_cmp(&b.value));
        let sorted: Vec<f64> = of_starts.iter().map(|reduced| reduced.value).collect();
        let quantile_share = starts.map_or(1.0, |starts| starts.quantile);
        let nearest = (quantile_share * (sorted.len() - 1) as f64).round() as usize;
        let mut constraints = Vec::new();
        for (constraint, of_metric) in optimisation.constraints.iter().zip(&simulated[1..]) {
            let mut worst = f64::NEG_INFINITY;
            let mut value = f64::NAN;
            for (place, grid) in of_metric.iter().enumerate() {
                let from_start = self.least_kept(constraint, grid, share_of(place), effort)?;
                if constraint.limit.excess(from_start) > worst {
                    (worst, value) = (constraint.limit.excess(from_start), from_start);
                }
            }
            constraints.push(value);
        }
        let violation =
            optimisation.constraints.iter().zip(&constraints).map(|(c, value)| c.limit.violation(*value)).sum();
        Ok(Evaluated {
            shares: Vec::new(),
            values: Vec::new(),
            objective: quantile(&sorted, quantile_share),
            band: of_starts[nearest].at.clone(),
            constraints,
            violation,
            unresolved: self.unresolved,
        })
    }
}
