//! Draws tracked resonances: frequency and equivalent damping ratio over the amplitude of x.

use super::campaign::shortened;
use crate::campaign::Campaign;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{Look, colour};
use crate::report::plot::traces::{Traces, marker};
use crate::report::plot::{BROAD, Picture};
use crate::report::resonance::{AtResonance, TrackedCurve, TrackedPoint};

const LEFT: f64 = 92.0;
const RIGHT: f64 = BROAD - 24.0;
const TALL: f64 = 210.0;
const GAP: f64 = 70.0;
/// Height of a row of the legend.
const ROW: f64 = 26.0;

/// What the figure shows, for its caption.
pub const CAPTION: &str = "The resonance over the amplitude of x at the drive frequency (backbone). Above: the frequency of the drive at which x has the phase that is kept. \
    Below: the damping ratio of the linear structure that would respond so. Bars: 95 % intervals, without the sensors' scales. Lines: predicted from the \
    set-up's model, on a base that moves as demanded. Hollow: the phase or the amplitude is not as asked for, or the motion not steady.";

/// Draws them in one picture.
#[must_use]
pub fn draw(campaign: &Campaign, curves: &[TrackedCurve]) -> Picture {
    let shown = |of: fn(&TrackedPoint) -> f64| -> Vec<f64> {
        let all = curves.iter().flat_map(|curve| curve.measured.iter().chain(&curve.predicted));
        all.map(of).filter(|value| value.is_finite()).collect()
    };
    // The legend has up to three entries in a row.
    let top = 22.0 + ROW * curves.len().div_ceil(3) as f64;
    let frame = |y: Axis, top: f64| PlotFrame {
        x: Axis::around("Amplitude of x (mm)", Scale::Linear, shown(|point| point.x_m * 1e3)),
        y,
        bounds: (LEFT, top, RIGHT, top + TALL),
    };
    let of_bars = |low: fn(&TrackedPoint) -> f64, high: fn(&TrackedPoint) -> f64| [shown(low), shown(high)].concat();
    let mut frequencies = shown(|point| point.frequency_hz);
    frequencies.extend(of_bars(
        |point| point.frequency_hz - point.frequency_95_hz,
        |point| point.frequency_hz + point.frequency_95_hz,
    ));
    let mut ratios = shown(|point| point.damping_ratio);
    ratios.extend(of_bars(
        |point| point.damping_ratio - point.damping_ratio_95,
        |point| point.damping_ratio + point.damping_ratio_95,
    ));
    ratios.retain(|ratio| *ratio > 0.0);
    let upper = frame(Axis::around("Drive frequency (Hz)", Scale::Linear, frequencies), top);
    let lower = frame(Axis::around("Equivalent damping ratio", Scale::Log, ratios), top + TALL + GAP);
    let (mut above, mut below) = (Traces::new(&upper), Traces::new(&lower));
    let mut entries = Vec::new();
    for curve in curves {
        let own = colour(curve.set_up);
        let of_model = |of: fn(&TrackedPoint) -> f64| -> Vec<(f64, f64)> {
            curve.predicted.iter().map(|point| (point.x_m * 1e3, of(point))).collect()
        };
        above.history(&of_model(|point| point.frequency_hz), own.stroke(1.2));
        below.history(&of_model(|point| point.damping_ratio), own.stroke(1.2));
        for point in &curve.measured {
            let mm = point.x_m * 1e3;
            for (traces, value, half) in [
                (&mut above, point.frequency_hz, point.frequency_95_hz),
                (&mut below, point.damping_ratio, point.damping_ratio_95),
            ] {
                if half.is_finite() && value > 0.0 {
                    // On the logarithmic axis a bar ends above 0.
                    let low = (value - half).max(0.02 * value);
                    traces.line([(mm, low), (mm, value + half)], own.stroke(1.5));
                }
            }
            mark(&mut above, (mm, point.frequency_hz), point.found, curve.set_up);
            mark(&mut below, (mm, point.damping_ratio), point.found, curve.set_up);
        }
        let name = shortened(&format!("{}: {}", campaign.set_ups[curve.set_up].label, curve.experiment));
        entries.push(LegendEntry::mark(name, &marker(Look { set_up: curve.set_up, run: 0 }, true)));
    }
    let mut picture = Picture::new(BROAD, top + 2.0 * TALL + GAP + 60.0);
    picture.panel(&upper, &above.svg());
    picture.panel(&lower, &below.svg());
    legend::rows(&mut picture, (LEFT, 20.0), RIGHT, &entries);
    picture
}

fn mark(traces: &mut Traces, at: (f64, f64), found: AtResonance, set_up: usize) {
    traces.mark(at, &marker(Look { set_up, run: 0 }, found == AtResonance::Yes));
}
