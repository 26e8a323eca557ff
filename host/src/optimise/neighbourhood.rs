//! What small changes of the variables do at the optimum: each alone in fine steps, and pairs of them on a grid. The band is searched
//! around the peaks of its grid; what is told of a variable is scanned then, as the optimum is, so that both can be compared.

use rayon::prelude::*;
use serde::Serialize;

use super::evaluate::{Care, Evaluated, GoOnAfter, at_values};
use super::file::Optimisation;
use crate::failure::Failure;
use crate::study::axis::{AxisValues, StudyAxis};
use crate::study::band::Effort;
use crate::study::distribution::Distribution;

/// Fine steps in a change of 1 %.
const STEPS: i32 = 10;

/// Fine steps to either side.
const REACH: i32 = 2 * STEPS;

/// Steps of 1 % to either side on the grid.
const GRID: i32 = 4;

/// A change over one fine step that counts as a jump: this share of the objective,
const JUMP: f64 = 0.01;

/// and this many times the middle one of all changes over a fine step.
const TIMES_MIDDLE: f64 = 5.0;

/// What a change of one variable does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VariableSensitivity {
    /// Key of the variable.
    pub key: String,
    /// A change of 1 %: of the value, or of the range if the value is 0.
    pub step: f64,
    /// The objective without a change.
    pub here: f64,
    /// The objective at 1 % less; `None` outside the variable's range.
    pub below: Option<f64>,
    /// The objective at 1 % more.
    pub above: Option<f64>,
    /// The worst objective of no change, 1 % less, 1 % more, and the step of 0.1 % between them that is worst around the peaks of the grid.
    pub worst_within: f64,
    /// The value 1 % away that keeps all constraints and has a better objective, if there is one: the search did not find it.
    pub better: Option<f64>,
    /// The largest jump within 2 %, if there is one.
    pub jump: Option<Jump>,
}

/// A ridge: the objective changes at once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Jump {
    /// The variable's value on the side of the optimum.
    pub near: f64,
    /// Its value a fine step further.
    pub far: f64,
    /// The objective on the side of the optimum.
    pub objective_near: f64,
    /// The objective a fine step further.
    pub objective_far: f64,
}

/// A change of 1 % of a variable.
#[must_use]
pub fn step(axis: &StudyAxis, value: f64) -> f64 {
    let AxisValues::Drawn(Distribution { from, to, .. }) = axis.values else { return 0.0 };
    0.01 * if value == 0.0 { to - from } else { value.abs() }
}

/// Points of [`sensitivities`] and [`grid`] at most, for so many variables.
pub(super) const fn points(variables: usize) -> u64 {
    let line = (2 * GRID + 1) as usize;
    let pairs = variables * variables.saturating_sub(1) / 2;
    (variables * (2 * REACH + 1) as usize + if variables == 1 { line } else { pairs * line * line }) as u64
}

/// Points of [`sensitivities`] that are scanned, at most, for so many variables.
pub(super) const fn scanned_points(variables: usize) -> u64 {
    (5 * variables) as u64
}

fn is_inside(axis: &StudyAxis, value: f64) -> bool {
    matches!(axis.values, AxisValues::Drawn(Distribution { from, to, .. }) if (from..=to).contains(&value))
}

/// What a change of each variable alone does.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub fn sensitivities(
    optimisation: &Optimisation,
    best: &Evaluated,
    go_on: GoOnAfter,
) -> Result<Vec<VariableSensitivity>, Failure> {
    optimisation
        .variable_axes()
        .iter()
        .enumerate()
        .map(|(place, axis)| of_variable(optimisation, best, place, axis, go_on))
        .collect()
}

fn of_variable(
    optimisation: &Optimisation,
    best: &Evaluated,
    place: usize,
    axis: &StudyAxis,
    go_on: GoOnAfter,
) -> Result<VariableSensitivity, Failure> {
    let step = step(axis, best.values[place]);
    let value = |n: i32| best.values[place] + step * f64::from(n) / f64::from(STEPS);
    let evaluated = |n: i32, effort: Effort| {
        let mut values = best.values.clone();
        values[place] = value(n);
        let inside = is_inside(axis, values[place]);
        inside.then(|| at_values(optimisation, values, Care::of(effort), go_on)).transpose()
    };
    let around: Vec<Option<Evaluated>> =
        (-REACH..=REACH).into_par_iter().map(|n| evaluated(n, Effort::Peaks)).collect::<Result<_, Failure>>()?;
    let at = |n: i32| around[(n + REACH) as usize].as_ref().map(|point| point.objective);
    let is_worse = |a: f64, b: f64| optimisation.is_better(b, a);
    let within = (-STEPS..=STEPS).filter_map(|n| Some((n, at(n)?)));
    let (worst_step, _) =
        within.reduce(|worst, own| if is_worse(own.1, worst.1) { own } else { worst }).unwrap_or_default();
    // Each fine step, outwards from the optimum.
    let outwards = (0..REACH).flat_map(|n| [(n, n + 1), (-n, -n - 1)]);
    let changes: Vec<Change> =
        outwards.filter_map(|steps| Some(Change { steps, objectives: (at(steps.0)?, at(steps.1)?) })).collect();
    let jump = largest_jump(&changes, best.objective);
    let steps: Vec<i32> = [-STEPS, STEPS, worst_step]
        .into_iter()
        .chain(jump.iter().flat_map(|jump| [jump.steps.0, jump.steps.1]))
        .collect();
    let scan = |n: &i32| if *n == 0 { Ok(Some(best.clone())) } else { evaluated(*n, Effort::Scan) };
    let scanned: Vec<Option<Evaluated>> = steps.par_iter().map(scan).collect::<Result<_, Failure>>()?;
    let here = best.objective;
    let better = steps[..2].iter().zip(&scanned).filter_map(|(n, point)| Some((value(*n), point.as_ref()?)));
    let better = better
        .filter(|(_, point)| point.is_feasible() && is_worse(here, point.objective))
        .reduce(|best, own| if is_worse(best.1.objective, own.1.objective) { own } else { best })
        .map(|(value, _)| value);
    let scanned: Vec<Option<f64>> = scanned.iter().map(|point| Some(point.as_ref()?.objective)).collect();
    let worst = scanned[..3].iter().flatten().fold(here, |worst, own| if is_worse(*own, worst) { *own } else { worst });
    let jump = jump.zip(scanned.get(3).copied().flatten().zip(scanned.get(4).copied().flatten())).map(
        |(jump, (near, far))| Jump {
            near: value(jump.steps.0),
            far: value(jump.steps.1),
            objective_near: near,
            objective_far: far,
        },
    );
    Ok(VariableSensitivity {
        key: axis.key.clone(),
        step,
        here,
        below: scanned[0],
        above: scanned[1],
        worst_within: worst,
        better,
        // What the scan does not show is no jump.
        jump: jump.filter(|jump| (jump.objective_far - jump.objective_near).abs() > JUMP * here.abs()),
    })
}

/// A change over a fine step, outwards: the steps of its ends, and the objectives there.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    steps: (i32, i32),
    objectives: (f64, f64),
}

impl Change {
    fn size(&self) -> f64 {
        (self.objectives.1 - self.objectives.0).abs()
    }
}

fn largest_jump(changes: &[Change], objective: f64) -> Option<Change> {
    let mut sizes: Vec<f64> = changes.iter().map(Change::size).collect();
    sizes.sort_by(f64::total_cmp);
    let middle = sizes.get(sizes.len() / 2).copied()?;
    let largest = changes.iter().max_by(|a, b| a.size().total_cmp(&b.size()))?;
    let is_jump = largest.size() > JUMP * objective.abs() && largest.size() > TIMES_MIDDLE * middle;
    is_jump.then_some(*largest)
}

/// Points around the optimum: each pair of variables on a grid of steps of 1 %, up to 4 % to either side (the one variable of an
/// optimisation on a line). Points outside the ranges are left out.
///
/// # Errors
/// As [`sensitivities`].
pub fn grid(optimisation: &Optimisation, best: &Evaluated, go_on: GoOnAfter) -> Result<Vec<Evaluated>, Failure> {
    let axes = optimisation.variable_axes();
    let mut points: Vec<Vec<f64>> = Vec::new();
    let last = axes.len().saturating_sub(1);
    for first in 0..if axes.is_empty() { 0 } else { axes.len().max(2) - 1 } {
        for second in (first + 1).min(last)..=last {
            for down in -GRID..=GRID {
                let across = if first == second { 0..=0 } else { -GRID..=GRID };
                for right in across {
                    let mut point = best.values.clone();
                    point[first] += f64::from(down) * step(&axes[first], best.values[first]);
                    if first != second {
                        point[second] += f64::from(right) * step(&axes[second], best.values[second]);
                    }
                    points.push(point);
                }
            }
        }
    }
    points.retain(|point| axes.iter().zip(point).all(|(axis, value)| is_inside(axis, *value)));
    points.into_par_iter().map(|values| at_values(optimisation, values, Care::of(Effort::Peaks), go_on)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(step: i32, near: f64, far: f64) -> Change {
        Change { steps: (step, step + 1), objectives: (near, far) }
    }

    #[test]
    fn a_jump_is_large_against_the_objective_and_against_the_other_changes() {
        let slope: Vec<Change> = (0..20).map(|n| change(n, f64::from(n), f64::from(n) + 1.0)).collect();
        assert_eq!(largest_jump(&slope, 10.0), None, "an even slope, however steep, has no jump");
        let mut ridge = slope.clone();
        ridge[7].objectives.1 += 9.0;
        assert_eq!(largest_jump(&ridge, 10.0).map(|jump| jump.steps.0), Some(7));
        assert_eq!(largest_jump(&ridge, 10_000.0), None, "0.1 % of the objective is none");
    }
}
