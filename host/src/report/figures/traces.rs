//! Writes curves of a frame as SVG elements with their numbers, which the script of a page (`report/script/figures.js`) shows, zooms and hides.
//!
//! The script moves the points of lines and areas, and the places of marks (elements with `transform="translate(x y)"`), which keep their size.

use std::fmt::Write;

use maud::{PreEscaped, html};
use plotters::style::RGBColor;

use super::axis::{Frame, Scale};
use crate::report::numbers::significant;

/// Significant digits of the numbers that the script shows.
const DIGITS: usize = 6;

/// A colour as the style sheet of the pages has it: `#E69F00`.
#[must_use]
pub fn hex(RGBColor(red, green, blue): RGBColor) -> String {
    format!("#{red:02X}{green:02X}{blue:02X}")
}

/// Elements within a frame. Pairs are values of its axes; those that it cannot draw must be left out.
#[derive(Debug)]
pub struct Traces<'a> {
    frame: &'a Frame,
    svg: String,
}

impl<'a> Traces<'a> {
    /// No elements.
    #[must_use]
    pub fn new(frame: &'a Frame) -> Self {
        Self { frame, svg: String::new() }
    }

    /// Places of the figure as an attribute has them.
    fn places(&self, points: impl IntoIterator<Item = (f64, f64)>) -> String {
        let place = |(x, y)| {
            let (across, up) = self.frame.exact_point(x, y);
            format!("{across:.1},{up:.1}")
        };
        points.into_iter().map(place).collect::<Vec<_>>().join(" ")
    }

    /// A line through points, `width` points wide.
    pub fn line(&mut self, points: impl IntoIterator<Item = (f64, f64)>, tint: RGBColor, width: f64) {
        let (places, tint) = (self.places(points), hex(tint));
        let _ = write!(
            self.svg,
            "<polyline fill=\"none\" stroke=\"{tint}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" points=\"{places}\"/>"
        );
    }

    /// The pale area between the lower and the upper values of a band: abscissa, low, high.
    pub fn band(&mut self, band: &[(f64, f64, f64)], tint: RGBColor) {
        if band.is_empty() {
            return;
        }
        let up = band.iter().map(|(x, _, high)| (*x, *high));
        let (places, tint) = (self.places(up.chain(band.iter().rev().map(|(x, low, _)| (*x, *low)))), hex(tint));
        let _ = write!(self.svg, "<polygon fill=\"{tint}\" fill-opacity=\"0.2\" points=\"{places}\"/>");
    }

    /// A mark at a point: elements around 0, 0.
    pub fn mark(&mut self, (x, y): (f64, f64), elements: &str) {
        let (across, up) = self.frame.exact_point(x, y);
        let _ = write!(self.svg, "<g transform=\"translate({across:.1} {up:.1})\">{elements}</g>");
    }

    /// A filled dot.
    pub fn dot(&mut self, at: (f64, f64), radius: f64, tint: RGBColor) {
        self.mark(at, &format!("<circle r=\"{radius}\" fill=\"{}\"/>", hex(tint)));
    }

    /// A ring.
    pub fn ring(&mut self, at: (f64, f64), radius: f64, tint: RGBColor, width: f64) {
        let tint = hex(tint);
        self.mark(at, &format!("<circle r=\"{radius}\" fill=\"none\" stroke=\"{tint}\" stroke-width=\"{width}\"/>"));
    }

    /// A cross.
    pub fn cross(&mut self, at: (f64, f64), radius: f64, tint: RGBColor) {
        let (tint, r) = (hex(tint), radius);
        self.mark(
            at,
            &format!("<path d=\"M-{r} -{r}L{r} {r}M-{r} {r}L{r} -{r}\" stroke=\"{tint}\" stroke-width=\"2\"/>"),
        );
    }

    /// A bar of uncertainty with its two ends; on a logarithmic axis it ends at a twentieth of the value ([`bar_low`]).
    pub fn bar(&mut self, (x, value): (f64, f64), half_width: f64, tint: RGBColor) {
        let ends = [bar_low(self.frame.y.scale, value, half_width), value + half_width];
        self.line(ends.map(|end| (x, end)), tint, 1.2);
        let cap = format!("<path d=\"M-4 0H4\" stroke=\"{}\" stroke-width=\"1.2\"/>", hex(tint));
        ends.into_iter().for_each(|end| self.mark((x, end), &cap));
    }

    /// The elements as a curve of a page's script: its place among the figure's legend entries, its name, and the points whose numbers are shown
    /// under the pointer (abscissa, value, lower and upper end of its interval or band, if it has one).
    #[must_use]
    pub fn curve(self, place: usize, label: &str, points: &[PointerValue]) -> String {
        let number = |value: f64| significant(value, DIGITS);
        let point = |p: &PointerValue| match p.range {
            Some((low, high)) => format!("[{},{},{},{}]", number(p.x), number(p.value), number(low), number(high)),
            None => format!("[{},{}]", number(p.x), number(p.value)),
        };
        let points = format!("[{}]", points.iter().map(point).collect::<Vec<_>>().join(","));
        html! { g data-curve=(place) data-label=(label) data-points=(points) { (PreEscaped(self.svg)) } }.into_string()
    }

    /// The elements as signs that move across only.
    #[must_use]
    pub fn upright(self) -> String {
        format!("<g data-upright=\"\">{}</g>", self.svg)
    }
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
