//! The answer of an optimisation: the optimum, how sure it is, what is around it, and what other dampers do.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;

use super::cases::BandCases;
use super::constraint::Constraint;
use super::evaluate::{Evaluated, GoOnAfter, from_starts};
use super::file::Optimisation;
use super::front::Front;
use super::mount;
use super::neighbourhood::{self, VariableSensitivity};
use super::over_band::{self, OverBand};
use super::references::References;
use super::search::SearchOutcome;
use super::stuck;
use super::variable::ValueChoice;
use crate::failure::Failure;
use crate::study::axis::{AxisValue, Reduction, StudyAxis};
use crate::study::band::Effort;
use crate::study::over::Over;
use crate::study::over::quantile;

/// Starts from wall to wall from which the optimum is simulated again.
pub(super) const DENSE_STARTS: u32 = 101;

/// A number and what it is of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Named {
    /// Key.
    pub key: String,
    /// Value.
    pub value: f64,
    /// Symbol of its unit; empty for a plain number.
    pub unit: &'static str,
}

/// A variable at the optimum.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BestVariable {
    /// Key.
    pub key: String,
    /// Value: one that can be made (without `step` and `values` rounded to the power of ten at or below the tolerance), or as the search
    /// had it if it was stopped or no point keeps the constraints.
    pub value: f64,
    /// How far from it the mounted value may be, to either side.
    pub tolerance: f64,
    /// Symbol of the unit of both; empty for a plain number.
    pub unit: &'static str,
    /// The end of its range lies within the tolerance: a better value may lie outside.
    pub is_at_edge: bool,
}

/// A constraint at the optimum.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KeptConstraint {
    /// The metric.
    pub metric: &'static str,
    /// What is asked of it.
    pub limit: String,
    /// Its value where it is nearest to the limit or furthest beyond it.
    pub value: f64,
    /// Symbol of its unit; empty for a plain number.
    pub unit: &'static str,
    /// Whether the constraint is kept; `None` of a second objective, which has no limit.
    pub is_kept: Option<bool>,
}

/// The objective over many starts of the particle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Starts {
    /// Number of starts.
    pub count: u32,
    /// Smallest value.
    pub min: f64,
    /// Quantile 0.05.
    pub q05: f64,
    /// Median.
    pub median: f64,
    /// Quantile 0.95.
    pub q95: f64,
    /// Largest value.
    pub max: f64,
}

/// The answer.
#[derive(Clone, Debug, Serialize)]
pub struct Optimum {
    /// Program and version.
    pub damprig: &'static str,
    /// Name of the optimisation.
    pub name: String,
    /// The metric that was optimised.
    pub metric: &'static str,
    /// `minimum` or `maximum`.
    pub goal: &'static str,
    /// Whether a point keeps all constraints. If none does, the optimum is the point of the least violation.
    pub is_feasible: bool,
    /// The search was stopped and the optimum is the best so far, or what is around the optimum is not complete.
    pub is_stopped: bool,
    /// Evaluated points of the search.
    pub evaluations: usize,
    /// Simulations of the search and of what follows it; of the whole run those of its front and alternatives too.
    pub simulations: u64,
    /// The objective at the values of the variables; over stated tolerances and uncertain values where there are some.
    pub objective: f64,
    /// What counts of starts, stated tolerances and uncertain values: `worst`, `q95`, `median` or `mean`.
    pub over: Over,
    /// Simulated scenarios of tolerances and uncertain values behind the objective; 1 without any.
    pub scenarios: usize,
    /// The objective at the nominal values: exactly those of the variables, and the middle ones of what is uncertain. `None` if it counts
    /// over tolerances or uncertain values and the search was stopped or no point keeps the constraints.
    pub nominal: Option<f64>,
    /// The worst objective of the scenarios, or at the ends of the tolerances where none is stated; `None` if the values are not those
    /// that can be made.
    pub worst_within_tolerance: Option<f64>,
    /// Whether all constraints are kept there; `None` if the values are not those that can be made.
    pub is_feasible_within_tolerance: Option<bool>,
    /// Symbol of its unit.
    pub unit: &'static str,
    /// The variables at the optimum.
    pub variables: Vec<BestVariable>,
    /// Variables and uncertain keys where the objective is, if it counts over tolerances or uncertain values (for a mean or a quantile:
    /// where a scenario is nearest to it).
    pub there: Vec<Named>,
    /// Where in the band the objective is.
    pub band: Vec<Named>,
    /// The constraints at the optimum.
    pub constraints: Vec<KeptConstraint>,
    /// How often an event search was given up at the optimum.
    pub unresolved: f64,
    /// Over many starts of the particle, if there is one.
    pub starts: Option<Starts>,
    /// What small changes do.
    pub sensitivity: Vec<VariableSensitivity>,
    /// Points around the optimum.
    #[serde(skip)]
    pub neighbourhood: Vec<Evaluated>,
    /// Other dampers.
    pub references: References,
    /// The objective's metric over a band of one axis.
    pub over_band: Vec<OverBand>,
    /// The share of the time in which the friction damper holds the structure on its base, over the band's grid at the optimum.
    pub stuck_share: Option<f64>,
    /// Mass of the particle or of the tuned mass, kg.
    pub damper_mass_kg: Option<f64>,
    /// The front of the objective and a second one, if one was asked for.
    pub front: Option<Front>,
    /// The answers of the alternatives.
    pub alternatives: Vec<Optimum>,
}

impl Optimum {
    /// From what a search found. A search that was stopped keeps its optimum; what is around it is not computed. When `go_on` says no,
    /// what is computed so far is kept.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn of(optimisation: &Optimisation, found: &SearchOutcome, go_on: GoOnAfter) -> Result<Self, Failure> {
        let simulations = AtomicU64::new(found.simulations);
        let go_on: GoOnAfter = &|ended| {
            simulations.fetch_add(ended, Ordering::Relaxed);
            go_on(ended)
        };
        let best = &found.points[found.best].1;
        let setting = if found.is_stopped || !best.is_feasible() {
            None
        } else {
            Failure::unless_interrupted(mount::best(optimisation, found, go_on))?.flatten()
        };
        let is_robust = optimisation.is_robust();
        let nominal = setting.as_ref().map_or(best, |setting| &setting.at);
        let over = setting.as_ref().map(|setting| &setting.over);
        let best = if is_robust { over.unwrap_or(best) } else { nominal };
        let is_stopped = found.is_stopped || (setting.is_none() && best.is_feasible());
        let around = Around::of(optimisation, nominal, is_stopped, go_on)?;
        let variable = |(place, axis): (usize, &StudyAxis)| {
            let (value, made) = (best.values[place], &optimisation.variables[place]);
            let (tolerance, (from, to)) = (made.tolerance(value), made.range);
            let is_at_edge = match &made.choice {
                ValueChoice::Digits => value - from <= tolerance || to - value <= tolerance,
                ValueChoice::Steps(step) => value - from < 0.5 * step || to - value < step * (1.0 - 1e-9),
                ValueChoice::Listed(_) => false,
            };
            BestVariable { key: axis.key.clone(), value, tolerance, unit: axis.unit(), is_at_edge }
        };
        let named =
            |(axis, value): (&StudyAxis, &f64)| Named { key: axis.key.clone(), value: *value, unit: axis.unit() };
        let there = optimisation.axes.iter().zip(&best.there).map(named).collect();
        let kept = |(constraint, value): (&Constraint, &f64)| KeptConstraint {
            metric: constraint.metric.name(),
            limit: constraint
                .limit
                .words(|limit| format!("{limit} {}", constraint.metric.suffix()).trim_end().to_string()),
            value: *value,
            unit: constraint.metric.suffix(),
            is_kept: constraint.limit.is_kept(*value),
        };
        Ok(Self {
            damprig: crate::VERSION_LINE,
            name: optimisation.name.clone(),
            metric: optimisation.objective.name(),
            goal: if optimisation.is_maximum { "maximum" } else { "minimum" },
            is_feasible: best.is_feasible(),
            is_stopped: around.is_stopped,
            evaluations: found.points.len(),
            simulations: simulations.load(Ordering::Relaxed),
            objective: best.objective,
            over: optimisation.over,
            scenarios: best.scenarios(optimisation),
            nominal: (!is_robust || over.is_some()).then_some(nominal.objective),
            worst_within_tolerance: over.map(|over| if is_robust { worst(optimisation, over) } else { over.objective }),
            is_feasible_within_tolerance: over.map(Evaluated::is_feasible),
            unit: optimisation.objective.suffix(),
            variables: optimisation.variable_axes().iter().enumerate().map(variable).collect(),
            there: if is_robust { there } else { Vec::new() },
            band: place_in_band(optimisation, best),
            constraints: optimisation.constraints.iter().zip(&best.constraints).map(kept).collect(),
            unresolved: best.unresolved,
            starts: around.starts,
            sensitivity: around.sensitivity,
            neighbourhood: around.neighbourhood,
            references: around.references,
            over_band: around.over_band,
            stuck_share: around.stuck_share,
            damper_mass_kg: damper_mass_kg(optimisation, nominal)?,
            front: None,
            alternatives: Vec::new(),
        })
    }
}

/// The worst of all scenarios and starts.
fn worst(optimisation: &Optimisation, over: &Evaluated) -> f64 {
    Over::Worst.of(&over.all, optimisation.is_maximum)
}

/// What is computed around an optimum.
struct Around {
    is_stopped: bool,
    starts: Option<Starts>,
    sensitivity: Vec<VariableSensitivity>,
    neighbourhood: Vec<Evaluated>,
    references: References,
    over_band: Vec<OverBand>,
    stuck_share: Option<f64>,
}

impl Around {
    /// Nothing after a search that was stopped and at a point of a front, and no neighbourhood where the constraints are not kept.
    fn of(optimisation: &Optimisation, best: &Evaluated, is_stopped: bool, go_on: GoOnAfter) -> Result<Self, Failure> {
        let mut around = Self {
            is_stopped,
            starts: None,
            sensitivity: Vec::new(),
            neighbourhood: Vec::new(),
            references: References { bare: None, tmd: None },
            over_band: Vec::new(),
            stuck_share: None,
        };
        if !is_stopped && optimisation.has_surroundings {
            around.is_stopped = Failure::unless_interrupted(around.fill(optimisation, best, go_on))?.is_none();
        }
        Ok(around)
    }

    fn fill(&mut self, optimisation: &Optimisation, best: &Evaluated, go_on: GoOnAfter) -> Result<(), Failure> {
        if best.is_feasible() {
            self.sensitivity = neighbourhood::sensitivities(optimisation, best, go_on)?;
            self.neighbourhood = neighbourhood::grid(optimisation, best, go_on)?;
        }
        self.starts = starts(optimisation, best, go_on)?;
        self.references = References::at(optimisation, best, go_on)?;
        self.stuck_share = stuck::share(optimisation, best, go_on)?;
        self.over_band = over_band::curve(optimisation, best, go_on)?;
        Ok(())
    }
}

fn damper_mass_kg(optimisation: &Optimisation, best: &Evaluated) -> Result<Option<f64>, Failure> {
    let case = BandCases::at(optimisation, &best.values)?.case(&optimisation.band_values(0))?;
    Ok(case.damper_mass().map(|(mass_kg, _)| mass_kg))
}

/// Values of the band's axes where the objective is; none of axes with a mean, and of those after one.
fn place_in_band(optimisation: &Optimisation, best: &Evaluated) -> Vec<Named> {
    let number = |(axis, value): (&StudyAxis, &AxisValue)| match value {
        AxisValue::Number(value) => Some(Named { key: axis.key.clone(), value: *value, unit: axis.unit() }),
        AxisValue::Word(_) => None,
    };
    let is_extreme = |(axis, _): &(&StudyAxis, &AxisValue)| axis.reduce != Some(Reduction::Mean);
    optimisation.band().iter().zip(&best.band).take_while(is_extreme).filter_map(number).collect()
}

fn starts(optimisation: &Optimisation, best: &Evaluated, go_on: GoOnAfter) -> Result<Option<Starts>, Failure> {
    let case = BandCases::at(optimisation, &best.values)?.case(&optimisation.band_values(0))?;
    if !case.has_particle() {
        return Ok(None);
    }
    let last = f64::from(DENSE_STARTS - 1);
    let shares: Vec<f64> = (0..DENSE_STARTS).map(|n| 2.0 * f64::from(n) / last - 1.0).collect();
    // The optimum was scanned: the grid has its place in the band.
    let with_place = optimisation.with_place_in_band(&best.band);
    let mut values = from_starts(&with_place, &best.values, &shares, Effort::Peaks, go_on)?;
    values.sort_by(f64::total_cmp);
    let at = |share: f64| quantile(&values, share);
    let (q05, median, q95) = (at(0.05), at(0.5), at(0.95));
    Ok(Some(Starts { count: DENSE_STARTS, min: at(0.0), q05, median, q95, max: at(1.0) }))
}
