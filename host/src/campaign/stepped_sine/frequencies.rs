//! The frequencies of a stepped sine: a list, or a grid with further points about each resonance.

use std::f64::consts::TAU;

use damprig_core::control::stepped_sine::MAX_POINTS;
use damprig_core::model::Structure;

use crate::campaign::keys::{grid, stepped_sine as keys};
use crate::input::section::Given;
use crate::input::{Number, Problem, Section};

/// Reports `peak_points` beside `frequencies_hz` instead of in it.
pub(super) fn refuse_misplaced(section: &Section) {
    let key = grid::PEAK_POINTS.name();
    if section.has_own(key) {
        let allowed = "belongs in the grid of frequencies_hz: a list has no points around its peak";
        let help = "write frequencies_hz = { from_hz = 2.0, to_hz = 3.0, step_hz = 0.05, peak_points = 8 }";
        section.reject(key, allowed, Some(help.into()));
    }
}

/// A list of numbers, or a grid; and the number of points around its peak.
pub(super) fn read(section: &Section, structures: &[Structure]) -> Option<(Vec<f64>, usize)> {
    match section.given(&keys::FREQUENCIES)? {
        (_, Given::Numbers(list)) => Some((listed(section, &list)?, 0)),
        (_, Given::Table(table)) => {
            let (from, to, step) = (table.scalar(&grid::FROM), table.scalar(&grid::TO), table.placed(&grid::STEP));
            let resonance_points = table.scalar(&grid::RESONANCE_POINTS).map(|points| points as usize);
            let peak_points = table.scalar(&grid::PEAK_POINTS).map_or(0, |points| points as usize);
            table.finish();
            let even = spread(&table, from?, to?, &step?)?;
            let list = refine(&table, even, resonance_points, structures)?;
            if peak_points > 0 && list.len() < 2 {
                let allowed = "needs a grid of at least two frequencies: the points lie between neighbours";
                table.reject(grid::PEAK_POINTS.name(), allowed, Some("leave it out, or widen the grid".into()));
                return None;
            }
            Some((list, peak_points))
        }
        _ => None,
    }
}

fn listed(section: &Section, list: &[Number]) -> Option<Vec<f64>> {
    let key = keys::FREQUENCIES.name();
    if list.is_empty() {
        section.reject(key, "must hold at least one frequency", Some("write frequencies_hz = [2.5]".into()));
        return None;
    }
    if list.len() > MAX_POINTS {
        // The value itself would fill pages.
        section.source().report(Problem {
            title: format!("`{}` holds {} frequencies", section.full(key), list.len()),
            span: section.span_of(key),
            allowed: format!("the controller holds at most {MAX_POINTS}"),
            help: Some("divide them among several experiments".into()),
        });
        return None;
    }
    Some(list.iter().map(|n| n.value).collect())
}

fn spread(grid: &Section, from: f64, to: f64, step: &Number) -> Option<Vec<f64>> {
    if (to - from) * step.value < 0.0 {
        let help = Some(format!("write step_hz = {}", -step.value));
        grid.refuse("step_hz", &step.span, format!("must lead from {from} to {to} Hz"), help);
        return None;
    }
    // Tolerates the rounding of decimal fractions at the grid's end.
    let steps = ((to - from) / step.value + 1e-6).floor();
    if steps + 1.0 > MAX_POINTS as f64 {
        grid.refuse(
            "step_hz",
            &step.span,
            format!("would give {} points; the controller holds {MAX_POINTS}", steps + 1.0),
            None,
        );
        return None;
    }
    Some((0..=steps as usize).map(|i| to_nine_places(from + i as f64 * step.value)).collect())
}

/// So that 2 + 7 × 0.05 is written 2.35.
pub(in crate::campaign) fn to_nine_places(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// Adds `points` frequencies over the half-power bandwidth of each structure that lies within the grid, in the grid's direction.
fn refine(table: &Section, even: Vec<f64>, points: Option<usize>, structures: &[Structure]) -> Option<Vec<f64>> {
    let Some(points) = points else { return Some(even) };
    let (Some(&first), Some(&last)) = (even.first(), even.last()) else { return Some(even) };
    let even_count = even.len();
    let mut all = even;
    if structures.is_empty() {
        // They could not be read.
        return Some(all);
    }
    for structure in structures.iter().filter(|structure| structure.damping_n_s_per_m > 0.0) {
        let natural_hz = structure.angular_frequency_rad_per_s() / TAU;
        let at =
            |n: usize| natural_hz * (1.0 + structure.damping_ratio() * (2.0 * n as f64 / (points - 1) as f64 - 1.0));
        let within = |f: &f64| (first.min(last)..=first.max(last)).contains(f);
        all.extend((0..points).map(at).map(to_nine_places).filter(within));
    }
    let before = all.len();
    all.sort_by(f64::total_cmp);
    all.dedup();
    if before == even_count {
        let allowed =
            "adds no frequency: no structure has its half-power bandwidth, fn(1 − ζ) to fn(1 + ζ), within the grid";
        table.reject(grid::RESONANCE_POINTS.name(), allowed, Some("leave it out, or widen the grid".into()));
        return None;
    }
    if first > last {
        all.reverse();
    }
    if all.len() > MAX_POINTS {
        let allowed = format!("would give {} points; the controller holds {MAX_POINTS}", all.len());
        table.reject(grid::RESONANCE_POINTS.name(), allowed, None);
        return None;
    }
    Some(all)
}
