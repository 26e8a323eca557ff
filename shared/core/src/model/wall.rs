//! A wall of the particle's cavity: hard, with a law of impact, or soft, with a law of force.

use super::Hertz;
use super::speed_table::{Pieces, SpeedTable};
use crate::io::{Invalid, not_negative, positive, require};
use crate::scalar::Scalar;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The walls at both ends of the particle's cavity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Wall {
    /// A hard wall: an instantaneous impact conserves momentum and multiplies the relative speed by the coefficient.
    Restitution {
        /// e, 0 (the particle does not bounce) to 1 (no energy is lost).
        coefficient: f64,
    },
    /// A soft wall: a spring and a dashpot in parallel that the particle presses into.
    Voigt {
        /// k1, N/m; greater than 0.
        stiffness_n_per_m: f64,
        /// c1, N·s/m; 0 or greater.
        damping_n_s_per_m: f64,
        /// Condition that ends the contact.
        release: Release,
    },
    /// A hard wall whose coefficient of restitution falls with the speed of the impact.
    SpeedRestitution(Restitution),
    /// A hard wall whose coefficient of restitution is a table over the speed of the impact.
    TableRestitution(SpeedTable),
    /// A wall with Hertz contact and dissipation: for motions of the exact integrator. A board refuses it: a hard wall takes its place.
    Hertz(Hertz),
}

/// Condition at which a particle leaves a soft wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Release {
    /// The penetration has returned to zero; the wall may pull until then.
    ZeroPenetration,
    /// The contact force would become tensile; a new contact requires the particle to have been back inside the
    /// clearance.
    ZeroForce,
}

/// Coefficient of restitution over the approach speed v: e(v) = min(coefficient·(v/reference speed)^(−exponent), maximum).
///
/// Real impacts lose more of their energy the faster they are: for impacts with plastic deformation the exponent is about
/// 1/4 (Johnson, *Contact Mechanics*, 1985, section 11.5). As the exponent is at most 1, the rebound speed v·e(v) never
/// falls as v rises.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Restitution {
    /// e at the reference speed, 0 to 1.
    pub coefficient: f64,
    /// Approach speed at which e is the coefficient, m/s; greater than 0.
    pub reference_speed_m_per_s: f64,
    /// Exponent, 0 (e does not depend on the speed) to 1.
    pub exponent: f64,
    /// Largest e, that of slow impacts: 0 to 1; less than 1 unless the exponent is 0, so that every chatter ends.
    pub maximum: f64,
}

impl Restitution {
    /// The same coefficient at every speed.
    #[must_use]
    pub const fn constant(coefficient: f64) -> Self {
        Self { coefficient, reference_speed_m_per_s: 1.0, exponent: 0.0, maximum: 1.0 }
    }

    /// e of an impact with this approach speed, m/s; greater than 0.
    #[must_use]
    pub fn at(&self, speed_m_per_s: f64) -> f64 {
        self.law(1.0).at(speed_m_per_s)
    }

    /// The law in the scalar of a calculation whose unit of velocity is this many m/s.
    #[must_use]
    pub fn law<S: Scalar>(&self, velocity_m_per_s: f64) -> ImpactLaw<S> {
        ImpactLaw(if self.exponent == 0.0 || self.coefficient == 0.0 {
            Law::Constant(S::from_f64(self.coefficient.min(self.maximum)))
        } else {
            Law::Power(Power {
                coefficient: S::from_f64(self.coefficient),
                reference: S::from_f64(self.reference_speed_m_per_s / velocity_m_per_s),
                exponent: S::from_f64(self.exponent),
                maximum: S::from_f64(self.maximum),
            })
        })
    }

    fn validate(&self) -> Result<(), Invalid> {
        let share = 0.0..=1.0;
        require(share.contains(&self.coefficient), "particle.wall.coefficient", self.coefficient, "from 0 to 1")?;
        positive("particle.wall.reference_speed_m_per_s", self.reference_speed_m_per_s)?;
        require(share.contains(&self.exponent), "particle.wall.exponent", self.exponent, "from 0 to 1")?;
        let (most, allowed) = (self.maximum, "from 0 to less than 1, or up to 1 where the exponent is 0");
        let below_one = self.exponent == 0.0 || most < 1.0;
        require(share.contains(&most) && below_one, "particle.wall.maximum", most, allowed)
    }
}

/// The law of impact of a hard wall in the scalar and the unit of velocity of a calculation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpactLaw<S>(Law<S>);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Law<S> {
    Constant(S),
    Power(Power<S>),
    Table(Pieces<S>),
}

/// [`Restitution`] whose exponent is greater than 0.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Power<S> {
    coefficient: S,
    reference: S,
    exponent: S,
    maximum: S,
}

/// Steps that find the approach speed of an impact where e follows a power of it.
const APPROACH_STEPS: u8 = 8;

impl<S: Scalar> Power<S> {
    fn at(&self, speed: S) -> S {
        (self.coefficient * (speed / self.reference).power(-self.exponent)).min(self.maximum)
    }

    /// As e falls with at most the first power of v, each step at least halves the error, which is below half the closing speed at the
    /// start.
    fn approach(&self, closing: S) -> S {
        let mut approach = closing;
        for _ in 0..APPROACH_STEPS {
            approach = closing / (S::ONE + self.at(approach));
        }
        approach
    }
}

impl<S: Scalar> Default for ImpactLaw<S> {
    /// Without rebound.
    fn default() -> Self {
        Self(Law::Constant(S::ZERO))
    }
}

impl<S: Scalar> ImpactLaw<S> {
    /// e of an impact with this approach speed; 0 or greater.
    #[inline]
    #[must_use]
    pub fn at(&self, speed: S) -> S {
        if let Law::Constant(e) = self.0 { e } else { self.varying(speed) }
    }

    /// A call of its own: the common constant coefficient stays inline.
    fn varying(&self, speed: S) -> S {
        match &self.0 {
            Law::Constant(e) => *e,
            Law::Power(law) => law.at(speed),
            Law::Table(pieces) => pieces.at(speed),
        }
    }

    /// The largest e: no impact has a larger one.
    #[must_use]
    pub fn maximum(&self) -> S {
        match &self.0 {
            Law::Constant(e) => *e,
            Law::Power(law) => law.maximum,
            Law::Table(pieces) => pieces.maximum(),
        }
    }

    /// e of slow impacts.
    #[must_use]
    pub fn slow(&self) -> S {
        if let Law::Table(pieces) = &self.0 { pieces.slow() } else { self.maximum() }
    }

    /// Whether e is that of slow impacts at this approach speed and all lower ones.
    #[must_use]
    pub fn is_slow(&self, speed: S) -> bool {
        match &self.0 {
            Law::Constant(_) => true,
            Law::Power(law) => law.at(speed) == law.maximum,
            Law::Table(pieces) => pieces.is_slow(speed),
        }
    }

    /// The approach speed v at which approach and rebound speed together, v (1 + e(v)), are `closing`, 0 or greater.
    #[must_use]
    pub fn approach(&self, closing: S) -> S {
        match &self.0 {
            Law::Constant(e) => closing / (S::ONE + *e),
            Law::Power(law) => law.approach(closing),
            Law::Table(pieces) => pieces.approach(closing),
        }
    }

    /// Whether e is the same at every speed.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        matches!(self.0, Law::Constant(_))
    }
}

impl Wall {
    /// The law of impact of a hard wall in a calculation whose unit of velocity is this many m/s; `None` of a soft wall.
    #[must_use]
    pub fn impact_law<S: Scalar>(&self, velocity_m_per_s: f64) -> Option<ImpactLaw<S>> {
        match self {
            Self::TableRestitution(table) => Some(ImpactLaw(Law::Table(table.pieces(velocity_m_per_s)))),
            _ => self.restitution().map(|law| law.law(velocity_m_per_s)),
        }
    }

    /// A constant e, or e as a power of the speed; `None` of a soft wall and of a table.
    #[must_use]
    pub fn restitution(&self) -> Option<Restitution> {
        match *self {
            Self::Restitution { coefficient } => Some(Restitution::constant(coefficient)),
            Self::SpeedRestitution(law) => Some(law),
            Self::TableRestitution(_) | Self::Voigt { .. } | Self::Hertz(_) => None,
        }
    }

    /// The table of a hard wall that has one.
    #[must_use]
    pub fn table(&self) -> Option<SpeedTable> {
        if let Self::TableRestitution(table) = *self { Some(table) } else { None }
    }

    /// The law of impact of a hard wall whose e falls with a power of the speed.
    #[must_use]
    pub fn falling(&self) -> Option<Restitution> {
        self.restitution().filter(|law| law.exponent > 0.0)
    }

    /// Whether a contact takes time: a spring and a dashpot, or Hertz contact.
    #[must_use]
    pub fn is_soft(&self) -> bool {
        matches!(self, Self::Voigt { .. } | Self::Hertz(_))
    }

    /// The law of a wall with Hertz contact; `None` of any other.
    #[must_use]
    pub fn hertz(&self) -> Option<Hertz> {
        match *self {
            Self::Hertz(law) => Some(law),
            _ => None,
        }
    }

    /// The hard wall with the restitution of the free impacts on a wall with Hertz contact, whose time is left out: a constant e, or
    /// the table over the speed ([`Hertz::table`]). Any other wall as it is.
    #[must_use]
    pub fn without_hertz(self) -> Self {
        let Self::Hertz(law) = self else { return self };
        let constant = Self::Restitution { coefficient: law.restitution(1.0) };
        law.table().map_or(constant, |(table, _)| Self::TableRestitution(table))
    }

    /// When a spring and a dashpot release the particle; `None` of another wall.
    #[must_use]
    pub fn release(&self) -> Option<Release> {
        match *self {
            Self::Voigt { release, .. } => Some(release),
            _ => None,
        }
    }

    /// k1, N/m, and c1, N·s/m, of a wall with a spring and a dashpot; `None` of another.
    #[must_use]
    pub fn spring_and_dashpot(&self) -> Option<(f64, f64)> {
        match *self {
            Self::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } => Some((stiffness_n_per_m, damping_n_s_per_m)),
            _ => None,
        }
    }

    /// Checks that every value is physical.
    pub(super) fn validate(&self) -> Result<(), Invalid> {
        match *self {
            Self::Restitution { coefficient } => Restitution::constant(coefficient).validate(),
            Self::SpeedRestitution(law) => law.validate(),
            Self::TableRestitution(table) => table.validate(),
            Self::Hertz(law) => law.validate(),
            Self::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } => {
                positive("particle.wall.stiffness_n_per_m", stiffness_n_per_m)?;
                not_negative("particle.wall.damping_n_s_per_m", damping_n_s_per_m)
            }
        }
    }
}
