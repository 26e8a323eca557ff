//! Draws several simulated cases over each other: their displacements over time, and their cycle maxima over the cycles.

use super::study_curves::{self, Curve, CurveLabels};
use crate::report::plot::{Breadth, Picture};
use crate::simulation::envelope::Envelope;

/// Columns of the displacements: enough for the shape of each cycle of a free vibration.
pub const COLUMNS: usize = 400;

const MILLIMETRES: f64 = 1e3;

/// A simulated case.
#[derive(Clone, Debug)]
pub struct DrawnCase {
    /// Name of the case.
    pub name: String,
    /// Its motion.
    pub envelope: Envelope,
    /// Largest |x| of each whole cycle, m.
    pub cycle_max_m: Vec<f64>,
}

/// Draws x over time.
#[must_use]
pub fn histories(cases: &[DrawnCase], title: &str) -> Picture {
    let curve = |case: &DrawnCase| {
        let ranges = case.envelope.columns().iter().filter_map(|column| column.x_m);
        let mut points: Vec<(f64, f64)> =
            ranges.flat_map(|range| range.in_order()).map(|(t_s, x_m)| (t_s, x_m * MILLIMETRES)).collect();
        points.dedup();
        (case.name.clone(), points)
    };
    let less = if cases.iter().any(|case| case.envelope.is_relative()) { " − z" } else { "" };
    draw(cases.iter().map(curve), title, ("Time (s)", false), &format!("x{less} (mm)"))
}

/// Draws the largest |x| of each cycle.
#[must_use]
pub fn cycle_maxima(cases: &[DrawnCase], title: &str) -> Picture {
    let curve = |case: &DrawnCase| {
        let points =
            case.cycle_max_m.iter().enumerate().map(|(cycle, max_m)| (cycle as f64 + 1.0, max_m * MILLIMETRES));
        (case.name.clone(), points.collect())
    };
    draw(cases.iter().map(curve), title, ("Cycle", false), "largest |x| of the cycle (mm)")
}

/// A result over the time step of a scheme.
#[derive(Clone, Debug)]
pub struct Series {
    /// What it is.
    pub label: String,
    /// Time step, s, and value.
    pub points: Vec<(f64, f64)>,
}

/// Draws results over a time step, which is on a logarithmic axis.
#[must_use]
pub fn over_step(series: Vec<Series>, title: &str, x: &str, y: &str) -> Picture {
    draw(series.into_iter().map(|Series { label, points }| (label, points)), title, (x, true), y)
}

fn draw(
    curves: impl Iterator<Item = (String, Vec<(f64, f64)>)>,
    title: &str,
    (x, is_log): (&str, bool),
    y: &str,
) -> Picture {
    let curves: Vec<Curve> = curves.map(|(label, points)| Curve { label, points, ..Curve::default() }).collect();
    let labels = CurveLabels { title: title.into(), x: x.into(), is_log, y: y.into(), ..CurveLabels::default() };
    study_curves::draw(&curves, &labels, Breadth::Broad)
}
