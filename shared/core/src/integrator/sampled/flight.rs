//! The motion between two events, from the state at its start: the equations of structure and particle as Taylor polynomials.

use super::{Joint, Sampled};
use crate::integrator::base::BaseSegment;
use crate::integrator::modes::{Coefficients, Contact, Grip, Mode, signed};
use crate::integrator::polynomial::{COEFFICIENTS, Polynomial};
use crate::scalar::Scalar;

/// The motion from one event to the next, as polynomials in the time since its start.
#[derive(Clone, Copy, Debug)]
pub struct Flight<S> {
    /// x.
    pub x: Polynomial<S>,
    /// y − x.
    pub offset: Polynomial<S>,
    /// x − z.
    pub stretch: Polynomial<S>,
}

/// Taylor recurrence of the structure for one moving mass: `X[n+2] = damping[n]·Q[n+1] + stiffness[n]·Q[n]`, where Q
/// are the coefficients of x − z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights<S> {
    damping: [S; COEFFICIENTS - 2],
    stiffness: [S; COEFFICIENTS - 2],
    /// Half the acceleration per unit of force.
    half_inverse_mass: S,
}

impl<S: Scalar> Weights<S> {
    pub(super) fn new(c: &Coefficients<S>, mass: S) -> Self {
        let mut weights = Self {
            damping: [S::ZERO; COEFFICIENTS - 2],
            stiffness: [S::ZERO; COEFFICIENTS - 2],
            half_inverse_mass: S::ONE / (mass + mass),
        };
        for n in 0..COEFFICIENTS - 2 {
            let (first, second) = (S::from_u8(n as u8 + 1), S::from_u8(n as u8 + 2));
            weights.damping[n] = -c.damping / (mass * second);
            weights.stiffness[n] = -c.stiffness / (mass * first * second);
        }
        weights
    }
}

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    /// The motion from the present state in `mode`.
    pub(super) fn flight(&self, mode: Mode, base: &BaseSegment<S>) -> Flight<S> {
        if let Some(link) = self.joint.link().filter(|link| link.acts(mode)) {
            return self.joined_flight(link, mode, base);
        }
        if self.is_force_driven {
            return self.forced_flight(mode, base);
        }
        let z = &base.0;
        let mut x = [S::ZERO; COEFFICIENTS];
        let mut stretch = [S::ZERO; COEFFICIENTS];
        x[0] = self.state.x;
        stretch[0] = self.state.x - z[0];
        match mode.grip {
            Grip::Stuck => x[1..4].copy_from_slice(&z[1..4]),
            Grip::Absent | Grip::Slip(_) => {
                let weights = match mode.contact {
                    Contact::Held(_) => &self.together,
                    Contact::Absent | Contact::Free(_) => &self.alone,
                };
                let force = self.c.drag(mode.contact) - self.c.resistance(mode.grip);
                x[1] = self.state.v;
                stretch[1] = x[1] - z[1];
                x[2] = force * weights.half_inverse_mass
                    + (weights.damping[0] * stretch[1] + weights.stiffness[0] * stretch[0]);
                stretch[2] = x[2] - z[2];
                x[3] = weights.damping[1] * stretch[2] + weights.stiffness[1] * stretch[1];
                stretch[3] = x[3] - z[3];
                for n in 2..COEFFICIENTS - 2 {
                    x[n + 2] = weights.damping[n] * stretch[n + 1] + weights.stiffness[n] * stretch[n];
                    stretch[n + 2] = x[n + 2];
                }
            }
        }
        Flight { x, offset: self.free_offset(mode, &x), stretch }
    }

    /// The same for a force drive, whose segments are P/k.
    fn forced_flight(&self, mode: Mode, push: &BaseSegment<S>) -> Flight<S> {
        let mut x = [S::ZERO; COEFFICIENTS];
        let mut stretch = [S::ZERO; COEFFICIENTS];
        x[0] = self.state.x;
        for (s, u) in stretch.iter_mut().zip(&push.0) {
            *s = -*u;
        }
        stretch[0] += x[0];
        if let Grip::Absent | Grip::Slip(_) = mode.grip {
            let weights = match mode.contact {
                Contact::Held(_) => &self.together,
                Contact::Absent | Contact::Free(_) => &self.alone,
            };
            x[1] = self.state.v;
            stretch[1] += x[1];
            for n in 0..COEFFICIENTS - 2 {
                x[n + 2] = weights.damping[n] * x[n + 1] + weights.stiffness[n] * stretch[n];
                if n == 0 {
                    x[2] += (self.c.drag(mode.contact) - self.c.resistance(mode.grip)) * weights.half_inverse_mass;
                }
                stretch[n + 2] += x[n + 2];
            }
        }
        Flight { x, offset: self.free_offset(mode, &x), stretch }
    }

    /// y − x of a particle that no joint moves, while the structure moves by `x`.
    pub(super) fn free_offset(&self, mode: Mode, x: &Polynomial<S>) -> Polynomial<S> {
        let mut offset = [S::ZERO; COEFFICIENTS];
        offset[0] = self.state.offset;
        if let Contact::Free(direction) = mode.contact {
            offset[1] = self.state.slide;
            for n in 2..COEFFICIENTS {
                offset[n] = -x[n];
            }
            offset[2] -= signed(direction, self.c.friction_acceleration) * S::from_f64(0.5);
            offset[2] -= self.c.weight * S::from_f64(0.5);
        }
        offset
    }
}
