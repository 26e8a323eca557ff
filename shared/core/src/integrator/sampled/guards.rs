//! Guards that end a flight: quantities that must not become negative in a mode, and the search for the first
//! violation.

use super::{Flight, Joint, Sampled, SampledEvent, WallTouch};
use crate::integrator::base::BaseSegment;
use crate::integrator::modes::{Contact, Grip, Mode, all_signed, signed};
use crate::integrator::polynomial::{self, COEFFICIENTS, Polynomial, first_failure};
use crate::scalar::Scalar;

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    /// The first violated guard within `rest`, and the time until then.
    pub(super) fn next_event(
        &self,
        mode: Mode,
        flight: &Flight<S>,
        base: &BaseSegment<S>,
        rest: S,
    ) -> (S, Option<SampledEvent>) {
        let mut first = First { at: rest, event: None };
        let mut consider = |guard: &Polynomial<S>, event: SampledEvent| first.consider(guard, event);
        match mode.contact {
            Contact::Absent => {}
            Contact::Free(direction) => {
                let reach = polynomial::reach(&flight.offset, rest);
                let touch = self.joint.link().map_or(WallTouch::Clear, |link| link.touch);
                if let Some((side, guard)) = self.joint.link().and_then(|link| link.contact(&flight.offset)) {
                    consider(&guard, SampledEvent::LetGo(side));
                } else {
                    for side in [1, -1] {
                        if touch == WallTouch::Leaving(side) {
                            let mut past = all_signed(side, flight.offset);
                            past[0] -= self.c.end(side);
                            consider(&past, SampledEvent::Inside(side));
                            continue;
                        }
                        if signed(side, flight.offset[0]) + reach < self.c.end(side) {
                            continue;
                        }
                        let mut gap = all_signed(-side, flight.offset);
                        gap[0] += self.c.end(side);
                        if self.slide_released && gap[0] == S::ZERO {
                            gap[2] = gap[2].max(S::ZERO);
                        }
                        consider(&gap, SampledEvent::Wall(side));
                    }
                }
                if self.c.friction_acceleration > S::ZERO {
                    let mut slide = all_signed(direction, polynomial::derivative(&flight.offset));
                    if self.slide_released {
                        slide[1] = slide[1].max(S::ZERO);
                    }
                    consider(&slide, SampledEvent::SlideStops);
                }
            }
            Contact::Held(side) => {
                let acceleration = polynomial::derivative(&polynomial::derivative(&flight.x));
                let joint_force = self.joint.link().map_or(S::ZERO, |link| link.force(self.state.offset, S::ZERO));
                let (low, high) = self.c.held_limits(side, joint_force);
                if let Some(high) = high {
                    let mut guard = acceleration.map(|a| -a);
                    guard[0] += high;
                    consider(&guard, SampledEvent::HoldBreaks(-1));
                }
                if let Some(low) = low {
                    let mut guard = acceleration;
                    guard[0] -= low;
                    consider(&guard, SampledEvent::HoldBreaks(1));
                }
            }
        }
        match mode.grip {
            Grip::Absent => {}
            Grip::Slip(direction) => {
                let moved = if self.is_force_driven { &flight.x } else { &flight.stretch };
                let mut slip = all_signed(direction, polynomial::derivative(moved));
                if self.slip_released {
                    slip[0] = S::ZERO;
                    slip[1] = slip[1].max(S::ZERO);
                }
                consider(&slip, SampledEvent::SlipStops);
            }
            Grip::Stuck => {
                let mass = self.c.moving_mass(mode.contact);
                let ground = self.ground(base);
                let mut needed = [S::ZERO; COEFFICIENTS];
                needed[0] = self.c.holding_force(mode.contact, flight.stretch[0], ground.acceleration());
                needed[1] = mass * S::from_u8(6) * ground.0[3];
                if self.is_force_driven {
                    for (n, s) in needed.iter_mut().zip(&flight.stretch).skip(1) {
                        *n += self.c.stiffness * *s;
                    }
                }
                if let Some(link) = self.joint.link().filter(|link| link.acts(mode)) {
                    let joint = link.force_along(&flight.offset);
                    for (n, f) in needed.iter_mut().zip(joint) {
                        *n -= f;
                    }
                }
                let mut above = needed.map(|n| -n);
                above[0] += self.c.damper_force;
                consider(&above, SampledEvent::GripBreaks);
                needed[0] += self.c.damper_force;
                consider(&needed, SampledEvent::GripBreaks);
            }
        }
        (first.at, first.event)
    }
}

/// The earliest event found so far.
struct First<S> {
    at: S,
    event: Option<SampledEvent>,
}

impl<S: Scalar> First<S> {
    fn consider(&mut self, guard: &Polynomial<S>, event: SampledEvent) {
        if let Some(at) = first_failure(guard, self.at)
            && (self.event.is_none() || at < self.at)
        {
            (self.at, self.event) = (at, Some(event));
        }
    }
}
