//! The signals of a measured file: the lowest and highest value of each part, a panel for each signal.

use crate::failure::Failure;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::palette::colour;
use crate::report::plot::traces::Traces;
use crate::report::plot::{BROAD, Picture};
use crate::signal_file::overview::{Overview, OverviewAxis, SignalOverview};

/// Signals that are drawn.
const MAX_PANELS: usize = 8;

const LEFT: f64 = 100.0;
const TOP: f64 = 20.0;
const TALL: f64 = 150.0;
const GAP: f64 = 64.0;

/// Draws the first signals of a file.
///
/// # Errors
/// There is no signal.
pub fn draw(overview: &Overview) -> Result<Picture, Failure> {
    let drawn = &overview.signals[..overview.signals.len().min(MAX_PANELS)];
    if drawn.is_empty() {
        return Err(Failure::undrawn("there is no signal in the file"));
    }
    let mut picture = Picture::new(BROAD, TOP + drawn.len() as f64 * (TALL + GAP) + 10.0);
    for (n, signal) in drawn.iter().enumerate() {
        let top = TOP + n as f64 * (TALL + GAP);
        let ends = || signal.envelope.iter().flat_map(|part| [(part.at, part.min), (part.at, part.max)]);
        let frame = PlotFrame {
            x: Axis::tight(across(signal), ends().map(|end| end.0)),
            y: Axis::around(label(n + 1, signal), scale(signal), ends().map(|end| end.1)),
            bounds: (LEFT, top, BROAD - 24.0, top + TALL),
        };
        let mut traces = Traces::new(&frame);
        traces.line(ends().filter(|(x, y)| frame.draws(*x, *y)), colour(n).stroke(1.0));
        picture.panel(&frame, &traces.svg());
    }
    let left_out = overview.signals.len() - drawn.len();
    picture.note(LEFT, (left_out > 0).then(|| format!("{left_out} more signals are not drawn")).as_deref());
    Ok(picture)
}

fn across(signal: &SignalOverview) -> &'static str {
    match signal.places {
        OverviewAxis::Time { .. } => "Time (s)",
        OverviewAxis::Frequency { .. } => "Frequency (Hz)",
        OverviewAxis::Unknown(_) => "Number of the value",
    }
}

fn label(number: usize, signal: &SignalOverview) -> String {
    let unit = if signal.unit_text.is_empty() { String::new() } else { format!(" ({})", signal.unit_text) };
    let name: String = signal.name.chars().take(18).collect();
    let magnitude = if signal.is_complex { "|" } else { "" };
    format!("#{number} {magnitude}{name}{magnitude}{unit}")
}

/// Magnitudes of a frequency response span decades.
fn scale(signal: &SignalOverview) -> Scale {
    if signal.is_complex && signal.min > 0.0 { Scale::Log } else { Scale::Linear }
}
