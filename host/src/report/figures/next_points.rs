//! What one more point narrows, over its frequency on each set-up, with the points that were chosen.

use crate::failure::Failure;
use crate::identify::next::{GainCurve, NextPoints};
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{Arrangement, LegendEntry, column};
use crate::report::plot::palette::{INK, Look};
use crate::report::plot::svg::Font;
use crate::report::plot::traces::{Traces, marker};
use crate::report::plot::{Breadth, LABEL, Picture};

/// Draws the uncertainty after each point alone over that before, with the numbers of the chosen points.
///
/// # Errors
/// No point.
pub fn draw(next: &NextPoints) -> Result<Picture, Failure> {
    let all = || next.gains.iter().flat_map(|gain| &gain.points);
    if all().all(|(_, share)| share.is_none()) {
        return Err(Failure::undrawn("there is no point to measure"));
    }
    let look = |set_up| Look { set_up, run: 0 };
    let entry = |(n, gain): (usize, &GainCurve)| {
        LegendEntry::line(gain.label.clone(), look(n).line(2.0)).with_detail(gain.set_up.clone())
    };
    let is_drawn = |(_, gain): &(usize, &GainCurve)| gain.points.iter().any(|(_, share)| share.is_some());
    let entries: Vec<LegendEntry> = next.gains.iter().enumerate().filter(is_drawn).map(entry).collect();
    let parts = Arrangement::of(Breadth::Broad, (92.0, 30.0), &entries, 0.0);
    let of = next.key.as_deref().unwrap_or("all parameters");
    let frame = PlotFrame {
        x: Axis::around("Frequency (Hz)", Scale::Linear, all().map(|(hz, _)| *hz)),
        y: Axis::around(
            format!("Uncertainty of {of} after one point, of that before"),
            Scale::Linear,
            all().filter_map(|(_, share)| *share).chain([1.0]),
        ),
        bounds: parts.bounds,
    };
    let mut traces = Traces::new(&frame);
    for (n, gain) in next.gains.iter().enumerate() {
        // A point that cannot be measured interrupts the curve.
        for run in gain.points.split(|(_, share)| share.is_none()) {
            traces.line(run.iter().filter_map(|(hz, share)| Some((*hz, (*share)?))), look(n).line(1.8));
        }
    }
    for (number, point) in (1..).zip(&next.points) {
        let Some((n, gain)) = next.gains.iter().enumerate().find(|(_, gain)| gain.set_up == point.set_up) else {
            continue;
        };
        let Some((hz, Some(share))) = gain.points.iter().find(|(hz, _)| *hz == point.frequency_hz) else { continue };
        let mut sign = marker(look(n), true);
        sign.text(&number.to_string(), (9.0, 0.0), Font::new(LABEL, INK));
        traces.mark((*hz, *share), &sign);
    }
    let mut picture = parts.picture();
    picture.panel(&frame, &traces.svg());
    column(&mut picture, parts.legend, &entries);
    Ok(picture)
}
