//! Modes of several places: |H| of each over frequency, with the fit.

use super::transfer_function::{LEFT, RIGHT, TOP, WIDTH, curve};
use crate::failure::Failure;
use crate::identify::modes::IdentifiedModes;
use crate::report::numbers::significant;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{INK, colour};
use crate::report::plot::svg::Font;
use crate::report::plot::traces::{Traces, upright};
use crate::report::plot::{Picture, TITLE};

const HEIGHT: f64 = 460.0;

/// Draws the lines of every place, and the fit over them as a thin dark line.
///
/// # Errors
/// Nothing to draw.
pub fn draw(found: &IdentifiedModes) -> Result<Picture, Failure> {
    let places = &found.fit.fitted;
    let [from, to] = found.band_hz;
    if places.is_empty() || from >= to {
        return Err(Failure::undrawn("there are no lines to draw"));
    }
    let sizes = places.iter().flatten().flat_map(|(line, h)| [line.h.norm(), h.norm()]);
    let y = Axis::around("|H| (SI units per N)", Scale::Log, sizes);
    let frame = PlotFrame { x: Axis::between("Frequency (Hz)", from, to), y, bounds: (LEFT, TOP, RIGHT, TOP + HEIGHT) };
    let mut picture = Picture::new(WIDTH, TOP + HEIGHT + 62.0);
    let frequencies: Vec<String> =
        found.modes.iter().map(|mode| significant(mode.natural_frequency_hz.value, 5)).collect();
    picture.text(&format!("Modes at {} Hz", frequencies.join(", ")), (LEFT, 22.0), Font::new(TITLE, INK));
    let mut entries: Vec<LegendEntry> = Vec::new();
    let mut traces = Traces::new(&frame);
    for (place, (own, name)) in places.iter().zip(&found.places).enumerate() {
        let style = colour(place).stroke(2.2);
        entries.push(LegendEntry::line(name.as_str(), style).of_sign());
        curve(&mut traces, &frame, own.iter().map(|(line, _)| (line.frequency_hz, line.h.norm())), style);
    }
    let fit = INK.stroke(0.9);
    for own in places {
        curve(&mut traces, &frame, own.iter().map(|(line, h)| (line.frequency_hz, h.norm())), fit);
    }
    entries.push(LegendEntry::line("fit", fit).of_sign());
    legend::rows(&mut picture, (LEFT, 45.0), RIGHT, &entries);
    let mut inside = upright(&frame, found.modes[0].natural_frequency_hz.value, "");
    for mode in &found.modes[1..] {
        inside.add(&upright(&frame, mode.natural_frequency_hz.value, ""));
    }
    inside.add(&traces.svg());
    picture.panel(&frame, &inside);
    Ok(picture)
}
