//! Curves and marks within a frame, by the values of its axes; with their numbers, if the script of a page (`report/script/figures.js`)
//! shows, zooms and hides them.
//!
//! The script moves the points of lines and areas, and the places of marks (elements with `transform="translate(x y)"`), which keep their
//! size.

use super::LABEL;
use super::axis::{PlotFrame, Scale};
use super::palette::{COLOURS, GREY, Look, WHITE};
use super::svg::{Colour, Font, PicturePlace, Style, Svg};
use crate::report::numbers::significant;

/// Significant digits of the numbers that the script shows.
const DIGITS: usize = 6;

/// Columns of a frame. A longer history shows the lowest and highest value per column.
pub const COLUMNS: usize = 760;

/// Elements within a frame. Pairs are values of its axes; those that it cannot draw must be left out.
#[derive(Debug)]
pub struct Traces<'a> {
    frame: &'a PlotFrame,
    svg: Svg,
}

impl<'a> Traces<'a> {
    /// No elements.
    #[must_use]
    pub fn new(frame: &'a PlotFrame) -> Self {
        Self { frame, svg: Svg::default() }
    }

    fn place(&self, (x, y): (f64, f64)) -> PicturePlace {
        self.frame.point(x, y)
    }

    /// A line through points.
    pub fn line(&mut self, points: impl IntoIterator<Item = (f64, f64)>, style: Style) {
        let mut places: Vec<PicturePlace> = points.into_iter().map(|at| self.place(at)).collect();
        places.dedup();
        if !places.is_empty() {
            self.svg.line(places, style);
        }
    }

    /// A line through the points that can be drawn; many points are reduced ([`thinned`]).
    pub fn history(&mut self, points: &[(f64, f64)], style: Style) {
        let drawn: Vec<(f64, f64)> = thinned(points).into_iter().filter(|(x, y)| self.frame.draws(*x, *y)).collect();
        self.line(drawn, style);
    }

    /// The pale area between the lower and the upper values of a band: abscissa, low, high.
    pub fn band(&mut self, band: &[(f64, f64, f64)], tint: Colour) {
        if band.is_empty() {
            return;
        }
        let up = band.iter().map(|(x, _, high)| (*x, *high));
        let corners = up.chain(band.iter().rev().map(|(x, low, _)| (*x, *low)));
        let places: Vec<PicturePlace> = corners.map(|at| self.place(at)).collect();
        self.svg.area(places, tint.fill().opacity(0.2));
    }

    /// A mark at a point: elements around 0, 0.
    pub fn mark(&mut self, at: (f64, f64), elements: &Svg) {
        self.svg.at(self.place(at), elements);
    }

    /// A filled dot.
    pub fn dot(&mut self, at: (f64, f64), radius: f64, tint: Colour) {
        self.mark(at, &circle(radius, tint.fill()));
    }

    /// A bar of uncertainty with its two ends; on a logarithmic axis it ends at a twentieth of the value ([`bar_low`]).
    pub fn bar(&mut self, (x, value): (f64, f64), half_width: f64, tint: Colour) {
        let ends = [bar_low(self.frame.y.scale, value, half_width), value + half_width];
        let style = tint.stroke(1.2);
        self.line(ends.map(|end| (x, end)), style);
        let mut cap = Svg::default();
        cap.path("M-4 0H4", style);
        ends.into_iter().for_each(|end| self.mark((x, end), &cap));
    }

    /// Triangles at impacts: abscissa, ordinate and side of the wall, −1 or 1.
    pub fn impacts(&mut self, impacts: impl IntoIterator<Item = (f64, f64, i8)>, tint: Colour) {
        for (x, y, side) in impacts {
            self.mark((x, y), &impact(side, tint));
        }
    }

    /// Squares at points: of those that look the same, one.
    pub fn squares(&mut self, points: impl IntoIterator<Item = (f64, f64)>, size: f64, tint: Colour) {
        let mut seen = std::collections::HashSet::new();
        // Places nearer than this look the same.
        let near = |place: f64| (place / 0.3).round() as i64;
        let places = points.into_iter().filter(|(x, y)| self.frame.draws(*x, *y)).map(|at| self.place(at));
        let places: Vec<PicturePlace> = places.filter(|(x, y)| seen.insert((near(*x), near(*y)))).collect();
        self.svg.squares(places, size, tint);
    }

    /// The elements.
    #[must_use]
    pub fn svg(self) -> Svg {
        self.svg
    }

    /// The elements as a curve of a page's script: its place among the figure's legend entries, its name, and the points whose numbers are shown
    /// under the pointer (abscissa, value, lower and upper end of its interval or band, if it has one).
    #[must_use]
    pub fn curve(self, place: usize, label: &str, points: &[PointerValue]) -> Svg {
        let number = |value: f64| significant(value, DIGITS);
        let point = |p: &PointerValue| match p.range {
            Some((low, high)) => format!("[{},{},{},{}]", number(p.x), number(p.value), number(low), number(high)),
            None => format!("[{},{}]", number(p.x), number(p.value)),
        };
        let points = format!("[{}]", points.iter().map(point).collect::<Vec<_>>().join(","));
        let mut group = Svg::default();
        let attributes = [("data-curve", &*place.to_string()), ("data-label", label), ("data-points", &points)];
        group.group(&attributes, &self.svg);
        group
    }
}

/// A dashed line across the frame at an abscissa, with a name above the frame; nothing beyond the axis. It moves across only.
#[must_use]
pub fn upright(frame: &PlotFrame, x: f64, name: &str) -> Svg {
    let mut group = Svg::default();
    if (frame.x.from..=frame.x.to).contains(&x) {
        let mut sign = Svg::default();
        sign.line([(0.0, 0.0), (0.0, frame.bounds.3 - frame.bounds.1)], GREY.stroke(1.0).dashed("5 4"));
        if !name.is_empty() {
            sign.text(name, (0.0, -4.0), Font::new(LABEL, GREY).centred().above());
        }
        let mut traces = Traces::new(frame);
        traces.mark((x, frame.y.to), &sign);
        group.group(&[("data-upright", "")], &traces.svg);
    }
    group
}

/// A circle around 0, 0.
#[must_use]
pub fn circle(radius: f64, style: Style) -> Svg {
    let mut svg = Svg::default();
    svg.circle((0.0, 0.0), radius, style);
    svg
}

/// A mark around 0, 0: a circle, square, triangle, diamond, triangle upside down or hexagon; others begin again.
#[must_use]
pub fn shape(number: usize, style: Style) -> Svg {
    const CORNERS: [&[(i8, i8)]; 5] = [
        &[(-4, -4), (4, -4), (4, 4), (-4, 4)],
        &[(0, -6), (6, 4), (-6, 4)],
        &[(0, -6), (6, 0), (0, 6), (-6, 0)],
        &[(0, 6), (6, -4), (-6, -4)],
        &[(-6, 0), (-3, -5), (3, -5), (6, 0), (3, 5), (-3, 5)],
    ];
    let Some(place) = (number % (CORNERS.len() + 1)).checked_sub(1) else { return circle(5.0, style) };
    let mut svg = Svg::default();
    svg.area(CORNERS[place].iter().map(|(x, y)| (f64::from(*x), f64::from(*y))), style);
    svg
}

/// The marker of a set-up around 0, 0; set-ups differ in its shape and colour.
#[must_use]
pub fn marker(look: Look, is_filled: bool) -> Svg {
    let inside = if is_filled { look.colour() } else { WHITE };
    // Where the colours begin again, the shapes are shifted.
    shape(look.set_up + look.set_up / COLOURS, inside.fill().edged(look.colour(), 2.0))
}

/// The sign of an impact: a triangle whose tip is at 0, 0, on the side of the wall.
#[must_use]
pub fn impact(side: i8, tint: Colour) -> Svg {
    let mut svg = Svg::default();
    let base = 7.0 * f64::from(side);
    svg.area([(0.0, 0.0), (-4.0, base), (4.0, base)], tint.fill());
    svg
}

/// Reduces many points to the lowest and highest per column, in order of the abscissa.
#[must_use]
pub fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
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

/// A point whose numbers are shown under the pointer. All are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointerValue {
    /// Abscissa.
    pub x: f64,
    /// Value.
    pub value: f64,
    /// Lower and upper end of its interval or band.
    pub range: Option<(f64, f64)>,
}

/// The lower end of a bar of uncertainty: above 0 on a logarithmic axis.
#[must_use]
pub fn bar_low(scale: Scale, value: f64, half_width: f64) -> f64 {
    if scale == Scale::Log { (value - half_width).max(0.05 * value) } else { value - half_width }
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
}
