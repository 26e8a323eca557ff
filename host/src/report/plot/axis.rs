//! Linear and logarithmic axes with round ticks, and the mapping from values to points of the figure.
//!
//! Ticks are 1, 2, 5 in every decade, or round steps.

use super::palette::{INK, PALE};
use super::svg::{Bounds, Font, PicturePlace, Svg};
use super::{LABEL, TITLE};
use crate::report::numbers::significant;

/// Range of a linear axis over the magnitude of its values below which the values count as equal.
const MIN_RANGE: f64 = 1e-6;

/// Magnitudes between which values are drawn: no measured or computed quantity of a rig is beyond them, and the sums, ratios and powers of
/// a drawing stay finite. Smaller values are drawn as 0.
const DRAWN: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

/// Farthest from its frame that a point is drawn, in lengths of the frame: lines keep their direction.
const FARTHEST: f64 = 50.0;

/// Fewest labels of an axis.
const MIN_LABELS: usize = 3;

/// Most decades of a logarithmic axis that are all labelled.
const MAX_DECADES: f64 = 12.0;

/// Values from which, and decimals above which, ticks are labelled as powers of ten.
const LONG_LABEL: (f64, i32) = (1e7, 7);

/// Scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Linear.
    Linear,
    /// Logarithmic; values must be greater than 0.
    Log,
}

impl Scale {
    /// Whether a value can be drawn: not one that is infinite or far beyond any quantity, nor 0 on a logarithmic axis.
    #[must_use]
    pub fn draws(self, value: f64) -> bool {
        value.abs() <= *DRAWN.end() && (self == Self::Linear || value >= *DRAWN.start())
    }

    /// Says how many of the values cannot be drawn, if there are any; those that are missing (not a number) do not count.
    pub fn undrawn(self, values: impl IntoIterator<Item = f64>) -> Option<String> {
        let (mut all, mut undrawn) = (0, 0);
        for value in values.into_iter().filter(|value| !value.is_nan()) {
            all += 1;
            undrawn += usize::from(!self.draws(value));
        }
        let limit = DRAWN.end();
        (undrawn > 0).then(|| format!("{undrawn} of {all} values are not drawn: infinite or beyond ±{limit:e}"))
    }
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Label: quantity and unit.
    pub label: String,
    /// Value at the lower or left end.
    pub from: f64,
    /// Value at the upper or right end; greater than `from`.
    pub to: f64,
    /// Linear or logarithmic.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis between two values.
    pub fn between(label: impl Into<String>, from: f64, to: f64) -> Self {
        Self { label: label.into(), from, to, scale: Scale::Linear }
    }

    /// An axis that covers all `values` that can be drawn with a margin; 0.5 to 2 without values. Values that differ by rounding only are drawn as
    /// one value: the axis is as wide as it is large.
    pub fn around(label: impl Into<String>, scale: Scale, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = ends(values, scale);
        let (from, to) = match scale {
            _ if low > high => (0.5, 2.0),
            Scale::Log => (low / 1.3, high * 1.3),
            Scale::Linear => with_margin((low, high), 0.04),
        };
        Self { label: label.into(), from, to, scale }
    }

    /// The same without the margin, linear: for a scale of colours. 0 to 1 without values.
    pub fn tight(label: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = ends(values, Scale::Linear);
        let (from, to) = if low > high { (0.0, 1.0) } else { with_margin((low, high), 0.0) };
        Self::between(label, from, to)
    }

    /// Position of a value on the axis, 0 at `from`, 1 at `to`.
    #[must_use]
    pub fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.from) / (self.to - self.from),
            Scale::Log => (value / self.from).ln() / (self.to / self.from).ln(),
        }
    }

    /// Major ticks, with a label, and minor ticks, with a line only. An axis has three labels or more.
    #[must_use]
    pub fn ticks(&self) -> (Vec<f64>, Vec<f64>) {
        if !(self.from < self.to && self.from.is_finite() && self.to.is_finite()) {
            return (Vec::new(), Vec::new());
        }
        match self.even_step() {
            Some(step) => {
                let (first, last) = self.within(step);
                ((first..=last).map(|i| i as f64 * step).collect(), Vec::new())
            }
            None => self.decade_ticks(),
        }
    }

    /// Ticks of a logarithmic axis: labelled are 1, 2 and 5 of each decade, or the decades alone.
    fn decade_ticks(&self) -> (Vec<f64>, Vec<f64>) {
        let inside = |v: &f64| *v >= self.from * (1.0 - 1e-9) - 1e-300 && *v <= self.to + 1e-9 * self.to.abs();
        let decades = (self.from.log10().floor() as i32)..=(self.to.log10().ceil() as i32);
        let spread = (self.to / self.from).log10();
        let labelled: &[f64] = if spread <= 3.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let step = (spread / MAX_DECADES).ceil().max(1.0) as usize;
        let digits = if step > 1 { 1..2 } else { 1..10 };
        let of_decade = |d| digits.clone().map(move |m| (f64::from(m), f64::from(m) * 10f64.powi(d)));
        let all = decades.step_by(step).flat_map(of_decade);
        let (major, minor): (Vec<_>, Vec<_>) = all.filter(|(_, v)| inside(v)).partition(|(m, _)| labelled.contains(m));
        (major.into_iter().map(|t| t.1).collect(), minor.into_iter().map(|t| t.1).collect())
    }

    /// Step of evenly spaced ticks: of a linear axis, and of a logarithmic one that is too short for labels at 1, 2 and 5.
    fn even_step(&self) -> Option<f64> {
        if self.scale == Scale::Log && self.decade_ticks().0.len() >= MIN_LABELS {
            return None;
        }
        let steps = [7.0, 10.0, 14.0].map(|parts| round_step((self.to - self.from) / parts));
        let is_enough = |step: &f64| {
            let (first, last) = self.within(*step);
            last - first + 1 >= MIN_LABELS as i64
        };
        steps.iter().copied().find(is_enough).or(Some(steps[2]))
    }

    /// Numbers of the first and the last multiple of a step on the axis.
    fn within(&self, step: f64) -> (i64, i64) {
        ((self.from / step).ceil() as i64, (self.to / step).floor() as i64)
    }

    /// Label of a tick, with the decimals that the tick spacing needs.
    #[must_use]
    pub fn tick_label(&self, value: f64) -> String {
        let (step, size) = (self.even_step(), self.from.abs().max(self.to.abs()));
        let smallest = step.unwrap_or(value);
        if size >= LONG_LABEL.0 || smallest.log10() < -f64::from(LONG_LABEL.1) {
            let digits = step.map_or(1.0, |step| (size / step).log10().ceil() + 1.0);
            return significant(value, digits as usize).replace('-', "−");
        }
        let decimals = (-smallest.log10().floor()).max(0.0) as usize;
        format!("{value:.decimals$}").replace('-', "−")
    }
}

/// Unit of an axis of displacements up to `largest_m`: its name and the number of units per metre.
#[must_use]
pub fn length_unit(largest_m: f64) -> (&'static str, f64) {
    match largest_m {
        m if m >= 1.0 => ("m", 1.0),
        m if m >= 1e-4 => ("mm", 1e3),
        _ => ("µm", 1e6),
    }
}

/// The smallest and the largest of the values that can be drawn.
fn ends(values: impl IntoIterator<Item = f64>, scale: Scale) -> (f64, f64) {
    let drawn = values.into_iter().filter(|value| scale.draws(*value));
    drawn.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

/// The ends of a linear axis, with a margin of this share of their distance; equal ones lie in its middle.
fn with_margin((low, high): (f64, f64), share: f64) -> (f64, f64) {
    let size = low.abs().max(high.abs());
    let margin = match high - low {
        _ if size < *DRAWN.start() => 0.5,
        range if range > MIN_RANGE * size => share * range,
        _ => 0.5 * size,
    };
    (low - margin, high + margin)
}

/// The smallest of 1, 2, 5 times a power of ten that is at least `at_least`.
fn round_step(at_least: f64) -> f64 {
    let power = 10f64.powf(at_least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].iter().map(|m| m * power).find(|s| *s >= at_least * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

/// Two axes and the rectangle between them.
#[derive(Clone, Debug)]
pub struct PlotFrame {
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Where the rectangle is.
    pub bounds: Bounds,
}

impl PlotFrame {
    /// Point of the figure for a pair of values.
    #[must_use]
    pub fn point(&self, x: f64, y: f64) -> PicturePlace {
        let (left, top, right, bottom) = self.bounds;
        let [x, y] = [self.x.place(x), self.y.place(y)].map(|place| place.clamp(-FARTHEST, FARTHEST));
        (left + x * (right - left), bottom - y * (bottom - top))
    }

    /// The rectangle between two corners, with edges at whole points.
    #[must_use]
    pub fn cell(&self, (x1, y1): (f64, f64), (x2, y2): (f64, f64)) -> Bounds {
        let ((left, bottom), (right, top)) = (self.point(x1, y1), self.point(x2, y2));
        (left.round(), top.round(), right.round(), bottom.round())
    }

    /// Whether both axes can draw their value.
    #[must_use]
    pub fn draws(&self, x: f64, y: f64) -> bool {
        self.x.scale.draws(x) && self.y.scale.draws(y)
    }

    /// The grid, below everything in the frame.
    #[must_use]
    pub fn grid(&self) -> Svg {
        let mut svg = Svg::default();
        let (left, top, right, bottom) = self.bounds;
        let (major, minor) = self.y.ticks();
        for (values, opacity) in [(minor, 0.45), (major, 1.0)] {
            for y in values.into_iter().map(|value| self.at_y(value)) {
                svg.line([(left, y), (right, y)], PALE.stroke(1.0).opacity(opacity));
            }
        }
        for x in self.x.ticks().0.into_iter().map(|value| self.at_x(value)) {
            svg.line([(x, top), (x, bottom)], PALE.stroke(1.0));
        }
        svg
    }

    /// The ticks with their labels.
    #[must_use]
    pub fn ticks(&self) -> Svg {
        let mut svg = Svg::default();
        let (left, _, _, bottom) = self.bounds;
        let font = Font::new(LABEL, INK);
        for value in self.y.ticks().0 {
            let y = self.at_y(value);
            svg.line([(left - 5.0, y), (left, y)], INK.stroke(1.0));
            svg.text(&self.y.tick_label(value), (left - 9.0, y), font.ending());
        }
        for value in self.x.ticks().0 {
            let x = self.at_x(value);
            svg.line([(x, bottom), (x, bottom + 5.0)], INK.stroke(1.0));
            svg.text(&self.x.tick_label(value), (x, bottom + 9.0), font.centred().below());
        }
        svg
    }

    /// Places of ticks, at whole points, where their lines are sharp.
    fn at_x(&self, value: f64) -> f64 {
        self.point(value, self.y.from).0.round()
    }

    fn at_y(&self, value: f64) -> f64 {
        self.point(self.x.from, value).1.round()
    }

    /// The rectangle and the labels of its axes.
    #[must_use]
    pub fn edges(&self) -> Svg {
        let mut svg = Svg::default();
        let (left, top, right, bottom) = self.bounds;
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        svg.line(corners, INK.stroke(1.0));
        let font = Font::new(TITLE, INK).centred();
        svg.text(&self.x.label, (0.5 * (left + right), bottom + 42.0), font);
        svg.text(&self.y.label, (left - 54.0, 0.5 * (top + bottom)), font.upright());
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logarithmic_axis_of_two_decades_is_labelled_at_1_2_5() {
        let axis = Axis { label: String::new(), from: 0.9, to: 110.0, scale: Scale::Log };
        assert_eq!(axis.ticks().0, [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
        assert_eq!(axis.tick_label(0.5), "0.5");
    }

    #[test]
    fn a_linear_axis_has_round_steps_and_the_decimals_they_need() {
        let axis = Axis::around("", Scale::Linear, [2.0, 3.0]);
        let (ticks, _) = axis.ticks();
        assert_eq!(
            ticks.iter().map(|t| axis.tick_label(*t)).collect::<Vec<_>>(),
            ["2.0", "2.2", "2.4", "2.6", "2.8", "3.0"]
        );
    }

    #[test]
    fn every_axis_has_three_different_labels_or_more() {
        // A grid of ranges: ratios of the ends from 1.01 to 1e5, starts over a decade.
        for (start, ratio) in (0..50).flat_map(|s| (1..80).map(move |r| (s, r))) {
            let from = 10f64.powf(f64::from(start) / 50.0 - 2.0);
            let to = from * 1.01 * 10f64.powf(f64::from(ratio) / 16.0);
            for scale in [Scale::Linear, Scale::Log] {
                let axis = Axis { label: String::new(), from, to, scale };
                let mut labels: Vec<String> = axis.ticks().0.iter().map(|tick| axis.tick_label(*tick)).collect();
                let count = labels.len();
                labels.dedup();
                assert!(labels.len() >= 3 && labels.len() == count && count <= 16, "{axis:?}: {labels:?}");
            }
        }
        let short = Axis { label: String::new(), from: 3.0, to: 4.6, scale: Scale::Log };
        assert_eq!(
            short.ticks().0.iter().map(|t| short.tick_label(*t)).collect::<Vec<_>>(),
            ["3.0", "3.5", "4.0", "4.5"]
        );
    }

    #[test]
    fn an_axis_covers_all_values_and_may_have_none() {
        let values = [3.2, f64::NAN, 118.0, 0.7, 0.0];
        let axis = Axis::around("", Scale::Log, values);
        for v in [3.2, 118.0, 0.7] {
            assert!((0.0..=1.0).contains(&axis.place(v)));
        }
        let empty = Axis::around("", Scale::Log, []);
        assert!(empty.from < empty.to && !empty.ticks().0.is_empty());
    }

    #[test]
    fn extreme_values_leave_an_axis_finite_with_few_short_labels() {
        let extremes = [1e308, -1e308, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-324, -5e-324, 0.0, 1e30, 1e-30];
        for scale in [Scale::Linear, Scale::Log] {
            for a in extremes {
                for b in extremes {
                    for values in [vec![a], vec![a, b], vec![a, b, 1.0, 2.0]] {
                        let axis = Axis::around("", scale, values.clone());
                        let (major, minor) = axis.ticks();
                        assert!(
                            axis.from < axis.to && axis.from.is_finite() && axis.to.is_finite(),
                            "{values:?} {axis:?}"
                        );
                        assert!(major.len() <= 30 && minor.len() <= 120, "{values:?} {axis:?}: {major:?} {minor:?}");
                        assert!(
                            major.iter().all(|tick| axis.tick_label(*tick).chars().count() <= 9),
                            "{axis:?} {major:?}"
                        );
                        let drawn = values.iter().filter(|value| scale.draws(**value));
                        assert!(
                            drawn.into_iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(&axis.place(*v))),
                            "{values:?} {axis:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn values_that_differ_by_rounding_only_are_drawn_as_a_constant() {
        for constant in [-3.4, 2.5e-3, 3.4, 7e5] {
            let values = [constant, constant * (1.0 + 1e-12), constant * (1.0 - 3e-13)];
            let axis = Axis::around("", Scale::Linear, values);
            assert!(values.iter().all(|v| (axis.place(*v) - 0.5).abs() < 1e-9), "{axis:?}");
            let (ticks, _) = axis.ticks();
            assert!(ticks.len() >= 4 && ticks.iter().all(|t| axis.tick_label(*t).len() <= 9), "{ticks:?}");
        }
        let zero = Axis::around("", Scale::Linear, [0.0, 0.0]);
        assert_eq!((zero.from, zero.to), (-0.5, 0.5));
        let apart = Axis::around("", Scale::Linear, [1.0, 1.00001]);
        assert!(apart.place(1.0) < 0.05 && apart.place(1.00001) > 0.95, "a range above rounding stays");
    }
}
