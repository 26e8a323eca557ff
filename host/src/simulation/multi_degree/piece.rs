//! A piece of motion of a structure with several places, seen at one of them.

use std::cell::OnceCell;

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::modes::{Contact, Grip, Mode};
use damprig_structures::{Course, Piece as StructurePiece};

use super::Shown;
use crate::simulation::motion::{Displacement, MotionState, Phase, Piece};

/// A piece at a place. What a viewer does not ask for is not computed.
pub struct PieceAtPlace<'a> {
    piece: &'a StructurePiece<'a>,
    shown: Shown,
    x: Course,
    z: OnceCell<Course>,
    x_minus_z: OnceCell<Course>,
    second: OnceCell<Option<Course>>,
}

impl<'a> PieceAtPlace<'a> {
    /// A piece at a place, with the dampers that are shown beside it.
    pub fn new(piece: &'a StructurePiece<'a>, place: usize, shown: Shown) -> Self {
        Self {
            piece,
            shown,
            x: piece.place(place),
            z: OnceCell::new(),
            x_minus_z: OnceCell::new(),
            second: OnceCell::new(),
        }
    }

    fn z(&self) -> &Course {
        self.z.get_or_init(|| self.piece.base())
    }

    fn second(&self) -> Option<&Course> {
        let Shown { particle, tuned_mass, .. } = self.shown;
        let course =
            || particle.map(|n| self.piece.particle(n)).or_else(|| tuned_mass.map(|n| self.piece.tuned_mass(n)));
        self.second.get_or_init(course).as_ref()
    }

    fn course(&self, of: Displacement) -> &Course {
        match of {
            Displacement::X => &self.x,
            Displacement::XMinusZ => self.x_minus_z.get_or_init(|| self.x.minus(self.z())),
        }
    }
}

impl Piece for PieceAtPlace<'_> {
    fn start_s(&self) -> f64 {
        self.piece.start_s
    }

    fn length_s(&self) -> f64 {
        self.piece.length_s
    }

    fn at(&self, after_s: f64) -> MotionState {
        let (x_m, v_m_per_s) = self.x.at(after_s);
        let (z_m, base_velocity_m_per_s) = self.z().at(after_s);
        let (y_m, u_m_per_s) = self.second().map_or((x_m, v_m_per_s), |second| second.at(after_s));
        MotionState {
            t_s: self.piece.start_s + after_s,
            state: ExactState { x_m, v_m_per_s, offset_m: y_m - x_m, slide_m_per_s: u_m_per_s - v_m_per_s },
            z_m,
            base_velocity_m_per_s,
        }
    }

    fn phase(&self) -> Phase {
        let grip = self.shown.friction_damper.map_or(Grip::Absent, |n| self.piece.grip(n));
        let contact = self.shown.particle.map_or(Contact::Absent, |n| self.piece.contact(n));
        let pressing = self.shown.particle.is_some_and(|n| self.piece.pressed_side(n).is_some());
        Phase { mode: Mode { grip, contact }, pressing }
    }

    fn places_at(&self, after_s: f64, values: &mut Vec<f64>) {
        let piece = self.piece;
        for place in 0..piece.place_count() {
            let course = piece.place(place);
            values.extend([course.at(after_s).0, course.acceleration_m_per_s2(after_s)]);
        }
        values.extend((0..piece.particle_count()).map(|n| piece.particle(n).at(after_s).0));
        values.extend((0..piece.tuned_mass_count()).map(|n| piece.tuned_mass(n).at(after_s).0));
    }

    fn square_m2_s(&self, of: Displacement) -> f64 {
        self.course(of).square_m2_s()
    }

    fn largest_abs_m(&self, of: Displacement, window_s: (f64, f64), _: u32, least_m: f64) -> f64 {
        self.course(of).largest_abs(window_s, least_m)
    }
}
