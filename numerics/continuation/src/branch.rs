//! Follows a branch of orbits in one direction, with the special points on it.

use crate::boundary_problem::{Condition, UNKNOWNS};
use crate::checks::Violation;
use crate::flow::STATE;
use crate::follower::{Follower, Point, Tests};
use crate::newton::solve;
use crate::orbit::Orbit;
use crate::special::{Special, SpecialKind};

/// How a branch is followed.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// Longest step, as a share of the parameter's range (and of the size of the unknowns).
    pub longest: f64,
    /// Most orbits in one direction.
    pub most_orbits: usize,
}

impl Default for Steps {
    fn default() -> Self {
        Self { longest: 0.01, most_orbits: 2_000 }
    }
}

/// Shortest step, as a share of the range.
const SHORTEST: f64 = 1e-9;

/// Accuracy of a located point in the arc length, as a share of the step.
const LOCATED: f64 = 1e-14;

/// How a branch ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BranchEnd {
    /// At the end of the parameter's range.
    Range,
    /// At a grazing, the last special point on that side.
    Grazing,
    /// It returns to its start.
    Closed,
    /// It meets the symmetric orbits that it and its mirror image branch off from.
    SymmetryBreaking,
    /// It meets the orbits of half the period that it branches off from.
    PeriodDoubling,
    /// Newton's method fails at the shortest step.
    NoConvergence,
    /// After the largest number of orbits.
    TooLong,
}

/// The orbits in one direction from a start.
pub(crate) struct Trace {
    pub orbits: Vec<Orbit>,
    /// Each with the number of orbits before it.
    pub specials: Vec<(usize, Special)>,
    pub end: BranchEnd,
}

/// The special points between two orbits with their places, in order, and the end of the branch if it meets another there.
type Between = (Vec<(f64, Special)>, Option<(f64, Point, BranchEnd)>);

impl Follower<'_> {
    pub(crate) fn orbit(&self, point: &Point) -> Orbit {
        self.problem.orbit(self.unknowns(point), &[self.value(point)])
    }

    pub(crate) fn violations(&self, point: &Point) -> Vec<Violation> {
        self.problem.violations(self.unknowns(point), &[self.value(point)])
    }

    fn special(&self, kind: SpecialKind, point: &Point, error: f64, touch_time: f64) -> Special {
        Special {
            meaning: kind.meaning(self.problem.sequence),
            kind,
            parameter: self.value(point),
            parameter_error: error,
            orbit: self.orbit(point),
            unknowns: self.unknowns(point).to_vec(),
            touch_time,
        }
    }

    /// Follows the branch from `start` along `tangent`.
    pub(crate) fn trace(&self, start: &Point, tangent: &Point, steps: Steps) -> Trace {
        let size = self.problem.len();
        let mut trace = Trace { orbits: vec![], specials: vec![], end: BranchEnd::TooLong };
        let (mut at, mut along) = (start.clone(), tangent.clone());
        let mut tests = self.tests(&at, &along);
        let mut step = 0.1 * steps.longest;
        while trace.orbits.len() < steps.most_orbits {
            let next = self.correct(&at + &along * step, &at, &along, step);
            let next = next.and_then(|solution| {
                let tangent = self.tangent(&solution.unknowns, &along)?;
                // A sharp bend is followed in shorter steps.
                (self.inner(&tangent, &along) > 0.95 || step < 1e3 * SHORTEST).then_some((solution, tangent))
            });
            let Some((solution, next_along)) = next else {
                step *= 0.5;
                if step < SHORTEST {
                    trace.end = BranchEnd::NoConvergence;
                    return trace;
                }
                continue;
            };
            let mut next = solution.unknowns;
            let mut is_over = false;
            if !(0.0..=1.0).contains(&next[size]) {
                // The last orbit lies at the end of the range.
                let edge = if next[size] < 0.0 { 0.0 } else { 1.0 };
                let share = ((edge - at[size]) / (next[size] - at[size])).clamp(0.0, 1.0);
                let guess = &at + (&next - &at) * share;
                match self.correct_at(guess, self.origin + self.scale * edge) {
                    Some(solution) => next = solution.unknowns,
                    None => {
                        trace.end = BranchEnd::Range;
                        return trace;
                    }
                }
                (is_over, trace.end) = (true, BranchEnd::Range);
            }
            let violations = self.violations(&next);
            let mut grazing = None;
            if !violations.is_empty() {
                let (valid, invalid, violations) = self.narrow((&at, &along), next, violations);
                grazing = Some(self.graze(&invalid, &violations));
                next = valid;
                (is_over, trace.end) = (true, BranchEnd::Grazing);
            }
            let next_along = if is_over { self.tangent(&next, &along).unwrap_or(next_along) } else { next_along };
            let next_tests = self.tests(&next, &next_along);
            let (specials, meeting) = self.between((&at, &along, &tests), (&next, &next_tests));
            let last_place = meeting.as_ref().map_or(f64::INFINITY, |(place, ..)| *place);
            for (_, special) in specials.into_iter().filter(|(place, _)| *place < last_place) {
                trace.specials.push((trace.orbits.len(), special));
            }
            if let Some((_, point, end)) = meeting {
                trace.orbits.push(self.orbit(&point));
                trace.end = end;
                return trace;
            }
            trace.orbits.push(self.orbit(&next));
            if let Some(special) = grazing {
                trace.specials.push((trace.orbits.len(), special));
            }
            if is_over {
                return trace;
            }
            let gap = &next - start;
            if trace.orbits.len() > 20 && self.inner(&gap, &gap).sqrt() < step && self.inner(&next_along, tangent) > 0.9
            {
                trace.end = BranchEnd::Closed;
                return trace;
            }
            (at, along, tests) = (next, next_along, next_tests);
            step = match solution.steps {
                0..=5 => (1.5 * step).min(steps.longest),
                6..=8 => step,
                _ => 0.5 * step,
            };
        }
        trace
    }

    /// Halves the step until the last orbit with the right events and the first one without are close.
    fn narrow(
        &self,
        (at, along): (&Point, &Point),
        invalid: Point,
        violations: Vec<Violation>,
    ) -> (Point, Point, Vec<Violation>) {
        let (mut low, mut high) = (0.0, self.inner(along, &(&invalid - at)));
        let (mut valid, mut invalid, mut violations) = (at.clone(), invalid, violations);
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            let guess = &valid + (&invalid - &valid) * ((middle - low) / (high - low));
            let Some(solution) = self.correct(guess, at, along, middle) else { break };
            let found = self.violations(&solution.unknowns);
            if found.is_empty() {
                (low, valid) = (middle, solution.unknowns);
            } else {
                (high, invalid, violations) = (middle, solution.unknowns, found);
            }
        }
        (valid, invalid, violations)
    }

    /// The grazing near an orbit with wrong events, by Newton's method for the orbit and the condition together.
    fn graze(&self, near: &Point, violations: &[Violation]) -> Special {
        let size = self.problem.len();
        // A sticking phase may vanish together with the guard that ends it: then its duration is the better condition.
        let durations = self.unknowns(near).chunks(UNKNOWNS).map(|segment| segment[STATE]);
        let shortest = durations.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(n, _)| n);
        let empty = Violation { conditions: vec![Condition::Empty(shortest)], time: 0.0, depth: 0.0 };
        for violation in violations.iter().chain([&empty]) {
            let has_time = violation.conditions.iter().any(Condition::has_time);
            let guess = near.clone().push(if has_time { violation.time } else { 0.0 });
            let extent = size + 1 + usize::from(has_time);
            let guess = if has_time { guess } else { near.clone() };
            let solution = solve(guess, |extended| {
                let point = extended.rows(0, size + 1).into_owned();
                let (residual, matrix) = self.derivatives(&point, 1.0);
                let mut matrix = matrix.resize(extent, extent, 0.0);
                let mut residual = residual.resize_vertically(extent, 0.0);
                let time = if has_time { extended[size + 1] } else { 0.0 };
                for (row, condition) in violation.conditions.iter().enumerate() {
                    let (value, gradient, by_parameter, by_time) =
                        self.problem.condition(*condition, self.unknowns(&point), &[self.value(&point)], time);
                    residual[size + row] = value;
                    for k in 0..size {
                        matrix[(size + row, k)] = gradient[k];
                    }
                    matrix[(size + row, size)] = by_parameter[0] * self.scale;
                    if has_time {
                        matrix[(size + row, size + 1)] = by_time;
                    }
                }
                (residual, matrix)
            });
            let Some(solution) = solution else { continue };
            let point = solution.unknowns.rows(0, size + 1).into_owned();
            let gap = &point - near;
            // Newton's method may end at another grazing.
            if self.inner(&gap, &gap).sqrt() > 1e-3 {
                continue;
            }
            let time = if has_time { solution.unknowns[size + 1] } else { 0.0 };
            let error = solution.last_step * (1.0 + solution.unknowns.norm()) * self.scale.abs();
            return self.special(SpecialKind::Grazing(violation.conditions.clone()), &point, error, time);
        }
        let conditions = violations.first().map(|v| v.conditions.clone()).unwrap_or_default();
        let time = violations.first().map_or(0.0, |v| v.time);
        self.special(SpecialKind::Grazing(conditions), near, SHORTEST * self.scale.abs(), time)
    }

    /// The special points between two orbits. Where a branch meets the one that it branches off from, it turns back on the same orbits:
    /// mirrored, or shifted by half their period.
    fn between(&self, (at, along, tests): (&Point, &Point, &Tests), (next, next_tests): (&Point, &Tests)) -> Between {
        let arc = self.inner(along, &(next - at));
        let (mut found, mut meeting) = (Vec::new(), None);
        let changes = |value: fn(&Tests) -> f64| value(tests) * value(next_tests) < 0.0;
        let mut locate = |value: fn(&Tests) -> f64, kind: SpecialKind| {
            let is_crossing = matches!(kind, SpecialKind::SymmetryBreaking | SpecialKind::BranchPoint);
            if let Some((place, point, error)) =
                self.locate((at, along, tests), (arc, next, next_tests), value, is_crossing)
            {
                let is_symmetric = |point| self.problem.is_symmetric(self.unknowns(point), &[self.value(point)]);
                let is_doubled = |point| self.problem.is_doubled(self.unknowns(point));
                match kind {
                    SpecialKind::Fold if is_symmetric(&point) && !is_symmetric(at) => {
                        meeting = Some((place, point, BranchEnd::SymmetryBreaking));
                    }
                    SpecialKind::Fold if is_doubled(&point) && !is_doubled(at) => {
                        meeting = Some((place, point, BranchEnd::PeriodDoubling));
                    }
                    kind => found.push((place, self.special(kind, &point, error, 0.0))),
                }
            }
        };
        if changes(|t| t.fold) {
            locate(|t| t.fold, SpecialKind::Fold);
        } else if changes(|t| t.plus) {
            let unknowns = self.unknowns(at);
            let is_symmetric = self.problem.is_symmetric(unknowns, &[self.value(at)]);
            locate(|t| t.plus, if is_symmetric { SpecialKind::SymmetryBreaking } else { SpecialKind::BranchPoint });
        }
        if changes(|t| t.minus) {
            locate(|t| t.minus, SpecialKind::PeriodDoubling);
        }
        if tests.outside.abs_diff(next_tests.outside) == 2 && changes(|t| t.circle.unwrap_or(0.0)) {
            locate(|t| t.circle.unwrap_or(0.0), SpecialKind::NeimarkSacker);
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        (found, meeting)
    }

    /// The zero of a test function between two orbits, by a secant inside a bracket: its place, the orbit and the error of
    /// the parameter.
    fn locate(
        &self,
        (at, along, tests): (&Point, &Point, &Tests),
        (arc, next, next_tests): (f64, &Point, &Tests),
        value: fn(&Tests) -> f64,
        is_crossing: bool,
    ) -> Option<(f64, Point, f64)> {
        let nearest = if value(tests).abs() < value(next_tests).abs() { at } else { next };
        let crossing = if is_crossing { Some(self.crossing(nearest)?) } else { None };
        let (mut low, mut high) = ((0.0, value(tests), at.clone()), (arc, value(next_tests), next.clone()));
        let (mut best_place, mut best) = (0.0, at.clone());
        let mut moved = f64::INFINITY;
        let mut last_side = 0;
        for _ in 0..80 {
            // Illinois: the end that stays twice counts half.
            let place = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let place =
                if place > low.0.min(high.0) && place < low.0.max(high.0) { place } else { 0.5 * (low.0 + high.0) };
            let guess = &low.2 + (&high.2 - &low.2) * ((place - low.0) / (high.0 - low.0));
            let corrected = match &crossing {
                Some(crossing) => self.correct_at_crossing(&guess, (at, along, place), crossing),
                None => self.correct(guess, at, along, place).map(|solution| solution.unknowns),
            };
            let point = corrected?;
            moved = (self.value(&point) - self.value(&best)).abs();
            let along = if crossing.is_some() { along.clone() } else { self.tangent(&point, along)? };
            let found = value(&self.tests(&point, &along));
            (best_place, best) = (place, point.clone());
            if found * low.1 < 0.0 {
                high = (place, found, point);
                if last_side == 1 {
                    low.1 *= 0.5;
                }
                last_side = 1;
            } else {
                low = (place, found, point);
                if last_side == -1 {
                    high.1 *= 0.5;
                }
                last_side = -1;
            }
            let is_close = moved <= LOCATED * self.scale.abs().max(self.value(&best).abs());
            if found == 0.0 || is_close || (high.0 - low.0).abs() <= LOCATED * arc.abs() {
                break;
            }
        }
        let error = moved.max(10.0 * f64::EPSILON * self.value(&best).abs());
        Some((best_place, best, error))
    }
}
