//! A wall of the particle in the equations of motion, without units: its law of impact, or its spring and dashpot.

use damprig_core::integrator::modes::Sign;
use damprig_core::model::{Release, SpeedTable, Wall};

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
    varying: Option<Varying>,
    pub stiffness: T,
    pub damping: T,
    /// When a soft wall releases the particle; `None` of a hard one.
    pub release: Option<Release>,
}

/// Restitution that varies with the speed of the impact.
#[derive(Clone, Copy, Debug)]
enum Varying {
    /// A power of the speed.
    Power { reference: f64, exponent: f64, maximum: f64 },
    /// A table over the speed, and the unit of velocity, m/s.
    Table(SpeedTable, f64),
}

impl<T: Real> WallLaw<T> {
    /// Of a wall of the set-up; without one, of a hard wall without restitution.
    pub fn of(wall: Option<&Wall>, scales: &Scales<T>) -> Self {
        let (stiffness, damping) = wall.and_then(Wall::spring_and_dashpot).unwrap_or_default();
        let power = wall.and_then(Wall::falling).map(|law| Varying::Power {
            reference: law.reference_speed_m_per_s / scales.velocity_m_per_s,
            exponent: law.exponent,
            maximum: law.maximum,
        });
        let table = wall.and_then(Wall::table).map(|table| Varying::Table(table, scales.velocity_m_per_s));
        Self {
            restitution: T::of(wall.and_then(Wall::restitution).map_or(0.0, |law| law.coefficient)),
            varying: power.or(table),
            stiffness: scales.stiffness(T::of(stiffness)),
            damping: scales.damping(T::of(damping)),
            release: wall.and_then(Wall::release),
        }
    }

    /// Takes coefficient of restitution, stiffness and damping from parameters.
    pub fn set(&mut self, restitution: T, stiffness: T, damping: T) {
        (self.restitution, self.stiffness, self.damping) = (restitution, stiffness, damping);
    }

    /// Of an impact with s = y′ − x′: the derivative of e(|s|) s, and how much larger e is than this derivative. Both are those of the
    /// faster side at a point of a table.
    pub fn restitution(&self, slide: T) -> (T, T) {
        let constant = |e| (e, T::of(0.0));
        let speed = if slide.value() < 0.0 { -slide } else { slide };
        match &self.varying {
            None => constant(self.restitution),
            Some(Varying::Power { reference, exponent, maximum }) => {
                let e = self.restitution * (speed / T::of(*reference)).power(-exponent);
                if e.value() >= *maximum {
                    return constant(T::of(*maximum));
                }
                (e * (T::of(1.0) - T::of(*exponent)), e * T::of(*exponent))
            }
            Some(Varying::Table(table, velocity_m_per_s)) => {
                let at = speed.value() * velocity_m_per_s;
                let (value, slope) = (table.at(at), table.slope(at) * velocity_m_per_s);
                // Linear about the value at the speed, with the slope of its piece.
                let e = T::of(value) + (speed - T::of(speed.value())) * T::of(slope);
                let rise = speed * T::of(slope);
                (e + rise, -rise)
            }
        }
    }
}
