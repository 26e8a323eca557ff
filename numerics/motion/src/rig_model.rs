//! What moves on a rig: the structure of one degree of freedom that the board knows, or one with several places in its stead.

use std::sync::Arc;

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::sampled::{Joined, Sampled, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::io::Invalid;
use damprig_core::model::{Initial, SetUp};

use super::placed_motion::{PlacedMotion, PlacedStructure};

/// A set-up as it moves on a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct RigModel {
    /// The set-up as the board knows it, with its dampers.
    pub set_up: SetUp,
    /// The structure that carries the dampers in place of the set-up's; `None` for that of one degree of freedom.
    pub placed: Option<Arc<PlacedStructure>>,
}

impl From<SetUp> for RigModel {
    fn from(set_up: SetUp) -> Self {
        Self { set_up, placed: None }
    }
}

impl RigModel {
    /// Number of steps into which a sample interval must be divided.
    ///
    /// # Errors
    /// The structure of one degree of freedom is too fast for 200.
    pub fn steps_per_sample(&self, sample_s: f64) -> Result<u8, Invalid> {
        match self.placed {
            Some(_) => Ok(1),
            None => Sampled::<f64>::steps_per_sample(&self.set_up, sample_s),
        }
    }

    /// In motion, in steps of `step_s` from `initial`.
    ///
    /// # Errors
    /// Names a value that cannot be simulated.
    pub fn motion(&self, step_s: f64, initial: &Initial) -> Result<RigMotion, Invalid> {
        Ok(match &self.placed {
            Some(placed) => RigMotion::Placed(Box::new(PlacedMotion::new(placed, &self.set_up, step_s, initial)?)),
            None => RigMotion::OneDegree(Joined::joined(&self.set_up, Units::metres(step_s), initial)?),
        })
    }
}

/// A [`RigModel`] in motion.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // One degree of freedom is the usual one, and the fast one.
pub enum RigMotion {
    /// Of one degree of freedom.
    OneDegree(Joined<f64>),
    /// With several places.
    Placed(Box<PlacedMotion>),
}

impl RigMotion {
    /// Makes a step on this motion of the base.
    pub fn step(&mut self, base: &BaseSegment<f64>, observer: &mut (impl SampledObserver<f64> + ?Sized)) {
        match self {
            Self::OneDegree(motion) => motion.step(base, observer),
            Self::Placed(motion) => motion.step(base, observer),
        }
    }

    /// x, m.
    #[must_use]
    pub fn x_m(&self) -> f64 {
        match self {
            Self::OneDegree(motion) => motion.state().x,
            Self::Placed(motion) => motion.x_m(),
        }
    }

    /// Starts again, from `initial`.
    pub fn restart(&mut self, initial: &Initial) {
        match self {
            Self::OneDegree(motion) => motion.reset(initial),
            Self::Placed(motion) => motion.restart(initial),
        }
    }

    /// The same motion of `set_up` in steps of another length, s.
    ///
    /// # Errors
    /// As [`RigModel::motion`].
    pub fn counted_in(self, set_up: &SetUp, step_s: f64) -> Result<Self, Invalid> {
        Ok(match self {
            Self::OneDegree(motion) => Self::OneDegree(motion.counted_in(set_up, Units::metres(step_s))?),
            Self::Placed(mut motion) => {
                motion.set_step_s(step_s);
                Self::Placed(motion)
            }
        })
    }

    /// Sets the largest force of the friction damper of `set_up`, N.
    pub fn set_friction_n(&mut self, force_n: f64, set_up: &SetUp) {
        match self {
            Self::OneDegree(motion) => motion.set_damper_force_n(force_n, set_up),
            Self::Placed(motion) => motion.set_friction_n(force_n),
        }
    }

    /// Why the motion stands still since some step, if it does.
    #[must_use]
    pub fn refused(&self) -> Option<Invalid> {
        match self {
            Self::OneDegree(_) => None,
            Self::Placed(motion) => motion.refused(),
        }
    }
}
