//! A set-up as written: quantities relative to the base amplitude are resolved once Z is known.

use damprig_core::control::friction_spring::SpringConfig;
use damprig_core::model::{Cavity, FrictionDamper, Particle, SetUp, Structure, Tmd, Wall};

use super::contact::StatedContact;

/// A quantity in its own unit, or relative to the base amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Relative {
    Absolute(f64),
    Ratio(f64),
}

/// Position of the particle at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StartPlace {
    /// Share of the clearance from the centre, −1 to 1.
    Share(f64),
    /// y − x, m.
    Metres(f64),
    /// Anywhere between the walls.
    Unknown,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ParticleSpec {
    pub(super) mass_kg: f64,
    pub(super) clearance: Relative,
    pub(super) friction_coefficient: f64,
    pub(super) wall: Wall,
    pub(super) cavity: Cavity,
    pub(super) contacts: [Option<StatedContact>; 2],
    pub(super) place: StartPlace,
    /// The position was written, not left to its default.
    pub(super) is_placed: bool,
}

impl ParticleSpec {
    fn clearance_m(&self, base_amplitude_m: f64) -> f64 {
        match self.clearance {
            Relative::Absolute(clearance) => clearance,
            Relative::Ratio(ratio) => ratio * base_amplitude_m,
        }
    }
}

/// A friction damper of constant force, or one whose spring the rig adjusts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum FrictionSpec {
    Constant(Relative),
    Tuned(SpringSpec),
}

/// Target of the friction damper's spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpringTarget {
    /// γF = μe·F_N/(kZ), kept while Z changes.
    FrictionRatio(f64),
    /// F_N, N.
    NormalForce(f64),
    /// Δs from the zero reading, m.
    Deflection(f64),
}

/// A friction damper whose spring the rig adjusts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringSpec {
    /// Its target.
    pub target: SpringTarget,
    /// μe between block and base; the board's unless stated.
    pub friction_coefficient: f64,
    /// Approximate k_s, N/m (the rig measures it); the board's unless stated.
    pub stiffness_n_per_m: f64,
    /// Whether the campaign states the friction coefficient, and whether the stiffness.
    pub(super) states: [bool; 2],
}

impl SpringSpec {
    /// μe and k_s where the campaign states them.
    #[must_use]
    pub fn stated(&self) -> [Option<f64>; 2] {
        let [friction, stiffness] = self.states;
        [friction.then_some(self.friction_coefficient), stiffness.then_some(self.stiffness_n_per_m)]
    }

    /// The normal force of the target on a structure of this stiffness at base amplitude Z, N.
    #[must_use]
    pub fn normal_force_n(&self, structure_stiffness_n_per_m: f64, base_amplitude_m: f64) -> f64 {
        match self.target {
            SpringTarget::FrictionRatio(ratio) => {
                ratio * structure_stiffness_n_per_m * base_amplitude_m / self.friction_coefficient
            }
            SpringTarget::NormalForce(force) => force,
            SpringTarget::Deflection(deflection) => self.stiffness_n_per_m * deflection,
        }
    }
}

/// A set-up as written; quantities may be relative to the base amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetUpSpec {
    pub(super) structure: Structure,
    pub(super) particle: Option<ParticleSpec>,
    pub(super) friction: Option<FrictionSpec>,
    pub(super) tmd: Option<Tmd>,
    pub(super) gravity_m_per_s2: f64,
    pub(super) is_force_driven: bool,
}

impl SetUpSpec {
    /// Completes the spring properties that the campaign does not state from the board's settings.
    pub(crate) fn on_board(&mut self, board: &SpringConfig) {
        let Some(FrictionSpec::Tuned(spring)) = &mut self.friction else { return };
        let [friction, stiffness] = spring.stated();
        spring.friction_coefficient = friction.unwrap_or(f64::from(board.friction_coefficient));
        spring.stiffness_n_per_m = stiffness.unwrap_or(f64::from(board.stiffness_n_per_m));
    }

    /// The set-up in SI units at base amplitude Z, m.
    #[must_use]
    pub fn at(&self, base_amplitude_m: f64) -> SetUp {
        let stiffness_n_per_m = self.structure.stiffness_n_per_m;
        SetUp {
            structure: self.structure,
            particle: self.particle.map(|p| Particle {
                mass_kg: p.mass_kg,
                clearance_m: p.clearance_m(base_amplitude_m),
                friction_coefficient: p.friction_coefficient,
                wall: p.wall,
                cavity: p.cavity,
            }),
            friction_damper: self.friction.map(|friction| FrictionDamper {
                force_n: match friction {
                    FrictionSpec::Constant(Relative::Absolute(force)) => force,
                    FrictionSpec::Constant(Relative::Ratio(ratio)) => ratio * stiffness_n_per_m * base_amplitude_m,
                    FrictionSpec::Tuned(spring) => {
                        spring.friction_coefficient * spring.normal_force_n(stiffness_n_per_m, base_amplitude_m)
                    }
                },
            }),
            tmd: self.tmd,
            gravity_m_per_s2: self.gravity_m_per_s2,
            is_force_driven: self.is_force_driven,
        }
    }

    /// P/k, m: the static deflection under a force, which takes the place of the base amplitude.
    #[must_use]
    pub fn static_deflection_m(&self, force_n: f64) -> f64 {
        force_n / self.structure.stiffness_n_per_m
    }

    /// Whether any quantity is relative to the base amplitude.
    #[must_use]
    pub fn is_relative(&self) -> bool {
        let by_friction = match self.friction {
            Some(FrictionSpec::Constant(force)) => matches!(force, Relative::Ratio(_)),
            Some(FrictionSpec::Tuned(spring)) => matches!(spring.target, SpringTarget::FrictionRatio(_)),
            None => false,
        };
        by_friction || self.particle.is_some_and(|p| matches!(p.clearance, Relative::Ratio(_)))
    }

    /// y − x at the start at base amplitude Z, m; 0 without a particle; the middle of the cavity where it is not known.
    #[must_use]
    pub fn particle_start_m(&self, base_amplitude_m: f64) -> f64 {
        self.particle.map_or(0.0, |p| match p.place {
            StartPlace::Share(share) => p.cavity.offset_m + share * p.clearance_m(base_amplitude_m),
            StartPlace::Metres(start) => start,
            StartPlace::Unknown => p.cavity.offset_m,
        })
    }

    /// Whether the particle may start anywhere.
    #[must_use]
    pub fn is_start_unknown(&self) -> bool {
        self.particle.is_some_and(|p| p.place == StartPlace::Unknown)
    }

    /// The same with a particle that starts at this share of the clearance from the centre, −1 to 1.
    #[must_use]
    pub fn starting_at(mut self, share: f64) -> Self {
        if let Some(particle) = &mut self.particle {
            particle.place = StartPlace::Share(share);
        }
        self
    }

    /// The structure.
    #[must_use]
    pub fn structure(&self) -> &Structure {
        &self.structure
    }

    /// The table of a damper that it has, if any.
    #[must_use]
    pub fn damper(&self) -> Option<&'static str> {
        let particle = self.particle.map(|_| "particle");
        particle.or(self.friction.map(|_| "friction_damper")).or(self.tmd.map(|_| "tmd"))
    }

    /// Whether a wall of its particle is piezoelectric.
    #[must_use]
    pub fn harvests(&self) -> bool {
        self.contacts().into_iter().flatten().any(|contact| contact.piezoelectric().is_some())
    }

    /// The contacts of its walls at the negative and the positive side, where they are stated.
    #[must_use]
    pub fn contacts(&self) -> [Option<StatedContact>; 2] {
        self.particle.map_or([None; 2], |p| p.contacts)
    }

    /// Whether it states where the particle starts.
    #[must_use]
    pub fn places_particle(&self) -> bool {
        self.particle.is_some_and(|p| p.is_placed)
    }

    /// The friction damper's spring, if the rig adjusts it.
    #[must_use]
    pub fn spring(&self) -> Option<SpringSpec> {
        match self.friction {
            Some(FrictionSpec::Tuned(spring)) => Some(spring),
            _ => None,
        }
    }
}
