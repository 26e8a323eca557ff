//! The front of two objectives: the best value of the first for each of some limits of the second (the ε-constraint method of Haimes,
//! Lasdon and Wismer 1971), which counts as a constraint does: where it is worst over the band, the starts and the scenarios.

use serde::Serialize;

use super::answer::{BestVariable, Optimum};
use super::constraint::{Constraint, Limit};
use super::file::Optimisation;
use super::keys::front as keys;
use crate::input::{Section, Span};
use crate::quantity::Quantity;
use crate::study::axis::Reduction;
use crate::study::band::Band;
use crate::study::metric::METRICS;
use crate::study::over::Over;

/// The last limit lies this share of the range behind the best second objective, so that a search finds places that keep it.
const SLACK: f64 = 0.01;

/// The second objective.
#[derive(Clone, Debug, PartialEq)]
pub struct Second {
    /// Its metric.
    pub metric: Quantity,
    /// The largest value is the best.
    pub is_maximum: bool,
    /// Points of the front, at most.
    pub count: usize,
    pub(super) span: Span,
}

/// A point of a front: no other one is better in one objective and as good in the other.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrontPoint {
    /// The objective.
    pub objective: f64,
    /// The second objective.
    pub second: f64,
    /// The variables there.
    pub variables: Vec<BestVariable>,
    /// The point furthest from the line between the ends, both objectives as shares of their ranges.
    pub is_knee: bool,
}

/// A front.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Front {
    /// The second objective's metric.
    pub metric: &'static str,
    /// `minimum` or `maximum`.
    pub goal: &'static str,
    /// Symbol of its unit.
    pub unit: &'static str,
    /// From the best second objective to the best objective.
    pub points: Vec<FrontPoint>,
}

impl Second {
    /// The constraint that has its value at every point and limits nothing; the last one of an optimisation with a front.
    pub(super) fn told(&self) -> Constraint {
        let limit = Limit::Unlimited { is_maximum: self.is_maximum };
        Constraint { metric: self.metric, limit, span: self.span.clone() }
    }

    /// The optimisation for the best objective whose second one is no worse than `limit`.
    #[must_use]
    pub fn limited(&self, optimisation: &Optimisation, limit: f64) -> Optimisation {
        let mut limited = single(optimisation);
        let limit = if self.is_maximum { Limit::AtLeast(limit) } else { Limit::AtMost(limit) };
        limited.constraints.push(Constraint { limit, ..self.told() });
        limited
    }

    /// The optimisation for the best second objective.
    #[must_use]
    pub fn alone(&self, optimisation: &Optimisation) -> Optimisation {
        let mut alone = single(optimisation);
        (alone.objective, alone.is_maximum, alone.over) = (self.metric, self.is_maximum, Over::Worst);
        let worst = if self.is_maximum { Reduction::Minimum } else { Reduction::Maximum };
        alone.reduced_band = Band::of_extreme(optimisation.band(), worst);
        alone
    }

    /// Limits from the second objective at the optimum to its best value.
    #[must_use]
    pub fn limits(&self, (at_optimum, best): (f64, f64)) -> Vec<f64> {
        let last = (self.count - 1) as f64;
        let to = best + SLACK * (at_optimum - best);
        (1..self.count).map(|n| at_optimum + (to - at_optimum) * n as f64 / last).collect()
    }

    /// The point of the optimum or of an optimum with a limit; none where a constraint is not kept or the second objective does not exist.
    #[must_use]
    pub fn point(&self, answer: &Optimum) -> Option<FrontPoint> {
        let (objective, second) = (answer.objective, answer.constraints.last()?.value);
        let is_point = answer.is_feasible && second.is_finite();
        is_point.then(|| FrontPoint { objective, second, variables: answer.variables.clone(), is_knee: false })
    }

    /// The front of some points.
    #[must_use]
    pub fn front(&self, optimisation: &Optimisation, all: &[FrontPoint]) -> Front {
        let sign = |is_maximum: bool| if is_maximum { -1.0 } else { 1.0 };
        let mut points = undominated(all, (sign(optimisation.is_maximum), sign(self.is_maximum)));
        if let Some(knee) = knee(&points) {
            points[knee].is_knee = true;
        }
        let goal = if self.is_maximum { "maximum" } else { "minimum" };
        Front { metric: self.metric.name(), goal, unit: self.metric.suffix(), points }
    }
}

/// The optimisation without front, alternatives and surroundings, and without its second objective.
fn single(optimisation: &Optimisation) -> Optimisation {
    let mut single = optimisation.clone();
    (single.second, single.has_surroundings) = (None, false);
    single.alternatives.clear();
    single.constraints.pop();
    single
}

/// Those that no other is better than, from the best second objective on; `signs` make both objectives small where they are good.
fn undominated(all: &[FrontPoint], (first, second): (f64, f64)) -> Vec<FrontPoint> {
    let costs = |point: &FrontPoint| (first * point.objective, second * point.second);
    let mut points = all.to_vec();
    points.sort_by(|a, b| costs(a).1.total_cmp(&costs(b).1).then(costs(a).0.total_cmp(&costs(b).0)));
    let mut best = f64::INFINITY;
    points.retain(|point| {
        let is_better = costs(point).0 < best;
        best = best.min(costs(point).0);
        is_better
    });
    points
}

/// The point furthest from the line between the ends, on the side of the better values; none of fewer than three points or of a front that
/// is nowhere better than that line.
fn knee(points: &[FrontPoint]) -> Option<usize> {
    let (first, last) = (points.first()?, points.last()?);
    let share = |point: &FrontPoint| {
        let objective = (point.objective - last.objective) / (first.objective - last.objective);
        let second = (point.second - first.second) / (last.second - first.second);
        objective + second
    };
    let inner = (1..points.len().saturating_sub(1)).filter(|place| share(&points[*place]) < 1.0 - 1e-9);
    inner.min_by(|a, b| share(&points[*a]).total_cmp(&share(&points[*b])))
}

/// Reads `[front]`.
pub(super) fn read(s: &Section) -> Option<Second> {
    let (metric, goal, count) = (s.word(&keys::METRIC), s.word(&keys::GOAL), s.scalar(&keys::COUNT));
    let span = s.span_of(keys::METRIC.name());
    s.finish();
    Some(Second { metric: METRICS[metric?], is_maximum: goal? == 1, count: count? as usize, span })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(all: &[(f64, f64)]) -> Vec<FrontPoint> {
        let point = |(objective, second): &(f64, f64)| FrontPoint {
            objective: *objective,
            second: *second,
            variables: Vec::new(),
            is_knee: false,
        };
        all.iter().map(point).collect()
    }

    #[test]
    fn a_front_has_no_point_that_another_one_is_better_than() {
        let all = points(&[(3.0, 1.0), (1.0, 3.0), (2.0, 3.5), (1.5, 1.5), (3.0, 0.5), (1.5, 1.5)]);
        let pairs = |points: Vec<FrontPoint>| points.iter().map(|p| (p.objective, p.second)).collect::<Vec<_>>();
        assert_eq!(pairs(undominated(&all, (1.0, 1.0))), [(3.0, 0.5), (1.5, 1.5), (1.0, 3.0)]);
        assert_eq!(pairs(undominated(&all, (-1.0, -1.0))), [(2.0, 3.5), (3.0, 1.0)]);
    }

    #[test]
    fn limits_go_evenly_from_the_optimum_to_just_before_the_best_second_objective() {
        let second = |is_maximum| Second { metric: METRICS[0], is_maximum, count: 3, span: 0..0 };
        assert_eq!(second(false).limits((300.0, 100.0)), [201.0, 102.0]);
        assert_eq!(second(true).limits((100.0, 300.0)), [199.0, 298.0]);
    }

    #[test]
    fn the_knee_is_furthest_from_the_line_between_the_ends_and_a_line_has_none() {
        assert_eq!(knee(&points(&[(10.0, 0.0), (6.0, 1.0), (2.0, 2.0), (1.0, 6.0), (0.0, 10.0)])), Some(2));
        assert_eq!(knee(&points(&[(10.0, 0.0), (5.0, 5.0), (0.0, 10.0)])), None);
        assert_eq!(knee(&points(&[(10.0, 0.0), (8.0, 8.0), (0.0, 10.0)])), None);
        assert_eq!(knee(&points(&[(1.0, 0.0), (0.0, 1.0)])), None);
        // Both largest: the better side is above the line.
        assert_eq!(knee(&points(&[(0.0, 10.0), (7.0, 8.0), (10.0, 0.0)])), Some(1));
    }
}
