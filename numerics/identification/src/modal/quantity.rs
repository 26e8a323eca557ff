//! What a frequency response is of: a motion per force, or a motion per motion.

use damprig_fourier::Complex;

/// How a frequency response states the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionKind {
    /// m.
    Displacement,
    /// m/s.
    Velocity,
    /// m/s².
    Acceleration,
}

/// Quantities of a frequency response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Displacement, velocity or acceleration.
    motion: MotionKind,
    /// Whether the motion is per force; else per a motion of the same kind.
    is_per_force: bool,
    /// Whether the file has the inverse: force per motion.
    is_inverse: bool,
    /// SI units per unit of the file's values.
    pub si: f64,
}

impl Quantity {
    /// Of a motion per force, or of force per motion (`is_inverse`).
    #[must_use]
    pub const fn of_force(motion: MotionKind, is_inverse: bool, si: f64) -> Self {
        Self { motion, is_per_force: true, is_inverse, si }
    }

    /// Of a motion per motion of the same kind.
    #[must_use]
    pub const fn of_base(motion: MotionKind, si: f64) -> Self {
        Self { motion, is_per_force: false, is_inverse: false, si }
    }

    /// Motion per excitation in SI units, of a value of the file.
    #[must_use]
    pub fn in_si(&self, value: Complex<f64>) -> Complex<f64> {
        let value = value * self.si;
        if self.is_inverse { value.inv() } else { value }
    }

    /// Its name, for people.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match (self.is_per_force, self.is_inverse, self.motion) {
            (false, ..) => "transmissibility",
            (_, false, MotionKind::Displacement) => "receptance",
            (_, false, MotionKind::Velocity) => "mobility",
            (_, false, _) => "accelerance",
            (_, true, MotionKind::Displacement) => "dynamic stiffness",
            (_, true, MotionKind::Velocity) => "impedance",
            (_, true, _) => "apparent mass",
        }
    }

    /// SI unit of motion per excitation; "" for a transmissibility.
    #[must_use]
    pub fn si_unit(&self) -> &'static str {
        match (self.is_per_force, self.motion) {
            (false, _) => "",
            (_, MotionKind::Displacement) => "m/N",
            (_, MotionKind::Velocity) => "(m/s)/N",
            _ => "(m/s²)/N",
        }
    }

    /// Whether it is a motion per force.
    #[must_use]
    pub fn is_per_force(&self) -> bool {
        self.is_per_force
    }

    /// What is added to, and what multiplies Σ Aₘ/(ωₘ² − ω² + 2ζₘωₘωj) to give H: (jω)ⁿ of a displacement's n-th derivative per force; of a
    /// transmissibility 1 and ω², since the base pushes by −z″ and x is absolute.
    #[must_use]
    pub fn of_receptance(&self, omega: f64) -> (Complex<f64>, Complex<f64>) {
        let real = |value: f64| Complex::new(value, 0.0);
        match (self.is_per_force, self.motion) {
            (false, _) => (real(1.0), real(omega * omega)),
            (_, MotionKind::Displacement) => (real(0.0), real(1.0)),
            (_, MotionKind::Velocity) => (real(0.0), Complex::new(0.0, omega)),
            _ => (real(0.0), real(-omega * omega)),
        }
    }
}
