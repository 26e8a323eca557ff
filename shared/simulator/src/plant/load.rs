//! What stands on the simulated rig's base: the structure with its dampers.
//!
//! Simulated boards carry the structure of one degree of freedom that the set-up describes. A host may mount another one, whose modes the board
//! knows nothing of: it implements [`Load`] and names it by [`PlantConfig::other_structure`].

use core::fmt::Debug;

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::modes::{Contact, Grip};
use damprig_core::integrator::sampled::{Joined, Sampled, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::io::{Invalid, require};
use damprig_core::model::{Initial, SetUp};
use damprig_core::scalar::Scalar;

use super::PlantConfig;

/// A structure with its dampers, moved by a base step by step. Masses are counted in the mass of the set-up's structure, lengths and times in
/// [`Units`].
pub trait Load<S>: Clone + Debug {
    /// Number of steps into which a sample interval must be divided.
    ///
    /// # Errors
    /// Names a value with which it moves too fast.
    fn steps_per_sample(config: &PlantConfig, sample_s: f64) -> Result<u8, Invalid>;

    /// At its start ([`PlantConfig::initial`]).
    ///
    /// # Errors
    /// Names a value that cannot be simulated.
    fn mounted(config: &PlantConfig, units: Units) -> Result<Self, Invalid>;

    /// Starts again, from `initial`.
    fn restart(&mut self, initial: &Initial);

    /// Sets the largest force of the friction damper of `set_up`, N; 0 or greater.
    fn set_friction_n(&mut self, force_n: f64, set_up: &SetUp);

    /// Makes a step on this motion of the base, whose velocity goes on from step to step.
    fn step(&mut self, base: &BaseSegment<S>, observer: &mut impl SampledObserver<S>);

    /// The displacement that the sensor of x sees.
    fn x(&self) -> S;

    /// Momentum of structure and dampers.
    fn momentum(&self) -> S;

    /// The momentum after a step on this motion of the base, which is not made.
    fn momentum_after(&mut self, base: &BaseSegment<S>) -> S;

    /// Mass of structure and dampers.
    fn mass(&self) -> S;

    /// The mass that sticks to the base; `None` if it moves on its springs.
    fn stuck_mass(&self) -> Option<S>;
}

impl<S: Scalar> Load<S> for Joined<S> {
    fn steps_per_sample(config: &PlantConfig, sample_s: f64) -> Result<u8, Invalid> {
        Sampled::<S>::steps_per_sample(&config.set_up, sample_s)
    }

    fn mounted(config: &PlantConfig, units: Units) -> Result<Self, Invalid> {
        let other = config.other_structure;
        let allowed = "left out: this simulated board has one degree of freedom";
        require(other.is_none(), "plant", other.map_or(0.0, f64::from), allowed)?;
        Self::joined(&config.set_up, units, &config.initial())
    }

    fn restart(&mut self, initial: &Initial) {
        self.reset(initial);
    }

    fn set_friction_n(&mut self, force_n: f64, set_up: &SetUp) {
        self.set_damper_force_n(force_n, set_up);
    }

    fn step(&mut self, base: &BaseSegment<S>, observer: &mut impl SampledObserver<S>) {
        Sampled::step(self, base, observer);
    }

    fn x(&self) -> S {
        self.state().x
    }

    fn momentum(&self) -> S {
        Joined::momentum(self)
    }

    fn momentum_after(&mut self, base: &BaseSegment<S>) -> S {
        let mut trial = *self;
        Sampled::step(&mut trial, base, &mut ());
        Joined::momentum(&trial)
    }

    fn mass(&self) -> S {
        S::ONE + self.second_mass()
    }

    fn stuck_mass(&self) -> Option<S> {
        let mode = self.mode();
        let is_stuck = mode.is_some_and(|mode| mode.grip == Grip::Stuck);
        is_stuck.then(|| self.coefficients().moving_mass(mode.map_or(Contact::Absent, |mode| mode.contact)))
    }
}
