//! Checks that the motion of a solution has exactly the events of its sequence.
//!
//! A guard must stay positive within its segment, fall through zero at the end that it names, and rise from zero where it
//! starts there. The first failure along a branch is a grazing: the sequence of events changes.

use crate::boundary_problem::{BoundaryProblem, Condition, UNKNOWNS, When};
use crate::flow::{N, STATE, Square, Vector, dot};
use crate::orbit::SAMPLE_RAD;
use crate::sequence::Guard;

/// A failed check.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Violation {
    /// What is zero where the failure begins.
    pub conditions: Vec<Condition>,
    /// Time of the touch within the segment.
    pub time: f64,
    /// How far the failed value is below zero.
    pub depth: f64,
}

/// A value that counts as zero at the start of a segment, relative to its terms.
const ZERO: f64 = 1e-9;

/// A minimum that is no lower than this, relative to its terms, is rounding: a guard may leave zero with zero rate.
const NOISE: f64 = 1e-11;

/// Terms of a series over a sample's step, which is at most 0.1 rad of the fastest rate.
const TERMS: usize = 10;

impl BoundaryProblem<'_> {
    /// The failed checks of a solution.
    pub(crate) fn violations(&self, unknowns: &[f64], values: &[f64]) -> Vec<Violation> {
        let settings = self.settings(values);
        let equations = self.system.equations(&settings);
        let mut found = Vec::new();
        for (n, segment) in self.sequence.segments.iter().enumerate() {
            let duration = unknowns[UNKNOWNS * n + STATE];
            if duration < 0.0 {
                found.push(Violation { conditions: vec![Condition::Empty(n)], time: 0.0, depth: -duration });
                continue;
            }
            let (step, states, a) = self.samples(n, unknowns, &settings, SAMPLE_RAD);
            for guard in segment.phase.guards() {
                let row = equations.guard(&segment.phase, guard);
                check_guard(n, guard, guard == segment.end, &Self::rates(&row, &a, 2), (step, &states, &a), &mut found);
            }
        }
        found
    }
}

/// Checks one guard along one segment.
fn check_guard(
    n: usize,
    guard: Guard,
    is_end: bool,
    rows: &[Vector<f64>],
    (step, states, a): (f64, &[Vector<f64>], &Square<f64>),
    found: &mut Vec<Violation>,
) {
    let mut fail = |conditions: Vec<Condition>, time: f64, value: f64| {
        found.push(Violation { conditions, time, depth: -value });
    };
    let (first, last) = (&states[0], &states[states.len() - 1]);
    // A row of one entry has no other terms to compare with: the motion is of the order of 1.
    let size = |row: &Vector<f64>, at: &Vector<f64>| {
        row.iter().zip(at).map(|(r, w)| (r * w).abs()).sum::<f64>()
            + row.iter().fold(0.0_f64, |most, r| most.max(r.abs()))
    };
    let is_zero = |row: &Vector<f64>, at: &Vector<f64>| dot(row, at).abs() <= ZERO * size(row, at);
    if !is_zero(&rows[0], first) {
        if dot(&rows[0], first) < 0.0 {
            fail(vec![Condition::Zero(n, guard, When::Start)], 0.0, dot(&rows[0], first));
            return;
        }
    } else if !is_zero(&rows[1], first) && dot(&rows[1], first) < 0.0 {
        fail(vec![Condition::Flat(n, guard, When::Start)], 0.0, dot(&rows[1], first));
        return;
    }
    if is_end && dot(&rows[1], last) > 0.0 {
        fail(vec![Condition::Flat(n, guard, When::End)], 0.0, -dot(&rows[1], last));
        return;
    }
    for (k, pair) in states.windows(2).enumerate() {
        // A minimum lies where the rate rises through zero.
        if dot(&rows[1], &pair[0]) < 0.0 && dot(&rows[1], &pair[1]) > 0.0 {
            let Some(after) = root_within(&rows[1], a, &pair[0], step) else { continue };
            let lowest = series(&rows[0], a, &pair[0], after);
            if lowest < -NOISE * size(&rows[0], &pair[0]) {
                let conditions = vec![Condition::Zero(n, guard, When::Inside), Condition::Flat(n, guard, When::Inside)];
                fail(conditions, step * k as f64 + after, lowest);
                return;
            }
        }
    }
    if !is_end && !is_zero(&rows[0], last) && dot(&rows[0], last) < 0.0 {
        fail(vec![Condition::Zero(n, guard, When::End)], 0.0, dot(&rows[0], last));
    }
}

fn coefficients(row: &Vector<f64>, a: &Square<f64>, state: &Vector<f64>) -> [f64; TERMS] {
    let mut terms = [0.0; TERMS];
    let mut state = *state;
    for (n, term) in terms.iter_mut().enumerate() {
        *term = dot(row, &state);
        let share = 1.0 / (n + 1) as f64;
        state = std::array::from_fn(|i| share * (0..N).map(|j| a[i][j] * state[j]).sum::<f64>());
    }
    terms
}

fn value(terms: &[f64; TERMS], after: f64) -> f64 {
    terms.iter().rev().fold(0.0, |sum, term| sum * after + term)
}

/// `row · w` at a time after `state`, within a sample's step.
fn series(row: &Vector<f64>, a: &Square<f64>, state: &Vector<f64>, after: f64) -> f64 {
    value(&coefficients(row, a, state), after)
}

/// The time within `step` after `state` at which `row · w` changes its sign; `None` if it has the same sign at both ends.
pub(crate) fn root_within(row: &Vector<f64>, a: &Square<f64>, state: &Vector<f64>, step: f64) -> Option<f64> {
    let terms = coefficients(row, a, state);
    let (mut low, mut high) = (0.0, step);
    let at_low = value(&terms, low);
    if at_low * value(&terms, high) > 0.0 {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if value(&terms, middle) * at_low > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(0.5 * (low + high))
}
