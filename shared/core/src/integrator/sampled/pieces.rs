//! A step in pieces, from event to event: for a controller that has no tick for a step with an impact in it.

use super::{Joint, Link, MOST_EVENTS_PER_STEP, Observer, Sampled};
use crate::integrator::base::Segment;
use crate::scalar::Scalar;

/// A step of base motion that has begun and not ended.
#[derive(Clone, Copy, Debug)]
pub struct BegunStep<S> {
    /// From `start` on.
    base: Segment<S>,
    start: S,
    events: usize,
}

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    /// Begins a step; [`Sampled::go_on`] until it is over, before anything else.
    pub fn begin_step(&mut self, base: &Segment<S>) -> BegunStep<S> {
        if self.mode.is_none() {
            let slip = self.state.v - base.velocity();
            self.mode = Some(self.resolve(base, slip));
        }
        BegunStep { base: *base, start: S::ZERO, events: 0 }
    }

    /// Goes on to the next event or to the step's end; whether that is reached.
    #[inline]
    pub fn go_on(&mut self, begun: &mut BegunStep<S>, observer: &mut impl Observer<S>) -> bool {
        let (base, start) = (&mut begun.base, &mut begun.start);
        let mode = self.current_mode();
        let flight = self.flight(mode, base);
        let rest = S::ONE - *start;
        if begun.events == MOST_EVENTS_PER_STEP {
            self.unresolved += 1;
            observer.mode(mode);
            observer.flight(*start, rest, &flight);
            self.advance(mode, &flight, rest);
            if self.joint.link().is_none() {
                self.state.offset = self.state.offset.min(self.c.clearance).max(-self.c.clearance);
            }
            return true;
        }
        let most = self.joint.link().map_or(rest, |link: &Link<S>| link.longest(mode, rest));
        let (length, event) = self.next_event(mode, &flight, base, most);
        observer.mode(mode);
        observer.flight(*start, length, &flight);
        self.advance(mode, &flight, length);
        if length > S::ZERO {
            self.slide_released = false;
            self.slip_released = false;
            if let Some(link) = self.joint.link_mut() {
                link.touched = false;
            }
        }
        let Some(event) = event else {
            let goes_on = self.joint.link().is_some() && most < rest;
            if goes_on {
                *start += most;
                *base = base.from(most);
            }
            return !goes_on;
        };
        begun.events += 1;
        *start += length;
        *base = base.from(length);
        self.handle(event, mode, base, *start, observer);
        false
    }
}
