//! Draws a simulated motion: displacements of structure, particle and base over time, walls and impacts.
//!
//! A long run has two panels: the whole run and its last cycles.

use plotters::element::{PathElement, Polygon, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::axis::{Axis, Frame, Scale};
use super::{Canvas, FINE, FigureError, INK, Picture, colour, text};
use damprig_core::integrator::exact::Excitation;

use crate::motion_record::Quantity;
use crate::report::describe;
use crate::simulation::Case;
use crate::simulation::envelope::{Envelope, EnvelopeColumn, ValueRange};

/// Columns of a panel, one per point of its width.
pub const COLUMNS: usize = 760;

/// Labels of the figure.
#[derive(Clone, Debug, Default, PartialEq)]
struct MotionNotes {
    /// Clearance d, m, if there are walls.
    clearance_m: Option<f64>,
    /// Name of the second mass.
    second_mass: Option<&'static str>,
    /// Whether the base moves.
    base_moves: bool,
    /// Title above the axes.
    title: String,
}

const WIDTH: i32 = 1040;
const LEFT: i32 = 82;
const TOP: i32 = 46;
const PANEL: i32 = 300;
const SINGLE: i32 = 420;
const GAP: i32 = 76;
const LINE: i32 = 24;

fn x_colour() -> RGBColor {
    colour(0)
}

fn y_colour() -> RGBColor {
    colour(3)
}

fn z_colour() -> RGBColor {
    colour(6)
}

fn impact_colour() -> RGBColor {
    colour(5)
}

const WALL: RGBColor = RGBColor(0xaa, 0xaa, 0xaa);

/// Cycles above which a figure shows the last ones in a panel of their own.
const LONG_CYCLES: f64 = 30.0;

/// Cycles in that panel.
const LAST_CYCLES: f64 = 10.0;

/// Whether the base drifts, as that of an uncorrected acceleration record does: x and y are then drawn relative to it.
fn drifts(case: &Case) -> bool {
    case.record.as_ref().is_some_and(|record| record.quantity == Quantity::Acceleration)
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
/// The drawing library's error; a run stopped before the drawn time.
pub fn of_case(case: &Case, whole: Option<&Envelope>, last: Option<&Envelope>) -> Result<Picture, FigureError> {
    let envelopes: Vec<&Envelope> = [whole, last].into_iter().flatten().filter(|o| !o.is_empty()).collect();
    if envelopes.is_empty() {
        return Err(FigureError("the run was stopped before the start of the drawn time".into()));
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
        clearance_m: set_up.particle.map(|p| p.clearance_m),
        second_mass,
        base_moves,
        title: format!("{}: {}", case.name, describe::excitation(case)),
    };
    draw(&envelopes, &notes)
}

/// Draws one panel per envelope, from top to bottom.
fn draw(envelopes: &[&Envelope], notes: &MotionNotes) -> Result<Picture, FigureError> {
    let panels = i32::try_from(envelopes.len()).unwrap_or(1).max(1);
    let right = LEFT + COLUMNS as i32;
    let high = if panels == 1 { SINGLE } else { PANEL };
    let height = TOP + panels * high + (panels - 1) * GAP + 64;
    let panels: Vec<MotionPanel> = envelopes
        .iter()
        .zip(0..)
        .map(|(envelope, place)| {
            let top = TOP + place * (high + GAP);
            MotionPanel::new(envelope, notes, (LEFT, top, right, top + high))
        })
        .collect();
    let page = Picture::draw(WIDTH as u32, height as u32, |canvas| {
        let title = text(15.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
        canvas.draw(&Text::new(notes.title.clone(), (LEFT, 22), title)).map_err(FigureError::of)?;
        for panel in &panels {
            panel.frame.draw(canvas)?;
        }
        legend(canvas, right + 20, notes, envelopes)
    })?;
    page.overlay(|canvas| panels.iter().try_for_each(|panel| panel.draw(canvas, notes)))
}

/// Unit for displacements up to `largest_m`: its name and the number of units per metre.
fn unit(largest_m: f64) -> (&'static str, f64) {
    match largest_m {
        m if m >= 1.0 => ("m", 1.0),
        m if m >= 1e-3 => ("mm", 1e3),
        _ => ("µm", 1e6),
    }
}

/// A window of the run in its frame.
struct MotionPanel<'a> {
    envelope: &'a Envelope,
    frame: Frame,
    scale: f64,
}

impl<'a> MotionPanel<'a> {
    fn new(envelope: &'a Envelope, notes: &MotionNotes, bounds: (i32, i32, i32, i32)) -> Self {
        let wall = notes.clearance_m.unwrap_or(0.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut hold = |stretch: Option<ValueRange>, beside: f64| {
            if let Some(s) = stretch {
                low = low.min(s.low.1 - beside);
                high = high.max(s.high.1 + beside);
            }
        };
        for column in envelope.columns() {
            hold(column.x_m, wall);
            hold(column.z_m, 0.0);
            if notes.second_mass.is_some() {
                hold(column.y_m, 0.0);
            }
        }
        let (name, scale) = unit(low.abs().max(high.abs()));
        let (from_s, to_s) = envelope.window_s();
        let from = if envelope.is_relative() { " relative to the base" } else { "" };
        let y = Axis::around(format!("Displacement{from} ({name})"), Scale::Linear, [low * scale, high * scale]);
        let x = Axis { label: "Time (s)".into(), from: from_s, to: to_s, scale: Scale::Linear };
        Self { envelope, frame: Frame { x, y, bounds }, scale }
    }

    fn draw(&self, canvas: &Canvas, notes: &MotionNotes) -> Result<(), FigureError> {
        if let Some(wall) = notes.clearance_m {
            self.curve(canvas, |c| c.x_m, wall, (WALL, 10))?;
            self.curve(canvas, |c| c.x_m, -wall, (WALL, 10))?;
        }
        if notes.base_moves {
            self.curve(canvas, |c| c.z_m, 0.0, (z_colour(), 12))?;
        }
        if notes.second_mass.is_some() {
            self.curve(canvas, |c| c.y_m, 0.0, (y_colour(), 12))?;
        }
        self.curve(canvas, |c| c.x_m, 0.0, (x_colour(), 18))?;
        for column in self.envelope.columns() {
            for (impact, side) in column.impacts.iter().zip([-1, 1]) {
                if let Some((t_s, y_m)) = impact {
                    mark(canvas, self.frame.fine_point(*t_s, y_m * self.scale), side, FINE)?;
                }
            }
        }
        Ok(())
    }

    fn curve(
        &self,
        canvas: &Canvas,
        of: impl Fn(&EnvelopeColumn) -> Option<ValueRange>,
        beside: f64,
        (tint, width): (RGBColor, u32),
    ) -> Result<(), FigureError> {
        let stretches = self.envelope.columns().iter().filter_map(of);
        let point = |(t_s, value): (f64, f64)| self.frame.fine_point(t_s, (value + beside) * self.scale);
        let mut points: Vec<_> = stretches.flat_map(|s| s.in_order()).map(point).collect();
        points.dedup();
        canvas.draw(&PathElement::new(points, tint.stroke_width(width))).map_err(FigureError::of)
    }
}

/// Draws a triangle that points at the wall; `size` is steps per point.
fn mark(canvas: &Canvas, (x, y): (i32, i32), side: i32, size: i32) -> Result<(), FigureError> {
    let outline = vec![(x, y), (x - 4 * size, y + 7 * side * size), (x + 4 * size, y + 7 * side * size)];
    canvas.draw(&Polygon::new(outline, impact_colour().filled())).map_err(FigureError::of)
}

fn legend(canvas: &Canvas, left: i32, notes: &MotionNotes, envelopes: &[&Envelope]) -> Result<(), FigureError> {
    let style = |tint: RGBColor| text(13.0, tint).pos(Pos::new(HPos::Left, VPos::Center));
    let mut y = TOP + 8;
    let mut entry = |word: String, tint: RGBColor, width: Option<u32>| {
        match width {
            Some(width) => {
                let line = PathElement::new(vec![(left, y), (left + 26, y)], tint.stroke_width(width));
                canvas.draw(&line).map_err(FigureError::of)?;
            }
            None => mark(canvas, (left + 13, y - 4), 1, 1)?,
        }
        canvas.draw(&Text::new(word, (left + 34, y), style(INK))).map_err(FigureError::of)?;
        y += LINE;
        Ok::<(), FigureError>(())
    };
    let less = if envelopes.iter().any(|o| o.is_relative()) { " − z" } else { "" };
    entry(format!("x{less} structure"), x_colour(), Some(2))?;
    if let Some(word) = notes.second_mass {
        entry(format!("y{less} {word}"), y_colour(), Some(1))?;
    }
    if notes.base_moves {
        entry("z base".into(), z_colour(), Some(1))?;
    }
    if notes.clearance_m.is_some() {
        entry("walls, ± d".into(), WALL, Some(1))?;
        if envelopes.iter().any(|o| o.impacts() > 0) {
            entry("impact".into(), impact_colour(), None)?;
        }
    }
    Ok(())
}
