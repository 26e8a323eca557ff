//! Draws a set-up of a campaign as a sketch, not to scale: base, structure on its springs, particle between its walls, friction
//! block, tuned mass.

use damprig_core::model::{SetUp, Wall};
use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor, ShapeStyle};

use super::campaign::shortened;
use super::{Canvas, FigureError, GREY, INK, PALE, Picture, colour, text};
use crate::campaign::CampaignSetUp;
use crate::report::describe;
use crate::report::numbers::{significant, trimmed};

/// Width and height.
const CELL: (i32, i32) = (346, 206);

/// Places.
const BASE: i32 = 168;
const FLOOR: i32 = 112;
const ROOF: i32 = 88;
const LEFT: i32 = 84;
const RIGHT: i32 = 224;

/// Draws a set-up.
///
/// # Errors
/// The drawing library's error.
pub fn draw(set_up: &CampaignSetUp) -> Result<Picture, FigureError> {
    Picture::draw(CELL.0 as u32, CELL.1 as u32, |canvas| Sketch { canvas }.set_up(set_up))
}

struct Sketch<'a, 'b> {
    canvas: &'a Canvas<'b>,
}

impl Sketch<'_, '_> {
    fn line(&self, points: &[(i32, i32)], style: impl Into<ShapeStyle>) -> Result<(), FigureError> {
        let path = points.to_vec();
        self.canvas.draw(&PathElement::new(path, style)).map_err(FigureError::of)
    }

    /// A filled box with an outline.
    fn body(&self, from: (i32, i32), to: (i32, i32), fill: RGBColor) -> Result<(), FigureError> {
        let corners = [from, to];
        self.canvas.draw(&Rectangle::new(corners, fill.filled())).map_err(FigureError::of)?;
        self.canvas.draw(&Rectangle::new(corners, INK.stroke_width(1))).map_err(FigureError::of)
    }

    fn write(
        &self,
        words: &str,
        place: (i32, i32),
        size: f64,
        tint: RGBColor,
        across: HPos,
    ) -> Result<(), FigureError> {
        let style = text(size, tint).pos(Pos::new(across, VPos::Center));
        self.canvas.draw(&Text::new(words.to_string(), place, style)).map_err(FigureError::of)
    }

    /// An arrow with two heads.
    fn travel(&self, from: i32, to: i32, height: i32) -> Result<(), FigureError> {
        self.line(&[(from, height), (to, height)], GREY.stroke_width(1))?;
        for (tip, back) in [(from, 5), (to, -5)] {
            let head = [(tip, height), (tip + back, height - 3), (tip + back, height + 3)];
            self.canvas.draw(&Polygon::new(head.to_vec(), GREY.filled())).map_err(FigureError::of)?;
        }
        Ok(())
    }

    /// An arrow to the right.
    fn arrow(&self, from: (i32, i32), to: i32) -> Result<(), FigureError> {
        self.line(&[from, (to, from.1)], GREY.stroke_width(2))?;
        let head = [(to, from.1), (to - 7, from.1 - 4), (to - 7, from.1 + 4)];
        self.canvas.draw(&Polygon::new(head.to_vec(), GREY.filled())).map_err(FigureError::of)
    }

    /// A coil spring.
    fn coil(&self, from: i32, to: i32, height: i32) -> Result<(), FigureError> {
        let step = (to - from) / 8;
        let mut points = vec![(from, height)];
        points.extend((1..8).map(|n| (from + n * step, if n % 2 == 0 { height - 5 } else { height + 5 })));
        points.push((to, height));
        self.line(&points, INK.stroke_width(1))
    }

    fn set_up(&self, set_up: &CampaignSetUp) -> Result<(), FigureError> {
        let model = set_up.model();
        self.write(&shortened(&set_up.label), (14, 14), 13.0, INK, HPos::Left)?;
        self.write(&describe::set_up(set_up), (14, 31), 11.0, GREY, HPos::Left)?;
        self.structure(&model)?;
        match set_up.force_amplitude_n() {
            Some(force_n) => {
                self.arrow((LEFT - 42, FLOOR + 14), LEFT - 4)?;
                self.line(&[(LEFT - 4, FLOOR + 14), (LEFT - 4, FLOOR)], GREY.stroke_width(1))?;
                let force = format!("P = {} N", significant(force_n, 3));
                self.write(&force, (LEFT - 76, FLOOR + 28), 11.0, GREY, HPos::Left)?;
            }
            None => {
                self.travel(LEFT, LEFT + 40, BASE + 18)?;
                let amplitude = format!("Z = {} mm", trimmed(set_up.base_amplitude_m * 1e3, 3));
                self.write(&amplitude, (LEFT + 48, BASE + 18), 11.0, GREY, HPos::Left)?;
            }
        }
        if let Some(particle) = &model.particle {
            self.particle(particle.clearance_m, particle.mass_kg, &particle.wall)?;
        }
        if set_up.has_unmodelled_damper {
            self.body((134, ROOF - 34), (174, ROOF), PALE)?;
            self.write("?", (154, ROOF - 17), 15.0, INK, HPos::Center)?;
        }
        if let Some(friction) = model.friction_damper {
            self.friction(friction.force_n)?;
        }
        if let Some(tmd) = model.tmd {
            self.tuned_mass(tmd.mass_kg)?;
        }
        Ok(())
    }

    fn structure(&self, model: &SetUp) -> Result<(), FigureError> {
        let structure = &model.structure;
        for x in [LEFT + 12, RIGHT - 12] {
            self.line(&[(x, BASE), (x, FLOOR)], INK.stroke_width(2))?;
        }
        self.body((LEFT, ROOF), (RIGHT, FLOOR), PALE)?;
        let natural_hz = structure.angular_frequency_rad_per_s() / std::f64::consts::TAU;
        self.write(&format!("M = {} kg", trimmed(structure.mass_kg, 3)), (154, 100), 12.0, INK, HPos::Center)?;
        let springs = format!("{} Hz, ζ = {}", trimmed(natural_hz, 3), significant(structure.damping_ratio(), 3));
        self.write(&springs, (154, 140), 11.0, GREY, HPos::Center)?;
        self.line(&[(LEFT - 20, BASE), (RIGHT + 44, BASE)], INK.stroke_width(2))?;
        for x in (LEFT - 18..RIGHT + 44).step_by(9) {
            self.line(&[(x, BASE), (x - 5, BASE + 6)], GREY.stroke_width(1))?;
        }
        self.travel(LEFT - 42, LEFT - 8, ROOF + 12)?;
        self.write("x", (LEFT - 48, ROOF + 12), 12.0, GREY, HPos::Right)
    }

    fn particle(&self, clearance_m: f64, mass_kg: f64, wall: &Wall) -> Result<(), FigureError> {
        let (low, high, top) = (LEFT + 14, RIGHT - 14, ROOF - 30);
        for (x, inwards) in [(low, 1), (high, -1)] {
            self.line(&[(x, ROOF), (x, top)], INK.stroke_width(3))?;
            if matches!(wall, Wall::Voigt { .. }) {
                let pad = [(x + 2 * inwards, ROOF - 2), (x + 9 * inwards, top + 2)];
                self.canvas.draw(&Rectangle::new(pad, colour(1).filled())).map_err(FigureError::of)?;
            }
        }
        self.canvas.draw(&Circle::new((154, ROOF - 11), 10, colour(3).filled())).map_err(FigureError::of)?;
        let mass = format!("m = {} kg", trimmed(mass_kg, 3));
        self.write(&mass, (high + 8, ROOF - 12), 11.0, GREY, HPos::Left)?;
        self.travel(low + 3, high - 3, top - 4)?;
        let room = format!("2d = {} mm", trimmed(2e3 * clearance_m, 2));
        self.write(&room, (high + 8, top - 4), 11.0, GREY, HPos::Left)
    }

    fn friction(&self, force_n: f64) -> Result<(), FigureError> {
        let post = RIGHT + 46;
        self.line(&[(post, BASE), (post, ROOF + 2)], INK.stroke_width(3))?;
        self.body((RIGHT + 1, ROOF + 5), (RIGHT + 14, FLOOR - 5), colour(5))?;
        self.coil(RIGHT + 14, post, (ROOF + FLOOR) / 2)?;
        self.write(&format!("F = {} N", significant(force_n, 3)), (post + 6, FLOOR + 8), 11.0, GREY, HPos::Left)
    }

    fn tuned_mass(&self, mass_kg: f64) -> Result<(), FigureError> {
        let post = LEFT + 14;
        self.line(&[(post, ROOF), (post, ROOF - 30)], INK.stroke_width(3))?;
        self.coil(post, 138, ROOF - 16)?;
        self.body((138, ROOF - 28), (178, ROOF - 4), colour(3))?;
        self.write(&format!("m = {} kg", trimmed(mass_kg, 3)), (186, ROOF - 16), 11.0, GREY, HPos::Left)
    }
}
