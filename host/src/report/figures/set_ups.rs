//! Draws a set-up of a campaign as a sketch, not to scale: base, structure on its springs, particle between its walls, friction
//! block, tuned mass.

use super::campaign::shortened;
use crate::campaign::CampaignSetUp;
use crate::report::describe;
use crate::report::numbers::{significant, trimmed};
use crate::report::plot::palette::{GREY, INK, Look, PALE, WALL};
use crate::report::plot::svg::{Colour, Font, PicturePlace};
use crate::report::plot::traces::marker;
use crate::report::plot::{LABEL, Picture, SMALL};
use damprig_core::model::{Particle, SetUp};

/// Width and height.
const CELL: (f64, f64) = (346.0, 206.0);

/// Places.
const BASE: f64 = 168.0;
const FLOOR: f64 = 112.0;
const ROOF: f64 = 88.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 224.0;

/// Small words.
const WORDS: Font = Font::new(8.9, GREY);

/// Draws a set-up; its damper has the colour of its curves.
#[must_use]
pub fn draw(set_up: &CampaignSetUp, look: Look) -> Picture {
    let mut sketch = Sketch { picture: Picture::new(CELL.0, CELL.1), look };
    sketch.set_up(set_up);
    sketch.picture
}

struct Sketch {
    picture: Picture,
    look: Look,
}

impl Sketch {
    fn line(&mut self, points: &[PicturePlace], tint: Colour, width: f64) {
        self.picture.line(points.iter().copied(), tint.stroke(width));
    }

    /// A filled box with an outline.
    fn body(&mut self, (left, top): PicturePlace, (right, bottom): PicturePlace, fill: Colour) {
        self.picture.rectangle((left, top, right, bottom), fill.fill().edged(INK, 1.0));
    }

    /// An arrow with two heads.
    fn travel(&mut self, from: f64, to: f64, height: f64) {
        self.line(&[(from, height), (to, height)], GREY, 1.0);
        for (tip, back) in [(from, 5.0), (to, -5.0)] {
            let head = [(tip, height), (tip + back, height - 3.0), (tip + back, height + 3.0)];
            self.picture.area(head, GREY.fill());
        }
    }

    /// An arrow to the right.
    fn arrow(&mut self, from: PicturePlace, to: f64) {
        self.line(&[from, (to, from.1)], GREY, 2.0);
        self.picture.area([(to, from.1), (to - 7.0, from.1 - 4.0), (to - 7.0, from.1 + 4.0)], GREY.fill());
    }

    /// A coil spring.
    fn coil(&mut self, from: f64, to: f64, height: f64) {
        let step = (to - from) / 8.0;
        let mut points = vec![(from, height)];
        points.extend((1u8..8).map(|n| (from + f64::from(n) * step, height + if n % 2 == 0 { -5.0 } else { 5.0 })));
        points.push((to, height));
        self.line(&points, INK, 1.0);
    }

    fn set_up(&mut self, set_up: &CampaignSetUp) {
        let model = set_up.model();
        self.picture.at((18.0, 15.0), &marker(self.look, true));
        self.picture.text(&shortened(&set_up.label), (30.0, 15.0), Font::new(LABEL, INK));
        self.picture.text(&describe::set_up(set_up), (30.0, 32.0), WORDS);
        self.structure(&model);
        match set_up.force_amplitude_n() {
            Some(force_n) => {
                self.arrow((LEFT - 42.0, FLOOR + 14.0), LEFT - 4.0);
                self.line(&[(LEFT - 4.0, FLOOR + 14.0), (LEFT - 4.0, FLOOR)], GREY, 1.0);
                let force = format!("P = {} N", significant(force_n, 3));
                self.picture.text(&force, (LEFT - 76.0, FLOOR + 28.0), WORDS);
            }
            None => {
                self.travel(LEFT, LEFT + 40.0, BASE + 18.0);
                let amplitude = format!("Z = {} mm", trimmed(set_up.base_amplitude_m * 1e3, 3));
                self.picture.text(&amplitude, (LEFT + 48.0, BASE + 18.0), WORDS);
            }
        }
        if let Some(particle) = &model.particle {
            self.particle(particle);
        }
        if set_up.has_unmodelled_damper {
            self.body((134.0, ROOF - 34.0), (174.0, ROOF), PALE);
            self.picture.text("?", (154.0, ROOF - 17.0), Font::new(12.0, INK).centred());
        }
        if let Some(friction) = model.friction_damper {
            self.friction(friction.force_n);
        }
        if let Some(tmd) = model.tmd {
            self.tuned_mass(tmd.mass_kg);
        }
    }

    fn structure(&mut self, model: &SetUp) {
        let structure = &model.structure;
        for x in [LEFT + 12.0, RIGHT - 12.0] {
            self.line(&[(x, BASE), (x, FLOOR)], INK, 2.0);
        }
        self.body((LEFT, ROOF), (RIGHT, FLOOR), PALE);
        let natural_hz = structure.angular_frequency_rad_per_s() / std::f64::consts::TAU;
        let mass = format!("M = {} kg", trimmed(structure.mass_kg, 3));
        self.picture.text(&mass, (154.0, 100.0), Font::new(SMALL, INK).centred());
        let springs = format!("{} Hz, ζ = {}", trimmed(natural_hz, 3), significant(structure.damping_ratio(), 3));
        self.picture.text(&springs, (154.0, 140.0), WORDS.centred());
        self.line(&[(LEFT - 20.0, BASE), (RIGHT + 44.0, BASE)], INK, 2.0);
        for x in (0u8..23).map(|n| LEFT - 18.0 + 9.0 * f64::from(n)) {
            self.line(&[(x, BASE), (x - 5.0, BASE + 6.0)], GREY, 1.0);
        }
        self.travel(LEFT - 42.0, LEFT - 8.0, ROOF + 12.0);
        self.picture.text("x", (LEFT - 48.0, ROOF + 12.0), Font::new(SMALL, GREY).ending());
    }

    fn particle(&mut self, particle: &Particle) {
        let (low, high, top) = (LEFT + 14.0, RIGHT - 14.0, ROOF - 30.0);
        for ((x, inwards), wall) in [(low, 1.0), (high, -1.0)].into_iter().zip(particle.walls()) {
            self.line(&[(x, ROOF), (x, top)], INK, 3.0);
            if wall.is_soft() {
                let ends = [x + 2.0 * inwards, x + 9.0 * inwards];
                let pad = (ends[0].min(ends[1]), top + 2.0, ends[0].max(ends[1]), ROOF - 2.0);
                self.picture.rectangle(pad, WALL.fill());
            }
        }
        self.picture.circle((154.0, ROOF - 11.0), 10.0, self.look.colour().fill());
        let mass = format!("m = {} kg", trimmed(particle.mass_kg, 3));
        self.picture.text(&mass, (high + 8.0, ROOF - 12.0), WORDS);
        self.travel(low + 3.0, high - 3.0, top - 4.0);
        let mut room = format!("2d = {} mm", trimmed(2e3 * particle.clearance_m, 2));
        if particle.cavity.inclination_deg != 0.0 {
            room += &format!(", {}° up", trimmed(particle.cavity.inclination_deg, 1));
        }
        self.picture.text(&room, (high + 8.0, top - 4.0), WORDS);
    }

    fn friction(&mut self, force_n: f64) {
        let post = RIGHT + 46.0;
        self.line(&[(post, BASE), (post, ROOF + 2.0)], INK, 3.0);
        self.body((RIGHT + 1.0, ROOF + 5.0), (RIGHT + 14.0, FLOOR - 5.0), self.look.colour());
        self.coil(RIGHT + 14.0, post, 0.5 * (ROOF + FLOOR));
        self.picture.text(&format!("F = {} N", significant(force_n, 3)), (post + 6.0, FLOOR + 8.0), WORDS);
    }

    fn tuned_mass(&mut self, mass_kg: f64) {
        let post = LEFT + 14.0;
        self.line(&[(post, ROOF), (post, ROOF - 30.0)], INK, 3.0);
        self.coil(post, 138.0, ROOF - 16.0);
        self.body((138.0, ROOF - 28.0), (178.0, ROOF - 4.0), self.look.colour());
        self.picture.text(&format!("m = {} kg", trimmed(mass_kg, 3)), (186.0, ROOF - 16.0), WORDS);
    }
}
