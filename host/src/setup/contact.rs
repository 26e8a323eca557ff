//! What a file states of a wall's contact besides the model of the wall. Of a hard wall it turns the impulse of an impact, which takes no time,
//! into a force and does not change the motion. Also says what acts in place of a wall with Hertz contact.

use damprig_core::model::{HERTZ_TABLE_ERROR, Hertz, ImpactLaw, Particle};
use damprig_structures::PiezoelectricWall;

/// The contact of a wall, as the file states it.
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
    /// That of the wall with Hertz contact that the hard wall stands for.
    HertzWall(Hertz),
    /// That of a piezoelectric wall, which acts in place of the soft wall.
    Piezoelectric(PiezoelectricWall),
}

impl StatedContact {
    /// The largest force of an impact with this approach speed v, m/s, on a wall with this law of impact, N. `reduced_mass_kg` is
    /// mM/(M + m) of particle and structure.
    ///
    /// A pulse has the impulse J = mM/(M + m)·v·(1 + e(v)) and the peak factor·J/τ. An elastic contact has the force at which it has
    /// stored the whole energy of the approach; e does not enter. A wall with Hertz contact has that of a free impact
    /// ([`Hertz::peak_force_n`]), a piezoelectric wall that of a free impact at open circuit. All rise with v.
    #[must_use]
    pub fn peak_force_n(&self, law: &ImpactLaw<f64>, reduced_mass_kg: f64, speed_m_per_s: f64) -> f64 {
        match *self {
            Self::Pulse { time_s, factor } => {
                factor * reduced_mass_kg * speed_m_per_s * (1.0 + law.at(speed_m_per_s)) / time_s
            }
            Self::Elastic(wall) | Self::HertzWall(wall) => wall.peak_force_n(reduced_mass_kg, speed_m_per_s),
            Self::Piezoelectric(wall) => {
                let open = wall.stiffness_n_per_m + wall.coupling_n_per_v.powi(2) / wall.capacitance_f;
                speed_m_per_s * (open * reduced_mass_kg).sqrt()
            }
        }
    }

    /// The piezoelectric wall, if it is one.
    #[must_use]
    pub const fn piezoelectric(&self) -> Option<PiezoelectricWall> {
        if let Self::Piezoelectric(wall) = *self { Some(wall) } else { None }
    }
}

/// The contacts of the walls of a particle as hard ones: of a wall with Hertz contact its own, of another that of the file.
#[must_use]
pub fn contacts_of(particle: &Particle, stated: [Option<StatedContact>; 2]) -> [Option<StatedContact>; 2] {
    let [negative, positive] = particle.walls().map(|wall| wall.hertz().map(StatedContact::HertzWall));
    [negative.or(stated[0]), positive.or(stated[1])]
}

/// What acts in place of walls with these Hertz contacts where impacts take no time; `None` without one.
#[must_use]
pub fn hertz_as_hard(laws: impl IntoIterator<Item = Hertz>) -> Option<String> {
    let of = |law: Hertz| match law.table() {
        None => format!("e = {:.4} of its free impacts", law.restitution(1.0)),
        Some((_, fastest_m_per_s)) => {
            format!(
                "e over the speed of its free impacts, from a table within {HERTZ_TABLE_ERROR} up to {fastest_m_per_s:.3} m/s"
            )
        }
    };
    let mut all: Vec<String> = laws.into_iter().map(of).collect();
    all.dedup();
    (!all.is_empty())
        .then(|| format!("a Hertz wall acts as a hard wall with {}; its contacts take no time", all.join(" or ")))
}
