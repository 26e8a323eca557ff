//! Draws a quantity over one axis of a study: a curve for each combination of the others, with the band between its quantiles.

use plotters::element::{Circle, Cross, PathElement, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, TextStyle};

use super::axis::{Axis, Frame, Scale};
use super::traces::{PointerValue, Traces};
use super::{
    BROAD, Breadth, Canvas, FigureError, INK, NARROW, Picture, WIDEST_LEGEND, colour, note, text, width, wrapped,
};

/// A curve, or points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What it is.
    pub label: String,
    /// Abscissa and value; a value that is not a number leaves a gap.
    pub points: Vec<(f64, f64)>,
    /// Abscissa, smallest and largest value; empty without a band.
    pub band: Vec<(f64, f64, f64)>,
    /// Points without a line.
    pub is_scattered: bool,
}

/// Labels of the figure.
#[derive(Clone, Debug, PartialEq)]
pub struct CurveLabels {
    /// Name of the study.
    pub title: String,
    /// Quantity and unit of the abscissa.
    pub x: String,
    /// The abscissa is logarithmic.
    pub is_log: bool,
    /// Quantity and unit of the ordinate.
    pub y: String,
    /// The best point and its text.
    pub best: Option<((f64, f64), String)>,
    /// Points from elsewhere.
    pub marks: Vec<Mark>,
}

/// A published point over a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Abscissa and value.
    pub at: (f64, f64),
    /// Place of its curve, whose colour it has.
    pub curve: usize,
    /// Measured (a ring), and not computed (a cross).
    pub is_measured: bool,
}

/// The sign of a published point in the legend: a ring or a cross.
fn draw_mark(canvas: &Canvas, at: (i32, i32), mark: &Mark) -> Result<(), FigureError> {
    let style = INK.stroke_width(2);
    if mark.is_measured {
        canvas.draw(&Circle::new(at, 5, style)).map_err(FigureError::of)
    } else {
        canvas.draw(&Cross::new(at, 5, style)).map_err(FigureError::of)
    }
}

/// Height of a broad figure; a long legend needs more.
const HEIGHT: i32 = 470;
/// Height of axes above their legend.
const AXES: i32 = 360;
const LEFT: i32 = 92;
const TOP: i32 = 44;
const BELOW: i32 = 88;
const LEGEND_LINE: i32 = 21;
const LINE: i32 = 17;

/// Draws the curves.
///
/// # Errors
/// The drawing library's error.
pub fn draw(curves: &[Curve], labels: &CurveLabels, breadth: Breadth) -> Result<Picture, FigureError> {
    let widest = curves.iter().map(|curve| width(&text(13.0, INK), &curve.label)).max().unwrap_or(0);
    let has_legend = curves.len() > 1;
    let legend_height = if has_legend { curves.len() as i32 * LEGEND_LINE } else { 0 };
    let (left, wide) = if breadth == Breadth::Broad { (LEFT, BROAD) } else { (LEFT - 18, NARROW) };
    let title = wrapped(&text(15.0, INK), &labels.title, wide - left - 10);
    let top = TOP + (title.len() as i32 - 1) * LEGEND_LINE;
    // Left end and first line of the legend.
    let (bounds, legend, height) = if breadth == Breadth::Broad && widest + 70 <= WIDEST_LEGEND {
        let height = HEIGHT.max(top + legend_height + BELOW);
        let right = wide - if has_legend { widest + 70 } else { 30 };
        ((left, top, right, height - BELOW), (right + 14, top + 8), height)
    } else {
        let bottom = top + AXES;
        ((left, top, wide - 16, bottom), (left - 40, bottom + 70), bottom + BELOW + legend_height + 12)
    };
    let marks = || labels.marks.iter().map(|mark| mark.at);
    let abscissae =
        || curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.0)).chain(marks().map(|at| at.0));
    let bands = || curves.iter().flat_map(|curve| curve.band.iter().flat_map(|(_, low, high)| [*low, *high]));
    let values = curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.1)).chain(bands());
    let values = values.chain(marks().map(|at| at.1));
    let scale = if labels.is_log { Scale::Log } else { Scale::Linear };
    let frame = Frame {
        x: Axis::around(labels.x.clone(), scale, abscissae()),
        y: Axis::around(labels.y.clone(), Scale::Linear, values),
        bounds,
    };
    let all = || curves.iter().flat_map(|curve| &curve.points).copied();
    let undrawn = scale.undrawn(all().map(|at| at.0)).or_else(|| Scale::Linear.undrawn(all().map(|at| at.1)));
    let inside: String =
        curves.iter().enumerate().map(|(place, curve)| elements_of(&frame, place, curve, labels)).collect();
    let mut picture = Picture::draw(wide as u32, height as u32, |_| Ok(()))?.framed(&frame, &inside)?;
    for (place, curve) in curves.iter().enumerate().filter(|_| has_legend) {
        let (x, y) = (legend.0, legend.1 + place as i32 * LEGEND_LINE);
        picture = picture.legend_entry(place, "", |canvas| {
            let sample = PathElement::new(vec![(x, y), (x + 26, y)], colour(place).stroke_width(2));
            canvas.draw(&sample).map_err(FigureError::of)?;
            canvas.draw(&Text::new(curve.label.clone(), (x + 34, y), at_left(13.0))).map_err(FigureError::of)
        })?;
    }
    picture.above(|canvas| {
        for (line, n) in title.iter().zip(1..) {
            let at = (left, top - 20 - (title.len() as i32 - n) * LINE);
            canvas.draw(&Text::new(line.clone(), at, at_left(15.0))).map_err(FigureError::of)?;
        }
        let (mut x, y) = (left.min(legend.0), height - 16);
        if let Some((_, words)) = &labels.best {
            canvas.draw(&Text::new(words.clone(), (x, y), at_left(13.0))).map_err(FigureError::of)?;
            x += width(&text(13.0, INK), words) + 40;
        }
        for (is_measured, words) in [(false, "published, computed"), (true, "published, measured")] {
            let Some(mark) = labels.marks.iter().find(|mark| mark.is_measured == is_measured) else { continue };
            draw_mark(canvas, (x + 6, y), mark)?;
            canvas.draw(&Text::new(words, (x + 20, y), at_left(13.0))).map_err(FigureError::of)?;
            x += width(&text(13.0, INK), words) + 50;
        }
        // On the line of these entries.
        note(canvas, (x, height - 8), undrawn.as_deref())
    })
}

fn at_left(size: f64) -> TextStyle<'static> {
    text(size, INK).pos(Pos::new(HPos::Left, VPos::Center))
}

/// The elements of a curve: band, line or dots, the published points on it, and the best point on the first one.
fn elements_of(frame: &Frame, place: usize, curve: &Curve, labels: &CurveLabels) -> String {
    let is_drawn = |(x, y): &(f64, f64)| frame.draws(*x, *y);
    let tint = colour(place);
    let mut traces = Traces::new(frame);
    if curve.band.iter().all(|(x, low, high)| is_drawn(&(*x, *low)) && is_drawn(&(*x, *high))) {
        traces.band(&curve.band, tint);
    }
    for part in curve.points.split(|at| !is_drawn(at)).filter(|part| !part.is_empty()) {
        if curve.is_scattered || part.len() == 1 {
            part.iter().for_each(|at| traces.dot(*at, 2.5, tint));
        } else {
            traces.line(part.iter().copied(), tint, 1.8);
        }
    }
    for mark in labels.marks.iter().filter(|mark| mark.curve == place && is_drawn(&mark.at)) {
        if mark.is_measured { traces.ring(mark.at, 5.0, tint, 2.0) } else { traces.cross(mark.at, 5.0, tint) }
    }
    if let Some((at, _)) = labels.best.as_ref().filter(|(at, _)| curve.points.contains(at) && is_drawn(at)) {
        traces.ring(*at, 7.0, colour(5), 2.8);
    }
    let band_at = |n: usize| curve.band.get(n).filter(|(x, low, high)| is_drawn(&(*x, *low)) && is_drawn(&(*x, *high)));
    let shown = |(n, at): (usize, &(f64, f64))| {
        let range = band_at(n).filter(|band| band.0 == at.0).map(|(_, low, high)| (*low, *high));
        PointerValue { x: at.0, value: at.1, range }
    };
    let drawn = curve.points.iter().enumerate().filter(|(_, at)| is_drawn(at)).take(MOST_READ_OUT).map(shown);
    traces.curve(place, &curve.label, &drawn.collect::<Vec<_>>())
}

/// Most points of a curve whose numbers are on the page.
const MOST_READ_OUT: usize = 20_000;
