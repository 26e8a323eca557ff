//! Draws a simulated motion: displacements of structure, particle and base over time, walls and impacts.
//!
//! A long run has two panels: the whole run and its last cycles.

use damprig_core::integrator::exact::Excitation;

use crate::failure::Failure;
use crate::motion_record::RecordQuantity;
use crate::report::describe;
use crate::report::plot::axis::{Axis, PlotFrame, Scale, length_unit};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{INK, MARKED, WALL, colour};
use crate::report::plot::svg::{Bounds, Colour, Font};
pub use crate::report::plot::traces::COLUMNS;
use crate::report::plot::traces::{Traces, impact};
use crate::report::plot::{Picture, TITLE};
use crate::simulation::Case;
use crate::simulation::envelope::{Envelope, EnvelopeColumn, ValueRange};

/// Labels of the figure.
#[derive(Clone, Debug, Default, PartialEq)]
struct MotionNotes {
    /// Clearance d, m, if there are walls.
    /// y − x at the walls, m.
    walls_m: Option<[f64; 2]>,
    /// Name of the second mass.
    second_mass: Option<&'static str>,
    /// Whether the base moves.
    base_moves: bool,
    /// Title above the axes.
    title: String,
}

const WIDTH: f64 = 1040.0;
const LEFT: f64 = 82.0;
const TOP: f64 = 46.0;
const PANEL: f64 = 300.0;
const SINGLE: f64 = 420.0;
const GAP: f64 = 76.0;

/// The structure, the second mass, the base.
const X: Colour = colour(0);
const Y: Colour = colour(3);
const Z: Colour = colour(6);

/// Cycles above which a figure shows the last ones in a panel of their own.
const LONG_CYCLES: f64 = 30.0;

/// Cycles in that panel.
const LAST_CYCLES: f64 = 10.0;

/// Whether the base drifts, as that of an uncorrected acceleration record does: x and y are then drawn relative to it.
fn drifts(case: &Case) -> bool {
    case.record.as_ref().is_some_and(|record| record.quantity == RecordQuantity::Acceleration)
}

/// The envelope that draws a case between two times, s, in so many columns.
#[must_use]
pub fn envelope(case: &Case, from_s: f64, to_s: f64, columns: usize) -> Envelope {
    let envelope = Envelope::new(from_s, to_s, columns);
    if drifts(case) { envelope.relative_to_base() } else { envelope }
}

/// What is drawn of a case unless a window is asked for: the whole run, and the last cycles of a long one.
#[must_use]
pub fn usual_envelopes(case: &Case) -> (Option<Envelope>, Option<Envelope>) {
    let duration_s = case.run.duration_s;
    let is_long = !drifts(case) && duration_s > LONG_CYCLES * case.cycle_s();
    let last = is_long.then(|| envelope(case, duration_s - LAST_CYCLES * case.cycle_s(), duration_s, COLUMNS));
    (Some(envelope(case, 0.0, duration_s, COLUMNS)), last)
}

/// Draws a simulated case: the whole run, the last cycles, or both.
///
/// # Errors
/// A run stopped before the drawn time.
pub fn of_case(case: &Case, whole: Option<&Envelope>, last: Option<&Envelope>) -> Result<Picture, Failure> {
    let envelopes: Vec<&Envelope> = [whole, last].into_iter().flatten().filter(|o| !o.is_empty()).collect();
    if envelopes.is_empty() {
        return Err(Failure::undrawn("the run was stopped before the start of the drawn time"));
    }
    let set_up = &case.set_up;
    let second_mass = match (set_up.particle, set_up.tmd, &case.many_particles) {
        (Some(_), ..) => Some("particle"),
        (None, Some(_), _) => Some("tuned mass"),
        (None, None, Some(_)) => Some("spheres, mean"),
        (None, None, None) => None,
    };
    let base_moves = envelopes.iter().all(|o| !o.is_relative()) && case.record.is_some()
        || matches!(
            case.excitation,
            Excitation::Sine { .. } | Excitation::HalfSine { .. } | Excitation::Versine { .. }
        );
    let notes = MotionNotes {
        walls_m: set_up.particle.map(|p| p.ends_m()),
        second_mass,
        base_moves,
        title: format!("{}: {}", case.name, describe::excitation(case)),
    };
    Ok(draw(&envelopes, &notes))
}

/// Draws one panel per envelope, from top to bottom.
fn draw(envelopes: &[&Envelope], notes: &MotionNotes) -> Picture {
    let panels = envelopes.len().max(1) as f64;
    let right = LEFT + COLUMNS as f64;
    let high = if panels == 1.0 { SINGLE } else { PANEL };
    let mut picture = Picture::new(WIDTH, TOP + panels * (high + GAP) - GAP + 64.0);
    picture.text(&notes.title, (LEFT, 22.0), Font::new(TITLE, INK));
    for (envelope, place) in envelopes.iter().zip(0u8..) {
        let top = TOP + f64::from(place) * (high + GAP);
        panel(&mut picture, envelope, notes, (LEFT, top, right, top + high));
    }
    legend::column(&mut picture, (right + 20.0, TOP + 8.0), &entries(notes, envelopes));
    picture
}

/// Draws a window of the run.
fn panel(picture: &mut Picture, envelope: &Envelope, notes: &MotionNotes, bounds: Bounds) {
    let walls_m = notes.walls_m.unwrap_or_default();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut hold = |stretch: Option<ValueRange>, beside: [f64; 2]| {
        if let Some(s) = stretch {
            low = low.min(s.low.1 + beside[0].min(0.0));
            high = high.max(s.high.1 + beside[1].max(0.0));
        }
    };
    for column in envelope.columns() {
        hold(column.x_m, walls_m);
        hold(column.z_m, [0.0; 2]);
        if notes.second_mass.is_some() {
            hold(column.y_m, [0.0; 2]);
        }
    }
    let (name, scale) = length_unit(low.abs().max(high.abs()));
    let (from, to) = envelope.window_s();
    let relative = if envelope.is_relative() { " relative to the base" } else { "" };
    let frame = PlotFrame {
        x: Axis::between("Time (s)", from, to),
        y: Axis::around(format!("Displacement{relative} ({name})"), Scale::Linear, [low * scale, high * scale]),
        bounds,
    };
    let mut traces = Traces::new(&frame);
    let mut curve = |of: fn(&EnvelopeColumn) -> Option<ValueRange>, beside: f64, (tint, width): (Colour, f64)| {
        let points = envelope.columns().iter().filter_map(of).flat_map(|s| s.in_order());
        traces.line(points.map(|(t_s, value)| (t_s, (value + beside) * scale)), tint.stroke(width));
    };
    if notes.walls_m.is_some() {
        [walls_m[1], walls_m[0]].into_iter().for_each(|beside| curve(|c| c.x_m, beside, (WALL, 1.0)));
    }
    if notes.base_moves {
        curve(|c| c.z_m, 0.0, (Z, 1.2));
    }
    if notes.second_mass.is_some() {
        curve(|c| c.y_m, 0.0, (Y, 1.2));
    }
    curve(|c| c.x_m, 0.0, (X, 1.8));
    for column in envelope.columns() {
        let sided = column.impacts.iter().zip([-1, 1]);
        let impacts = sided.filter_map(|(impact, side)| impact.map(|(t_s, y_m)| (t_s, y_m * scale, side)));
        traces.impacts(impacts, MARKED);
    }
    picture.panel(&frame, &traces.svg());
}

fn entries(notes: &MotionNotes, envelopes: &[&Envelope]) -> Vec<LegendEntry> {
    let less = if envelopes.iter().any(|o| o.is_relative()) { " − z" } else { "" };
    let mut entries = vec![LegendEntry::line(format!("x{less} structure"), X.stroke(2.0))];
    entries.extend(notes.second_mass.map(|word| LegendEntry::line(format!("y{less} {word}"), Y.stroke(1.2))));
    entries.extend(notes.base_moves.then(|| LegendEntry::line("z base", Z.stroke(1.2))));
    if notes.walls_m.is_some() {
        entries.push(LegendEntry::line("walls, ± d", WALL.stroke(1.0)));
        if envelopes.iter().any(|o| o.impacts() > 0) {
            entries.push(LegendEntry::mark("impact", &impact(1, MARKED)));
        }
    }
    entries
}
