//! Text of `damprig optimise`.

use std::path::Path;

use super::{Block, Document, Rows};
use crate::optimise::answer::{BestVariable, KeptConstraint};
use crate::optimise::constraint::Constraint;
use crate::optimise::neighbourhood::VariableSensitivity;
use crate::optimise::run;
use crate::optimise::search::points_that_can_be_made;
use crate::optimise::{Optimisation, Optimum};
use crate::quantity::Quantity;
use crate::report::numbers::significant;
use crate::study::metric::METRICS;

/// Size of an optimisation: `Hybrid: 3 variables, 4000 points of 26 simulations, up to 900000 in all`.
#[must_use]
pub fn scope(optimisation: &Optimisation) -> String {
    let variables = optimisation.variables.len();
    let plural = if variables == 1 { "variable" } else { "variables" };
    let each = match optimisation.simulations_per_point() {
        1 => String::new(),
        each => format!(" of {each} simulations"),
    };
    let (name, most) = (&optimisation.name, run::most(optimisation));
    let points = match points_that_can_be_made(optimisation) {
        Some(points) => format!("all {} points that can be made", points.len()),
        None => format!("{} points", optimisation.evaluations),
    };
    format!("{name}: {variables} {plural}, {points}{each}, up to {most} simulations in all")
}

/// The answer.
#[must_use]
pub fn answer(optimisation: &Optimisation, answer: &Optimum) -> Document {
    let mut document = alone(optimisation, answer);
    document.add(alternatives(answer));
    document
}

/// The answer without its alternatives.
#[must_use]
pub fn alone(optimisation: &Optimisation, answer: &Optimum) -> Document {
    let mut document = Document::default();
    for section in
        [optimum(answer), starts(answer), sensitivity(optimisation, answer), references(answer), front(answer)]
    {
        document.add(section);
    }
    document
}

fn with_unit(value: f64, digits: usize, unit: &str) -> String {
    if value.is_nan() {
        "missing".into()
    } else {
        format!("{} {unit}", significant(value, digits)).trim_end().to_string()
    }
}

fn optimum(answer: &Optimum) -> Vec<Block> {
    let goal = if answer.goal == "maximum" { "largest" } else { "smallest" };
    let is_robust = !answer.there.is_empty();
    let goal = if is_robust { format!("{goal} {}", answer.over.before_metric()) } else { goal.into() };
    let value = with_unit(answer.objective, 6, answer.unit);
    let mut text = match (answer.is_feasible, answer.is_stopped) {
        (true, false) => format!("{goal} {}: {value} at", answer.metric),
        (true, true) => format!("{goal} {} so far: {value} at", answer.metric),
        (false, _) => {
            format!("no point keeps the constraints; the least violation, with {} {value}, is at", answer.metric)
        }
    };
    let concerns = concerns(answer);
    if !concerns.is_empty() {
        text = format!("{} ({}) at", text.trim_end_matches(" at"), concerns.join("; "));
    }
    let mut facts = Vec::new();
    let mut line = |key: &str, value: &str| facts.push((key.to_string(), value.to_string()));
    let exact = |value: f64, unit: &str| format!("{value} {unit}").trim_end().to_string();
    for variable in &answer.variables {
        let value = exact(variable.value, variable.unit);
        let tolerance = with_unit(variable.tolerance, 2, variable.unit);
        let is_rounded = answer.worst_within_tolerance.is_some();
        line(&variable.key, &if is_rounded { format!("{value} ± {tolerance}") } else { value });
    }
    let variables = answer.variables.len();
    for place in answer.there.iter().skip(variables).chain(answer.there.iter().take(variables)).chain(&answer.band) {
        line(&format!("there, {}", place.key), &exact(place.value, place.unit));
    }
    for constraint in &answer.constraints {
        let value = with_unit(constraint.value, 5, constraint.unit);
        line(constraint.metric, &format!("{value} ({}{})", constraint.limit, kept(constraint)));
    }
    if answer.unresolved > 0.0 {
        line("unresolved", &format!("{} instants with too many events", answer.unresolved));
    }
    vec![Block::Text(text), Block::Facts(facts)]
}

/// Whether a constraint is kept, after its limit.
fn kept(constraint: &KeptConstraint) -> &'static str {
    match constraint.is_kept {
        None => "",
        Some(true) => ": kept",
        Some(false) => ": not kept",
    }
}

/// What bears on the value, for its line.
fn concerns(answer: &Optimum) -> Vec<String> {
    let mut concerns = Vec::new();
    if !answer.there.is_empty() {
        concerns.push(format!("of {} scenarios", answer.scenarios));
        concerns.extend(answer.nominal.map(|nominal| format!("nominal {}", with_unit(nominal, 5, answer.unit))));
    }
    if let Some(worst) = answer.worst_within_tolerance.filter(|worst| *worst != answer.objective) {
        let side = if answer.goal == "maximum" { "down" } else { "up" };
        let unkept = answer.is_feasible_within_tolerance == Some(false);
        let unkept = if unkept { ", where a constraint is not kept" } else { "" };
        concerns.push(format!("{side} to {} within the tolerances{unkept}", with_unit(worst, 5, answer.unit)));
    }
    if let Some(share) = answer.stuck_share.filter(|share| *share > HELD) {
        let percent = significant(100.0 * share, 2);
        concerns.push(format!(
            "the friction damper holds the structure {percent} % of the time, more a clamp than a damper"
        ));
    }
    if let Some(starts) = &answer.starts {
        let (min, max) = (significant(starts.min, 4), significant(starts.max, 4));
        concerns.push(format!("{min} to {max} from other starts"));
    }
    for sensitivity in answer.sensitivity.iter().filter(|sensitivity| sensitivity.jump.is_some()) {
        concerns.push(format!("ridge of {}{}", sensitivity.key, distance(sensitivity, answer)));
    }
    for variable in answer.variables.iter().filter(|variable| variable.is_at_edge) {
        concerns.push(format!("{} is at the edge of its range", variable.key));
    }
    concerns
}

fn starts(answer: &Optimum) -> Vec<Block> {
    let Some(starts) = &answer.starts else { return Vec::new() };
    let number = |value: f64| significant(value, 5);
    vec![Block::Text(format!(
        "From {} starts between the walls: median {}, 5 % to 95 % {} to {}, all {} to {}.",
        starts.count,
        number(starts.median),
        number(starts.q05),
        number(starts.q95),
        number(starts.min),
        number(starts.max)
    ))]
}

fn sensitivity(optimisation: &Optimisation, answer: &Optimum) -> Vec<Block> {
    if answer.sensitivity.is_empty() {
        return Vec::new();
    }
    let change = |value: Option<f64>, here: f64| match value {
        Some(value) if !value.is_nan() => percent(value / here - 1.0),
        Some(_) => "missing".into(),
        None => "outside the range".into(),
    };
    let mut rows = Rows::new(&["change of", "1 %", "1 % less", "1 % more", "worst within 1 %"]);
    for (sensitivity, axis) in answer.sensitivity.iter().zip(optimisation.variable_axes()) {
        rows.add([
            sensitivity.key.clone(),
            with_unit(sensitivity.step, 3, axis.unit()),
            change(sensitivity.below, sensitivity.here),
            change(sensitivity.above, sensitivity.here),
            change(Some(sensitivity.worst_within), sensitivity.here),
        ]);
    }
    let mut blocks = vec![Block::Text(format!("What small changes do to {}:", answer.metric)), Block::Table(rows)];
    for (sensitivity, axis) in answer.sensitivity.iter().zip(optimisation.variable_axes()) {
        blocks.extend(better(sensitivity, axis.unit()).map(Block::Text));
        blocks.extend(ridge(sensitivity, answer).map(Block::Text));
    }
    blocks
}

/// A better value near the optimum, in words.
fn better(sensitivity: &VariableSensitivity, unit: &str) -> Option<String> {
    let (key, value) = (&sensitivity.key, with_unit(sensitivity.better?, 6, unit));
    Some(format!("{key} = {value} is better still: the search did not reach it; more `evaluations` search further."))
}

/// A ridge near the optimum, in words.
fn ridge(sensitivity: &VariableSensitivity, answer: &Optimum) -> Option<String> {
    let jump = sensitivity.jump.as_ref()?;
    let away = distance(sensitivity, answer);
    Some(format!(
        "ridge: between {} = {} and {}{away} {} jumps from {} to {}",
        sensitivity.key,
        significant(jump.near, 6),
        significant(jump.far, 6),
        answer.metric,
        significant(jump.objective_near, 5),
        significant(jump.objective_far, 5)
    ))
}

/// How far the ridge is from the optimum: ` (+1.40 % away)`.
fn distance(sensitivity: &VariableSensitivity, answer: &Optimum) -> String {
    let at = answer.variables.iter().find(|variable| variable.key == sensitivity.key).map_or(f64::NAN, |v| v.value);
    match &sensitivity.jump {
        Some(jump) if at != 0.0 => format!(" ({} away)", percent((jump.near - at) / at)),
        _ => String::new(),
    }
}

fn percent(share: f64) -> String {
    format!("{:+.2} %", 100.0 * share)
}

fn references(answer: &Optimum) -> Vec<Block> {
    let mut lines = Vec::new();
    let against = |value: f64| {
        let share = answer.objective / value - 1.0;
        let side = if share < 0.0 { "below" } else { "above" };
        format!("{} % {side} it", significant(100.0 * share.abs(), 3))
    };
    if let Some(bare) = answer.references.bare {
        let value = with_unit(bare, 5, answer.unit);
        lines.push(format!("Bare structure: {value}; the optimum is {}", against(bare)));
    }
    if let Some(tmd) = &answer.references.tmd {
        lines.push(format!(
            "Tuned mass damper of equal mass ({} kg, {}: γ = {}, ζ₁ = {}): {}; the optimum is {}",
            significant(tmd.mass_kg, 4),
            tmd.tuning,
            significant(tmd.frequency_ratio, 4),
            significant(tmd.damping_ratio, 4),
            with_unit(tmd.objective, 5, answer.unit),
            against(tmd.objective)
        ));
    }
    lines.into_iter().map(Block::Text).collect()
}

/// The front of two objectives as a table.
fn front(answer: &Optimum) -> Vec<Block> {
    let Some(front) = &answer.front else { return Vec::new() };
    let mut rows = Rows::new(&[answer.metric, front.metric, "make", ""]);
    for point in &front.points {
        rows.add([
            for_people(answer.metric, point.objective),
            for_people(front.metric, point.second),
            made(&point.variables),
            if point.is_knee { "knee".into() } else { String::new() },
        ]);
    }
    vec![Block::Text(format!("Best {} for each {}:", answer.metric, front.metric)), Block::Table(rows)]
}

/// The share of the time from which a friction damper is said to hold the structure.
const HELD: f64 = 0.5;

/// The optimisation and its alternatives side by side, the best first.
fn alternatives(answer: &Optimum) -> Vec<Block> {
    if answer.alternatives.is_empty() {
        return Vec::new();
    }
    let of_each = answer.alternatives.iter().map(|of| Block::Text(format!("{}: {}", of.name, concerns(of).join("; "))));
    let head = Block::Text("Dampers under the same rules, the best first:".into());
    [head, Block::Table(compared(answer))].into_iter().chain(of_each).collect()
}

/// The dampers beside each other, the best first.
#[must_use]
pub fn compared(answer: &Optimum) -> Rows {
    let mut rows = Rows::new(&COMPARED.map(|(head, _)| head));
    ranked(answer).into_iter().for_each(|of| rows.add(COMPARED.map(|(_, cell)| cell(of))));
    rows
}

/// An optimisation and its alternatives, the best first, and those that keep no constraint last.
#[must_use]
pub fn ranked(answer: &Optimum) -> Vec<&Optimum> {
    let mut all: Vec<&Optimum> = std::iter::once(answer).chain(&answer.alternatives).collect();
    let cost = |of: &Optimum| if answer.goal == "maximum" { -of.objective } else { of.objective };
    all.sort_by(|a, b| (!a.is_feasible).cmp(&!b.is_feasible).then(cost(a).total_cmp(&cost(b))));
    all
}

/// Values of the variables as they are made.
fn made(variables: &[BestVariable]) -> String {
    let variable = |variable: &BestVariable| {
        let tolerance = with_unit(variable.tolerance, 2, variable.unit);
        format!("{} = {} ± {tolerance}", variable.key, with_unit(variable.value, 12, variable.unit))
    };
    variables.iter().map(variable).collect::<Vec<_>>().join(", ")
}

/// A value of a metric in the unit that people read.
fn for_people(metric: &str, value: f64) -> String {
    let metric = METRICS.into_iter().find(|known| known.name() == metric);
    let (unit, scale) = metric.map_or(("", 1.0), Quantity::shown_unit);
    with_unit(scale * value, 4, unit)
}

/// A cell of the comparison.
type ComparedCell = fn(&Optimum) -> String;

/// The columns of the comparison of dampers.
const COMPARED: [(&str, ComparedCell); 6] = [
    ("damper", |answer| answer.name.clone()),
    ("objective", |answer| for_people(answer.metric, answer.objective)),
    ("nominal", |answer| answer.nominal.map_or_else(String::new, |nominal| for_people(answer.metric, nominal))),
    ("make", |answer| made(&answer.variables)),
    ("mass", |answer| answer.damper_mass_kg.map_or_else(String::new, |mass_kg| with_unit(mass_kg, 4, "kg"))),
    ("constraints", |answer| {
        let words = |of: &KeptConstraint| {
            format!("{} {} ({}{})", of.metric, with_unit(of.value, 4, of.unit), of.limit, kept(of))
        };
        answer.constraints.iter().map(words).collect::<Vec<_>>().join(", ")
    }),
];

/// What to say when no point keeps the constraints.
#[must_use]
pub fn unkept(optimisation: &Optimisation, answer: &Optimum, file: &Path) -> String {
    let missed = |(kept, constraint): (&KeptConstraint, &Constraint)| {
        let value = with_unit(kept.value, 5, kept.unit);
        let by = constraint.limit.excess(kept.value);
        let by = if by.is_finite() { format!(", beyond it by {}", with_unit(by, 3, kept.unit)) } else { String::new() };
        format!("; {} = {value}, and it must be {}{by}", kept.metric, kept.limit)
    };
    let constraints =
        answer.constraints.iter().zip(&optimisation.constraints).filter(|(kept, _)| kept.is_kept == Some(false));
    let missed: String = constraints.map(missed).collect();
    format!(
        "{}: no point keeps the constraints{missed} at the least violation\n  loosen the constraint, or widen the ranges of the variables",
        file.display()
    )
}
