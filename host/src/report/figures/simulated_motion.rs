//! The figure of a simulated motion: displacements of structure, particle and base over time, walls and impacts.
//!
//! A long run has two panels: all of it, and its last cycles in detail.

use plotters::element::{PathElement, Polygon, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::axis::{Axis, Frame, Scale};
use super::{Canvas, FINE, FigureError, INK, Picture, colour, text};
use crate::simulation::envelope::{Column, Outline, Stretch};

/// Columns that a panel has: as many as points across it.
pub const COLUMNS: usize = 760;

/// What the figure says besides the curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Notes {
    /// d, m, when there are walls.
    pub clearance_m: Option<f64>,
    /// What y is called, when there is a second mass.
    pub second_mass: Option<&'static str>,
    /// Whether the base moves.
    pub base_moves: bool,
    /// Above the axes.
    pub title: String,
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

/// Draws one panel for each outline, from top to bottom.
///
/// # Errors
/// What the drawing library says.
pub fn draw(outlines: &[&Outline], notes: &Notes) -> Result<Picture, FigureError> {
    let panels = i32::try_from(outlines.len()).unwrap_or(1).max(1);
    let right = LEFT + COLUMNS as i32;
    let high = if panels == 1 { SINGLE } else { PANEL };
    let height = TOP + panels * high + (panels - 1) * GAP + 64;
    let panels: Vec<Panel> = outlines
        .iter()
        .zip(0..)
        .map(|(outline, place)| {
            let top = TOP + place * (high + GAP);
            Panel::new(outline, notes, (LEFT, top, right, top + high))
        })
        .collect();
    let page = Picture::draw(WIDTH as u32, height as u32, |canvas| {
        let title = text(15.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
        canvas.draw(&Text::new(notes.title.clone(), (LEFT, 22), title)).map_err(FigureError::of)?;
        for panel in &panels {
            panel.frame.draw(canvas)?;
        }
        legend(canvas, right + 20, notes, outlines)
    })?;
    page.overlay(|canvas| panels.iter().try_for_each(|panel| panel.draw(canvas, notes)))
}

/// Displacements in a unit that leaves few digits: its name and how many make a metre.
fn unit(largest_m: f64) -> (&'static str, f64) {
    match largest_m {
        m if m >= 1.0 => ("m", 1.0),
        m if m >= 1e-3 => ("mm", 1e3),
        _ => ("µm", 1e6),
    }
}

/// A window of the run in its frame.
struct Panel<'a> {
    outline: &'a Outline,
    frame: Frame,
    scale: f64,
}

impl<'a> Panel<'a> {
    fn new(outline: &'a Outline, notes: &Notes, bounds: (i32, i32, i32, i32)) -> Self {
        let wall = notes.clearance_m.unwrap_or(0.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut hold = |stretch: Option<Stretch>, beside: f64| {
            if let Some(s) = stretch {
                low = low.min(s.low.1 - beside);
                high = high.max(s.high.1 + beside);
            }
        };
        for column in outline.columns() {
            hold(column.x_m, wall);
            hold(column.z_m, 0.0);
            if notes.second_mass.is_some() {
                hold(column.y_m, 0.0);
            }
        }
        let (name, scale) = unit(low.abs().max(high.abs()));
        let (from_s, to_s) = outline.window_s();
        let from = if outline.is_relative() { " from the base" } else { "" };
        let y = Axis::around(format!("Displacement{from} ({name})"), Scale::Linear, [low * scale, high * scale]);
        let x = Axis { label: "Time (s)".into(), from: from_s, to: to_s, scale: Scale::Linear };
        Self { outline, frame: Frame { x, y, bounds }, scale }
    }

    fn draw(&self, canvas: &Canvas, notes: &Notes) -> Result<(), FigureError> {
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
        for column in self.outline.columns() {
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
        of: impl Fn(&Column) -> Option<Stretch>,
        beside: f64,
        (tint, width): (RGBColor, u32),
    ) -> Result<(), FigureError> {
        let stretches = self.outline.columns().iter().filter_map(of);
        let point = |(t_s, value): (f64, f64)| self.frame.fine_point(t_s, (value + beside) * self.scale);
        let mut points: Vec<_> = stretches.flat_map(|s| s.in_order()).map(point).collect();
        points.dedup();
        canvas.draw(&PathElement::new(points, tint.stroke_width(width))).map_err(FigureError::of)
    }
}

/// A triangle that points at the wall, `size` steps to a point.
fn mark(canvas: &Canvas, (x, y): (i32, i32), side: i32, size: i32) -> Result<(), FigureError> {
    let outline = vec![(x, y), (x - 4 * size, y + 7 * side * size), (x + 4 * size, y + 7 * side * size)];
    canvas.draw(&Polygon::new(outline, impact_colour().filled())).map_err(FigureError::of)
}

fn legend(canvas: &Canvas, left: i32, notes: &Notes, outlines: &[&Outline]) -> Result<(), FigureError> {
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
    let less = if outlines.iter().any(|o| o.is_relative()) { " − z" } else { "" };
    entry(format!("x{less} structure"), x_colour(), Some(2))?;
    if let Some(word) = notes.second_mass {
        entry(format!("y{less} {word}"), y_colour(), Some(1))?;
    }
    if notes.base_moves {
        entry("z base".into(), z_colour(), Some(1))?;
    }
    if notes.clearance_m.is_some() {
        entry("walls, ± d".into(), WALL, Some(1))?;
        if outlines.iter().any(|o| o.impacts() > 0) {
            entry("impact".into(), impact_colour(), None)?;
        }
    }
    Ok(())
}
