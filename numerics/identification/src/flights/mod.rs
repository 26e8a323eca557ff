//! Coefficient of restitution and clearance from the impacts that a run recorded, and from x.
//!
//! Between two impacts on opposite walls the particle flies over a known distance in a known time, so its velocity follows from the
//! impact times, x at these times and the clearance d: y changes by x(t₂) + s₂d − x(t₁) − s₁d, with the wall s = ±1. Friction
//! changes the velocity evenly in flight. The structure's velocity at an impact, its jump there and its position come from a fit
//! to x on both sides (`kink`). Two equations hold for each impact, with β = m/M, the particle's velocities u and the
//! structure's velocity v before the impact:
//!
//! - impact law: u_after = u_before − (1 + e)/(1 + β)·(u_before − v)
//! - momentum: the structure's velocity jumps by β·(u_before − u_after)
//!
//! [`identify`] fits e, d, the friction and the time from the impact's pulse to the kink of x to all of them, and the third-order
//! error of a sensor that has one. The equations are linear in x, d and the friction together, so an error of the sensor's scale
//! does not change e.

mod answer;
mod estimate;
mod kink;
mod usable;

pub use estimate::{Flights, identify};
pub use usable::LeftOut;

use damprig_core::model::SetUp;

use super::Sensors;
use crate::Refused;

/// An impact as the board measured it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Centre of its pulse, s, on the clock of the samples.
    pub t_s: f64,
    /// +1 for the wall at y − x = +d, −1 for the other.
    pub side: f64,
    /// Length of the half sine with the pulse's peak and impulse, s.
    pub contact_s: f64,
    /// A reading was clipped: the contact time is not known.
    pub clipped: bool,
    /// The particle came to rest on the wall.
    pub held: bool,
}

/// x and the impacts of one start of an experiment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// Times of the readings, rising, s.
    pub t_s: Vec<f64>,
    /// Readings of x, m.
    pub x_m: Vec<f64>,
    /// Impacts in the order of their times.
    pub hits: Vec<Hit>,
}

/// What the set-up states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownSetUp {
    /// ω = √(k/M), rad/s.
    pub angular_frequency_rad_per_s: f64,
    /// ζ of the structure.
    pub damping_ratio: f64,
    /// β = m/M.
    pub mass_ratio: f64,
    /// μi·g, m/s².
    pub friction_m_per_s2: f64,
    /// Whether μi is taken as stated instead of fitted; 0 is always taken.
    pub is_friction_held: bool,
    /// d as the set-up states it, m.
    pub clearance_m: f64,
    /// Whether d is taken as stated instead of fitted.
    pub is_clearance_held: bool,
    /// The displacement sensor; its third-order error is fitted where it has one.
    pub sensors: Sensors,
    /// Relative standard uncertainty of the mass ratio.
    pub mass_ratio_uncertainty: f64,
}

impl KnownSetUp {
    /// Of a set-up with a particle between hard walls.
    ///
    /// # Errors
    /// A set-up without a particle, with soft walls, or with a friction damper.
    pub fn of(set_up: &SetUp) -> Result<Self, Refused> {
        let refuse = |text: &str| Err(Refused(text.into()));
        let Some(particle) = set_up.particle else {
            return refuse("has no particle\n  choose a set-up with an impact damper");
        };
        if set_up.has_soft_walls() {
            return refuse(
                "has soft walls, which have no coefficient of restitution\n  `damprig identify wall` gives k1 and η",
            );
        }
        if !particle.is_symmetric() {
            return refuse(
                "has two different walls or is inclined: the method takes one coefficient of restitution from flights at constant \
                 velocity\n  use equal walls on a level, or a drop test of each wall",
            );
        }
        if set_up.friction_damper.is_some_and(|damper| damper.force_n > 0.0) {
            return refuse(
                "has a friction damper, whose force changes its sign at every reversal: the jumps of x' are not those of the \
                 impacts alone\n  measure the particle without the friction damper",
            );
        }
        Ok(Self {
            angular_frequency_rad_per_s: set_up.structure.angular_frequency_rad_per_s(),
            damping_ratio: set_up.structure.damping_ratio(),
            mass_ratio: particle.mass_kg / set_up.structure.mass_kg,
            friction_m_per_s2: set_up.internal_friction_m_per_s2(),
            is_friction_held: false,
            clearance_m: particle.clearance_m,
            is_clearance_held: false,
            sensors: Sensors::EXACT,
            mass_ratio_uncertainty: 0.0,
        })
    }
}
