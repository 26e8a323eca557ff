//! A step in pieces, to the next event and past it: for a controller that has no tick for a step with an impact in it.

use super::{Event, Flight, Joint, Link, MOST_EVENTS_PER_STEP, Observer, Sampled};
use crate::integrator::base::Segment;
use crate::integrator::modes::Mode;
use crate::scalar::Scalar;

/// A step of base motion that has begun and not ended.
#[derive(Clone, Copy, Debug)]
pub struct BegunStep<S> {
    /// From `start` on.
    base: Segment<S>,
    start: S,
    events: usize,
    found: Option<Found<S>>,
}

/// An event that the motion has not come to yet.
#[derive(Clone, Copy, Debug)]
struct Found<S> {
    mode: Mode,
    flight: Flight<S>,
    length: S,
    event: Event,
}

/// What [`Sampled::seek`] came upon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sought {
    /// The step's end.
    End,
    /// The end of a flight that is shorter than what was left of the step.
    Flight,
    /// An event: [`Sampled::carry_out`] comes next.
    Event,
}

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    /// Begins a step; [`Sampled::seek`], and [`Sampled::carry_out`] what it finds, until it is over, before anything else.
    pub fn begin_step(&mut self, base: &Segment<S>) -> BegunStep<S> {
        if self.mode.is_none() {
            let slip = self.state.v - base.velocity();
            self.mode = Some(self.resolve(base, slip));
        }
        BegunStep { base: *base, start: S::ZERO, events: 0, found: None }
    }

    /// Looks for the next event, and goes on to the step's end if there is none.
    #[inline]
    pub fn seek(&mut self, begun: &mut BegunStep<S>, observer: &mut impl Observer<S>) -> Sought {
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
            return Sought::End;
        }
        let most = self.joint.link().map_or(rest, |link: &Link<S>| link.longest(mode, rest));
        let (length, event) = self.next_event(mode, &flight, base, most);
        if let Some(event) = event {
            begun.found = Some(Found { mode, flight, length, event });
            return Sought::Event;
        }
        self.fly(*start, mode, &flight, length, observer);
        if self.joint.link().is_none() || most >= rest {
            return Sought::End;
        }
        *start += most;
        *base = base.from(most);
        Sought::Flight
    }

    /// Goes on to the event that was found, and past it.
    pub fn carry_out(&mut self, begun: &mut BegunStep<S>, observer: &mut impl Observer<S>) {
        let Some(Found { mode, flight, length, event }) = begun.found.take() else { return };
        self.fly(begun.start, mode, &flight, length, observer);
        begun.events += 1;
        begun.start += length;
        begun.base = begun.base.from(length);
        self.handle(event, mode, &begun.base, begun.start, observer);
    }

    fn fly(&mut self, start: S, mode: Mode, flight: &Flight<S>, length: S, observer: &mut impl Observer<S>) {
        observer.mode(mode);
        observer.flight(start, length, flight);
        self.advance(mode, flight, length);
        if length > S::ZERO {
            self.slide_released = false;
            self.slip_released = false;
            if let Some(link) = self.joint.link_mut() {
                link.touched = false;
            }
        }
    }
}
