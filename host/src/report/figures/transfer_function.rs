//! The transfer function from base to structure: |H|, phase and coherence over frequency, with the fitted structure.

use std::f64::consts::PI;

use crate::failure::Failure;
use crate::identify::time_response::TimeResponse;
use crate::identify::time_response::welch::SpectralLine;
use crate::report::numbers::significant;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{INK, colour};
use crate::report::plot::svg::{Font, Style};
use crate::report::plot::traces::{Traces, upright};
use crate::report::plot::{Picture, TITLE};

pub(super) const WIDTH: f64 = 980.0;
pub(super) const LEFT: f64 = 82.0;
pub(super) const RIGHT: f64 = WIDTH - 30.0;
pub(super) const TOP: f64 = 66.0;
pub(super) const GAP: f64 = 30.0;

/// Heights of the panels: |H|, phase, coherence.
const HEIGHTS: [f64; 3] = [330.0, 170.0, 130.0];

/// Points of the fitted curve.
pub(super) const CURVE: usize = 1500;

/// Octaves that are drawn on either side of fn, at most.
const OCTAVES: f64 = 2.0;

/// Expanded uncertainty of |H| over its standard uncertainty.
const EXPANDED: f64 = 2.0;

/// Draws H1 with its expanded uncertainty, the fitted structure over it, phase and coherence.
///
/// # Errors
/// No line where the base moves.
pub fn draw(found: &TimeResponse) -> Result<Picture, Failure> {
    let natural = found.fitted.natural_frequency_hz.value;
    let reach = 2f64.powf(OCTAVES);
    let is_near = |line: &&SpectralLine| (natural / reach..=natural * reach).contains(&line.frequency_hz);
    let lines: Vec<&SpectralLine> = found.spectrum.excited().filter(is_near).collect();
    let (Some(first), Some(last)) = (lines.first(), lines.last()) else {
        return Err(Failure::undrawn("the base does not move about the natural frequency"));
    };
    let (from, to) = (first.frequency_hz, last.frequency_hz);
    let across = |label: &str| Axis::between(label, from, to);
    let frequencies: Vec<f64> = (0..=CURVE).map(|n| from + (to - from) * n as f64 / CURVE as f64).collect();
    let zeta = found.fitted.damping_ratio.value;
    let fitted: Vec<(f64, f64)> = frequencies.iter().map(|f| fitted(*f / natural, zeta)).collect();
    let magnitudes = lines.iter().map(|line| line.magnitude()).chain(fitted.iter().map(|h| h.0));
    let magnitude = Axis::around("|H| = |X/Z|", Scale::Log, magnitudes);
    let axes = [
        (across(""), magnitude),
        (across(""), Axis::between("Phase (°)", -200.0, 20.0)),
        (across("Frequency (Hz)"), Axis::between("Coherence γ²", 0.0, 1.05)),
    ];
    let measured: [fn(&SpectralLine) -> f64; 3] =
        [SpectralLine::magnitude, |line| degrees(line.phase_rad()), |line| line.coherence];
    let mut picture = Picture::new(WIDTH, TOP + HEIGHTS.iter().sum::<f64>() + 2.0 * GAP + 62.0);
    head(&mut picture, found);
    let mut top = TOP;
    for (place, ((x, y), value)) in axes.into_iter().zip(measured).enumerate() {
        let frame = PlotFrame { x, y, bounds: (LEFT, top, RIGHT, top + HEIGHTS[place]) };
        top += HEIGHTS[place] + GAP;
        let mut traces = Traces::new(&frame);
        if place == 0 {
            lines.iter().for_each(|line| uncertainty(&mut traces, &frame, line, found.spectrum.averages));
        }
        curve(&mut traces, &frame, lines.iter().map(|line| (line.frequency_hz, value(line))), MEASURED);
        let model = |(f, h): (&f64, &(f64, f64))| (*f, if place == 0 { h.0 } else { degrees(h.1) });
        if place < 2 {
            curve(&mut traces, &frame, frequencies.iter().zip(&fitted).map(model), MODEL);
        }
        let mut inside = upright(&frame, natural, "");
        inside.add(&traces.svg());
        picture.panel(&frame, &inside);
    }
    Ok(picture)
}

pub(super) const MEASURED: Style = colour(0).stroke(2.0);
pub(super) const MODEL: Style = colour(5).stroke(1.0);

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

fn head(picture: &mut Picture, found: &TimeResponse) {
    let (frequency, damping) = (&found.fitted.natural_frequency_hz, &found.fitted.damping_ratio);
    let value = |value: f64, u: f64| format!("{} ± {}", significant(value, 6), significant(EXPANDED * u, 2));
    let title = format!(
        "fn = {} Hz, ζ = {} (fit over time, k = 2)",
        value(frequency.value, frequency.standard_uncertainty),
        value(damping.value, damping.standard_uncertainty)
    );
    picture.text(&title, (LEFT, 22.0), Font::new(TITLE, INK));
    let segments = &found.spectrum.segments;
    let words = format!(
        "H1 by Welch: Hann's window over {} s, overlap {:.0} %, {:.0} averages; bars: ± {EXPANDED} standard uncertainties",
        significant(segments.segment_s, 3),
        100.0 * segments.overlap,
        found.spectrum.averages
    );
    let entries = [LegendEntry::line(words, MEASURED), LegendEntry::line("fitted structure", MODEL)];
    legend::rows(picture, (LEFT, 45.0), RIGHT, &entries.map(LegendEntry::of_sign));
}

/// Draws a curve, cut at the ends of the frame.
pub(super) fn curve(traces: &mut Traces, frame: &PlotFrame, values: impl Iterator<Item = (f64, f64)>, style: Style) {
    let inside = |(f, value): (f64, f64)| (f, value.clamp(frame.y.from, frame.y.to));
    traces.line(values.filter(|(_, value)| value.is_finite()).map(inside), style);
}

/// Draws the expanded uncertainty of |H| at a line as a pale bar.
fn uncertainty(traces: &mut Traces, frame: &PlotFrame, line: &SpectralLine, averages: f64) {
    let half = (EXPANDED * line.relative_uncertainty(averages)).min(0.99);
    let end = |share: f64| (line.frequency_hz, (line.magnitude() * share).clamp(frame.y.from, frame.y.to));
    traces.line([end(1.0 - half), end(1.0 + half)], colour(2).stroke(2.0).opacity(0.5));
}
