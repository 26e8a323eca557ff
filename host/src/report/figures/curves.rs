//! Draws curves of special points in two parameters: alone, and over the map of a study.

use super::axis::{Axis, Frame, Scale};
use super::{FAMILY, FigureError, Picture, source, text, width};
use crate::continuation::Found;
use crate::report::branch_table;

/// A curve of special points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name of its kind.
    pub kind: &'static str,
    /// Abscissa and ordinate of its points.
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// The curves of a continuation; with `is_swapped` its second parameter is the abscissa.
    #[must_use]
    pub fn all(found: &Found, is_swapped: bool) -> Vec<Self> {
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

const WIDTH: i32 = 980;
const HEIGHT: i32 = 640;
const BOUNDS: (i32, i32, i32, i32) = (92, 34, 950, 560);

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
const LABEL_HEIGHT: i32 = 16;

/// Size of a label, in points.
const LABEL_SIZE: f64 = 13.0;

/// Between a curve and its label, in points.
const LABEL_AFTER: i32 = 9;

/// Places along a curve at which its label may stand, as shares of its visible points; the first that is free.
const LABEL_PLACES: [f64; 7] = [0.5, 0.35, 0.65, 0.2, 0.8, 0.05, 0.95];

/// Draws the curves of a continuation.
///
/// # Errors
/// The continuation has no second parameter; the drawing library's error.
pub fn draw(found: &Found) -> Result<Picture, FigureError> {
    let Some([across, up]) = found.curve_parameters else {
        return Err(FigureError("the continuation has one parameter: its file has no table [second]".into()));
    };
    let curves = Curve::all(found, false);
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let frame = Frame {
        x: Axis::around(across.label, Scale::Linear, points().map(|point| point.0)),
        y: Axis::around(up.label, Scale::Linear, points().map(|point| point.1)),
        bounds: BOUNDS,
    };
    let picture = Picture::draw(WIDTH as u32, HEIGHT as u32, |canvas| frame.draw(canvas))?;
    let table = branch_table::curves(found).map_err(FigureError::of)?;
    let source = source("continuation", &branch_table::identity(&table));
    picture.with_elements(&elements(&curves, &frame)).of_source(&source)
}

/// The curves with their names, as SVG: dark on a light edge, cut at the borders of the frame.
#[must_use]
pub fn elements(curves: &[Curve], frame: &Frame) -> String {
    if curves.is_empty() {
        return String::new();
    }
    let (left, top, right, bottom) = frame.bounds;
    let mut svg = format!(
        "<defs><clipPath id=\"frame\"><rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\"/></clipPath></defs>\n",
        right - left,
        bottom - top
    );
    for curve in curves {
        let at = |point: &(f64, f64)| {
            let (x, y) = frame.exact_point(point.0, point.1);
            format!("{x:.1},{y:.1}")
        };
        let points: Vec<String> = curve.points.iter().map(at).collect();
        let points = points.join(" ");
        for (colour, breadth, dash) in [("#ffffff", 4.5, ""), ("#111111", 2.0, dashes(curve.kind))] {
            svg.push_str(&format!(
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{breadth}\" \
                 stroke-linejoin=\"round\" stroke-dasharray=\"{}\" clip-path=\"url(#frame)\"/>\n",
                if dash.is_empty() { "none" } else { dash }
            ));
        }
    }
    let mut taken = Vec::new();
    for curve in curves {
        svg.push_str(&label(curve, frame, &mut taken));
    }
    svg
}

/// The name of a curve beside it, at a place that no other label takes; empty if the frame shows nothing of the curve.
fn label(curve: &Curve, frame: &Frame, taken: &mut Vec<(i32, i32, i32)>) -> String {
    let (left, top, right, bottom) = frame.bounds;
    let points = curve.points.iter().map(|point| frame.point(point.0, point.1));
    let visible: Vec<(i32, i32)> =
        points.filter(|(x, y)| (left..=right).contains(x) && (top..=bottom).contains(y)).collect();
    let length = width(&text(LABEL_SIZE, super::INK), curve.kind);
    let place = |share: &f64| {
        let (x, y) = visible[(share * (visible.len() - 1) as f64).round() as usize];
        let fits_right = x + LABEL_AFTER + length < right;
        let start = if fits_right { x + LABEL_AFTER } else { x - LABEL_AFTER - length };
        (start, start + length, y.clamp(top + LABEL_HEIGHT, bottom - LABEL_HEIGHT))
    };
    if visible.is_empty() {
        return String::new();
    }
    let is_free = |(start, end, y): &(i32, i32, i32)| {
        taken.iter().all(|(from, to, at)| (at - y).abs() >= LABEL_HEIGHT || end < from || to < start)
    };
    let (start, end, y) = LABEL_PLACES.iter().map(place).find(is_free).unwrap_or_else(|| place(&LABEL_PLACES[0]));
    taken.push((start, end, y));
    format!(
        "<text x=\"{start}\" y=\"{}\" font-family=\"{FAMILY}\" font-size=\"{LABEL_SIZE}\" fill=\"#111111\" stroke=\"#ffffff\" \
         stroke-width=\"3.5\" stroke-linejoin=\"round\" paint-order=\"stroke\">{}</text>\n",
        y + 5,
        curve.kind
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_curves_on_one_another_do_not_cover_each_other_and_a_curve_outside_has_none() {
        let axis = |to: f64| Axis { label: String::new(), from: 0.0, to, scale: Scale::Linear };
        let frame = Frame { x: axis(10.0), y: axis(1.0), bounds: (0, 0, 1000, 500) };
        let points: Vec<(f64, f64)> = (0..=20).map(|n| (3.0 + 0.1 * f64::from(n), 0.05 * f64::from(n))).collect();
        let outside = points.iter().map(|(x, y)| (x + 20.0, *y)).collect();
        let mut taken = Vec::new();
        for kind in ["fold", "grazing", "period doubling"] {
            assert!(label(&Curve { kind, points: points.clone() }, &frame, &mut taken).contains(kind));
        }
        assert!(label(&Curve { kind: "fold", points: outside }, &frame, &mut taken).is_empty());
        for (n, a) in taken.iter().enumerate() {
            for b in &taken[..n] {
                assert!((a.2 - b.2).abs() >= LABEL_HEIGHT || a.1 < b.0 || b.1 < a.0, "{taken:?}");
            }
        }
        assert_eq!(taken.len(), 3);
    }
}
