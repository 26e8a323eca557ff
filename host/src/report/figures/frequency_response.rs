//! Draws curves over frequency, one per set-up, for example X/Z. [`super::campaign`] supplies the curves.

use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, Arrangement, LegendEntry};
use crate::report::plot::palette::{GREY, Look};
use crate::report::plot::svg::{Font, Svg};
use crate::report::plot::traces::{PointerValue, Traces, bar_low, circle, marker, upright};
use crate::report::plot::{BROAD, Breadth, NARROW, Picture, SMALL};

/// One point of a curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResponsePoint {
    /// Hz.
    pub frequency_hz: f64,
    /// The quantity's value; of repeats their mean.
    pub value: f64,
    /// Whether the value is within its tolerance of its limit: the motion was steady or stationary.
    pub is_settled: bool,
    /// Half-width of the value's 95 % interval; NaN or 0 without one, and of repeats.
    pub half_width: f64,
    /// The values of the repeats; empty without repeats.
    pub repeats: Vec<f64>,
}

impl ResponsePoint {
    /// Lower and upper end of what is drawn of the point: its bar, or the band of its repeats.
    fn range(&self, scale: Scale) -> Option<(f64, f64)> {
        let drawn = || self.repeats.iter().copied().filter(|value| scale.draws(*value));
        if drawn().count() > 1 {
            return Some((drawn().fold(f64::INFINITY, f64::min), drawn().fold(f64::NEG_INFINITY, f64::max)));
        }
        let (low, high) = (bar_low(scale, self.value, self.half_width), self.value + self.half_width);
        (self.half_width > 0.0 && scale.draws(low) && scale.draws(high)).then_some((low, high))
    }
}

/// The curve of one experiment on one set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseCurve {
    /// Its place among the curves of the figure.
    pub place: usize,
    /// How it looks in every figure.
    pub look: Look,
    /// Label of the set-up, and of the experiment if the set-up has several.
    pub label: String,
    /// Second line of the legend: "d/Z = 10, Z = 1.5 mm".
    pub detail: String,
    /// Points in the order of the run.
    pub points: Vec<ResponsePoint>,
    /// Frequency of the highest X/Z, Hz, if the points beside it do not resolve the peak ([`crate::report::peak`]).
    pub unresolved_peak_hz: Option<f64>,
}

/// Labels of the figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResponseNotes {
    /// fn, marked by a line, Hz.
    pub natural_frequency_hz: Option<f64>,
    /// Text below the axis: definition of X, measurement time.
    pub caption: String,
}

/// The ordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ordinate {
    /// Ordinate and unit, as written beside the axis.
    pub label: &'static str,
    /// Whether a peak that is not resolved is ringed.
    pub rings_peaks: bool,
    /// Linear or logarithmic; a logarithmic one leaves out values of 0 and below.
    pub scale: Scale,
}

const TOP: f64 = 34.0;
const CAPTION_LINE: f64 = 17.0;

/// Draws the quantity over frequency. Points that are not steady are hollow; bars are 95 % intervals, bands reach over repeats.
#[must_use]
pub fn draw(curves: &[ResponseCurve], quantity: &Ordinate, notes: &ResponseNotes, breadth: Breadth) -> Picture {
    let values = || curves.iter().flat_map(|c| &c.points);
    let mut entries: Vec<LegendEntry> = curves.iter().map(entry).collect();
    entries.extend(signs(curves, quantity));
    let undrawn =
        Scale::Linear.undrawn(values().map(|p| p.value)).map(|words| format!(" {words}.")).unwrap_or_default();
    let (left, caption_left) = if breadth == Breadth::Broad { (82.0, 82.0) } else { (66.0, 14.0) };
    let room = if breadth == Breadth::Broad { BROAD - caption_left - 14.0 } else { NARROW - 28.0 };
    let font = Font::new(SMALL, GREY);
    let caption = font.wrapped(&(notes.caption.clone() + &undrawn), room);
    let under = 9.0 + caption.len() as f64 * CAPTION_LINE;
    let places = Arrangement::of(breadth, (left, TOP), &entries, under);
    let ends = |p: &ResponsePoint| p.range(quantity.scale).map_or([p.value; 3], |(low, high)| [low, p.value, high]);
    let frame = PlotFrame {
        x: Axis::around("Frequency (Hz)", Scale::Linear, values().map(|p| p.frequency_hz)),
        y: Axis::around(quantity.label, quantity.scale, values().flat_map(ends)),
        bounds: places.bounds,
    };
    let mut inside = Svg::default();
    if let Some(natural_hz) = notes.natural_frequency_hz {
        inside.add(&upright(&frame, natural_hz, "fn"));
    }
    curves.iter().for_each(|curve| inside.add(&elements_of(&frame, curve, quantity)));
    let mut picture = places.picture();
    picture.live_panel(&frame, &inside);
    legend::column(&mut picture, places.legend, &entries);
    for (line, n) in caption.iter().rev().zip(0u8..) {
        let y = places.size.1 - 12.0 - f64::from(n) * CAPTION_LINE;
        picture.text(line, (caption_left, y), font.above());
    }
    picture
}

/// The elements of a curve: band, line, bars, repeats and markers.
fn elements_of(frame: &PlotFrame, curve: &ResponseCurve, quantity: &Ordinate) -> Svg {
    let can_be_drawn = |p: &&ResponsePoint| frame.draws(p.frequency_hz, p.value);
    let mut points: Vec<&ResponsePoint> = curve.points.iter().filter(can_be_drawn).collect();
    points.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let tint = curve.look.colour();
    let mut traces = Traces::new(frame);
    let of_repeats = |p: &&&ResponsePoint| p.repeats.len() > 1;
    let band = points.iter().filter(of_repeats);
    let band = band.filter_map(|p| p.range(quantity.scale).map(|(low, high)| (p.frequency_hz, low, high)));
    traces.band(&band.collect::<Vec<_>>(), tint);
    traces.line(points.iter().map(|p| (p.frequency_hz, p.value)), curve.look.line(2.0));
    for p in &points {
        let at = (p.frequency_hz, p.value);
        for value in p.repeats.iter().filter(|value| frame.y.scale.draws(**value)) {
            traces.dot((p.frequency_hz, *value), REPEAT, tint);
        }
        if p.repeats.is_empty() && p.range(quantity.scale).is_some() {
            traces.bar(at, p.half_width, tint);
        }
        traces.mark(at, &marker(curve.look, p.is_settled));
        if quantity.rings_peaks && Some(p.frequency_hz) == curve.unresolved_peak_hz {
            traces.mark(at, &circle(RING, tint.stroke(1.0)));
        }
    }
    let shown = |p: &&ResponsePoint| PointerValue { x: p.frequency_hz, value: p.value, range: p.range(quantity.scale) };
    traces.curve(curve.place, &curve.label, &points.iter().map(shown).collect::<Vec<_>>())
}

/// Radius of the ring around a peak that is not resolved, points.
const RING: f64 = 10.0;
/// Radius of the dot of a repeat, points.
const REPEAT: f64 = 2.2;

/// A curve's entry in the legend.
fn entry(curve: &ResponseCurve) -> LegendEntry {
    let line = LegendEntry::line(&curve.label, curve.look.line(2.0)).marked(&marker(curve.look, true));
    line.with_detail(&curve.detail).of_curve(curve.place)
}

/// The legend's lower part: what the signs of the figure mean.
fn signs(curves: &[ResponseCurve], quantity: &Ordinate) -> Vec<LegendEntry> {
    let any = |is: &dyn Fn(&ResponsePoint) -> bool| curves.iter().flat_map(|c| &c.points).any(is);
    let two = |is_filled| {
        let mut sign = Svg::default();
        for (set_up, x) in [(0, -8.0), (1, 8.0)] {
            sign.at((x, 0.0), &marker(Look { set_up, run: 0 }, is_filled));
        }
        sign
    };
    let (mut interval, mut repeats) = (Svg::default(), Svg::default());
    interval.path("M0 -8V8M-4 -8H4M-4 8H4", GREY.stroke(1.2));
    repeats.rectangle((-14.0, -7.0, 14.0, 7.0), GREY.fill().opacity(0.2));
    [(-5.0, -3.0), (5.0, 3.0)].into_iter().for_each(|at| repeats.circle(at, REPEAT, GREY.fill()));
    let has_interval = any(&|p| p.repeats.is_empty() && p.range(quantity.scale).is_some());
    let is_unresolved = quantity.rings_peaks && curves.iter().any(|c| c.unresolved_peak_hz.is_some());
    let all = [
        (true, "steady or stationary", two(true)),
        (true, "not steady within the dwell", two(false)),
        (has_interval, "95 % interval of the mean over cycles", interval),
        (any(&|p| !p.repeats.is_empty()), "repeats, their mean and range", repeats),
        (is_unresolved, "peak not resolved or at a jump", circle(RING, GREY.stroke(1.0))),
    ];
    let drawn = all.into_iter().filter(|(is_drawn, ..)| *is_drawn);
    drawn.map(|(_, words, sign)| LegendEntry::mark(words, &sign).of_sign()).collect()
}
