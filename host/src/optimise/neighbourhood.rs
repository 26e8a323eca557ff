//! What small changes of the variables do at the optimum: each alone in fine steps, and pairs of them on a grid. The band is searched
//! around the peaks of its grid, which may give less than the scan of the optimum itself.

use rayon::prelude::*;
use serde::Serialize;

use super::evaluate::{Care, Evaluated, GoOnAfter, at_values};
use super::file::Optimisation;
use crate::failure::Failure;
use crate::study::axis::{AxisValues, StudyAxis};
use crate::study::band::Effort;
use crate::study::distribution::Distribution;

const CARE: Care = Care::of(Effort::Peaks);

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
    /// The objective without a change, searched as that of the changes.
    pub here: f64,
    /// The objective at 1 % less; `None` outside the variable's range.
    pub below: Option<f64>,
    /// The objective at 1 % more.
    pub above: Option<f64>,
    /// The worst objective within 1 %, in steps of 0.1 %.
    pub worst_within: f64,
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
    let objective = |n: i32| {
        let mut values = best.values.clone();
        values[place] = value(n);
        let inside = is_inside(axis, values[place]);
        inside.then(|| Ok(at_values(optimisation, values, CARE, go_on)?.objective)).transpose()
    };
    let scan: Vec<Option<f64>> = (-REACH..=REACH).into_par_iter().map(objective).collect::<Result<_, Failure>>()?;
    let at = |n: i32| scan[(n + REACH) as usize];
    let here = at(0).unwrap_or(best.objective);
    let within = (-STEPS..=STEPS).filter_map(at);
    let worst = within.fold(here, |worst, value| if optimisation.is_better(worst, value) { value } else { worst });
    // Each fine step, outwards from the optimum.
    let outwards = (0..REACH).flat_map(|n| [(n, n + 1), (-n, -n - 1)]);
    let changes: Vec<Jump> = outwards
        .filter_map(|(near, far)| {
            let (objective_near, objective_far) = (at(near)?, at(far)?);
            Some(Jump { near: value(near), far: value(far), objective_near, objective_far })
        })
        .collect();
    let jump = largest_jump(&changes, here);
    Ok(VariableSensitivity {
        key: axis.key.clone(),
        step,
        here,
        below: at(-STEPS),
        above: at(STEPS),
        worst_within: worst,
        jump,
    })
}

impl Jump {
    fn size(&self) -> f64 {
        (self.objective_far - self.objective_near).abs()
    }
}

fn largest_jump(changes: &[Jump], objective: f64) -> Option<Jump> {
    let mut sizes: Vec<f64> = changes.iter().map(Jump::size).collect();
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
    points.into_par_iter().map(|values| at_values(optimisation, values, CARE, go_on)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(near: f64, objective_near: f64, objective_far: f64) -> Jump {
        Jump { near, far: near + 0.1, objective_near, objective_far }
    }

    #[test]
    fn a_jump_is_large_against_the_objective_and_against_the_other_changes() {
        let slope: Vec<Jump> = (0..20).map(|n| change(f64::from(n), f64::from(n), f64::from(n) + 1.0)).collect();
        assert_eq!(largest_jump(&slope, 10.0), None, "an even slope, however steep, has no jump");
        let mut ridge = slope.clone();
        ridge[7].objective_far += 9.0;
        assert_eq!(largest_jump(&ridge, 10.0).map(|jump| jump.near), Some(7.0));
        assert_eq!(largest_jump(&ridge, 10_000.0), None, "0.1 % of the objective is none");
    }
}
