//! Corrections from outside: what an observer that follows a real structure may change between steps.

use super::{Joint, Sampled};
use crate::integrator::modes::Grip;
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
}
