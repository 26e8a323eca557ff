//! A set-up: a linear structure and the dampers mounted on it, in SI units, as plain data.

use damprig_core::model::{FrictionDamper, GRAVITY_M_PER_S2, Particle, Structure, Tmd, Wall};

/// A natural mode of the structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Undamped natural angular frequency ω, rad/s; greater than 0.
    pub angular_frequency_rad_per_s: f64,
    /// Damping ratio ζ, 0 or greater.
    pub damping_ratio: f64,
    /// Displacement of each place in this mode, normalised to a modal mass of 1 kg, 1/√kg.
    pub shape: Vec<f64>,
    /// Participation Γ = φᵀ M ι of the mode in a motion of the base, √kg: q″ + 2ζω q′ + ω² q = −Γ z″.
    pub participation: f64,
}

/// A linear structure on a base with displacement z: its natural modes at the places where something acts or is observed.
///
/// With modal coordinates q the displacement of place p is x = Σ φ q + ι z.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    /// The modes, in any order.
    pub modes: Vec<Mode>,
    /// ι of each place: its displacement per displacement of the base when the structure moves as a rigid body; 1 where the place moves
    /// along with the base.
    pub influence: Vec<f64>,
    /// Damping that is not modal: the matrix C of `q″ + (2ζω + C) q′ + …` by rows, 1/s, symmetric; empty for modal damping.
    pub coupling_per_s: Vec<f64>,
}

impl From<Structure> for Modes {
    /// One mode and one place.
    fn from(structure: Structure) -> Self {
        let root = structure.mass_kg.sqrt();
        let mode = Mode {
            angular_frequency_rad_per_s: structure.angular_frequency_rad_per_s(),
            damping_ratio: structure.damping_ratio(),
            shape: vec![1.0 / root],
            participation: root,
        };
        Self { modes: vec![mode], influence: vec![1.0], coupling_per_s: Vec::new() }
    }
}

/// An impact damper at a place: a particle in a cavity that is fixed to the structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpactDamper {
    /// Number of the place.
    pub place: usize,
    /// The particle, its cavity and its walls; a wall with Hertz contact is refused.
    pub particle: Particle,
}

/// A friction damper between a place and the base, or between two places: a set-valued Coulomb force on their relative velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionJoint {
    /// Number of the place.
    pub place: usize,
    /// Number of the other place; `None`: the base.
    pub other: Option<usize>,
    /// The damper; its force is greater than 0.
    pub damper: FrictionDamper,
}

/// A tuned mass damper at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TunedMass {
    /// Number of the place.
    pub place: usize,
    /// Mass, spring and dashpot.
    pub tmd: Tmd,
}

/// A structure and the dampers mounted on it.
#[derive(Clone, Debug, PartialEq)]
pub struct SetUp {
    /// The structure.
    pub structure: Modes,
    /// Impact dampers.
    pub impact_dampers: Vec<ImpactDamper>,
    /// Friction dampers.
    pub friction_dampers: Vec<FrictionJoint>,
    /// Tuned mass dampers.
    pub tuned_masses: Vec<TunedMass>,
    /// g in the weight of the particles, m/s²; 0 or greater.
    pub gravity_m_per_s2: f64,
    /// The place at which the excitation's force acts; `None`: the excitation moves the base.
    pub driven_place: Option<usize>,
}

impl SetUp {
    /// The structure without dampers, on a moving base.
    #[must_use]
    pub fn bare(structure: impl Into<Modes>) -> Self {
        Self {
            structure: structure.into(),
            impact_dampers: Vec::new(),
            friction_dampers: Vec::new(),
            tuned_masses: Vec::new(),
            gravity_m_per_s2: GRAVITY_M_PER_S2,
            driven_place: None,
        }
    }
}
