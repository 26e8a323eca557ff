//! Draws a quantity over one axis of a study: a curve for each combination of the others, with the band between its quantiles.

use plotters::element::{Circle, Cross, PathElement, Polygon, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::axis::{Axis, Frame, Scale};
use super::{Canvas, FigureError, INK, Picture, colour, note, text, width};

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

/// A ring or a cross, with its size and line in the canvas' points.
fn draw_mark(canvas: &Canvas, at: (i32, i32), mark: &Mark, colour: RGBColor, scale: i32) -> Result<(), FigureError> {
    let style = colour.stroke_width(2 * scale as u32);
    if mark.is_measured {
        canvas.draw(&Circle::new(at, 5 * scale, style)).map_err(FigureError::of)
    } else {
        canvas.draw(&Cross::new(at, 5 * scale, style)).map_err(FigureError::of)
    }
}

const WIDTH: i32 = 980;
const HEIGHT: i32 = 560;
const LEFT: i32 = 92;
const TOP: i32 = 44;
const BELOW: i32 = 88;
const LEGEND_LINE: i32 = 21;

/// Draws the curves.
///
/// # Errors
/// The drawing library's error.
pub fn draw(curves: &[Curve], labels: &CurveLabels) -> Result<Picture, FigureError> {
    let widest = curves.iter().map(|curve| width(&text(13.0, INK), &curve.label)).max().unwrap_or(0);
    let legend = if curves.len() > 1 { widest + 70 } else { 30 };
    let height = HEIGHT.max(TOP + curves.len() as i32 * LEGEND_LINE + BELOW);
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
        bounds: (LEFT, TOP, WIDTH - legend, height - BELOW),
    };
    let all = || curves.iter().flat_map(|curve| &curve.points).copied();
    let undrawn = scale.undrawn(all().map(|at| at.0)).or_else(|| Scale::Linear.undrawn(all().map(|at| at.1)));
    let is_drawn = |(x, y): &(f64, f64)| frame.draws(*x, *y);
    let picture = Picture::draw(WIDTH as u32, height as u32, |canvas| {
        frame.draw(canvas)?;
        let left = |size: f64| text(size, INK).pos(Pos::new(HPos::Left, VPos::Center));
        canvas.draw(&Text::new(labels.title.clone(), (LEFT, TOP - 20), left(15.0))).map_err(FigureError::of)?;
        for (place, curve) in curves.iter().enumerate().filter(|_| curves.len() > 1) {
            let (x, y) = (frame.bounds.2 + 14, TOP + 8 + place as i32 * LEGEND_LINE);
            let sample = PathElement::new(vec![(x, y), (x + 26, y)], colour(place).stroke_width(2));
            canvas.draw(&sample).map_err(FigureError::of)?;
            canvas.draw(&Text::new(curve.label.clone(), (x + 34, y), left(13.0))).map_err(FigureError::of)?;
        }
        let mut x = LEFT;
        if let Some((_, words)) = &labels.best {
            canvas.draw(&Text::new(words.clone(), (x, height - 16), left(13.0))).map_err(FigureError::of)?;
            x += width(&text(13.0, INK), words) + 40;
        }
        for (is_measured, words) in [(false, "published, computed"), (true, "published, measured")] {
            let Some(mark) = labels.marks.iter().find(|mark| mark.is_measured == is_measured) else { continue };
            draw_mark(canvas, (x + 6, height - 16), mark, INK, 1)?;
            canvas.draw(&Text::new(words, (x + 20, height - 16), left(13.0))).map_err(FigureError::of)?;
            x += width(&text(13.0, INK), words) + 50;
        }
        // On the line of these entries.
        note(canvas, (x, height - 8), undrawn.as_deref())
    })?;
    picture.overlay(|canvas| {
        for (place, curve) in curves.iter().enumerate() {
            let at = |x: f64, y: f64| frame.fine_point(x, y);
            if !curve.band.is_empty()
                && curve.band.iter().all(|(x, low, high)| is_drawn(&(*x, *low)) && is_drawn(&(*x, *high)))
            {
                let up = curve.band.iter().map(|(x, _, high)| at(*x, *high));
                let back = curve.band.iter().rev().map(|(x, low, _)| at(*x, *low));
                let outline: Vec<(i32, i32)> = up.chain(back).collect();
                canvas.draw(&Polygon::new(outline, colour(place).mix(0.2).filled())).map_err(FigureError::of)?;
            }
            for part in curve.points.split(|at| !is_drawn(at)).filter(|part| !part.is_empty()) {
                let points: Vec<(i32, i32)> = part.iter().map(|(x, y)| at(*x, *y)).collect();
                if curve.is_scattered || points.len() == 1 {
                    for point in &points {
                        let dot = Circle::new(*point, 25, colour(place).filled());
                        canvas.draw(&dot).map_err(FigureError::of)?;
                    }
                } else {
                    let line = PathElement::new(points, colour(place).stroke_width(18));
                    canvas.draw(&line).map_err(FigureError::of)?;
                }
            }
        }
        for mark in labels.marks.iter().filter(|mark| is_drawn(&mark.at)) {
            draw_mark(canvas, frame.fine_point(mark.at.0, mark.at.1), mark, colour(mark.curve), 10)?;
        }
        if let Some((at, _)) = labels.best.as_ref().filter(|(at, _)| is_drawn(at)) {
            let mark = Circle::new(frame.fine_point(at.0, at.1), 70, colour(5).stroke_width(28));
            canvas.draw(&mark).map_err(FigureError::of)?;
        }
        Ok(())
    })
}
