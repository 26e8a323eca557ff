//! Corrections of the state between steps, for an observer that follows a real structure.

use super::{Joint, Sampled};
use crate::integrator::modes::{Coefficients, Grip};
use crate::model::{FrictionDamper, SetUp};
use crate::scalar::Scalar;

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    /// Adds `dx` to the displacement and `dv` to the velocity of the structure, in units; the particle moves with it. A
    /// structure that sticks to its base keeps the base's velocity.
    pub fn nudge(&mut self, dx: S, dv: S) {
        self.state.x += dx;
        if !matches!(self.mode.map(|mode| mode.grip), Some(Grip::Stuck)) {
            self.state.v += dv;
        }
    }

    /// Sets the particle's `offset` y − x and its relative velocity `slide`, in units; an
    /// offset beyond a wall is clamped to the wall. Does nothing without a particle.
    pub fn place_particle(&mut self, offset: S, slide: S) {
        if self.has_particle {
            self.state.offset = offset.min(self.c.wall(1)).max(self.c.wall(-1));
            self.state.slide = slide;
            self.mode = None;
        }
    }

    /// Sets the friction damper's force, N; 0 or greater. `set_up` must be the set-up of this motion. A sticking
    /// structure breaks free in the next step if the new force no longer holds it.
    pub fn set_damper_force_n(&mut self, force_n: f64, set_up: &SetUp) {
        let set_up = SetUp { friction_damper: Some(FrictionDamper { force_n }), ..*set_up };
        let was_absent = self.c.damper_force == S::ZERO;
        self.c.damper_force = Coefficients::in_units(&set_up, &self.units).damper_force;
        // When the damper appears or disappears, the mode is resolved again.
        if was_absent != (self.c.damper_force == S::ZERO) {
            self.mode = None;
        }
    }
}
