//! Draws harmonic force surfaces: the base amplitude Z over frequency for each kept amplitude, and beside it the kept amplitude over
//! frequency at constant Z: whole response curves, unstable parts included.

use super::campaign::shortened;
use crate::campaign::Campaign;
use crate::compare::Continued;
use crate::report::force_surface::ForceSurface;
use crate::report::numbers::{significant, trimmed};
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::palette::{GREY, INK, MARKED, colour, viridis};
use crate::report::plot::svg::{Bounds, Colour, Font, Svg};
use crate::report::plot::traces::{Traces, circle};
use crate::report::plot::{LABEL, Picture, SMALL};

const WIDTH: f64 = 1040.0;
const LEFT: f64 = 82.0;
const PANEL: f64 = 380.0;
/// From the left panel's left edge to that of the right one.
const ACROSS: f64 = 500.0;
const TOP: f64 = 44.0;
const HIGH: f64 = 300.0;
const GAP: f64 = 104.0;
/// Between the names of lines at the right edge of a panel.
const NAME_HEIGHT: f64 = 11.0;

/// Cuts, as multiples of the base amplitude that the set-up states.
const CUTS: [f64; 9] = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0];

/// Of the model's motions.
const CONTINUED_TINT: Colour = colour(1);

/// What the figure shows, for its caption.
pub const CAPTION: &str = "Left: the base amplitude Z that keeps the response at an amplitude, over frequency. Right: the same points as \
    amplitude over frequency, with lines of constant Z: the response curve at that Z, unstable parts included. The dark line is the Z that the set-up \
    states; rings: it turns back in frequency there, and a sweep at that Z jumps. Missing points: not measured, or not held.";

/// What the continued motions behind it are, for its caption.
pub const CONTINUED: &str = "Behind the cuts: the model's periodic motions at the Z that the set-up states (max |x|; unstable ones dashed), as damprig \
    continue follows them.";

/// Dashes of unstable motions.
const UNSTABLE: &str = "5 4";

/// Draws the surfaces from top to bottom, with the model's periodic motions behind the cuts where there are any.
#[must_use]
pub fn draw(campaign: &Campaign, surfaces: &[ForceSurface], continued: &[Continued]) -> Picture {
    let height = TOP + surfaces.len().max(1) as f64 * (HIGH + GAP) - GAP + 64.0;
    let mut picture = Picture::new(WIDTH, height);
    for (surface, place) in surfaces.iter().zip(0u32..) {
        let set_up = &campaign.set_ups[surface.set_up];
        let top = TOP + f64::from(place) * (HIGH + GAP);
        let title = shortened(&format!("{}: {}", set_up.label, surface.experiment));
        picture.text(&title, (LEFT, top - 12.0), Font::new(LABEL + 0.8, INK).above());
        sheets(&mut picture, surface, (LEFT, top, LEFT + PANEL, top + HIGH));
        let bounds = (LEFT + ACROSS, top, LEFT + ACROSS + PANEL, top + HIGH);
        let is_own = |own: &&Continued| own.set_up == set_up.name && own.experiment == surface.experiment;
        // Their max |x| is no amplitude of another quantity.
        let behind = continued.iter().find(is_own).filter(|_| surface.kept.name == "x");
        cuts(&mut picture, surface, set_up.base_amplitude_m, bounds, behind);
    }
    picture
}

fn tint(surface: &ForceSurface, row: usize) -> Colour {
    // The light end of the scale is hardly seen on white.
    viridis(0.9 * row as f64 / (surface.amplitudes.len() - 1).max(1) as f64)
}

/// Measured points: row, frequency and Z.
fn points(surface: &ForceSurface) -> impl Iterator<Item = (usize, f64, f64)> {
    let columns = surface.frequencies_hz.len();
    let all = surface.z_m.iter().enumerate().filter(|(_, z_m)| z_m.is_finite());
    all.map(move |(n, z_m)| (n / columns, surface.frequencies_hz[n % columns], *z_m))
}

/// Z over frequency, a line for each amplitude.
fn sheets(picture: &mut Picture, surface: &ForceSurface, bounds: Bounds) {
    let frame = PlotFrame {
        x: Axis::around("Frequency (Hz)", Scale::Linear, surface.frequencies_hz.iter().copied()),
        y: Axis::around("Base amplitude Z (mm)", Scale::Linear, points(surface).map(|(_, _, z_m)| z_m * 1e3)),
        bounds,
    };
    let mut traces = Traces::new(&frame);
    let columns = surface.frequencies_hz.len();
    for (row, values) in surface.z_m.chunks(columns).enumerate() {
        for part in values.iter().enumerate().collect::<Vec<_>>().split(|(_, z_m)| !z_m.is_finite()) {
            let line = part.iter().map(|(n, z_m)| (surface.frequencies_hz[*n], **z_m * 1e3));
            traces.line(line.clone(), tint(surface, row).stroke(1.4));
            line.for_each(|at| traces.dot(at, 2.0, tint(surface, row)));
        }
    }
    picture.panel(&frame, &traces.svg());
    let ends = surface.z_m.chunks(columns).enumerate().filter_map(|(row, values)| {
        let last = values.iter().rposition(|z_m| z_m.is_finite())?;
        Some((significant(surface.amplitudes[row], 3), frame.point(0.0, values[last] * 1e3).1, tint(surface, row)))
    });
    names(picture, bounds, ends.collect());
    let head = format!("{} ({})", surface.kept.name, surface.kept.unit);
    picture.text(&head, (bounds.2 + 6.0, bounds.1 - 8.0), Font::new(SMALL, GREY).above());
}

/// Kept amplitude over frequency at constant Z.
fn cuts(picture: &mut Picture, surface: &ForceSurface, stated_m: f64, bounds: Bounds, behind: Option<&Continued>) {
    let label = format!("Amplitude of {} ({})", surface.kept.name, surface.kept.unit);
    let orbits = behind.iter().flat_map(|own| &own.branches).flat_map(|branch| &branch.orbits);
    let of_model = orbits.map(|orbit| orbit.max_abs_x_m * 1e3);
    let frame = PlotFrame {
        x: Axis::around("Frequency (Hz)", Scale::Linear, surface.frequencies_hz.iter().copied()),
        y: Axis::around(label, Scale::Linear, surface.amplitudes.iter().copied().chain(of_model)),
        bounds,
    };
    let mut inside = Svg::default();
    let mut traces = Traces::new(&frame);
    for branch in behind.iter().flat_map(|own| &own.branches) {
        for part in branch.orbits.chunk_by(|a, b| a.is_stable == b.is_stable) {
            let style = CONTINUED_TINT.stroke(4.0);
            let style = if part[0].is_stable { style } else { style.dashed(UNSTABLE) };
            traces.history(
                &part.iter().map(|orbit| (orbit.parameter, orbit.max_abs_x_m * 1e3)).collect::<Vec<_>>(),
                style,
            );
        }
    }
    points(surface).for_each(|(row, f, _)| traces.dot((f, surface.amplitudes[row]), 1.6, tint(surface, row)));
    let mut names = Svg::default();
    for share in CUTS {
        let z_m = share * stated_m;
        let lines = surface.cut(z_m);
        let style = if share == 1.0 { INK.stroke(2.2) } else { GREY.stroke(1.1) };
        for line in &lines {
            traces.line(line.iter().copied(), style);
        }
        for line in lines {
            let end = line.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((f, amplitude)) = end {
                let (x, y) = frame.point(f, amplitude);
                names.text(&trimmed(z_m * 1e3, 3), (x, y - 5.0), Font::new(SMALL, INK).centred().above());
            }
        }
    }
    inside.add(&traces.svg());
    inside.add(&names);
    for fold in surface.folds(stated_m) {
        let (x, y) = frame.point(fold.frequency_hz, fold.amplitude);
        inside.at((x, y), &circle(5.0, MARKED.stroke(1.8)));
        let font = Font::new(SMALL, INK);
        let (at, font) = if fold.is_highest { ((x + 9.0, y), font) } else { ((x - 9.0, y), font.ending()) };
        inside.text(&format!("{} Hz", trimmed(fold.frequency_hz, 3)), at, font);
    }
    picture.panel(&frame, &inside);
    picture.text("Lines of constant Z (mm)", (bounds.0, bounds.1 - 12.0), Font::new(LABEL + 0.8, INK).above());
}

/// Names of lines beside the right edge, at their ends; where they would overlap they move down, and above the lower edge up.
fn names(picture: &mut Picture, (_, _, right, bottom): Bounds, mut ends: Vec<(String, f64, Colour)>) {
    ends.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut below = f64::NEG_INFINITY;
    for (_, y, _) in &mut ends {
        *y = y.max(below);
        below = *y + NAME_HEIGHT;
    }
    let mut above = bottom;
    for (_, y, _) in ends.iter_mut().rev() {
        *y = y.min(above);
        above = *y - NAME_HEIGHT;
    }
    for (name, y, tint) in ends {
        picture.text(&name, (right + 6.0, y), Font::new(SMALL, tint));
    }
}

/// The folds at the stated base amplitude in words, a line for each surface that has one.
#[must_use]
pub fn folds(campaign: &Campaign, surfaces: &[ForceSurface]) -> Vec<String> {
    let line = |surface: &ForceSurface| {
        let set_up = &campaign.set_ups[surface.set_up];
        let folds = surface.folds(set_up.base_amplitude_m);
        let each = folds.iter().map(|fold| {
            let (f, amplitude) = (trimmed(fold.frequency_hz, 4), significant(fold.amplitude, 3));
            format!("{f} Hz ({} {amplitude} {})", surface.kept.name, surface.kept.unit)
        });
        let each: Vec<String> = each.collect();
        (!each.is_empty()).then(|| {
            let z = trimmed(set_up.base_amplitude_m * 1e3, 3);
            format!(
                "{}, {}: at Z = {z} mm the response turns back at {}.",
                set_up.label,
                surface.experiment,
                each.join(", ")
            )
        })
    };
    surfaces.iter().filter_map(line).collect()
}

/// The folds measured at the stated base amplitude and those of the model's motions, a line for each surface.
#[must_use]
pub fn folds_compared(campaign: &Campaign, surfaces: &[ForceSurface], continued: &[Continued]) -> Vec<String> {
    let listed = |folds: Vec<f64>| {
        let all: Vec<String> = folds.into_iter().map(|f| format!("{} Hz", trimmed(f, 4))).collect();
        if all.is_empty() { "none".to_string() } else { all.join(", ") }
    };
    let line = |surface: &ForceSurface| {
        let set_up = &campaign.set_ups[surface.set_up];
        let own = continued.iter().find(|own| own.set_up == set_up.name && own.experiment == surface.experiment)?;
        let z = trimmed(own.base_amplitude_m * 1e3, 3);
        let measured = listed(surface.folds(own.base_amplitude_m).iter().map(|fold| fold.frequency_hz).collect());
        let of_model = match &own.without {
            Some(why) => format!("no periodic motion of the model was found ({why})"),
            None => format!("of the model: {}", listed(own.folds().map(|(f, _)| f).collect())),
        };
        Some(format!("{}, {}: folds at Z = {z} mm, measured: {measured}; {of_model}", set_up.name, surface.experiment))
    };
    surfaces.iter().filter_map(line).collect()
}
