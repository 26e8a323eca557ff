//! Draws tracked resonances: frequency and equivalent damping ratio over the amplitude of x.

use super::campaign::shortened;
use crate::campaign::Campaign;
use crate::report::plot::axis::{Axis, Frame, Scale};
use crate::report::plot::legend::{self, Entry};
use crate::report::plot::palette::{Look, colour};
use crate::report::plot::traces::{Traces, marker};
use crate::report::plot::{BROAD, Picture};
use crate::report::resonance::{Found, TrackedCurve, TrackedPoint};

const LEFT: f64 = 92.0;
const RIGHT: f64 = BROAD - 24.0;
const TALL: f64 = 210.0;
const GAP: f64 = 70.0;
/// Height of a row of the legend.
const ROW: f64 = 26.0;

/// What the figure shows, for its caption.
pub const CAPTION: &str = "The resonance over the amplitude of x at the drive frequency (backbone). Above: the frequency at which x has the phase that is kept. Below: \
    the damping ratio of the linear structure that would respond so; bars: 95 % interval, without the sensors' scales. Lines: predicted from the \
    set-up's model. Hollow: the phase or the amplitude is not as asked for.";

/// Draws them in one picture.
#[must_use]
pub fn draw(campaign: &Campaign, curves: &[TrackedCurve]) -> Picture {
    let shown = |of: fn(&TrackedPoint) -> f64| -> Vec<f64> {
        let all = curves.iter().flat_map(|curve| curve.measured.iter().chain(&curve.predicted));
        all.map(of).filter(|value| value.is_finite()).collect()
    };
    // The legend has up to three entries in a row.
    let top = 22.0 + ROW * curves.len().div_ceil(3) as f64;
    let frame = |label: &'static str, of: fn(&TrackedPoint) -> f64, top: f64| Frame {
        x: Axis::around("Amplitude of x (mm)", Scale::Linear, shown(|point| point.x_m * 1e3).into_iter().chain([0.0])),
        y: Axis::around(label, Scale::Linear, shown(of)),
        bounds: (LEFT, top, RIGHT, top + TALL),
    };
    let upper = frame("Frequency (Hz)", |point| point.frequency_hz, top);
    let lower = frame("Equivalent damping ratio", |point| point.damping_ratio, top + TALL + GAP);
    let (mut above, mut below) = (Traces::new(&upper), Traces::new(&lower));
    let mut entries = Vec::new();
    for curve in curves {
        let own = colour(curve.set_up);
        let of_model = |of: fn(&TrackedPoint) -> f64| -> Vec<(f64, f64)> {
            let mut line: Vec<(f64, f64)> = curve.predicted.iter().map(|point| (point.x_m * 1e3, of(point))).collect();
            line.sort_by(|a, b| a.0.total_cmp(&b.0));
            line
        };
        above.history(&of_model(|point| point.frequency_hz), own.stroke(1.2));
        below.history(&of_model(|point| point.damping_ratio), own.stroke(1.2));
        for point in &curve.measured {
            let mm = point.x_m * 1e3;
            for (traces, value, half) in [
                (&mut above, point.frequency_hz, point.frequency_95_hz),
                (&mut below, point.damping_ratio, point.damping_ratio_95),
            ] {
                if half.is_finite() {
                    traces.line([(mm, value - half), (mm, value + half)], own.stroke(1.5));
                }
            }
            mark(&mut above, (mm, point.frequency_hz), point.found, curve.set_up);
            mark(&mut below, (mm, point.damping_ratio), point.found, curve.set_up);
        }
        let name = shortened(&format!("{}: {}", campaign.set_ups[curve.set_up].label, curve.experiment));
        entries.push(Entry::mark(name, &marker(Look { set_up: curve.set_up, run: 0 }, true)));
    }
    let mut picture = Picture::new(BROAD, top + 2.0 * TALL + GAP + 60.0);
    picture.panel(&upper, &above.svg());
    picture.panel(&lower, &below.svg());
    legend::rows(&mut picture, (LEFT, 20.0), RIGHT, &entries);
    picture
}

fn mark(traces: &mut Traces, at: (f64, f64), found: Found, set_up: usize) {
    traces.mark(at, &marker(Look { set_up, run: 0 }, found == Found::Yes));
}
