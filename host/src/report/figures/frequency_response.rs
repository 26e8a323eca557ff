//! Draws curves over frequency, one per set-up, for example X/Z. [`super::campaign`] supplies the curves.

use plotters::element::{PathElement, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor, TextStyle};

use super::axis::{Axis, Frame, Scale};
use super::traces::{PointerValue, Traces, bar_low, hex};
use super::{
    BROAD, Breadth, COLOURS, Canvas, FigureError, GREY, INK, NARROW, Picture, WIDEST_LEGEND, colour, elements, text,
    width, wrapped,
};

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
    /// Its place among all curves of the campaign, which gives colour and marker: the same in every figure.
    pub place: usize,
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

/// Least height of a broad figure; a long legend needs more.
const HEIGHT: i32 = 480;
/// Height of axes above their legend.
const AXES: i32 = 360;
const LEFT: i32 = 82;
const TOP: i32 = 34;
/// Between the axes and the lower edge, or the legend below them.
const BELOW: i32 = 88;
const LEGEND_LINE: i32 = 19;
/// Height of a curve's entry in the legend.
const ENTRY: i32 = 2 * LEGEND_LINE + 9;
const CAPTION_LINE: i32 = 17;

/// Where the parts of a figure are.
struct Arrangement {
    size: (i32, i32),
    bounds: (i32, i32, i32, i32),
    /// Left end and first line of the legend.
    legend: (i32, i32),
    /// Last line of the caption.
    caption_y: i32,
}

impl Arrangement {
    fn of(breadth: Breadth, legend: (i32, i32), caption_lines: i32) -> Self {
        let (legend_width, legend_height) = legend;
        let wide = if breadth == Breadth::Broad { BROAD } else { NARROW };
        let left = if breadth == Breadth::Broad { LEFT } else { LEFT - 16 };
        if breadth == Breadth::Broad && legend_width <= WIDEST_LEGEND {
            let bottom = (HEIGHT - BELOW).max(TOP + legend_height + 14 - BELOW);
            let height = bottom + BELOW + (caption_lines - 1) * CAPTION_LINE;
            let right = wide - legend_width - 24;
            let bounds = (left, TOP, right, bottom);
            return Self { size: (wide, height), bounds, legend: (right + 22, TOP + 8), caption_y: height - 12 };
        }
        let bounds = (left, TOP, wide - 14, TOP + AXES);
        let legend_y = bounds.3 + BELOW - 14;
        let height = legend_y + legend_height + caption_lines * CAPTION_LINE;
        Self { size: (wide, height), bounds, legend: (14, legend_y), caption_y: height - 12 }
    }
}

/// Draws the quantity over frequency. Points that are not steady are hollow; bars are 95 % intervals, bands reach over repeats.
///
/// # Errors
/// The drawing library's error.
pub fn draw(
    curves: &[ResponseCurve],
    quantity: &Ordinate,
    notes: &ResponseNotes,
    breadth: Breadth,
) -> Result<Picture, FigureError> {
    let values = || curves.iter().flat_map(|c| &c.points);
    let signs = Sign::of(curves, quantity);
    let widest = curves.iter().flat_map(|c| [width(&text(14.0, INK), &c.label), width(&text(12.0, GREY), &c.detail)]);
    let widest = widest.chain(signs.iter().map(|sign| width(&text(12.0, GREY), sign.words()))).max().unwrap_or(0);
    let legend_height = curves.len() as i32 * ENTRY + signs.len() as i32 * (LEGEND_LINE + 2) + 28;
    let undrawn =
        Scale::Linear.undrawn(values().map(|p| p.value)).map(|words| format!(" {words}.")).unwrap_or_default();
    let room = if breadth == Breadth::Broad { BROAD - LEFT - 14 } else { NARROW - 28 };
    let caption = wrapped(&text(12.0, GREY), &(notes.caption.clone() + &undrawn), room);
    let places = Arrangement::of(breadth, (widest + 52, legend_height), caption.len() as i32);
    let ends = |p: &ResponsePoint| p.range(quantity.scale).map_or([p.value; 3], |(low, high)| [low, p.value, high]);
    let frame = Frame {
        x: Axis::around("Frequency (Hz)", Scale::Linear, values().map(|p| p.frequency_hz)),
        y: Axis::around(quantity.label, quantity.scale, values().flat_map(ends)),
        bounds: places.bounds,
    };
    let inside: String = natural_frequency(&frame, notes)?
        + &curves.iter().map(|curve| elements_of(&frame, curve, quantity)).collect::<String>();
    let (wide, high) = places.size;
    let mut picture = Picture::draw(wide as u32, high as u32, |_| Ok(()))?.framed(&frame, &inside)?;
    let (left, mut y) = places.legend;
    for curve in curves {
        let marker = marker_at((left + 15, y), curve.place, true);
        picture = picture.legend_entry(curve.place, &marker, |canvas| curve_entry(canvas, (left, y), curve))?;
        y += ENTRY;
    }
    y += 8;
    for sign in &signs {
        picture = picture.with_elements(&sign.sample((left, y))).above(|canvas| {
            canvas.draw(&Text::new(sign.words(), (left + 40, y), at_left(12.0, GREY))).map_err(FigureError::of)
        })?;
        y += LEGEND_LINE + 2;
    }
    picture.above(|canvas| {
        let style = || text(12.0, GREY).pos(Pos::new(HPos::Left, VPos::Bottom));
        let left = if breadth == Breadth::Broad { LEFT } else { places.legend.0 };
        caption.iter().rev().zip(0..).try_for_each(|(line, n)| {
            let at = (left, places.caption_y - n * CAPTION_LINE);
            canvas.draw(&Text::new(line.clone(), at, style())).map_err(FigureError::of)
        })
    })
}

fn at_left(size: f64, tint: RGBColor) -> TextStyle<'static> {
    text(size, tint).pos(Pos::new(HPos::Left, VPos::Center))
}

/// A dashed line at fn, with its name above the frame.
fn natural_frequency(frame: &Frame, notes: &ResponseNotes) -> Result<String, FigureError> {
    let inside = |hz: &f64| (frame.x.from..=frame.x.to).contains(hz);
    let Some(natural_hz) = notes.natural_frequency_hz.filter(inside) else { return Ok(String::new()) };
    let name = elements(|canvas| {
        let style = text(13.0, GREY).pos(Pos::new(HPos::Center, VPos::Bottom));
        canvas.draw(&Text::new("fn", (0, -4), style)).map_err(FigureError::of)
    })?;
    let height = frame.bounds.3 - frame.bounds.1;
    let line = format!("<path d=\"M0 0V{height}\" stroke=\"{}\" stroke-dasharray=\"5 4\"/>", hex(GREY));
    let mut traces = Traces::new(frame);
    traces.mark((natural_hz, frame.y.to), &(line + &name));
    Ok(traces.upright())
}

/// The elements of a curve: band, line, bars, repeats and markers.
fn elements_of(frame: &Frame, curve: &ResponseCurve, quantity: &Ordinate) -> String {
    let can_be_drawn = |p: &&ResponsePoint| frame.draws(p.frequency_hz, p.value);
    let mut points: Vec<&ResponsePoint> = curve.points.iter().filter(can_be_drawn).collect();
    points.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let tint = colour(curve.place);
    let mut traces = Traces::new(frame);
    let of_repeats = |p: &&&ResponsePoint| p.repeats.len() > 1;
    let band = points.iter().filter(of_repeats);
    let band = band.filter_map(|p| p.range(quantity.scale).map(|(low, high)| (p.frequency_hz, low, high)));
    traces.band(&band.collect::<Vec<_>>(), tint);
    traces.line(points.iter().map(|p| (p.frequency_hz, p.value)), tint, 2.0);
    for p in &points {
        let at = (p.frequency_hz, p.value);
        for value in p.repeats.iter().filter(|value| frame.y.scale.draws(**value)) {
            traces.dot((p.frequency_hz, *value), 2.2, tint);
        }
        if p.repeats.is_empty() && p.range(quantity.scale).is_some() {
            traces.bar(at, p.half_width, tint);
        }
        traces.mark(at, &marker(curve.place, p.is_settled));
        if quantity.rings_peaks && Some(p.frequency_hz) == curve.unresolved_peak_hz {
            traces.ring(at, RING, tint, 1.0);
        }
    }
    let shown = |p: &&ResponsePoint| PointerValue { x: p.frequency_hz, value: p.value, range: p.range(quantity.scale) };
    traces.curve(curve.place, &curve.label, &points.iter().map(shown).collect::<Vec<_>>())
}

/// Radius of the ring around a peak that is not resolved, points.
const RING: f64 = 10.0;

/// A marker around 0, 0; curves differ in its shape and colour.
fn marker(index: usize, is_filled: bool) -> String {
    const SHAPES: [&[(i32, i32)]; 6] = [
        &[(5, 0), (4, 3), (3, 4), (0, 5), (-3, 4), (-4, 3), (-5, 0), (-4, -3), (-3, -4), (0, -5), (3, -4), (4, -3)],
        &[(-4, -4), (4, -4), (4, 4), (-4, 4)],
        &[(0, -6), (6, 4), (-6, 4)],
        &[(0, -6), (6, 0), (0, 6), (-6, 0)],
        &[(0, 6), (6, -4), (-6, -4)],
        &[(-6, 0), (-3, -5), (3, -5), (6, 0), (3, 5), (-3, 5)],
    ];
    // Where the colours begin again, the shapes are shifted.
    let shape = (index + index / COLOURS) % SHAPES.len();
    let corners: Vec<String> = SHAPES[shape].iter().map(|(x, y)| format!("{x},{y}")).collect();
    let (corners, tint) = (corners.join(" "), hex(colour(index)));
    let inside = if is_filled { &tint } else { "#FFFFFF" };
    format!("<polygon points=\"{corners}\" fill=\"{inside}\" stroke=\"{tint}\" stroke-width=\"2\"/>")
}

fn marker_at((x, y): (i32, i32), index: usize, is_filled: bool) -> String {
    format!("<g transform=\"translate({x} {y})\">{}</g>", marker(index, is_filled))
}

/// An entry of the legend's lower part: what a sign means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sign {
    Steady,
    NotSteady,
    Interval,
    Repeats,
    Unresolved,
}

impl Sign {
    /// The signs that a figure has.
    fn of(curves: &[ResponseCurve], quantity: &Ordinate) -> Vec<Self> {
        let any = |is: &dyn Fn(&ResponsePoint) -> bool| curves.iter().flat_map(|c| &c.points).any(is);
        let has_range = |p: &ResponsePoint| p.range(quantity.scale).is_some();
        let signs = [
            (Self::Steady, true),
            (Self::NotSteady, true),
            (Self::Interval, any(&|p| p.repeats.is_empty() && has_range(p))),
            (Self::Repeats, any(&|p| !p.repeats.is_empty())),
            (Self::Unresolved, quantity.rings_peaks && curves.iter().any(|c| c.unresolved_peak_hz.is_some())),
        ];
        signs.into_iter().filter(|(_, is_drawn)| *is_drawn).map(|(sign, _)| sign).collect()
    }

    fn words(self) -> &'static str {
        match self {
            Self::Steady => "steady or stationary",
            Self::NotSteady => "not steady within the dwell",
            Self::Interval => "95 % interval of the mean over cycles",
            Self::Repeats => "repeats, their mean and range",
            Self::Unresolved => "peak not resolved or at a jump",
        }
    }

    /// The sign at the left end of a line of the legend.
    fn sample(self, (left, y): (i32, i32)) -> String {
        let at = |elements: String| format!("<g transform=\"translate({} {y})\">{elements}</g>", left + 16);
        let grey = hex(GREY);
        let two = |is_filled| marker_at((left + 8, y), 0, is_filled) + &marker_at((left + 24, y), 1, is_filled);
        match self {
            Self::Steady => two(true),
            Self::NotSteady => two(false),
            Self::Interval => {
                at(format!("<path d=\"M0 -8V8M-4 -8H4M-4 8H4\" stroke=\"{grey}\" stroke-width=\"1.2\"/>"))
            }
            Self::Repeats => at(format!(
                "<path d=\"M-15 -7H15V7H-15Z\" fill=\"{grey}\" fill-opacity=\"0.2\"/><circle cx=\"-5\" cy=\"-3\" r=\"2.2\" \
                 fill=\"{grey}\"/><circle cx=\"5\" cy=\"3\" r=\"2.2\" fill=\"{grey}\"/>"
            )),
            Self::Unresolved => at(format!("<circle r=\"{RING}\" fill=\"none\" stroke=\"{grey}\"/>")),
        }
    }
}

/// A curve's entry in the legend, without its marker.
fn curve_entry(canvas: &Canvas, (left, y): (i32, i32), curve: &ResponseCurve) -> Result<(), FigureError> {
    let line = PathElement::new(vec![(left, y), (left + 30, y)], colour(curve.place).stroke_width(2));
    canvas.draw(&line).map_err(FigureError::of)?;
    let name = Text::new(curve.label.clone(), (left + 40, y), at_left(14.0, INK));
    canvas.draw(&name).map_err(FigureError::of)?;
    let detail = Text::new(curve.detail.clone(), (left + 40, y + LEGEND_LINE), at_left(12.0, GREY));
    canvas.draw(&detail).map_err(FigureError::of)
}
