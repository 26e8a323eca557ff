//! Observers of a motion: smooth pieces and impacts.

use damprig_core::integrator::modes::{Contact, Grip, Sign, signed};

use crate::contacts::{Slide, Touch};
use crate::course::Course;
use crate::flight::Flight;
use crate::linear::{C64, Rest};
use crate::mount::{Mount, WallLaw};
use crate::polynomial::Polynomial;
use crate::squeeze::Squeeze;
use crate::system::System;

/// A particle meets a wall at a speed greater than zero: an impact on a hard wall, the first touch of a soft, a piezoelectric or a Hertz wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// Time, s.
    pub time_s: f64,
    /// Number of the impact damper.
    pub damper: usize,
    /// +1 at the wall on the positive side, −1 at the other.
    pub side: Sign,
    /// |y′ − x′| just before, m/s.
    pub approach_speed_m_per_s: f64,
    /// y, m.
    pub y_m: f64,
    /// Impulse of a hard wall, N·s; 0 or greater. 0 of any other wall, which pushes over time.
    pub impulse_n_s: f64,
    /// Energy that is lost in it, J.
    pub lost_j: f64,
}

/// A contact with a Hertz wall, from the first touch until the penetration has returned to zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HertzContact {
    /// Time of the first touch, s.
    pub touch_s: f64,
    /// Number of the impact damper.
    pub damper: usize,
    /// +1 at the wall on the positive side, −1 at the other.
    pub side: Sign,
    /// |y′ − x′| at the first touch, m/s; 0 where the particle began to press from rest.
    pub approach_speed_m_per_s: f64,
    /// |y′ − x′| at the end, m/s.
    pub separation_speed_m_per_s: f64,
    /// Duration, s; without the rounding of the times.
    pub duration_s: f64,
    /// Largest force, N.
    pub peak_force_n: f64,
}

/// What a piece is made of.
#[derive(Clone, Copy)]
pub(crate) struct Parts<'a> {
    pub mount: &'a Mount,
    pub system: &'a System,
    pub rest: &'a Rest,
    pub z: &'a [C64],
    /// The natural motions at the end of the piece.
    pub end: &'a [C64],
    pub free: &'a [Flight],
    /// The contacts with Hertz walls, by particle.
    pub squeezes: &'a [Option<Squeeze>],
    /// The base's displacement but for the wave's sine.
    pub base: Polynomial,
}

/// A piece of motion without an event inside.
pub struct Piece<'a> {
    pub(crate) parts: Parts<'a>,
    /// Start time, s.
    pub start_s: f64,
    /// Duration, s.
    pub length_s: f64,
}

impl<'a> Piece<'a> {
    pub(crate) fn new(parts: Parts<'a>, start_s: f64, length_s: f64) -> Self {
        Self { parts, start_s, length_s }
    }

    /// Number of places.
    #[must_use]
    pub fn place_count(&self) -> usize {
        self.parts.mount.places.len()
    }

    /// Number of impact dampers.
    #[must_use]
    pub fn particle_count(&self) -> usize {
        self.parts.mount.cavities.len()
    }

    /// Number of tuned masses.
    #[must_use]
    pub fn tuned_mass_count(&self) -> usize {
        self.parts.mount.tuned_influence.len()
    }

    /// The absolute displacement of a place.
    #[must_use]
    pub fn place(&self, place: usize) -> Course {
        let Parts { mount, system, rest, base, .. } = self.parts;
        let signal = &system.places[place];
        self.course(&signal.coefficients, signal.polynomial(rest) + mount.places[place].influence * base)
    }

    /// The displacement of the base; 0 where a force drives.
    #[must_use]
    pub fn base(&self) -> Course {
        let Parts { mount, system, z, end, base, .. } = self.parts;
        let wave = system.linear.natural.wave;
        let share = C64::new(0.0, -mount.share);
        let term = (share * z[wave], share * end[wave], system.linear.natural.rates[wave]);
        Course::new(std::iter::once(term), base, self.length_s)
    }

    /// The absolute displacement of the particle of an impact damper.
    #[must_use]
    pub fn particle(&self, damper: usize) -> Course {
        let Parts { mount, system, .. } = self.parts;
        if let Some(n) = system.free.iter().position(|free| *free == damper) {
            return Course::new(std::iter::empty(), self.parts.free[n].polynomial(), self.length_s);
        }
        self.body(mount.permanent + damper, mount.cavities[damper].influence)
    }

    /// The absolute displacement of a tuned mass.
    #[must_use]
    pub fn tuned_mass(&self, damper: usize) -> Course {
        let mount = self.parts.mount;
        self.body(mount.modes + damper, mount.tuned_influence[damper])
    }

    /// The modal coordinate q of a mode, relative to the base, m·√kg.
    #[must_use]
    pub fn modal_coordinate(&self, mode: usize) -> Course {
        self.body(mode, 0.0)
    }

    /// A body of the system, whose displacement relative to the base is a coordinate.
    fn body(&self, body: usize, influence: f64) -> Course {
        let Parts { system, rest, base, .. } = self.parts;
        let row: Vec<f64> = system.members.iter().map(|member| f64::from(u8::from(*member == body))).collect();
        let mut signal = system.linear.displacement(&row);
        signal.coefficients[system.linear.natural.wave] -= C64::new(0.0, influence);
        self.course(&signal.coefficients, signal.polynomial(rest) + influence * base)
    }

    /// The course with these coefficients on the natural motions, and a cubic.
    pub(crate) fn course(&self, coefficients: &[C64], cubic: Polynomial) -> Course {
        let Parts { system, z, end, .. } = self.parts;
        let ends = z.iter().zip(end).zip(&system.linear.natural.rates);
        let terms = coefficients.iter().zip(ends).map(|(c, ((z, end), rate))| (c * z, c * end, *rate));
        Course::new(terms, cubic, self.length_s)
    }

    /// Whether a friction damper sticks or slips, and in which direction.
    #[must_use]
    pub fn grip(&self, damper: usize) -> Grip {
        match self.parts.system.contacts.slides[damper] {
            Slide::Stuck => Grip::Stuck,
            Slide::Free(direction) => Grip::Slip(direction),
        }
    }

    /// Whether the particle of an impact damper flies or is held.
    #[must_use]
    pub fn contact(&self, damper: usize) -> Contact {
        let contacts = &self.parts.system.contacts;
        match (contacts.slides[self.parts.mount.joint_of(damper)], contacts.touches[damper]) {
            (Slide::Free(direction), _) => Contact::Free(direction),
            (Slide::Stuck, Touch::Wall(side)) => Contact::Held(side),
            (Slide::Stuck, _) => Contact::Held(0),
        }
    }

    /// Force of the soft, piezoelectric or Hertz wall that the particle of an impact damper presses into, inwards, N. That of a Hertz wall is the cubic that
    /// acts in the piece: within 10⁻⁶ of the largest force of the contact where it is large, within 10⁻⁵ near δ = 0. [`HertzContact`] has the law's.
    #[must_use]
    pub fn wall_force_n(&self, damper: usize) -> Option<Course> {
        let side = self.pressed_side(damper)?;
        let cavity = &self.parts.mount.cavities[damper];
        let offset = self.particle(damper).minus(&self.place_of_cavity(damper));
        let force = |stiffness: f64, damping: f64| {
            let [of, of_rate] = [stiffness, damping].map(|of| signed(side, of));
            offset.with_rate(of, of_rate, -stiffness * cavity.end(side))
        };
        match *cavity.wall(side) {
            WallLaw::Hard(_) => None,
            WallLaw::Hertz(_) => {
                let force = self.parts.squeezes[damper].as_ref()?.force;
                Some(Course::new(std::iter::empty(), force, self.length_s))
            }
            WallLaw::Soft { stiffness, damping, .. } => Some(force(stiffness, damping)),
            WallLaw::Piezoelectric(wall) => {
                let stiffness = wall.open_stiffness();
                let surface = self.body(wall.charge, 0.0).with_rate(stiffness * wall.stands_m_per_c(), 0.0, 0.0);
                Some(force(stiffness, 0.0).minus(&surface))
            }
        }
    }

    /// Voltage of a piezoelectric wall, V; positive while a particle presses into a wall without charge. `None` of another wall.
    #[must_use]
    pub fn voltage_v(&self, damper: usize, side: Sign) -> Option<Course> {
        let wall = self.parts.mount.cavities[damper].piezoelectric(side)?;
        Some(self.body(wall.charge, 0.0).with_rate(0.0, self.parts.mount.bodies.damping[wall.charge], 0.0))
    }

    /// R of a piezoelectric wall, Ω; `None` of another wall.
    pub(crate) fn load_ohm(&self, damper: usize, side: Sign) -> Option<f64> {
        let mount = self.parts.mount;
        mount.cavities[damper].piezoelectric(side).map(|wall| mount.bodies.damping[wall.charge])
    }

    /// The absolute displacement of the place of an impact damper.
    pub(crate) fn place_of_cavity(&self, damper: usize) -> Course {
        let Parts { mount, system, rest, base, .. } = self.parts;
        let cavity = &mount.cavities[damper];
        let signal = system.place(&cavity.place, cavity.influence);
        self.course(&signal.coefficients, signal.polynomial(rest) + cavity.influence * base)
    }

    /// The side of the soft, piezoelectric or Hertz wall that the particle of an impact damper presses into.
    #[must_use]
    pub fn pressed_side(&self, damper: usize) -> Option<Sign> {
        if let Touch::Pressing(side) = self.parts.system.contacts.touches[damper] { Some(side) } else { None }
    }
}

/// Receives a motion while it is computed.
pub trait Observer {
    /// Whether pieces are wanted.
    const PIECES: bool = false;

    /// A piece of motion without an event inside.
    fn piece(&mut self, _piece: &Piece) {}

    /// An impact.
    fn impact(&mut self, _impact: &Impact) {}

    /// A contact with a Hertz wall has ended.
    fn contact(&mut self, _contact: &HertzContact) {}

    /// Whether the motion goes on from time `time_s`.
    fn goes_on(&mut self, _time_s: f64) -> bool {
        true
    }
}

impl Observer for () {}
