//! A piece of motion of a structure with several places, seen at one of them.

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::modes::{Contact, Grip, Mode};
use damprig_structures::{Course, Piece as StructurePiece};

use super::{MultiDegree, SecondMass};
use crate::simulation::motion::{Displacement, MotionState, Phase, Piece};

/// A piece at a place.
pub struct PieceAtPlace {
    start_s: f64,
    length_s: f64,
    x: Course,
    z: Course,
    x_minus_z: Course,
    second: Option<Course>,
    phase: Phase,
}

impl PieceAtPlace {
    /// A piece at a place.
    pub fn new(piece: &StructurePiece, of: &MultiDegree, place: usize) -> Self {
        let (x, z) = (piece.place(place), piece.base());
        let second = (place == of.observed).then(|| of.second_mass()).flatten();
        let grip = match of.set_up.friction_dampers.is_empty() {
            true => Grip::Absent,
            false => piece.grip(0),
        };
        let (contact, pressing) = match of.set_up.impact_dampers.is_empty() {
            true => (Contact::Absent, false),
            false => piece.contact(0),
        };
        Self {
            start_s: piece.start_s,
            length_s: piece.length_s,
            x_minus_z: x.minus(&z),
            second: second.map(|second| match second {
                SecondMass::Particle => piece.particle(0),
                SecondMass::Tuned => piece.tuned_mass(0),
            }),
            x,
            z,
            phase: Phase { mode: Mode { grip, contact }, pressing },
        }
    }

    fn course(&self, of: Displacement) -> &Course {
        match of {
            Displacement::X => &self.x,
            Displacement::XMinusZ => &self.x_minus_z,
        }
    }
}

impl Piece for PieceAtPlace {
    fn start_s(&self) -> f64 {
        self.start_s
    }

    fn length_s(&self) -> f64 {
        self.length_s
    }

    fn at(&self, after_s: f64) -> MotionState {
        let (x_m, v_m_per_s) = self.x.at(after_s);
        let (z_m, base_velocity_m_per_s) = self.z.at(after_s);
        let (y_m, u_m_per_s) = self.second.as_ref().map_or((x_m, v_m_per_s), |second| second.at(after_s));
        MotionState {
            t_s: self.start_s + after_s,
            state: ExactState { x_m, v_m_per_s, offset_m: y_m - x_m, slide_m_per_s: u_m_per_s - v_m_per_s },
            z_m,
            base_velocity_m_per_s,
        }
    }

    fn phase(&self) -> Phase {
        self.phase
    }

    fn square_m2_s(&self, of: Displacement) -> f64 {
        self.course(of).square_m2_s(self.length_s)
    }

    fn largest_abs_m(&self, of: Displacement, window_s: (f64, f64), _: u32, least_m: f64) -> f64 {
        self.course(of).largest_abs(window_s, least_m)
    }
}
