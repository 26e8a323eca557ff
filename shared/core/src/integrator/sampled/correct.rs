//! Corrections from outside: what an observer that follows a real structure may change between steps.

use super::{Joint, Sampled};
use crate::integrator::modes::{Coefficients, Grip};
use crate::model::{FrictionDamper, SetUp};
use crate::scalar::Scalar;

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    /// Moves the structure by `dx` and changes its velocity by `dv`, in units; the particle goes with it. A structure that
    /// sticks to its base keeps the base's velocity.
    pub fn nudge(&mut self, dx: S, dv: S) {
        self.state.x += dx;
        if !matches!(self.mode.map(|mode| mode.grip), Some(Grip::Stuck)) {
            self.state.v += dv;
        }
    }

    /// Puts the particle to `offset` from the middle of its cavity with relative velocity `slide`, in units; an offset
    /// beyond the walls becomes the wall's. Nothing without a particle.
    pub fn place_particle(&mut self, offset: S, slide: S) {
        if self.has_particle {
            self.state.offset = offset.min(self.c.clearance).max(-self.c.clearance);
            self.state.slide = slide;
            self.mode = None;
        }
    }

    /// The friction damper's force becomes this, N; 0 or greater. `set_up` is the one that this motion is of. A structure
    /// that sticks breaks free in the next step if the force no longer holds it.
    pub fn set_damper_force_n(&mut self, force_n: f64, set_up: &SetUp) {
        let set_up = SetUp { friction_damper: Some(FrictionDamper { force_n }), ..*set_up };
        let was_absent = self.c.damper_force == S::ZERO;
        self.c.damper_force = Coefficients::in_units(&set_up, &self.units).damper_force;
        // With the damper's coming or going the mode is decided anew.
        if was_absent != (self.c.damper_force == S::ZERO) {
            self.mode = None;
        }
    }
}
