//! Draws curves of special points in two parameters: alone, and over the map of a study.

use crate::continuation::FoundBranches;
use crate::failure::Failure;
use crate::report::branch_table;
use crate::report::figures::symbols;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::svg::{Bounds, Colour, Font, Svg};
use crate::report::plot::{LABEL, Picture, source};

/// A curve of special points.
#[derive(Clone, Debug, PartialEq)]
pub struct SpecialCurve {
    /// Name of its kind.
    pub kind: &'static str,
    /// Abscissa and ordinate of its points.
    pub points: Vec<(f64, f64)>,
}

impl SpecialCurve {
    /// The curves of a continuation; with `is_swapped` its second parameter is the abscissa.
    #[must_use]
    pub fn all(found: &FoundBranches, is_swapped: bool) -> Vec<Self> {
        let at = |point: &[f64; 3]| if is_swapped { (point[1], point[0]) } else { (point[0], point[1]) };
        let curve = |curve: &crate::continuation::FoundCurve| Self {
            kind: curve.kind,
            // One that cannot be drawn on any axis is left out.
            points: curve
                .points
                .iter()
                .map(at)
                .filter(|(x, y)| Scale::Linear.draws(*x) && Scale::Linear.draws(*y))
                .collect(),
        };
        found.curves.iter().map(curve).collect()
    }
}

const SIZE: (f64, f64) = (980.0, 640.0);
const BOUNDS: Bounds = (92.0, 34.0, 950.0, 560.0);

/// Curves and their light edges keep these colours also where a page is dark: they lie over a map.
const DARK: Colour = Colour(0x11, 0x11, 0x11);
const LIGHT: Colour = Colour(0xff, 0xff, 0xff);

/// Dashes of a kind, as SVG has them; empty for a solid line.
fn dashes(kind: &str) -> &'static str {
    match kind {
        "fold" => "12 5",
        "period doubling" => "6 4",
        "Neimark-Sacker" => "12 4 2 4",
        "symmetry breaking" => "2 4",
        _ => "",
    }
}

/// Room of a label, in points.
const LABEL_HEIGHT: f64 = 16.0;

const LABEL_FONT: Font = Font::new(LABEL + 2.5, DARK);

/// Between a curve and its label, in points.
const LABEL_AFTER: f64 = 9.0;

/// Places along a curve at which its label may stand, as shares of its visible points; the first that is free.
const LABEL_PLACES: [f64; 7] = [0.5, 0.35, 0.65, 0.2, 0.8, 0.05, 0.95];

/// Draws the curves of a continuation.
///
/// # Errors
/// The continuation has no second parameter; a table without an identity.
pub fn draw(found: &FoundBranches) -> Result<Picture, Failure> {
    let Some(second) = &found.second_parameter else {
        return Err(Failure::undrawn("the continuation has one parameter: its file has no table [second]"));
    };
    let [across, up] = [&found.parameter, second].map(|key| symbols::label(key, || found.reference));
    let curves = SpecialCurve::all(found, false);
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let frame = PlotFrame {
        x: Axis::around(&across, Scale::Linear, points().map(|point| point.0)),
        y: Axis::around(&up, Scale::Linear, points().map(|point| point.1)),
        bounds: BOUNDS,
    };
    let mut picture = Picture::new(SIZE.0, SIZE.1);
    picture.panel(&frame, &Svg::default());
    draw_over(&mut picture, &curves, &frame);
    let table = branch_table::curves(found).map_err(Failure::undrawn)?;
    Ok(picture.of_source(&source("continuation", &branch_table::identity(&table))))
}

/// Draws the curves with their names: dark on a light edge, cut at the borders of the frame.
pub fn draw_over(svg: &mut Svg, curves: &[SpecialCurve], frame: &PlotFrame) {
    if curves.is_empty() {
        return;
    }
    let mut area = Svg::default();
    area.rectangle_with(frame.bounds, "");
    svg.raw(&format!("<clipPath id=\"frame\">{area}</clipPath>\n"));
    let mut lines = Svg::default();
    for curve in curves {
        for style in [LIGHT.stroke(4.5), DARK.stroke(2.0).dashed(dashes(curve.kind))] {
            lines.line(curve.points.iter().map(|point| frame.point(point.0, point.1)), style);
        }
    }
    svg.group(&[("clip-path", "url(#frame)")], &lines);
    let mut taken = Vec::new();
    for curve in curves {
        if let Some((start, y)) = label_place(curve, frame, &mut taken) {
            let edge =
                format!(" stroke=\"{LIGHT}\" stroke-width=\"3.5\" stroke-linejoin=\"round\" paint-order=\"stroke\"");
            svg.text_with(curve.kind, (start, y), LABEL_FONT, &edge);
        }
    }
}

/// Where the name of a curve begins beside it, at a place that no other label takes; `None` if the frame shows nothing of the curve.
fn label_place(curve: &SpecialCurve, frame: &PlotFrame, taken: &mut Vec<(f64, f64, f64)>) -> Option<(f64, f64)> {
    let (left, top, right, bottom) = frame.bounds;
    let points = curve.points.iter().map(|point| frame.point(point.0, point.1));
    let visible: Vec<(f64, f64)> =
        points.filter(|(x, y)| (left..=right).contains(x) && (top..=bottom).contains(y)).collect();
    let length = LABEL_FONT.width(curve.kind);
    let place = |share: &f64| {
        let (x, y) = visible[(share * (visible.len() - 1) as f64).round() as usize];
        let fits_right = x + LABEL_AFTER + length < right;
        let start = if fits_right { x + LABEL_AFTER } else { x - LABEL_AFTER - length };
        (start, start + length, y.clamp(top + LABEL_HEIGHT, bottom - LABEL_HEIGHT))
    };
    if visible.is_empty() {
        return None;
    }
    let is_free = |(start, end, y): &(f64, f64, f64)| {
        taken.iter().all(|(from, to, at)| (at - y).abs() >= LABEL_HEIGHT || end < from || to < start)
    };
    let (start, end, y) = LABEL_PLACES.iter().map(place).find(is_free).unwrap_or_else(|| place(&LABEL_PLACES[0]));
    taken.push((start, end, y));
    Some((start, y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_curves_on_one_another_do_not_cover_each_other_and_a_curve_outside_has_none() {
        let axis = |to: f64| Axis::between("", 0.0, to);
        let frame = PlotFrame { x: axis(10.0), y: axis(1.0), bounds: (0.0, 0.0, 1000.0, 500.0) };
        let points: Vec<(f64, f64)> = (0..=20).map(|n| (3.0 + 0.1 * f64::from(n), 0.05 * f64::from(n))).collect();
        let outside = points.iter().map(|(x, y)| (x + 20.0, *y)).collect();
        let mut taken = Vec::new();
        for kind in ["fold", "grazing", "period doubling"] {
            assert!(label_place(&SpecialCurve { kind, points: points.clone() }, &frame, &mut taken).is_some());
        }
        assert!(label_place(&SpecialCurve { kind: "fold", points: outside }, &frame, &mut taken).is_none());
        for (n, a) in taken.iter().enumerate() {
            for b in &taken[..n] {
                assert!((a.2 - b.2).abs() >= LABEL_HEIGHT || a.1 < b.0 || b.1 < a.0, "{taken:?}");
            }
        }
        assert_eq!(taken.len(), 3);
    }
}
