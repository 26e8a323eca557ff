//! What a frequency response is of: a motion per force, or a motion per motion.

use damprig_fourier::Complex;

use crate::signal_file::unit::{Kind, Ratio};

/// Quantities of a frequency response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Displacement, velocity or acceleration.
    motion: Kind,
    /// Whether the motion is per force; else per a motion of the same kind.
    is_per_force: bool,
    /// Whether the file has the inverse: force per motion.
    is_inverse: bool,
    /// SI units per unit of the file's values.
    pub si: f64,
}

/// Units that a frequency response may have, for messages.
pub const UNITS: &str = "m/N, m/s/N, m/s2/N, g/N, N/m, N/(m/s), N/(m/s2), or m/m, g/g for a transmissibility x/z, also with mm, um, kN and others";

impl Quantity {
    /// Of a unit's text.
    ///
    /// # Errors
    /// No ratio of known units; a ratio that is no frequency response of a structure.
    pub fn of(text: &str) -> Result<Self, String> {
        let Some(Ratio { of, per }) = Ratio::of(text) else {
            return Err(format!("the unit {text:?} is not that of a frequency response: allowed are {UNITS}"));
        };
        let is_motion = |kind: Kind| matches!(kind, Kind::Displacement | Kind::Velocity | Kind::Acceleration);
        let si = of.si / per.si;
        match (of.kind, per.kind) {
            (motion, Kind::Force) if is_motion(motion) => {
                Ok(Self { motion, is_per_force: true, is_inverse: false, si })
            }
            (Kind::Force, motion) if is_motion(motion) => Ok(Self { motion, is_per_force: true, is_inverse: true, si }),
            (motion, base) if is_motion(motion) && motion == base => {
                Ok(Self { motion, is_per_force: false, is_inverse: false, si })
            }
            (of, per) => Err(format!(
                "the unit {text:?} is {} per {}: a frequency response of a structure is a motion per force, force per motion, or a \
                 motion per motion of the same kind: allowed are {UNITS}",
                of.text(),
                per.text()
            )),
        }
    }

    /// Motion per excitation in SI units, of a value of the file.
    pub(super) fn in_si(&self, value: Complex<f64>) -> Complex<f64> {
        let value = value * self.si;
        if self.is_inverse { value.inv() } else { value }
    }

    /// Its name, for people.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match (self.is_per_force, self.is_inverse, self.motion) {
            (false, ..) => "transmissibility",
            (_, false, Kind::Displacement) => "receptance",
            (_, false, Kind::Velocity) => "mobility",
            (_, false, _) => "accelerance",
            (_, true, Kind::Displacement) => "dynamic stiffness",
            (_, true, Kind::Velocity) => "impedance",
            (_, true, _) => "apparent mass",
        }
    }

    /// SI unit of motion per excitation; "" for a transmissibility.
    #[must_use]
    pub fn si_unit(&self) -> &'static str {
        match (self.is_per_force, self.motion) {
            (false, _) => "",
            (_, Kind::Displacement) => "m/N",
            (_, Kind::Velocity) => "(m/s)/N",
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
    pub(super) fn of_receptance(&self, omega: f64) -> (Complex<f64>, Complex<f64>) {
        let real = |value: f64| Complex::new(value, 0.0);
        match (self.is_per_force, self.motion) {
            (false, _) => (real(1.0), real(omega * omega)),
            (_, Kind::Displacement) => (real(0.0), real(1.0)),
            (_, Kind::Velocity) => (real(0.0), Complex::new(0.0, omega)),
            _ => (real(0.0), real(-omega * omega)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_say_what_a_response_is_of() {
        for (text, name, si) in [
            ("m/N", "receptance", 1.0),
            ("mm/kN", "receptance", 1e-6),
            ("m/s/N", "mobility", 1.0),
            ("m/s²/N", "accelerance", 1.0),
            ("(m/s^2)/N", "accelerance", 1.0),
            ("g/N", "accelerance", 9.80665),
            ("m_per_s2_per_n", "accelerance", 1.0),
            ("N/m", "dynamic stiffness", 1.0),
            ("N/(m/s)", "impedance", 1.0),
            ("N/m/s2", "apparent mass", 1.0),
            ("N/g", "apparent mass", 1.0 / 9.80665),
            ("g/g", "transmissibility", 1.0),
            ("m/s^2/m/s^2", "transmissibility", 1.0),
            ("mm/m", "transmissibility", 1e-3),
        ] {
            let quantity = Quantity::of(text).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(quantity.name(), name, "{text}");
            assert!((quantity.si / si - 1.0).abs() < 1e-12, "{text}: {}", quantity.si);
        }
        for (text, part) in [
            ("", "is not that of a frequency response"),
            ("m/s2", "is not that"),
            ("V/V", "is voltage per voltage"),
            ("g/m", "is acceleration per displacement"),
            ("N/N", "is force per force"),
            ("furlong/N", "allowed are m/N"),
        ] {
            let error = Quantity::of(text).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
