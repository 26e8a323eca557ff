//! Draws playbacks, impulses and free vibrations: x over time, a panel per experiment, a curve per set-up.

use plotters::element::{PathElement, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::{Axis, Frame, Scale};
use super::{Canvas, FINE, FigureError, GREY, INK, Picture, colour, text, width};

/// Columns of a panel. A longer history shows the lowest and highest value per column.
pub const COLUMNS: usize = 760;

/// x over time on one set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryCurve {
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

const WIDTH: i32 = 1040;
const LEFT: i32 = 82;
const TOP: i32 = 40;
const HIGH: i32 = 280;
const GAP: i32 = 96;
const LINE: i32 = 22;
const MILLIMETRES: f64 = 1e3;

/// Draws the panels from top to bottom.
///
/// # Errors
/// The drawing library's error.
pub fn draw(panels: &[HistoryPanel]) -> Result<Picture, FigureError> {
    let count = i32::try_from(panels.len()).unwrap_or(1).max(1);
    let names = panels.iter().flat_map(|p| &p.curves).map(|c| width(&text(13.0, INK), &c.label));
    let legend = names.chain([width(&text(13.0, INK), BASE)]).max().unwrap_or(0) + 60;
    let right = WIDTH - legend;
    let frames: Vec<Frame> = panels.iter().zip(0..).map(|(panel, place)| frame(panel, place, right)).collect();
    let height = TOP + count * HIGH + (count - 1) * GAP + 64;
    let page = Picture::draw(WIDTH as u32, height as u32, |canvas| {
        for (panel, frame) in panels.iter().zip(&frames) {
            let title = text(14.0, INK).pos(Pos::new(HPos::Left, VPos::Bottom));
            let values = panel.curves.iter().flat_map(|c| &c.points).chain(panel.base.iter().flatten());
            let undrawn = Scale::Linear.undrawn(values.map(|p| p.1 * MILLIMETRES));
            let undrawn = undrawn.map(|words| format!(" ({words})")).unwrap_or_default();
            canvas
                .draw(&Text::new(panel.title.clone() + &undrawn, (LEFT, frame.bounds.1 - 8), title))
                .map_err(FigureError::of)?;
            frame.draw(canvas)?;
            legend_of(canvas, panel, (right + 16, frame.bounds.1 + 10))?;
        }
        Ok(())
    })?;
    page.overlay(|canvas| panels.iter().zip(&frames).try_for_each(|(panel, frame)| curves(canvas, panel, frame)))
}

const BASE: &str = "base z";

fn frame(panel: &HistoryPanel, place: i32, right: i32) -> Frame {
    let points = || panel.curves.iter().flat_map(|c| &c.points).chain(panel.base.iter().flatten());
    let top = TOP + place * (HIGH + GAP);
    let y = Axis::around("Displacement (mm)", Scale::Linear, points().map(|p| p.1 * MILLIMETRES));
    let times = points()
        .map(|p| p.0)
        .filter(|t| Scale::Linear.draws(*t))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
    let (from, to) = if times.0 < times.1 { times } else { (0.0, 1.0) };
    Frame {
        x: Axis { label: "Time (s)".into(), from, to, scale: Scale::Linear },
        y,
        bounds: (LEFT, top, right, top + HIGH),
    }
}

fn curves(canvas: &Canvas, panel: &HistoryPanel, frame: &Frame) -> Result<(), FigureError> {
    let draw = |points: &[(f64, f64)], style: plotters::style::ShapeStyle| {
        let drawn = thinned(points).into_iter().filter(|(t, v)| frame.draws(*t, v * MILLIMETRES));
        let path = drawn.map(|(t, v)| frame.fine_point(t, v * MILLIMETRES)).collect::<Vec<_>>();
        canvas.draw(&PathElement::new(path, style)).map_err(FigureError::of)
    };
    let thick = FINE as u32;
    panel.curves.iter().enumerate().try_for_each(|(i, c)| draw(&c.points, colour(i).stroke_width(13 * thick / 10)))?;
    panel.base.as_ref().map_or(Ok(()), |base| draw(base, GREY.stroke_width(thick)))
}

fn legend_of(canvas: &Canvas, panel: &HistoryPanel, (left, top): (i32, i32)) -> Result<(), FigureError> {
    let own = panel.curves.iter().enumerate().map(|(i, c)| (c.label.as_str(), colour(i)));
    let all = own.chain(panel.base.as_ref().map(|_| (BASE, GREY)));
    for ((label, tint), line) in all.zip(0..) {
        let y = top + line * LINE;
        let stroke = PathElement::new(vec![(left, y), (left + 24, y)], tint.stroke_width(2));
        canvas.draw(&stroke).map_err(FigureError::of)?;
        let style = text(13.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
        canvas.draw(&Text::new(label.to_string(), (left + 32, y), style)).map_err(FigureError::of)?;
    }
    Ok(())
}

/// Reduces many points to the lowest and highest per column, in order of time.
pub(super) fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= 2 * COLUMNS {
        return points.to_vec();
    }
    let mut out = Vec::with_capacity(2 * COLUMNS);
    for some in points.chunks(points.len().div_ceil(COLUMNS)) {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        if let (Some(low), Some(high)) = (some.iter().min_by(by), some.iter().max_by(by)) {
            out.extend(if low.0 <= high.0 { [*low, *high] } else { [*high, *low] });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_history_keeps_its_peaks() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|n| (f64::from(n), (f64::from(n) * 0.01).sin())).collect();
        points[77_777].1 = 5.0;
        points[3].1 = -4.0;
        let thin = thinned(&points);
        assert!(thin.len() <= 2 * COLUMNS);
        assert!(thin.contains(&(77_777.0, 5.0)) && thin.contains(&(3.0, -4.0)));
        assert!(thin.windows(2).all(|w| w[0].0 <= w[1].0));
    }

    #[test]
    fn panels_without_points_are_drawn() {
        let panel = HistoryPanel { title: "nothing".into(), curves: vec![], base: None };
        assert!(draw(&[panel]).unwrap().svg().contains("nothing"));
        assert!(draw(&[]).is_ok());
    }
}
