//! Verifies places that the search found with many more scenarios than it compared points by.

use rayon::prelude::*;

use super::evaluate::{Care, Evaluated, GoOnAfter, Known, at_values, together};
use super::file::Optimisation;
use super::mount::PointCounts;
use super::scenarios::{self, Scenario, Scenarios};
use crate::failure::Failure;
use crate::study::band::Effort;
use crate::study::over::Over;

/// Places that are verified with many scenarios, one after the other until no other can be better; where the objective is not that of
/// the worst scenario, no scenario shows that.
const VERIFIED: [usize; 2] = [64, 3];

/// Places of them whose every scenario is evaluated, about: neighbours share scenarios, and a place that is worse ends early.
const ABOUT_VERIFIED: u64 = 2;

/// Scenarios that are evaluated side by side.
const TOGETHER: usize = 64;

/// The worst of many scenarios from which worse ones are looked for, and rounds of that, each with half the steps of the one before.
const WORST: usize = 12;
const ROUNDS: usize = 5;

/// The worst of all these, whose band is scanned.
const SCANNED: usize = 4;

/// Points that a verification evaluates around the peaks of their grid, and with a scan.
pub(super) fn points(optimisation: &Optimisation) -> (PointCounts, PointCounts) {
    let places = most_places(optimisation) as u64;
    let steps = scenarios::steps(optimisation).len();
    let all = (Scenarios::of(optimisation).many.len() + ROUNDS * WORST * 2 * steps) as u64;
    let of = |each: u64| PointCounts { most: places * each, about: ABOUT_VERIFIED * each };
    (of(all), of(SCANNED as u64))
}

fn most_places(optimisation: &Optimisation) -> usize {
    VERIFIED[usize::from(optimisation.over != Over::Worst)]
}

/// A verification. Neighbouring places share scenarios, which are evaluated once.
pub(super) struct Verification<'a> {
    optimisation: &'a Optimisation,
    all: Scenarios,
    known: Known<'a>,
    go_on: GoOnAfter<'a>,
}

/// The scenarios of a place that are evaluated.
type Tried = Vec<(Scenario, Evaluated)>;

impl<'a> Verification<'a> {
    /// Of an optimisation that [counts over some scenarios](Optimisation::is_robust).
    pub fn of(optimisation: &'a Optimisation, go_on: GoOnAfter<'a>) -> Self {
        let (all, known) = (Scenarios::of(optimisation), Known::none(optimisation, Effort::Peaks, go_on));
        Self { optimisation, all, known, go_on }
    }

    /// The best of some places, of which the best come first, with what many scenarios give.
    ///
    /// # Errors
    /// The refusal of a case that the values make, or that `go_on` said no.
    pub fn best(mut self, places: &[Evaluated]) -> Result<Option<Evaluated>, Failure> {
        let is_worst = self.optimisation.over == Over::Worst;
        let mut best: Option<Evaluated> = None;
        for place in places.iter().take(most_places(self.optimisation)) {
            let bar = best.as_ref().map_or(f64::INFINITY, |best| self.cost(best));
            // More scenarios make the worst no better, but they may do that to another value.
            if is_worst && self.cost(place) >= bar {
                break;
            }
            let verified = self.place(place, if is_worst { bar } else { f64::INFINITY })?;
            best = verified.filter(|over| self.cost(over) < bar).or(best);
        }
        Ok(best)
    }

    /// What many scenarios of a place give; `None` as soon as one of them costs `bar`.
    fn place(&mut self, place: &Evaluated, bar: f64) -> Result<Option<Evaluated>, Failure> {
        let mut tried = Tried::new();
        for part in self.nearest_first(place).chunks(TOGETHER) {
            if !self.try_all(place, part, &mut tried, bar)? {
                return Ok(None);
            }
        }
        if self.optimisation.over == Over::Worst && !self.look_for_worse(place, &mut tried, bar)? {
            return Ok(None);
        }
        let all: Vec<&Evaluated> = tried.iter().map(|(_, point)| point).collect();
        Ok(Some(together(self.optimisation, place.values.clone(), &all)))
    }

    /// Looks for worse scenarios near the worst ones, and scans the band of the worst; whether none costs `bar`.
    fn look_for_worse(&mut self, place: &Evaluated, tried: &mut Tried, bar: f64) -> Result<bool, Failure> {
        let mut step = self.all.spacing;
        for _ in 0..ROUNDS {
            step /= 2.0;
            let near: Vec<Scenario> =
                self.worst(tried, WORST).iter().flat_map(|scenario| self.neighbours(scenario, step)).collect();
            if !self.try_all(place, &near, tried, bar)? {
                return Ok(false);
            }
        }
        let worst = self.worst(tried, SCANNED);
        let scan = |scenario: &Scenario| {
            at_values(self.optimisation, self.values(place, scenario), Care::of(Effort::Scan), self.go_on)
        };
        let scanned: Vec<Evaluated> = worst.par_iter().map(scan).collect::<Result<_, Failure>>()?;
        tried.extend(worst.into_iter().zip(scanned));
        Ok(true)
    }

    /// Evaluates some scenarios; whether none costs `bar`.
    fn try_all(
        &mut self,
        place: &Evaluated,
        scenarios: &[Scenario],
        tried: &mut Tried,
        bar: f64,
    ) -> Result<bool, Failure> {
        let values: Vec<Vec<f64>> = scenarios.iter().map(|scenario| self.values(place, scenario)).collect();
        let found: Vec<Evaluated> = self.known.at(&values)?.into_iter().cloned().collect();
        let is_better = found.iter().all(|point| self.cost(point) < bar);
        tried.extend(scenarios.iter().cloned().zip(found));
        Ok(is_better)
    }

    /// All scenarios, of which those near the worst known one of a place come first: they show soonest that another place is better.
    fn nearest_first(&self, place: &Evaluated) -> Vec<Scenario> {
        let off = |scenario: &Scenario| -> Vec<f64> {
            let values = self.values(place, scenario);
            values.iter().zip(&place.there).map(|(value, there)| (value - there).abs()).collect()
        };
        let largest = |scale: Vec<f64>, off: Vec<f64>| scale.iter().zip(&off).map(|(a, b)| a.max(*b)).collect();
        let scale = self.all.many.iter().map(off).fold(vec![f64::MIN_POSITIVE; place.values.len()], largest);
        let distance =
            |scenario: &Scenario| off(scenario).iter().zip(&scale).map(|(off, scale)| off / scale).sum::<f64>();
        let mut order: Vec<(f64, &Scenario)> =
            self.all.many.iter().map(|scenario| (distance(scenario), scenario)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order.into_iter().map(|(_, scenario)| scenario.clone()).collect()
    }

    /// So many of the worst of those that are evaluated.
    fn worst(&self, tried: &Tried, count: usize) -> Vec<Scenario> {
        let mut order: Vec<&(Scenario, Evaluated)> = tried.iter().collect();
        order.sort_by(|(_, a), (_, b)| self.cost(b).total_cmp(&self.cost(a)));
        order.into_iter().take(count).map(|(scenario, _)| scenario.clone()).collect()
    }

    /// Those a step away, as a share of each dimension's length.
    fn neighbours(&self, scenario: &Scenario, step: f64) -> Vec<Scenario> {
        let along = |(dimension, (from, to)): (usize, (f64, f64))| {
            [-step, step].map(|side| {
                let mut neighbour = scenario.clone();
                neighbour[dimension] = (neighbour[dimension] + side * (to - from)).clamp(from, to);
                neighbour
            })
        };
        scenarios::steps(self.optimisation).into_iter().flat_map(along).collect()
    }

    fn values(&self, place: &Evaluated, scenario: &Scenario) -> Vec<f64> {
        scenarios::values(self.optimisation, &place.values, scenario)
    }

    fn cost(&self, point: &Evaluated) -> f64 {
        point.cost(self.optimisation.is_maximum)
    }
}
