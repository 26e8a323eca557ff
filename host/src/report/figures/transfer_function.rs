//! The transfer function from base to structure: |H|, phase and coherence over frequency, with the fitted structure.

use std::f64::consts::PI;

use plotters::element::{PathElement, Polygon, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::axis::{Axis, Frame, Scale};
use super::{Canvas, FigureError, GREY, INK, Picture, colour, text};
use crate::identify::time_response::TimeResponse;
use crate::identify::time_response::welch::Line;
use crate::report::numbers::significant;

const WIDTH: i32 = 980;
const LEFT: i32 = 82;
const RIGHT: i32 = WIDTH - 30;
const TOP: i32 = 66;
const GAP: i32 = 30;

/// Heights of the panels: |H|, phase, coherence.
const HEIGHTS: [i32; 3] = [330, 170, 130];

/// Points of the fitted curve.
const CURVE: usize = 1500;

/// Octaves that are drawn on either side of fn, at most.
const OCTAVES: f64 = 2.0;

/// Expanded uncertainty of |H| over its standard uncertainty.
const EXPANDED: f64 = 2.0;

/// Draws H1 with its expanded uncertainty, the fitted structure over it, phase and coherence.
///
/// # Errors
/// The drawing library's error; no line where the base moves.
pub fn draw(found: &TimeResponse) -> Result<Picture, FigureError> {
    let natural = found.fitted.natural_frequency_hz.value;
    let reach = 2f64.powf(OCTAVES);
    let is_near = |line: &&Line| (natural / reach..=natural * reach).contains(&line.frequency_hz);
    let lines: Vec<&Line> = found.spectrum.excited().filter(is_near).collect();
    let (Some(first), Some(last)) = (lines.first(), lines.last()) else {
        return Err(FigureError("the base does not move about the natural frequency".into()));
    };
    let (from, to) = (first.frequency_hz, last.frequency_hz);
    let across = |label: &str| Axis { label: label.into(), from, to, scale: Scale::Linear };
    let frequencies: Vec<f64> = (0..=CURVE).map(|n| from + (to - from) * n as f64 / CURVE as f64).collect();
    let zeta = found.fitted.damping_ratio.value;
    let fitted: Vec<(f64, f64)> = frequencies.iter().map(|f| fitted(*f / natural, zeta)).collect();
    let magnitudes = lines.iter().map(|line| line.magnitude()).chain(fitted.iter().map(|h| h.0));
    let tops = [TOP, TOP + HEIGHTS[0] + GAP, TOP + HEIGHTS[0] + HEIGHTS[1] + 2 * GAP];
    let bounds = |place: usize| (LEFT, tops[place], RIGHT, tops[place] + HEIGHTS[place]);
    let frames = [
        Frame { x: across(""), y: Axis::around("|H| = |X/Z|", Scale::Log, magnitudes), bounds: bounds(0) },
        Frame { x: across(""), y: axis("Phase (°)", -200.0, 20.0), bounds: bounds(1) },
        Frame { x: across("Frequency (Hz)"), y: axis("Coherence γ²", 0.0, 1.05), bounds: bounds(2) },
    ];
    let height = tops[2] + HEIGHTS[2] + 62;
    Picture::draw(WIDTH as u32, height as u32, |canvas| {
        head(canvas, found)?;
        for frame in &frames {
            frame.draw(canvas)?;
            frame.mark_x(canvas, natural, "")?;
        }
        let [magnitude, phase, coherence] = &frames;
        let averages = found.spectrum.averages;
        for line in &lines {
            uncertainty(canvas, magnitude, line, averages)?;
        }
        curve(canvas, magnitude, lines.iter().map(|line| (line.frequency_hz, line.magnitude())), MEASURED, 2)?;
        curve(canvas, magnitude, frequencies.iter().zip(&fitted).map(|(f, h)| (*f, h.0)), model_colour(), 1)?;
        curve(canvas, phase, lines.iter().map(|line| (line.frequency_hz, degrees(line.phase_rad()))), MEASURED, 2)?;
        curve(canvas, phase, frequencies.iter().zip(&fitted).map(|(f, h)| (*f, degrees(h.1))), model_colour(), 1)?;
        curve(canvas, coherence, lines.iter().map(|line| (line.frequency_hz, line.coherence)), MEASURED, 2)
    })
}

const MEASURED: RGBColor = RGBColor(0x00, 0x00, 0x00);

fn model_colour() -> RGBColor {
    colour(5)
}

fn axis(label: &str, from: f64, to: f64) -> Axis {
    Axis { label: label.into(), from, to, scale: Scale::Linear }
}

/// |H| and phase (rad) of the fitted structure at r = f/fn.
fn fitted(r: f64, zeta: f64) -> (f64, f64) {
    let d = 2.0 * zeta * r;
    let stiff = 1.0 - r * r;
    (((1.0 + d * d) / (stiff * stiff + d * d)).sqrt(), d.atan() - d.atan2(stiff))
}

/// A phase between −200° and 160°, so that one at −180° is not torn.
fn degrees(phase_rad: f64) -> f64 {
    let phase = phase_rad * 180.0 / PI;
    if phase > 160.0 { phase - 360.0 } else { phase }
}

fn head(canvas: &Canvas, found: &TimeResponse) -> Result<(), FigureError> {
    let left = |size: f64, tint: RGBColor| text(size, tint).pos(Pos::new(HPos::Left, VPos::Center));
    let (frequency, damping) = (&found.fitted.natural_frequency_hz, &found.fitted.damping_ratio);
    let value = |value: f64, u: f64| format!("{} ± {}", significant(value, 6), significant(EXPANDED * u, 2));
    let title = format!(
        "fn = {} Hz, ζ = {} (fit over time, k = 2)",
        value(frequency.value, frequency.standard_uncertainty),
        value(damping.value, damping.standard_uncertainty)
    );
    canvas.draw(&Text::new(title, (LEFT, 22), left(15.0, INK))).map_err(FigureError::of)?;
    let segments = &found.spectrum.segments;
    let words = format!(
        "H1 by Welch: Hann's window over {} s, overlap {:.0} %, {:.0} averages; bars: ± {EXPANDED} standard uncertainties",
        significant(segments.segment_s, 3),
        100.0 * segments.overlap,
        found.spectrum.averages
    );
    let entries = [(words, MEASURED, 2, LEFT), ("fitted structure".to_string(), model_colour(), 1, LEFT + 680)];
    for (word, tint, width, at) in entries {
        let line = PathElement::new(vec![(at, 45), (at + 24, 45)], tint.stroke_width(width));
        canvas.draw(&line).map_err(FigureError::of)?;
        canvas.draw(&Text::new(word, (at + 32, 45), left(12.0, GREY))).map_err(FigureError::of)?;
    }
    Ok(())
}

/// Draws a curve, cut at the ends of the frame.
fn curve(
    canvas: &Canvas,
    frame: &Frame,
    values: impl Iterator<Item = (f64, f64)>,
    tint: RGBColor,
    width: u32,
) -> Result<(), FigureError> {
    let inside = |(f, value): (f64, f64)| frame.point(f, value.clamp(frame.y.from, frame.y.to));
    let points: Vec<(i32, i32)> = values.filter(|(_, value)| value.is_finite()).map(inside).collect();
    canvas.draw(&PathElement::new(points, tint.stroke_width(width))).map_err(FigureError::of)
}

/// Draws the expanded uncertainty of |H| at a line as a pale bar.
fn uncertainty(canvas: &Canvas, frame: &Frame, line: &Line, averages: f64) -> Result<(), FigureError> {
    let half = (EXPANDED * line.relative_uncertainty(averages)).min(0.99);
    let at = |share: f64| frame.point(line.frequency_hz, (line.magnitude() * share).clamp(frame.y.from, frame.y.to));
    let ((x, low), (_, high)) = (at(1.0 - half), at(1.0 + half));
    let bar = vec![(x - 1, low), (x + 1, low), (x + 1, high), (x - 1, high)];
    canvas.draw(&Polygon::new(bar, colour(2).mix(0.5).filled())).map_err(FigureError::of)
}
