//! A wall of the particle in the equations of motion, without units: its law of impact, or its spring and dashpot.

use damprig_core::integrator::modes::Sign;
use damprig_core::model::{Release, SpeedTable, Wall};

use crate::dual::Real;
use crate::parameter::WallValues;

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
    varying: Option<Varying<T>>,
    pub stiffness: T,
    pub damping: T,
    /// When a soft wall releases the particle; `None` of a hard one.
    pub release: Option<Release>,
}

/// Restitution that varies with the speed of the impact.
#[derive(Clone, Copy, Debug)]
enum Varying<T> {
    /// A power of the speed.
    Power { reference: f64, exponent: T, maximum: f64 },
    /// A table over the speed, and the unit of velocity, m/s.
    Table(SpeedTable, f64),
}

impl<T: Real> WallLaw<T> {
    /// Of a wall of the set-up; without one, of a hard wall without restitution.
    pub fn of(wall: Option<&Wall>, scales: &Scales<T>) -> Self {
        let (stiffness, damping) = wall.and_then(Wall::spring_and_dashpot).unwrap_or_default();
        let power = wall.and_then(Wall::falling).map(|law| Varying::Power {
            reference: law.reference_speed_m_per_s / scales.velocity_m_per_s,
            exponent: T::of(law.exponent),
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

    /// Takes the values that parameters change.
    pub fn set(&mut self, values: &WallValues<T>, scales: &Scales<T>) {
        self.restitution = values.restitution;
        (self.stiffness, self.damping) = (scales.stiffness(values.stiffness), scales.damping(values.damping));
        if let Some(Varying::Power { exponent, .. }) = &mut self.varying {
            *exponent = values.exponent;
        }
    }

    /// Of an impact with s = y′ − x′: the derivative of e(|s|) s, and how much larger e is than this derivative. Both are those of the
    /// faster side at a point of a table.
    pub fn restitution(&self, slide: T) -> (T, T) {
        let constant = |e| (e, T::of(0.0));
        let speed = if slide.value() < 0.0 { -slide } else { slide };
        match &self.varying {
            None => constant(self.restitution),
            Some(Varying::Power { reference, exponent, maximum }) => {
                let (about, ratio) = (exponent.value(), speed / T::of(*reference));
                let e = self.restitution * ratio.power(-about);
                if e.value() >= *maximum {
                    return constant(T::of(*maximum));
                }
                // The exponent differs from its value by derivatives alone, whose third power is 0.
                let moved = (T::of(about) - *exponent) * ratio.ln();
                let e = e * (T::of(1.0) + moved + T::of(0.5) * moved * moved);
                (e * (T::of(1.0) - *exponent), e * *exponent)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use damprig_core::model::Restitution;

    #[test]
    fn the_derivatives_by_the_exponent_are_those_of_the_power() {
        let law = Restitution { coefficient: 0.5, reference_speed_m_per_s: 0.4, exponent: 0.25, maximum: 0.95 };
        let wall = Wall::SpeedRestitution(law);
        type Second = Dual<Dual<f64>>;
        let one = Second::of(1.0);
        let mut by_exponent = WallLaw::of(Some(&wall), &Scales { velocity_m_per_s: 1.0, time: one, per_mass: one });
        let exponent = Dual { value: Dual::variable(0.25), slope: Dual::constant(1.0) };
        let zero = Second::of(0.0);
        let values = WallValues { restitution: Second::of(0.5), exponent, stiffness: zero, damping: zero };
        by_exponent.set(&values, &Scales { velocity_m_per_s: 1.0, time: one, per_mass: one });
        for speed in [0.1, 0.4, 2.0] {
            let (_, falls) = by_exponent.restitution(Second::of(speed));
            // p r^(−p): its derivatives by p are (1 − p ln r) r^(−p) and (p ln r − 2) ln r r^(−p).
            let (log, power) = ((speed / 0.4_f64).ln(), 0.5 * (speed / 0.4_f64).powf(-0.25));
            assert!((falls.value.value - 0.25 * power).abs() < 1e-15);
            assert!((falls.slope.value - (1.0 - 0.25 * log) * power).abs() < 1e-14);
            assert!((falls.slope.slope - (0.25 * log - 2.0) * log * power).abs() < 1e-14);
        }
    }
}
