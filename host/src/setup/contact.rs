//! The contact of a hard wall: what turns the impulse of an impact, which takes no time, into a force. It does not change the motion.

use damprig_core::model::{Hertz, ImpactLaw};

/// The contact of a hard wall, as the file states it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StatedContact {
    /// A pulse of one duration at every speed.
    Pulse {
        /// τ, s; greater than 0.
        time_s: f64,
        /// Peak times duration over impulse, 1 or greater: π/2 of a half-sine.
        factor: f64,
    },
    /// Elastic spheres.
    Elastic(Hertz),
}

impl StatedContact {
    /// The largest force of an impact with this approach speed v, m/s, on a wall with this law of impact, N. `reduced_mass_kg` is
    /// mM/(M + m) of particle and structure.
    ///
    /// A pulse has the impulse J = mM/(M + m)·v·(1 + e(v)) and the peak factor·J/τ. An elastic contact has the force at which it has
    /// stored the whole energy of the approach ([`Hertz::peak_force_n`]); e does not enter. Both rise with v.
    #[must_use]
    pub fn peak_force_n(&self, law: &ImpactLaw<f64>, reduced_mass_kg: f64, speed_m_per_s: f64) -> f64 {
        match *self {
            Self::Pulse { time_s, factor } => {
                factor * reduced_mass_kg * speed_m_per_s * (1.0 + law.at(speed_m_per_s)) / time_s
            }
            Self::Elastic(wall) => wall.peak_force_n(reduced_mass_kg, speed_m_per_s),
        }
    }
}
