//! Draws curves over frequency, one per set-up, for example X/Z. [`super::campaign`] supplies the curves.

use plotters::element::{Circle, PathElement, Polygon, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor, WHITE};

use super::axis::{Axis, Frame, Scale};
use super::{COLOURS, Canvas, FigureError, GREY, INK, Picture, colour, text, width};

/// One point of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponsePoint {
    /// Hz.
    pub frequency_hz: f64,
    /// The quantity's value.
    pub value: f64,
    /// Whether the value is within its tolerance of its limit: the motion was steady or stationary.
    pub is_settled: bool,
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

const WIDTH: i32 = 980;
/// Least height; a long legend needs more.
const HEIGHT: i32 = 600;
const LEFT: i32 = 82;
const TOP: i32 = 34;
/// Between the axes and the lower edge.
const BELOW: i32 = 88;
const LEGEND_LINE: i32 = 19;

/// Draws the quantity over frequency. Points that are not steady are hollow.
///
/// # Errors
/// The drawing library's error.
pub fn draw(curves: &[ResponseCurve], quantity: &Ordinate, notes: &ResponseNotes) -> Result<Picture, FigureError> {
    let widest = curves.iter().flat_map(|c| [width(&text(14.0, INK), &c.label), width(&text(12.0, GREY), &c.detail)]);
    let legend_width =
        widest.chain([NOT_STEADY.0, UNRESOLVED].map(|word| width(&text(12.0, GREY), word))).max().unwrap_or(0) + 52;
    let height = HEIGHT.max(TOP + curves.len() as i32 * (2 * LEGEND_LINE + 9) + 4 * LEGEND_LINE + 34);
    let values = || curves.iter().flat_map(|c| &c.points);
    let frame = Frame {
        x: Axis::around("Frequency (Hz)", Scale::Linear, values().map(|p| p.frequency_hz)),
        y: Axis::around(quantity.label, quantity.scale, values().map(|p| p.value)),
        bounds: (LEFT, TOP, WIDTH - legend_width - 30, height - BELOW),
    };
    Picture::draw(WIDTH as u32, height as u32, |canvas| {
        frame.draw(canvas)?;
        if let Some(natural) = notes.natural_frequency_hz {
            frame.mark_x(canvas, natural, "fn")?;
        }
        for curve in curves {
            draw_curve(canvas, &frame, curve, curve.place)?;
            if quantity.rings_peaks {
                ring_peak(canvas, &frame, curve)?;
            }
        }
        legend(canvas, frame.bounds.2 + 22, curves, quantity.rings_peaks)?;
        let undrawn =
            Scale::Linear.undrawn(values().map(|p| p.value)).map(|words| format!(" {words}.")).unwrap_or_default();
        let caption = text(12.0, GREY).pos(Pos::new(HPos::Left, VPos::Bottom));
        canvas.draw(&Text::new(notes.caption.clone() + &undrawn, (LEFT, height - 12), caption)).map_err(FigureError::of)
    })
}

fn draw_curve(canvas: &Canvas, frame: &Frame, curve: &ResponseCurve, index: usize) -> Result<(), FigureError> {
    let can_be_drawn = |p: &&ResponsePoint| frame.draws(p.frequency_hz, p.value);
    let mut points: Vec<&ResponsePoint> = curve.points.iter().filter(can_be_drawn).collect();
    points.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let at = |p: &ResponsePoint| frame.point(p.frequency_hz, p.value);
    let path = points.iter().map(|p| at(p)).collect::<Vec<_>>();
    canvas.draw(&PathElement::new(path, colour(index).stroke_width(2))).map_err(FigureError::of)?;
    points.iter().try_for_each(|p| marker(canvas, at(p), index, p.is_settled))
}

/// Radius of the ring around a peak that is not resolved, pixels.
const RING: i32 = 10;

fn ring_peak(canvas: &Canvas, frame: &Frame, curve: &ResponseCurve) -> Result<(), FigureError> {
    let is_peak = |p: &&ResponsePoint| Some(p.frequency_hz) == curve.unresolved_peak_hz;
    let drawn = curve.points.iter().filter(is_peak).find(|p| frame.draws(p.frequency_hz, p.value));
    drawn.map_or(Ok(()), |p| ring(canvas, frame.point(p.frequency_hz, p.value), colour(curve.place)))
}

fn ring(canvas: &Canvas, at: (i32, i32), tint: RGBColor) -> Result<(), FigureError> {
    canvas.draw(&Circle::new(at, RING, tint.stroke_width(1))).map_err(FigureError::of)
}

/// Draws a marker; curves differ in its shape and colour.
fn marker(canvas: &Canvas, (x, y): (i32, i32), index: usize, filled: bool) -> Result<(), FigureError> {
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
    let mut outline: Vec<(i32, i32)> = SHAPES[shape].iter().map(|(dx, dy)| (x + dx, y + dy)).collect();
    let tint: RGBColor = colour(index);
    let inside = if filled { tint } else { WHITE };
    canvas.draw(&Polygon::new(outline.clone(), inside.filled())).map_err(FigureError::of)?;
    outline.push(outline[0]);
    outline.push(outline[1]);
    canvas.draw(&PathElement::new(outline, tint.stroke_width(2))).map_err(FigureError::of)
}

const STEADY: (&str, bool) = ("steady or stationary", true);
const NOT_STEADY: (&str, bool) = ("not steady within the dwell", false);

const UNRESOLVED: &str = "peak not resolved or at a jump";

fn legend(canvas: &Canvas, left: i32, curves: &[ResponseCurve], rings_peaks: bool) -> Result<(), FigureError> {
    let at = |style: plotters::style::TextStyle<'static>| style.pos(Pos::new(HPos::Left, VPos::Center));
    let mut y = TOP + 8;
    for curve in curves {
        let i = curve.place;
        canvas
            .draw(&PathElement::new(vec![(left, y), (left + 30, y)], colour(i).stroke_width(2)))
            .map_err(FigureError::of)?;
        marker(canvas, (left + 15, y), i, true)?;
        canvas.draw(&Text::new(curve.label.clone(), (left + 40, y), at(text(14.0, INK)))).map_err(FigureError::of)?;
        y += LEGEND_LINE;
        canvas.draw(&Text::new(curve.detail.clone(), (left + 40, y), at(text(12.0, GREY)))).map_err(FigureError::of)?;
        y += LEGEND_LINE + 9;
    }
    y += 8;
    for (word, filled) in [STEADY, NOT_STEADY] {
        for (place, index) in [(8, 0), (24, 1)] {
            marker(canvas, (left + place, y), index, filled)?;
        }
        canvas.draw(&Text::new(word.to_string(), (left + 40, y), at(text(12.0, GREY)))).map_err(FigureError::of)?;
        y += LEGEND_LINE + 2;
    }
    if rings_peaks && curves.iter().any(|curve| curve.unresolved_peak_hz.is_some()) {
        ring(canvas, (left + 16, y), GREY)?;
        canvas.draw(&Text::new(UNRESOLVED, (left + 40, y), at(text(12.0, GREY)))).map_err(FigureError::of)?;
    }
    Ok(())
}
