//! The particle's cavity: how its walls, its place and its direction differ from the plain one.

use super::Wall;
use crate::io::{Invalid, finite, require};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// How a cavity differs from one with two equal walls at y − x = ±d on a structure that moves horizontally, which is the
/// default.
///
/// x is measured from where the structure rests without the particle: the weight of the structure itself needs no term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[serde(default)]
pub struct Cavity {
    /// The wall at the positive side, where it differs from the one at the negative side.
    pub positive_wall: Option<Wall>,
    /// y − x in the middle between the walls, m: they are at y − x = offset ± d.
    pub offset_m: f64,
    /// Angle of the motion to the horizontal, degrees, −90 to 90: above 0, +x and +y point upwards.
    pub inclination_deg: f64,
}

impl Cavity {
    /// sin of the inclination: the share of g along the motion, positive against +y.
    #[must_use]
    pub fn rise(&self) -> f64 {
        libm::sin(self.inclination_deg.to_radians())
    }

    /// cos of the inclination: the share of g that presses the particle on its floor. Exactly 0 in an upright cavity.
    #[must_use]
    pub fn level(&self) -> f64 {
        libm::sin((90.0 - self.inclination_deg.abs()).to_radians())
    }

    /// Checks that every value is physical.
    pub(super) fn validate(&self) -> Result<(), Invalid> {
        if let Some(wall) = &self.positive_wall {
            wall.validate().map_err(of_positive_wall)?;
        }
        finite("particle.offset_m", self.offset_m)?;
        let degrees = self.inclination_deg;
        require((-90.0..=90.0).contains(&degrees), "particle.inclination_deg", degrees, "from -90 to 90")
    }
}

/// The same refusal of the wall at the positive side.
fn of_positive_wall(invalid: Invalid) -> Invalid {
    let parameter = match invalid.parameter {
        "particle.wall.coefficient" => "particle.positive_wall.coefficient",
        "particle.wall.reference_speed_m_per_s" => "particle.positive_wall.reference_speed_m_per_s",
        "particle.wall.exponent" => "particle.positive_wall.exponent",
        "particle.wall.maximum" => "particle.positive_wall.maximum",
        "particle.wall.coefficients" => "particle.positive_wall.coefficients",
        "particle.wall.speeds_m_per_s" => "particle.positive_wall.speeds_m_per_s",
        "particle.wall.stiffness_n_per_m" => "particle.positive_wall.stiffness_n_per_m",
        "particle.wall.damping_n_s_per_m" => "particle.positive_wall.damping_n_s_per_m",
        "particle.wall.stiffness_n_per_m15" => "particle.positive_wall.stiffness_n_per_m15",
        "particle.wall.coefficient_s_per_m" => "particle.positive_wall.coefficient_s_per_m",
        other => other,
    };
    Invalid { parameter, ..invalid }
}
