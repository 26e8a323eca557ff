//! The search: all points that can be made where these are few; otherwise gradient steps from some places, which end it where they
//! show that the objective has few optima; otherwise Sobol points over the whole range, a particle swarm from the best of them, and
//! Nelder–Mead from the best places.
//!
//! The objective of an impact damper jumps along ridges and has many local optima. So no further step uses a slope, many places are tried
//! before any is followed, and several are followed to their end. The points do not depend on the number of threads.

use std::borrow::Borrow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use argmin::core::{CostFunction, Error, Executor, PopulationState};
use argmin::solver::neldermead::NelderMead;
use argmin::solver::particleswarm::{Particle, ParticleSwarm};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use super::evaluate::{self, Care, Evaluated, Known};
use super::file::Optimisation;
use super::gradient;
use super::scenarios::{self, Scenario, Scenarios};
use super::variable::Variable;
use crate::failure::Failure;
use crate::study::band::Effort;
use crate::study::over::Over;
use crate::study::sampling::{Sampling, SamplingMethod};

/// Share of the evaluations that the Sobol points have, and the swarm; the rest is Nelder–Mead's.
const SOBOL_SHARE: f64 = 0.4;
const SWARM_SHARE: f64 = 0.3;

/// The first of so many Sobol points are searched over the whole band, and of the others those that may be among the best of so many.
const FIRST: usize = 8;

/// Points that are evaluated side by side where all are.
const TOGETHER: usize = 16;

/// Particles of the swarm.
const PARTICLES: usize = 32;

/// Places that are followed to their end.
pub(super) const PLACES: usize = 8;

/// Least distance between two of them, as a share of the ranges.
pub(super) const APART: f64 = 0.03;

/// Edge of the first simplex as a share of the ranges, and of the second one, from where the first has ended.
const EDGES: [f64; 2] = [0.03, 0.003];

/// Evaluations for each variable with which Nelder–Mead follows the end of gradient steps.
const POLISHED: usize = 25;

/// Standard deviation of the objective in a simplex, as a share of it, at which Nelder–Mead has ended.
const FLAT: f64 = 1e-6;

/// The part of the search that a point belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchStage {
    /// All points that can be made.
    All,
    /// Gradient steps from places over the whole range.
    Gradient,
    /// Over the whole range.
    Sobol,
    /// The swarm.
    Swarm,
    /// Nelder–Mead.
    Polish,
}

impl SearchStage {
    /// As tables name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Gradient => "gradient",
            Self::Sobol => "sobol",
            Self::Swarm => "swarm",
            Self::Polish => "nelder_mead",
        }
    }
}

/// Where a search is.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchProgress {
    /// Points that are evaluated.
    pub done: u64,
    /// Simulations that have ended.
    pub simulations: u64,
    /// The best point so far.
    pub best: Option<Evaluated>,
}

/// What a search found.
#[derive(Clone, Debug)]
pub struct SearchOutcome {
    /// All evaluated points, in the order of the search.
    pub points: Vec<(SearchStage, Evaluated)>,
    /// Number of the best one: of those that keep the constraints, or else of the least violation.
    pub best: usize,
    /// Simulations behind them.
    pub simulations: u64,
    /// Whether gradient steps from many places showed that it has no other optima, likely.
    pub is_complete: bool,
    /// It was stopped before its end.
    pub is_stopped: bool,
}

/// Searches. `report` sees the progress now and then and answers whether to go on.
///
/// # Errors
/// A case that is refused; a search that was stopped before its first point.
pub fn run(
    optimisation: &Optimisation,
    report: &(dyn Fn(&SearchProgress) -> bool + Sync),
) -> Result<SearchOutcome, Failure> {
    let judge = Judge::new(optimisation, report);
    let (points, is_complete) = match points_that_can_be_made(optimisation) {
        Some(points) => (all(&judge, &points), false),
        None => searched(&judge),
    };
    judge.verdict()?;
    let cost = |place: &usize| points[*place].1.cost(optimisation.is_maximum);
    let best = (0..points.len()).min_by(|a, b| cost(a).total_cmp(&cost(b)));
    let best = best.ok_or_else(|| Failure::Interrupted("stopped before the first point".into()))?;
    let (simulations, is_stopped) = (judge.simulations.into_inner(), judge.is_stopped.into_inner());
    Ok(SearchOutcome { points, best, simulations, is_complete, is_stopped })
}

/// All points that can be made, if they are no more than the evaluations of the search.
#[must_use]
pub fn points_that_can_be_made(optimisation: &Optimisation) -> Option<Vec<Vec<f64>>> {
    let most = usize::try_from(optimisation.evaluations).ok()?;
    let mut points: Vec<Vec<f64>> = vec![Vec::new()];
    for variable in &optimisation.variables {
        let values = variable.all(most / points.len())?;
        points = points.iter().flat_map(|point| values.iter().map(move |v| [&point[..], &[*v]].concat())).collect();
    }
    Some(points)
}

/// Evaluates all these points at their nominal values, and in their scenarios those that can be the best.
fn all(judge: &Judge, points: &[Vec<f64>]) -> Vec<(SearchStage, Evaluated)> {
    let optimisation = judge.optimisation;
    let cost = |point: &Evaluated| point.cost(optimisation.is_maximum);
    let go_on = |ended| judge.goes_on(ended);
    let mut known = Known::none(optimisation, Effort::Peaks, &go_on);
    let middle = scenarios::nominal(optimisation);
    let nominal: Vec<Vec<f64>> = points.iter().map(|point| scenarios::values(optimisation, point, &middle)).collect();
    let mut found: Vec<Evaluated> = Vec::new();
    for part in nominal.chunks(TOGETHER) {
        let Some(evaluated) = judge.kept(known.at(part)) else { break };
        found.extend(evaluated.into_iter().cloned());
        found[found.len() - part.len()..].iter().for_each(|point| judge.meet(point));
    }
    for point in &mut found {
        let share =
            |(value, variable): (&f64, &Variable)| (value - variable.range.0) / (variable.range.1 - variable.range.0);
        point.shares = point.values.iter().zip(&optimisation.variables).map(share).collect();
    }
    if optimisation.is_robust() && found.len() == points.len() {
        let few = Scenarios::of(optimisation).few;
        let mut order: Vec<usize> = (0..found.len()).collect();
        order.sort_by(|a, b| cost(&found[*a]).total_cmp(&cost(&found[*b])));
        judge.forget();
        let (mut best, mut done) = (f64::INFINITY, Vec::new());
        for part in order.chunks(TOGETHER) {
            // The worst of a point is no better than its nominal values.
            if optimisation.over == Over::Worst && cost(&found[part[0]]) >= best {
                break;
            }
            let of = |place: usize| few.iter().map(move |scenario| (place, scenario));
            let values: Vec<Vec<f64>> = part
                .iter()
                .flat_map(|place| of(*place))
                .map(|(place, scenario)| scenarios::values(optimisation, &nominal[place], scenario))
                .collect();
            let Some(evaluated) = judge.kept(known.at(&values)) else { break };
            for (place, scenarios) in part.iter().zip(evaluated.chunks(few.len())) {
                let point = evaluate::with_scenarios(optimisation, &found[*place], scenarios);
                best = best.min(cost(&point));
                judge.meet(&point);
                found[*place] = Evaluated { shares: found[*place].shares.clone(), ..point };
                done.push(*place);
            }
        }
        if judge.is_stopped.load(Ordering::Relaxed) && !done.is_empty() {
            found = done.into_iter().map(|place| found[place].clone()).collect();
        }
    }
    found.into_iter().map(|point| (SearchStage::All, point)).collect()
}

/// Searches a range: with gradient steps alone if they show that it has few optima.
fn searched(judge: &Judge) -> (Vec<(SearchStage, Evaluated)>, bool) {
    let optimisation = judge.optimisation;
    let mut descended = Vec::new();
    if optimisation.has_slopes() {
        let evaluate = |shares: &[f64]| judge.evaluate(shares, f64::INFINITY);
        let found = judge.kept(gradient::descents(optimisation, &evaluate, &|ended| judge.goes_on(ended)));
        if let Some(found) = found {
            descended = found.points.into_iter().map(|point| (SearchStage::Gradient, point)).collect();
            let best = best_places(&descended, optimisation.is_maximum, (1, APART)).pop();
            if let Some(best) = best.filter(|_| found.is_complete) {
                // Kinks that differences smooth over.
                let left = (optimisation.evaluations as usize).saturating_sub(descended.len());
                let most = left.min(POLISHED * optimisation.variables.len());
                descended.extend(polish(judge, best, (most, &EDGES[1..])));
                return (descended, true);
            }
        }
    }
    let cost = |point: &(SearchStage, Evaluated)| point.1.cost(optimisation.is_maximum);
    let evaluations = (optimisation.evaluations as usize).saturating_sub(descended.len());
    let share = |share: f64| (share * evaluations as f64) as usize;
    let sampling =
        Sampling { method: SamplingMethod::Sobol, count: share(SOBOL_SHARE).max(1), seed: optimisation.seed };
    // The first point of the sequence is a corner; the second is the middle.
    let shares = sampling.shares(optimisation.variables.len());
    let (first, rest) = shares.split_at(shares.len().div_ceil(FIRST));
    let mut points = judge.evaluate_all(SearchStage::Sobol, first, f64::INFINITY);
    // The band is searched only where the objective may be among the best: a bar that does not depend on the threads.
    let mut costs: Vec<f64> = points.iter().map(cost).collect();
    costs.sort_by(f64::total_cmp);
    let bar = costs.get(costs.len() / FIRST).copied().unwrap_or(f64::INFINITY);
    points.extend(judge.evaluate_all(SearchStage::Sobol, rest, bar));
    points.extend(swarm(judge, &points, share(SWARM_SHARE) / PARTICLES));
    points.extend(descended);
    let places = best_places(&points, optimisation.is_maximum, (PLACES, APART));
    let left = optimisation.evaluations as usize - points.len().min(optimisation.evaluations as usize);
    let each = left / places.len().max(1);
    let polished: Vec<Vec<(SearchStage, Evaluated)>> =
        places.into_par_iter().map(|place| polish(judge, place, (each, &EDGES))).collect();
    points.extend(polished.into_iter().flatten());
    (points, false)
}

/// So many of the best points so far that are apart from each other by this share of the ranges, best first.
pub(super) fn best_places(
    points: &[(SearchStage, Evaluated)],
    is_maximum: bool,
    (count, apart): (usize, f64),
) -> Vec<Evaluated> {
    let mut sorted: Vec<&Evaluated> = points.iter().map(|(_, point)| point).collect();
    sorted.sort_by(|a, b| a.cost(is_maximum).total_cmp(&b.cost(is_maximum)));
    let mut places: Vec<Evaluated> = Vec::new();
    for point in sorted {
        let distance = |other: &Evaluated| {
            let along = other.shares.iter().zip(&point.shares).map(|(a, b)| (a - b).abs());
            along.fold(0.0, f64::max)
        };
        if places.iter().all(|other| distance(other) > apart) {
            places.push(point.clone());
        }
        if places.len() == count {
            break;
        }
    }
    places
}

/// Moves a swarm that starts at the best points so far.
fn swarm(judge: &Judge, points: &[(SearchStage, Evaluated)], iterations: usize) -> Vec<(SearchStage, Evaluated)> {
    let is_maximum = judge.optimisation.is_maximum;
    let mut sorted: Vec<&Evaluated> = points.iter().map(|(_, point)| point).collect();
    sorted.sort_by(|a, b| a.cost(is_maximum).total_cmp(&b.cost(is_maximum)));
    sorted.truncate(PARTICLES);
    if sorted.is_empty() || iterations == 0 {
        return Vec::new();
    }
    let variables = judge.optimisation.variables.len();
    let particle =
        |point: &&Evaluated| Particle::new(point.shares.clone(), point.cost(is_maximum), vec![0.0; variables]);
    let particles: Vec<Particle<Vec<f64>, f64>> = sorted.iter().map(particle).collect();
    let bounds = (vec![0.0; variables], vec![1.0; variables]);
    let random = Xoshiro256PlusPlus::seed_from_u64(judge.optimisation.seed);
    let solver = ParticleSwarm::new(bounds, particles.len()).with_rng_generator(random);
    let bar = sorted.last().map_or(f64::INFINITY, |point| point.cost(is_maximum));
    let points = Mutex::default();
    let search = Search { judge, stage: SearchStage::Swarm, limit: usize::MAX, bar, points: &points };
    let state = |state: PopulationState<Particle<Vec<f64>, f64>, f64>| {
        state.population(particles.clone()).max_iters(iterations as u64)
    };
    // The points are kept as they are evaluated; the result has nothing more.
    let _ = Executor::new(search, solver).configure(state).timer(false).run();
    taken(points)
}

/// Follows a place to its end with Nelder–Mead, with about so many evaluations.
fn polish(judge: &Judge, place: Evaluated, (evaluations, edges): (usize, &[f64])) -> Vec<(SearchStage, Evaluated)> {
    let is_maximum = judge.optimisation.is_maximum;
    let (mut best, mut points) = (place, Vec::new());
    for edge in edges.iter().copied() {
        let corner = |variable: usize| {
            let mut corner = best.shares.clone();
            corner[variable] += if corner[variable] + edge <= 1.0 { edge } else { -edge };
            corner
        };
        let mut simplex = vec![best.shares.clone()];
        simplex.extend((0..judge.optimisation.variables.len()).map(corner));
        // An iteration has at least one evaluation.
        let limit = (evaluations / edges.len()).max(1);
        let kept = Mutex::default();
        let search = Search { judge, stage: SearchStage::Polish, limit, bar: best.cost(is_maximum), points: &kept };
        let Ok(solver) = NelderMead::new(simplex).with_sd_tolerance(FLAT * best.objective.abs()) else { return points };
        let _ = Executor::new(search, solver).configure(|state| state.max_iters(limit as u64)).timer(false).run();
        let found = taken(kept);
        for (_, point) in &found {
            if point.cost(is_maximum) < best.cost(is_maximum) {
                best = point.clone();
            }
        }
        points.extend(found);
    }
    points
}

/// Evaluates points for all parts of the search, and counts and reports them.
struct Judge<'a> {
    optimisation: &'a Optimisation,
    /// Those of each point; none where the objective counts over none.
    scenarios: Vec<Scenario>,
    report: &'a (dyn Fn(&SearchProgress) -> bool + Sync),
    done: AtomicU64,
    simulations: AtomicU64,
    best: Mutex<Option<Evaluated>>,
    is_stopped: AtomicBool,
    refusal: Mutex<Option<Failure>>,
}

impl<'a> Judge<'a> {
    fn new(optimisation: &'a Optimisation, report: &'a (dyn Fn(&SearchProgress) -> bool + Sync)) -> Self {
        let scenarios = if optimisation.is_robust() { Scenarios::of(optimisation).few } else { Vec::new() };
        Self {
            optimisation,
            scenarios,
            report,
            done: AtomicU64::new(0),
            simulations: AtomicU64::new(0),
            best: Mutex::default(),
            is_stopped: AtomicBool::new(false),
            refusal: Mutex::default(),
        }
    }

    /// The point, unless the search is stopped. Its band is searched if it costs no more than `bar` on the grid.
    fn evaluate(&self, shares: &[f64], bar: f64) -> Option<Evaluated> {
        if self.is_stopped.load(Ordering::Relaxed) {
            return None;
        }
        let inside: Vec<f64> = shares.iter().map(|share| share.clamp(0.0, 1.0)).collect();
        let care = Care { effort: Effort::Peaks, up_to_cost: bar };
        let nominal = evaluate::values(self.optimisation, &inside);
        let go_on = |ended| self.goes_on(ended);
        let point = self.kept(evaluate::in_scenarios(self.optimisation, nominal, &self.scenarios, care, &go_on))?;
        let point = Evaluated { shares: inside, ..point };
        self.meet(&point);
        Some(point)
    }

    /// What was evaluated, or nothing and the end of the search.
    fn kept<T>(&self, evaluated: Result<T, Failure>) -> Option<T> {
        match evaluated {
            Ok(evaluated) => Some(evaluated),
            Err(Failure::Interrupted(_)) => None,
            Err(refusal) => {
                self.is_stopped.store(true, Ordering::Relaxed);
                lock(&self.refusal).get_or_insert(refusal);
                None
            }
        }
    }

    /// Forgets the best point so far: what follows is evaluated differently.
    fn forget(&self) {
        *lock(&self.best) = None;
        self.done.store(0, Ordering::Relaxed);
    }

    fn meet(&self, point: &Evaluated) {
        self.done.fetch_add(1, Ordering::Relaxed);
        let is_maximum = self.optimisation.is_maximum;
        let mut best = lock(&self.best);
        if best.as_ref().is_none_or(|best| point.cost(is_maximum) < best.cost(is_maximum)) {
            *best = Some(point.clone());
        }
        drop(best);
        self.goes_on(0);
    }

    /// Reports the progress after so many more simulations; whether the search goes on.
    fn goes_on(&self, ended: u64) -> bool {
        let simulations = self.simulations.fetch_add(ended, Ordering::Relaxed) + ended;
        let (done, best) = (self.done.load(Ordering::Relaxed), lock(&self.best).clone());
        if !(self.report)(&SearchProgress { done, simulations, best }) {
            self.is_stopped.store(true, Ordering::Relaxed);
        }
        !self.is_stopped.load(Ordering::Relaxed)
    }

    fn evaluate_all(&self, stage: SearchStage, points: &[Vec<f64>], bar: f64) -> Vec<(SearchStage, Evaluated)> {
        let evaluated: Vec<Option<Evaluated>> = points.par_iter().map(|shares| self.evaluate(shares, bar)).collect();
        evaluated.into_iter().flatten().map(|point| (stage, point)).collect()
    }

    fn verdict(&self) -> Result<(), Failure> {
        lock(&self.refusal).take().map_or(Ok(()), Err)
    }
}

fn lock<T>(value: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    value.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn taken<T>(value: Mutex<T>) -> T {
    value.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// The cost as a solver sees it. It keeps the points.
struct Search<'a> {
    judge: &'a Judge<'a>,
    stage: SearchStage,
    /// Most points.
    limit: usize,
    /// Cost on the grid above which the band is not searched.
    bar: f64,
    points: &'a Mutex<Vec<(SearchStage, Evaluated)>>,
}

impl Search<'_> {
    /// Cost of a point. A search that is stopped finds nothing better and ends by its number of iterations.
    fn keep(&self, point: Option<Evaluated>) -> f64 {
        let Some(point) = point else { return f64::MAX };
        let cost = point.cost(self.judge.optimisation.is_maximum);
        lock(self.points).push((self.stage, point));
        cost
    }
}

impl CostFunction for Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, shares: &Vec<f64>) -> Result<f64, Error> {
        if lock(self.points).len() >= self.limit {
            return Ok(f64::MAX);
        }
        Ok(self.keep(self.judge.evaluate(shares, self.bar)))
    }

    fn bulk_cost<P: Borrow<Vec<f64>>>(&self, points: &[P]) -> Result<Vec<f64>, Error> {
        let points: Vec<&Vec<f64>> = points.iter().map(|point| point.borrow()).collect();
        let evaluated: Vec<Option<Evaluated>> =
            points.par_iter().map(|shares| self.judge.evaluate(shares, self.bar)).collect();
        Ok(evaluated.into_iter().map(|point| self.keep(point)).collect())
    }
}
