//! Mechanical model of a set-up: structure, impact damper, friction damper and tuned mass damper, in SI units, as plain
//! data.
//!
//! [`SetUp`] is what files and the protocol carry. [`SetUp::validate`] alone decides which values are physical. Soft
//! walls from material data are in [`soft_wall`](DampingLaw), tuning rules in [`Tuning`]. Motions, including that of
//! the base, are in [`crate::integrator`].

mod cavity;
mod hertz;
mod soft_wall;
mod speed_table;
mod tuning;
mod wall;

use crate::io::{Invalid, finite, not_negative, positive, require};
use core::f64::consts::PI;
use postcard_schema::Schema;
use serde::ser::{SerializeStruct, Serializer};
use serde::{Deserialize, Serialize};

pub use cavity::Cavity;
pub use hertz::{Dissipation, HERTZ_TABLE_ERROR, Hertz};
pub use soft_wall::{DampingLaw, Material};
pub use speed_table::{SPEED_TABLE_POINTS, SpeedTable};
pub use tuning::Tuning;
pub use wall::{ImpactLaw, Release, Restitution, Wall};

/// Standard gravity in the rig's defaults, m/s².
pub const GRAVITY_M_PER_S2: f64 = 9.81;

/// The single-degree-of-freedom structure: M x″ + c (x′ − z′) + k (x − z) = forces, base displacement z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Structure {
    /// M, kg; greater than 0.
    pub mass_kg: f64,
    /// k, N/m; greater than 0.
    pub stiffness_n_per_m: f64,
    /// c, N·s/m; 0 or greater.
    pub damping_n_s_per_m: f64,
}

impl Structure {
    /// Makes a structure from the results of a free-vibration test: mass in kg, undamped natural frequency in Hz, damping
    /// ratio ζ = c/(2√(kM)).
    #[must_use]
    pub fn from_modal(mass_kg: f64, natural_frequency_hz: f64, damping_ratio: f64) -> Self {
        let omega = 2.0 * PI * natural_frequency_hz;
        Self {
            mass_kg,
            stiffness_n_per_m: mass_kg * omega * omega,
            damping_n_s_per_m: 2.0 * damping_ratio * mass_kg * omega,
        }
    }

    /// ω = √(k/M), rad/s.
    #[must_use]
    pub fn angular_frequency_rad_per_s(&self) -> f64 {
        libm::sqrt(self.stiffness_n_per_m / self.mass_kg)
    }

    /// ζ = c/(2√(kM)).
    #[must_use]
    pub fn damping_ratio(&self) -> f64 {
        self.damping_n_s_per_m / (2.0 * libm::sqrt(self.stiffness_n_per_m * self.mass_kg))
    }
}

/// A single particle that slides between two walls fixed to the structure.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Schema)]
pub struct Particle {
    /// m, kg; greater than 0.
    pub mass_kg: f64,
    /// d, m: half the free travel, so the particle moves within |y − x| ≤ d, from the middle of its cavity; greater than 0.
    pub clearance_m: f64,
    /// μi of the dry friction between particle and structure; 0 or greater.
    pub friction_coefficient: f64,
    /// Both walls; of a [`Cavity`] with a wall of its own at the positive side, that at the negative side.
    pub wall: Wall,
    /// How the cavity differs from one with equal walls at ±d on a level structure.
    #[serde(default)]
    pub cavity: Cavity,
}

/// As derived, but a text (JSON) has no plain cavity: it is then as it was before there were others.
impl Serialize for Particle {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let has_cavity = !serializer.is_human_readable() || self.cavity != Cavity::default();
        let mut fields = serializer.serialize_struct("Particle", 4 + usize::from(has_cavity))?;
        fields.serialize_field("mass_kg", &self.mass_kg)?;
        fields.serialize_field("clearance_m", &self.clearance_m)?;
        fields.serialize_field("friction_coefficient", &self.friction_coefficient)?;
        fields.serialize_field("wall", &self.wall)?;
        if has_cavity {
            fields.serialize_field("cavity", &self.cavity)?;
        }
        fields.end()
    }
}

impl Particle {
    /// The walls at y − x = offset − d and offset + d.
    #[must_use]
    pub fn walls(&self) -> [Wall; 2] {
        [self.wall, self.cavity.positive_wall.unwrap_or(self.wall)]
    }

    /// y − x at the walls, m.
    #[must_use]
    pub fn ends_m(&self) -> [f64; 2] {
        [self.cavity.offset_m - self.clearance_m, self.cavity.offset_m + self.clearance_m]
    }

    /// Whether the mirror image of a motion is a motion too: equal walls, and no weight along the motion.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        let [negative, positive] = self.walls();
        negative == positive && self.cavity.inclination_deg == 0.0
    }

    /// The particle for motions whose impacts take no time: its walls with Hertz contact as hard ones ([`Wall::without_hertz`]).
    #[must_use]
    pub fn without_hertz(mut self) -> Self {
        self.wall = self.wall.without_hertz();
        self.cavity.positive_wall = self.cavity.positive_wall.map(Wall::without_hertz);
        self
    }
}

/// A dry friction damper between the structure and the moving base: a set-valued Coulomb force on x′ − z′.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct FrictionDamper {
    /// F = μe·F_N, N: the friction force while slipping and the limit while stuck; 0 or greater.
    pub force_n: f64,
}

/// A tuned mass damper: a mass on a spring and a dashpot from the structure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Tmd {
    /// m, kg; greater than 0.
    pub mass_kg: f64,
    /// k1, N/m; greater than 0.
    pub stiffness_n_per_m: f64,
    /// c1, N·s/m; 0 or greater.
    pub damping_n_s_per_m: f64,
}

/// One mechanical set-up: a structure and the dampers mounted on it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SetUp {
    /// The structure.
    pub structure: Structure,
    /// The impact damper, if mounted.
    pub particle: Option<Particle>,
    /// The friction damper, if mounted.
    pub friction_damper: Option<FrictionDamper>,
    /// The tuned mass damper, if mounted (instead of a particle).
    pub tmd: Option<Tmd>,
    /// g in the particle's weight, and so in the internal friction force μi·m·g, m/s²; 0 or greater.
    pub gravity_m_per_s2: f64,
    /// The drive is a force P on the structure, over a base at rest: M x″ + c x′ + k x = P + forces, with the friction damper
    /// acting on x′. What is otherwise the base's motion then stands for P/k, the static deflection.
    #[serde(default)]
    pub is_force_driven: bool,
}

/// Initial positions and velocities of the masses, in the laboratory frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Initial {
    /// Structure displacement x, m.
    pub x_m: f64,
    /// Structure velocity x′, m/s.
    pub v_m_per_s: f64,
    /// Displacement y of the particle or the tuned mass, m; |y − x| ≤ d for a particle.
    pub y_m: f64,
    /// Velocity y′ of the particle or the tuned mass, m/s.
    pub u_m_per_s: f64,
}

impl SetUp {
    /// A structure without any damper.
    #[must_use]
    pub fn bare(structure: Structure) -> Self {
        Self {
            structure,
            particle: None,
            friction_damper: None,
            tmd: None,
            gravity_m_per_s2: GRAVITY_M_PER_S2,
            is_force_driven: false,
        }
    }

    /// Whether a particle with soft walls is mounted.
    #[must_use]
    pub fn has_soft_walls(&self) -> bool {
        self.particle.is_some_and(|particle| particle.walls().iter().any(Wall::is_soft))
    }

    /// Whether a particle with Hertz contact is mounted: only the exact integrator follows it.
    #[must_use]
    pub fn has_hertz_walls(&self) -> bool {
        self.particle.is_some_and(|particle| particle.walls().iter().any(|wall| wall.hertz().is_some()))
    }

    /// The set-up for motions whose impacts take no time: its walls with Hertz contact as hard ones ([`Wall::without_hertz`]).
    #[must_use]
    pub fn without_hertz(mut self) -> Self {
        self.particle = self.particle.map(Particle::without_hertz);
        self
    }

    /// The part of the weight along the motion that acts on the particle, per mass, m/s²: positive pulls it towards −y. 0 without
    /// a particle.
    #[must_use]
    pub fn weight_m_per_s2(&self) -> f64 {
        self.particle.map_or(0.0, |particle| self.gravity_m_per_s2 * particle.cavity.rise())
    }

    /// The largest acceleration of the particle by internal friction, μi·g·cos of the inclination, m/s². 0 without a particle.
    #[must_use]
    pub fn internal_friction_m_per_s2(&self) -> f64 {
        let friction =
            |particle: Particle| particle.friction_coefficient * self.gravity_m_per_s2 * particle.cavity.level();
        self.particle.map_or(0.0, friction)
    }

    /// Everything at rest, with the particle in the middle of its cavity.
    #[must_use]
    pub fn neutral(&self) -> Initial {
        Initial { y_m: self.particle.map_or(0.0, |particle| particle.cavity.offset_m), ..Initial::default() }
    }

    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first parameter outside its range.
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("structure.mass_kg", self.structure.mass_kg)?;
        positive("structure.stiffness_n_per_m", self.structure.stiffness_n_per_m)?;
        not_negative("structure.damping_n_s_per_m", self.structure.damping_n_s_per_m)?;
        not_negative("gravity_m_per_s2", self.gravity_m_per_s2)?;
        if let Some(particle) = &self.particle {
            positive("particle.mass_kg", particle.mass_kg)?;
            positive("particle.clearance_m", particle.clearance_m)?;
            not_negative("particle.friction_coefficient", particle.friction_coefficient)?;
            particle.wall.validate()?;
            particle.cavity.validate()?;
        }
        if let Some(damper) = &self.friction_damper {
            not_negative("friction_damper.force_n", damper.force_n)?;
        }
        if let Some(tmd) = &self.tmd {
            positive("tmd.mass_kg", tmd.mass_kg)?;
            positive("tmd.stiffness_n_per_m", tmd.stiffness_n_per_m)?;
            not_negative("tmd.damping_n_s_per_m", tmd.damping_n_s_per_m)?;
            require(
                self.particle.is_none(),
                "tmd.mass_kg",
                tmd.mass_kg,
                "left out when a particle is mounted: one or the other",
            )?;
        }
        Ok(())
    }

    /// Checks that no wall has Hertz contact, for motions whose impacts take no time or whose soft walls are linear.
    ///
    /// # Errors
    /// Names the stiffness of the wall.
    pub fn validate_without_hertz(&self) -> Result<(), Invalid> {
        let stiffness = self.particle.and_then(|p| p.walls().iter().find_map(Wall::hertz));
        stiffness.map_or(Ok(()), |hertz| {
            let allowed = "left out: only the exact integrator follows a wall with Hertz contact";
            require(false, "particle.wall.stiffness_n_per_m15", hertz.stiffness_n_per_m15, allowed)
        })
    }

    /// Checks a starting state against this set-up.
    ///
    /// # Errors
    /// A value that is not finite, or a particle outside its cavity.
    pub fn validate_initial(&self, initial: &Initial) -> Result<(), Invalid> {
        self.validate_state(initial, |_| false)
    }

    /// The same of a state of a motion, in which the particle may press into a soft wall without Hertz contact. What a wall with
    /// Hertz contact exerts depends on the speed at which the contact began, which a state does not tell.
    ///
    /// # Errors
    /// A value that is not finite, or a particle outside its cavity that does not press into such a wall.
    pub fn validate_moving(&self, state: &Initial) -> Result<(), Invalid> {
        self.validate_state(state, |wall| wall.spring_and_dashpot().is_some())
    }

    /// Checks a state in which the particle may be beyond a wall that it `may_press`.
    fn validate_state(&self, initial: &Initial, may_press: impl Fn(&Wall) -> bool) -> Result<(), Invalid> {
        finite("initial.x_m", initial.x_m)?;
        finite("initial.v_m_per_s", initial.v_m_per_s)?;
        finite("initial.y_m", initial.y_m)?;
        finite("initial.u_m_per_s", initial.u_m_per_s)?;
        if let Some(particle) = &self.particle {
            // A start "at the wall" is written as y = x ± d and may miss the wall by a rounding.
            let offset_m = particle.cavity.offset_m;
            let rounding_m = 4.0 * f64::EPSILON * (initial.x_m.abs() + offset_m.abs());
            let room = particle.clearance_m * (1.0 + 1e-12) + rounding_m;
            let from_middle_m = initial.y_m - initial.x_m - offset_m;
            require(
                from_middle_m.abs() <= room || may_press(&particle.walls()[usize::from(from_middle_m > 0.0)]),
                "initial.y_m",
                initial.y_m,
                "within particle.clearance_m of initial.x_m, plus the offset of the cavity (the particle starts inside its cavity)",
            )?;
        }
        Ok(())
    }
}
