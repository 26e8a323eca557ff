//! A wall of the particle in the equations of motion, without units: its law of impact, or its spring and dashpot.

use damprig_core::integrator::modes::Sign;
use damprig_core::model::{Release, Wall};

use crate::dual::Real;

/// Place of a side among two walls.
pub(crate) fn of(side: Sign) -> usize {
    usize::from(side > 0)
}

/// What turns the values of a wall into those without units.
pub(crate) struct Scales<T> {
    /// Unit of velocity, m/s.
    pub velocity_m_per_s: f64,
    /// Unit of time, s.
    pub time: T,
    /// 1/M of the structure.
    pub per_mass: T,
}

impl<T: Real> Scales<T> {
    /// A stiffness without its unit.
    pub fn stiffness(&self, value: T) -> T {
        value * (self.time * self.time) * self.per_mass
    }

    /// A damping without its unit.
    pub fn damping(&self, value: T) -> T {
        value * self.time * self.per_mass
    }
}

/// A wall; with a tuned mass the first one has its spring and dashpot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallLaw<T> {
    restitution: T,
    falling: Option<Falling>,
    pub stiffness: T,
    pub damping: T,
    /// When a soft wall releases the particle; `None` of a hard one.
    pub release: Option<Release>,
}

/// Restitution that falls with the speed of the impact.
#[derive(Clone, Copy, Debug)]
struct Falling {
    reference: f64,
    exponent: f64,
    maximum: f64,
}

impl<T: Real> WallLaw<T> {
    /// Of a wall of the set-up; without one, of a hard wall without restitution.
    pub fn of(wall: Option<&Wall>, scales: &Scales<T>) -> Self {
        let (stiffness, damping) = wall.and_then(Wall::spring_and_dashpot).unwrap_or_default();
        Self {
            restitution: T::of(wall.and_then(Wall::restitution).map_or(0.0, |law| law.coefficient)),
            falling: wall.and_then(Wall::falling).map(|law| Falling {
                reference: law.reference_speed_m_per_s / scales.velocity_m_per_s,
                exponent: law.exponent,
                maximum: law.maximum,
            }),
            stiffness: scales.stiffness(T::of(stiffness)),
            damping: scales.damping(T::of(damping)),
            release: wall.and_then(Wall::release),
        }
    }

    /// Takes coefficient of restitution, stiffness and damping from parameters.
    pub fn set(&mut self, restitution: T, stiffness: T, damping: T) {
        (self.restitution, self.stiffness, self.damping) = (restitution, stiffness, damping);
    }

    /// e of an impact with y′ − x′ = `slide`, and the share of it that falls: the exponent, 0 where e is constant or at its
    /// maximum.
    pub fn restitution(&self, slide: T) -> (T, T) {
        let constant = (self.restitution, T::of(0.0));
        let Some(law) = self.falling else { return constant };
        let speed = if slide.value() < 0.0 { -slide } else { slide };
        let e = self.restitution * (speed / T::of(law.reference)).power(-law.exponent);
        if e.value() < law.maximum { (e, T::of(law.exponent)) } else { (T::of(law.maximum), T::of(0.0)) }
    }
}
