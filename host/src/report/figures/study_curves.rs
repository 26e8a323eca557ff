//! Draws a quantity over one axis of a study: a curve for each combination of the others, with the band between its quantiles.

use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, Arrangement, LegendEntry};
use crate::report::plot::palette::{INK, MARKED, colour};
use crate::report::plot::svg::{Colour, Font, Svg};
use crate::report::plot::traces::{PointerValue, Traces, circle};
use crate::report::plot::{Breadth, LABEL, Picture, TITLE};

/// A curve, or points.
#[derive(Clone, Debug, Default, PartialEq)]
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
#[derive(Clone, Debug, Default, PartialEq)]
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

/// The sign of a published point: a ring or a cross.
fn sign(is_measured: bool, tint: Colour) -> Svg {
    if is_measured {
        return circle(5.0, tint.stroke(2.0));
    }
    let mut svg = Svg::default();
    svg.path("M-5 -5L5 5M-5 5L5 -5", tint.stroke(2.0));
    svg
}

const TOP: f64 = 44.0;
const LINE: f64 = 17.0;

/// Draws the curves.
#[must_use]
pub fn draw(curves: &[Curve], labels: &CurveLabels, breadth: Breadth) -> Picture {
    let entry =
        |(place, curve): (usize, &Curve)| LegendEntry::line(&curve.label, colour(place).stroke(2.0)).of_curve(place);
    let entries: Vec<LegendEntry> = curves.iter().enumerate().filter(|_| curves.len() > 1).map(entry).collect();
    let left = if breadth == Breadth::Broad { 92.0 } else { 74.0 };
    let font = Font::new(TITLE, INK);
    let title = font.wrapped(&labels.title, breadth.width() - left - 10.0);
    let top = TOP + (title.len() as f64 - 1.0) * LINE;
    let places = Arrangement::of(breadth, (left, top), &entries, 26.0);
    let marks = || labels.marks.iter().map(|mark| mark.at);
    let abscissae =
        || curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.0)).chain(marks().map(|at| at.0));
    let bands = || curves.iter().flat_map(|curve| curve.band.iter().flat_map(|(_, low, high)| [*low, *high]));
    let values = curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.1)).chain(bands());
    let values = values.chain(marks().map(|at| at.1));
    let scale = if labels.is_log { Scale::Log } else { Scale::Linear };
    let frame = PlotFrame {
        x: Axis::around(labels.x.clone(), scale, abscissae()),
        y: Axis::around(labels.y.clone(), Scale::Linear, values),
        bounds: places.bounds,
    };
    let all = || curves.iter().flat_map(|curve| &curve.points).copied();
    let undrawn = scale.undrawn(all().map(|at| at.0)).or_else(|| Scale::Linear.undrawn(all().map(|at| at.1)));
    let mut inside = Svg::default();
    curves.iter().enumerate().for_each(|(place, curve)| inside.add(&elements_of(&frame, place, curve, labels)));
    let mut picture = places.picture();
    picture.live_panel(&frame, &inside);
    legend::column(&mut picture, places.legend, &entries);
    for (line, n) in title.iter().zip(0u8..) {
        picture.text(line, (left, TOP - 20.0 + f64::from(n) * LINE), font);
    }
    let (mut left, y) = (left.min(places.legend.0), places.size.1 - 16.0);
    if let Some((_, words)) = &labels.best {
        picture.text(words, (left, y), Font::new(LABEL, INK));
        left += Font::new(LABEL, INK).width(words) + 40.0;
    }
    let published = [(false, "published, computed"), (true, "published, measured")];
    let has = |is_measured: bool| labels.marks.iter().any(|mark| mark.is_measured == is_measured);
    let published = published.into_iter().filter(|(is_measured, _)| has(*is_measured));
    let entries: Vec<LegendEntry> =
        published.map(|(is_measured, words)| LegendEntry::mark(words, &sign(is_measured, INK))).collect();
    let (left, _) = legend::rows(&mut picture, (left, y), f64::INFINITY, &entries);
    // On the line of these entries.
    picture.note(left, undrawn.as_deref());
    picture
}

/// The elements of a curve: band, line or dots, the published points on it, and the best point on the first one.
fn elements_of(frame: &PlotFrame, place: usize, curve: &Curve, labels: &CurveLabels) -> Svg {
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
            traces.line(part.iter().copied(), tint.stroke(1.8));
        }
    }
    for mark in labels.marks.iter().filter(|mark| mark.curve == place && is_drawn(&mark.at)) {
        traces.mark(mark.at, &sign(mark.is_measured, tint));
    }
    if let Some((at, _)) = labels.best.as_ref().filter(|(at, _)| curve.points.contains(at) && is_drawn(at)) {
        traces.mark(*at, &circle(7.0, MARKED.stroke(2.8)));
    }
    let band_at = |n: usize| curve.band.get(n).filter(|(x, low, high)| is_drawn(&(*x, *low)) && is_drawn(&(*x, *high)));
    let shown = |(n, at): (usize, &(f64, f64))| {
        let range = band_at(n).filter(|band| band.0 == at.0).map(|(_, low, high)| (*low, *high));
        PointerValue { x: at.0, value: at.1, range }
    };
    let drawn = curve.points.iter().enumerate().filter(|(_, at)| is_drawn(at)).take(MAX_READ_OUT).map(shown);
    traces.curve(place, &curve.label, &drawn.collect::<Vec<_>>())
}

/// Most points of a curve whose numbers are on the page.
const MAX_READ_OUT: usize = 20_000;
