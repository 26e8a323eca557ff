//! The contact of a hard wall: what turns the impulse of an impact, which takes no time, into a force. It does not change the motion.

use damprig_core::model::ImpactLaw;

/// The contact of a hard wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contact {
    /// A pulse of one duration at every speed.
    Pulse {
        /// τ, s; greater than 0.
        time_s: f64,
        /// Peak times duration over impulse, 1 or greater: π/2 of a half-sine.
        factor: f64,
    },
    /// Elastic spheres, F = k δ^(3/2).
    Hertz {
        /// k, N/m^1.5; greater than 0.
        stiffness_n_per_m15: f64,
    },
}

impl Contact {
    /// The largest force of an impact with this approach speed v, m/s, on a wall with this law of impact, N. `reduced_mass_kg` is
    /// mM/(M + m) of particle and structure.
    ///
    /// A pulse has the impulse J = mM/(M + m)·v·(1 + e(v)) and the peak factor·J/τ. Hertz: k (5 mM/(M + m) v²/(4k))^(3/5), the force
    /// at which an elastic contact has stored the whole energy of the approach (Johnson, *Contact Mechanics*, 1985, section 11.4);
    /// e does not enter. Both rise with v.
    #[must_use]
    pub fn peak_force_n(&self, law: &ImpactLaw<f64>, reduced_mass_kg: f64, speed_m_per_s: f64) -> f64 {
        match *self {
            Self::Pulse { time_s, factor } => {
                factor * reduced_mass_kg * speed_m_per_s * (1.0 + law.at(speed_m_per_s)) / time_s
            }
            Self::Hertz { stiffness_n_per_m15: k } => {
                k * libm::pow(1.25 * reduced_mass_kg * speed_m_per_s * speed_m_per_s / k, 0.6)
            }
        }
    }
}
