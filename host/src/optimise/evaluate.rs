//! The objective and the constraints at a point: the metrics of a study over the band, between the values of its grid too, and over the
//! starts.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use super::cases::BandCases;
use super::constraint::Constraint;
use super::file::Optimisation;
use super::scenarios::{self, Scenario};
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::simulation::Case;
use crate::study::axis::{AxisValue, StudyAxis};
use crate::study::band::{Band, Effort, Reduced};
use crate::study::over::Over;
use crate::study::simulate::metrics_of_all;

/// What an evaluated point gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluated {
    /// Place of each variable in its range, 0 to 1.
    pub shares: Vec<f64>,
    /// Nominal value of each variable and of what is uncertain.
    pub values: Vec<f64>,
    /// Those where the objective is: others where it counts over tolerances or uncertain values.
    pub there: Vec<f64>,
    /// The objective; not a number if it does not exist.
    pub objective: f64,
    /// That of each start (and scenario), sorted.
    pub all: Vec<f64>,
    /// Values of the band's axes where the objective is; the first ones for a mean.
    pub band: Vec<AxisValue>,
    /// For each constraint its metric where it is kept least.
    pub constraints: Vec<f64>,
    /// Sum of the constraints' violations; 0 if all are kept.
    pub violation: f64,
    /// How often an event search was given up.
    pub unresolved: f64,
    /// The simulations of which one is the worst here, and another one may be nearby; none where no gradient steps are made.
    pub tops: Vec<Top>,
}

/// A simulation that may decide.
#[derive(Clone, Debug, PartialEq)]
pub struct Top {
    /// Values of the variables and of what is uncertain.
    pub values: Vec<f64>,
    /// Start of the particle as a share, if it is one of several.
    pub start: Option<f64>,
    /// Values of the band's axes.
    pub band: Vec<AxisValue>,
    /// The objective's metric.
    pub value: f64,
}

impl Evaluated {
    /// Whether it has an objective and keeps all constraints.
    #[must_use]
    pub fn is_feasible(&self) -> bool {
        self.violation == 0.0 && !self.objective.is_nan()
    }

    /// Scenarios of tolerances and uncertain values behind it; 1 without any.
    #[must_use]
    pub fn scenarios(&self, optimisation: &Optimisation) -> usize {
        self.all.len() / optimisation.starts.as_ref().map_or(1, Vec::len)
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
pub type GoOnAfter<'a> = &'a (dyn Fn(u64) -> bool + Sync);

/// The metrics of some simulations: by metric, then by start, then by point of the band.
type MetricsByStart = Vec<Vec<Vec<f64>>>;

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

/// The values of the variables at these shares of their ranges, and the middle ones of what is uncertain.
#[must_use]
pub fn values(optimisation: &Optimisation, shares: &[f64]) -> Vec<f64> {
    let nominal = optimisation.variable_axes().iter().zip(shares).map(|(axis, share)| number(axis, *share));
    scenarios::values(optimisation, &nominal.collect::<Vec<f64>>(), &scenarios::nominal(optimisation))
}

/// The value of a variable at a share of its range.
pub(super) fn number(axis: &StudyAxis, share: f64) -> f64 {
    match axis.value(0, share) {
        AxisValue::Number(number) => number,
        AxisValue::Word(_) => f64::NAN,
    }
}

/// Evaluates the point with these values of the variables and of what is uncertain; it has no shares.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub fn at_values(
    optimisation: &Optimisation,
    values: Vec<f64>,
    care: Care,
    go_on: GoOnAfter,
) -> Result<Evaluated, Failure> {
    let metrics: Vec<Quantity> =
        [optimisation.objective].into_iter().chain(optimisation.constraints.iter().map(|c| c.metric)).collect();
    let starts = optimisation.starts.as_ref();
    let cases = BandCases::at(optimisation, &values)?;
    let case = |at: &[AxisValue]| cases.case(at);
    let mut point = Simulations { optimisation, case: &case, go_on, unresolved: 0.0 };
    let simulated = point.grid(&metrics, starts.map(Vec::as_slice))?;
    let mut evaluated = point.evaluated(&simulated, Effort::Grid)?;
    let can_improve = optimisation.can_improve_between();
    if care.effort != Effort::Grid && (can_improve || evaluated.cost(optimisation.is_maximum) <= care.up_to_cost) {
        evaluated = point.evaluated(&simulated, care.effort)?;
    }
    let tops = evaluated.tops.into_iter().map(|top| Top { values: values.clone(), ..top }).collect();
    Ok(Evaluated { there: values.clone(), values, tops, ..evaluated })
}

/// The objective's metric of a simulation with other values of the variables and of what is uncertain.
///
/// # Errors
/// As [`at_values`].
pub fn of_top(optimisation: &Optimisation, top: &Top, values: &[f64], go_on: GoOnAfter) -> Result<f64, Failure> {
    let cases = BandCases::at(optimisation, values)?;
    let case = |at: &[AxisValue]| cases.case(at);
    let mut point = Simulations { optimisation, case: &case, go_on, unresolved: 0.0 };
    Ok(point.at(std::slice::from_ref(&top.band), top.start, optimisation.objective)?[0])
}

/// Evaluates nominal values in some scenarios; as they are alone where that costs more already than `care` allows, since the worst is no
/// better.
///
/// # Errors
/// As [`at_values`].
pub fn in_scenarios(
    optimisation: &Optimisation,
    nominal: Vec<f64>,
    scenarios: &[Scenario],
    care: Care,
    go_on: GoOnAfter,
) -> Result<Evaluated, Failure> {
    let at = |scenario: &Scenario| {
        at_values(optimisation, scenarios::values(optimisation, &nominal, scenario), Care::of(care.effort), go_on)
    };
    let all = || scenarios.iter().map(at).collect::<Result<Vec<Evaluated>, Failure>>();
    if optimisation.over != Over::Worst && !scenarios.is_empty() {
        return Ok(together(optimisation, nominal.clone(), &all()?.iter().collect::<Vec<_>>()));
    }
    let alone = at_values(optimisation, nominal.clone(), care, go_on)?;
    if scenarios.is_empty() || alone.cost(optimisation.is_maximum) > care.up_to_cost {
        return Ok(alone);
    }
    Ok(with_scenarios(optimisation, &alone, &all()?.iter().collect::<Vec<_>>()))
}

/// What some scenarios of nominal values give together; the worst is of the nominal values too.
#[must_use]
pub fn with_scenarios(optimisation: &Optimisation, nominal: &Evaluated, scenarios: &[&Evaluated]) -> Evaluated {
    let counted = (optimisation.over == Over::Worst).then_some(nominal);
    let all: Vec<&Evaluated> = scenarios.iter().copied().chain(counted).collect();
    together(optimisation, nominal.values.clone(), &all)
}

/// What some scenarios of the same nominal values give together.
#[must_use]
pub fn together(optimisation: &Optimisation, nominal: Vec<f64>, scenarios: &[&Evaluated]) -> Evaluated {
    let mut all: Vec<f64> = scenarios.iter().flat_map(|point| point.all.iter().copied()).collect();
    all.sort_by(f64::total_cmp);
    let objective = optimisation.over.of(&all, optimisation.is_maximum);
    // The worst scenario, or the one nearest to the value that counts.
    let distance = |point: &Evaluated| match optimisation.over {
        Over::Worst => -point.cost(optimisation.is_maximum),
        _ => (point.objective - objective).abs(),
    };
    let nearest = scenarios.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let (there, band) = nearest.map_or_else(Default::default, |point| (point.there.clone(), point.band.clone()));
    let least_kept = |(place, constraint): (usize, &Constraint)| {
        let values = scenarios.iter().map(|point| point.constraints[place]);
        let worse = |a: f64, b: f64| if constraint.limit.excess(b) > constraint.limit.excess(a) { b } else { a };
        values.reduce(worse).unwrap_or(f64::NAN)
    };
    let constraints: Vec<f64> = optimisation.constraints.iter().enumerate().map(least_kept).collect();
    Evaluated {
        shares: Vec::new(),
        values: nominal,
        there,
        objective,
        all,
        band,
        violation: violation(optimisation, &constraints),
        constraints,
        unresolved: scenarios.iter().map(|point| point.unresolved).sum(),
        tops: scenarios.iter().flat_map(|point| point.tops.iter().cloned()).collect(),
    }
}

fn violation(optimisation: &Optimisation, constraints: &[f64]) -> f64 {
    optimisation.constraints.iter().zip(constraints).map(|(c, value)| c.limit.violation(*value)).sum()
}

/// Points that are evaluated, each once.
pub struct Known<'a> {
    optimisation: &'a Optimisation,
    effort: Effort,
    go_on: GoOnAfter<'a>,
    points: HashMap<Vec<u64>, Evaluated>,
}

impl<'a> Known<'a> {
    /// None yet.
    #[must_use]
    pub fn none(optimisation: &'a Optimisation, effort: Effort, go_on: GoOnAfter<'a>) -> Self {
        Self { optimisation, effort, go_on, points: HashMap::new() }
    }

    /// Evaluates those of some points that are not known yet, and gives all.
    ///
    /// # Errors
    /// As [`at_values`].
    pub fn at(&mut self, points: &[Vec<f64>]) -> Result<Vec<&Evaluated>, Failure> {
        let mut new: Vec<&Vec<f64>> = points.iter().filter(|point| !self.points.contains_key(&bits(point))).collect();
        let mut seen = HashSet::new();
        new.retain(|point| seen.insert(bits(point)));
        let care = Care::of(self.effort);
        let evaluate = |point: &&Vec<f64>| at_values(self.optimisation, (*point).clone(), care, self.go_on);
        let found: Vec<Evaluated> = new.par_iter().map(evaluate).collect::<Result<_, Failure>>()?;
        self.points.extend(new.iter().map(|point| bits(point)).zip(found));
        Ok(points.iter().filter_map(|point| self.points.get(&bits(point))).collect())
    }
}

fn bits(point: &[f64]) -> Vec<u64> {
    point.iter().map(|value| value.to_bits()).collect()
}

/// The objective from each of some starts, at these values of the variables.
///
/// # Errors
/// As [`at_values`].
pub fn from_starts(
    optimisation: &Optimisation,
    values: &[f64],
    starts: &[f64],
    effort: Effort,
    go_on: GoOnAfter,
) -> Result<Vec<f64>, Failure> {
    let cases = BandCases::at(optimisation, values)?;
    let case = |at: &[AxisValue]| cases.case(at);
    let mut point = Simulations { optimisation, case: &case, go_on, unresolved: 0.0 };
    let simulated = point.grid(&[optimisation.objective], Some(starts))?;
    let of_start = |(share, over_band): (&f64, &Vec<f64>)| {
        Ok(point.reduced(&optimisation.reduced_band, over_band, Some(*share), effort)?.value)
    };
    starts.iter().zip(&simulated[0]).map(of_start).collect()
}

/// The objective's metric at some points of the band, from each start: of the case with these values, or of its bare structure.
///
/// # Errors
/// As [`at_values`].
pub fn on_axis(
    optimisation: &Optimisation,
    values: &[f64],
    points: &[Vec<AxisValue>],
    is_bare: bool,
    go_on: GoOnAfter,
) -> Result<Vec<Vec<f64>>, Failure> {
    let cases = BandCases::at(optimisation, values)?;
    let case = |at: &[AxisValue]| Ok(if is_bare { cases.case(at)?.with_dampers(None) } else { cases.case(at)? });
    let mut point = Simulations { optimisation, case: &case, go_on, unresolved: 0.0 };
    match optimisation.starts.as_ref().filter(|_| !is_bare) {
        None => Ok(vec![point.at(points, None, optimisation.objective)?]),
        Some(starts) => starts.iter().map(|share| point.at(points, Some(*share), optimisation.objective)).collect(),
    }
}

/// The objective of cases that are not the optimisation's own, from their own starts, over the band: `case` makes one from values of the
/// band's axes.
///
/// # Errors
/// A case that is refused, or that `go_on` said no.
pub fn over_band(
    optimisation: &Optimisation,
    case: &dyn Fn(&[AxisValue]) -> Result<Case, Failure>,
    go_on: GoOnAfter,
) -> Result<f64, Failure> {
    let mut point = Simulations { optimisation, case, go_on, unresolved: 0.0 };
    let simulated = point.grid(&[optimisation.objective], None)?;
    Ok(point.reduced(&optimisation.reduced_band, &simulated[0][0], None, Effort::Scan)?.value)
}

/// The simulations of a point.
struct Simulations<'a> {
    optimisation: &'a Optimisation,
    /// The case with values of the band's axes.
    case: &'a dyn Fn(&[AxisValue]) -> Result<Case, Failure>,
    go_on: GoOnAfter<'a>,
    /// How often an event search was given up.
    unresolved: f64,
}

impl Simulations<'_> {
    /// Simulates the case at each point of the band's grid from each start (from its own without any).
    fn grid(&mut self, metrics: &[Quantity], starts: Option<&[f64]>) -> Result<MetricsByStart, Failure> {
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

    fn metrics(&mut self, cases: &[Case], metrics: &[Quantity]) -> Result<Vec<Vec<f64>>, Failure> {
        let simulated = metrics_of_all(cases, self.optimisation.record, metrics, &|| (self.go_on)(0))?;
        (self.go_on)(cases.len() as u64);
        self.unresolved += simulated.iter().map(|(_, given_up)| given_up).sum::<f64>();
        Ok(simulated.into_iter().map(|(values, _)| values).collect())
    }

    /// A metric at points of the band from a start.
    fn at(&mut self, points: &[Vec<AxisValue>], share: Option<f64>, metric: Quantity) -> Result<Vec<f64>, Failure> {
        let case = |at: &Vec<AxisValue>| {
            let case = (self.case)(at)?;
            Ok(share.map_or_else(|| case.clone(), |share| case.started_at(share)))
        };
        let cases = points.iter().map(case).collect::<Result<Vec<Case>, Failure>>()?;
        Ok(self.metrics(&cases, &[metric])?.into_iter().flatten().collect())
    }

    /// The objective over the band from a start.
    fn reduced(&mut self, band: &Band, grid: &[f64], share: Option<f64>, effort: Effort) -> Result<Reduced, Failure> {
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
    ) -> Result<f64, Failure> {
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
    fn evaluated(&mut self, simulated: &MetricsByStart, effort: Effort) -> Result<Evaluated, Failure> {
        let optimisation = self.optimisation;
        let starts = optimisation.starts.as_ref();
        let share_of = |place: usize| starts.map(|starts| starts[place]);
        let mut of_starts: Vec<Reduced> = Vec::new();
        for (place, grid) in simulated[0].iter().enumerate() {
            of_starts.push(self.reduced(&optimisation.reduced_band, grid, share_of(place), effort)?);
        }
        let mut tops = Vec::new();
        if optimisation.has_slopes() {
            for (place, reduced) in of_starts.iter().enumerate() {
                let top = |(band, value): &(Vec<AxisValue>, f64)| Top {
                    values: Vec::new(),
                    start: share_of(place),
                    band: band.clone(),
                    value: *value,
                };
                tops.extend(reduced.tops.iter().map(top));
            }
        }
        // The objective over the starts, with the place in the band of the start nearest to it.
        of_starts.sort_by(|a, b| a.value.total_cmp(&b.value));
        let sorted: Vec<f64> = of_starts.iter().map(|reduced| reduced.value).collect();
        let share = optimisation.over.quantile(optimisation.is_maximum).unwrap_or(0.0);
        let nearest = (share * (sorted.len() - 1) as f64).round() as usize;
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
        Ok(Evaluated {
            shares: Vec::new(),
            values: Vec::new(),
            there: Vec::new(),
            objective: optimisation.over.of(&sorted, optimisation.is_maximum),
            all: sorted,
            band: of_starts[nearest].at.clone(),
            violation: violation(optimisation, &constraints),
            constraints,
            unresolved: self.unresolved,
            tops,
        })
    }
}
