//! Draws playbacks, impulses and free vibrations: x over time, a panel per experiment, a curve per set-up.

use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{GREY, INK, Look};
use crate::report::plot::svg::{Bounds, Font, Style};
use crate::report::plot::traces::Traces;
use crate::report::plot::{LABEL, Picture};

/// x over time on one set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryCurve {
    /// How the set-up looks in every figure.
    pub look: Look,
    /// Label of the set-up.
    pub label: String,
    /// Time (s) and displacement (m), in rising order of time.
    pub points: Vec<(f64, f64)>,
}

/// The panel of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryPanel {
    /// Title above the panel.
    pub title: String,
    /// x of each set-up.
    pub curves: Vec<HistoryCurve>,
    /// z of the first set-up, if it was recorded and moves.
    pub base: Option<Vec<(f64, f64)>>,
}

const WIDTH: f64 = 1040.0;
const LEFT: f64 = 82.0;
const TOP: f64 = 40.0;
const HIGH: f64 = 280.0;
const GAP: f64 = 96.0;
const MILLIMETRES: f64 = 1e3;

/// Draws the panels from top to bottom.
#[must_use]
pub fn draw(panels: &[HistoryPanel]) -> Picture {
    let legends: Vec<Vec<LegendEntry>> = panels.iter().map(entries).collect();
    let right = WIDTH - 32.0 - legends.iter().map(|entries| legend::size(entries).0).fold(0.0, f64::max);
    let height = TOP + panels.len().max(1) as f64 * (HIGH + GAP) - GAP + 64.0;
    let mut picture = Picture::new(WIDTH, height);
    for ((panel, entries), place) in panels.iter().zip(&legends).zip(0u32..) {
        let top = TOP + f64::from(place) * (HIGH + GAP);
        let curves: Vec<(Vec<(f64, f64)>, _)> = curves(panel).collect();
        let undrawn = Scale::Linear.undrawn(curves.iter().flat_map(|(points, _)| points).map(|p| p.1));
        let undrawn = undrawn.map(|words| format!(" ({words})")).unwrap_or_default();
        picture.text(&(panel.title.clone() + &undrawn), (LEFT, top - 8.0), Font::new(LABEL + 0.8, INK).above());
        let frame = frame(curves.iter().flat_map(|(points, _)| points), (LEFT, top, right, top + HIGH));
        let mut traces = Traces::new(&frame);
        curves.iter().for_each(|(points, style)| traces.history(points, *style));
        picture.panel(&frame, &traces.svg());
        legend::column(&mut picture, (right + 16.0, top + 10.0), entries);
    }
    picture
}

/// The curves in millimetres and how they are drawn, the base last.
fn curves(panel: &HistoryPanel) -> impl Iterator<Item = (Vec<(f64, f64)>, Style)> {
    let own = panel.curves.iter().map(|curve| (&curve.points, curve.look.line(1.3)));
    let all = own.chain(panel.base.as_ref().map(|base| (base, GREY.stroke(1.0))));
    all.map(|(points, style)| (points.iter().map(|(t, m)| (*t, m * MILLIMETRES)).collect(), style))
}

fn entries(panel: &HistoryPanel) -> Vec<LegendEntry> {
    let own = panel.curves.iter().map(|curve| LegendEntry::line(&curve.label, curve.look.line(2.0)));
    own.chain(panel.base.as_ref().map(|_| LegendEntry::line("base z", GREY.stroke(2.0)))).collect()
}

fn frame<'a>(points: impl Iterator<Item = &'a (f64, f64)> + Clone, bounds: Bounds) -> PlotFrame {
    let times = points.clone().map(|p| p.0).filter(|t| Scale::Linear.draws(*t));
    let (from, to) = times.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
    let (from, to) = if from < to { (from, to) } else { (0.0, 1.0) };
    PlotFrame {
        x: Axis::between("Time (s)", from, to),
        y: Axis::around("Displacement (mm)", Scale::Linear, points.map(|p| p.1)),
        bounds,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_without_points_are_drawn() {
        let panel = HistoryPanel { title: "nothing".into(), curves: vec![], base: None };
        assert!(draw(&[panel]).svg().contains("nothing"));
        assert!(draw(&[]).png().is_ok());
    }
}
