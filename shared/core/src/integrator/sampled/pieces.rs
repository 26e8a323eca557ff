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
    ahead: Option<Ahead<S>>,
}

/// A motion that has not been gone along yet.
#[derive(Clone, Copy, Debug)]
struct Ahead<S> {
    mode: Mode,
    flight: Flight<S>,
    length: S,
    /// None while it has only been looked at.
    event: Option<Event>,
}

/// How far a piece of work came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// To the step's end.
    Over,
    /// There is more to do.
    Under,
}

impl<S: Scalar, J: Joint<S>> Sampled<S, J> {
    /// Begins a step; [`Sampled::go_on`] until it is over, before anything else.
    pub fn begin_step(&mut self, base: &Segment<S>) -> BegunStep<S> {
        if self.mode.is_none() {
            let slip = self.state.v - base.velocity();
            self.mode = Some(self.resolve(base, slip));
        }
        BegunStep { base: *base, start: S::ZERO, events: 0, ahead: None }
    }

    /// One piece of a step: to its end if nothing can happen before, else a look ahead, the search for what happens, or
    /// that. What comes out is what [`Sampled::step`] makes of it.
    pub fn go_on(&mut self, begun: &mut BegunStep<S>, observer: &mut impl Observer<S>) -> Progress {
        match &mut begun.ahead {
            None => self.look(begun, observer, true),
            Some(Ahead { mode, flight, length, event: event @ None }) => {
                (*length, *event) = self.next_event(*mode, flight, &begun.base, *length, false);
                if event.is_some() {
                    return Progress::Under;
                }
                let Some(Ahead { mode, flight, length, .. }) = begun.ahead.take() else { return Progress::Under };
                self.end_flight(begun, mode, &flight, length, observer)
            }
            Some(_) => {
                self.carry_out(begun, observer);
                Progress::Under
            }
        }
    }

    /// Goes on to the step's end, or to what is ahead.
    #[inline]
    pub(super) fn look(
        &mut self,
        begun: &mut BegunStep<S>,
        observer: &mut impl Observer<S>,
        first_look: bool,
    ) -> Progress {
        let mode = self.current_mode();
        let flight = self.flight(mode, &begun.base);
        let rest = S::ONE - begun.start;
        if begun.events == MOST_EVENTS_PER_STEP {
            self.unresolved += 1;
            observer.mode(mode);
            observer.flight(begun.start, rest, &flight);
            self.advance(mode, &flight, rest);
            if self.joint.link().is_none() {
                self.state.offset = self.state.offset.min(self.c.clearance).max(-self.c.clearance);
            }
            return Progress::Over;
        }
        let most = self.joint.link().map_or(rest, |link: &Link<S>| link.longest(mode, rest));
        let (length, event) = self.next_event(mode, &flight, &begun.base, most, first_look);
        if event.is_some() {
            begun.ahead = Some(Ahead { mode, flight, length, event: event.filter(|_| !first_look) });
            return Progress::Under;
        }
        self.end_flight(begun, mode, &flight, length, observer)
    }

    /// A flight without an event: to the step's end, or as far as a joint lets it be exact.
    fn end_flight(
        &mut self,
        begun: &mut BegunStep<S>,
        mode: Mode,
        flight: &Flight<S>,
        length: S,
        observer: &mut impl Observer<S>,
    ) -> Progress {
        self.fly(begun.start, mode, flight, length, observer);
        if self.joint.link().is_none() || length >= S::ONE - begun.start {
            return Progress::Over;
        }
        begun.start += length;
        begun.base = begun.base.from(length);
        Progress::Under
    }

    /// Goes on to the event ahead, and past it.
    pub(super) fn carry_out(&mut self, begun: &mut BegunStep<S>, observer: &mut impl Observer<S>) {
        let Some(Ahead { mode, flight, length, event: Some(event) }) = begun.ahead.take() else { return };
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
