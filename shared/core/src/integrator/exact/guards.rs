//! Guards of each mode as power series, and the search for the first one that fails.

use super::flow::Span;
use super::motion::{Exact, ROUNDINGS, Touch};
use super::series::{Series, TERMS, derivative, first_failure};
use crate::integrator::modes::{Contact, Grip, Sign, signed};
use crate::model::Release;

/// The event at which a guard stops being positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GuardEvent {
    /// The particle reaches the wall of that side.
    Wall(Sign),
    /// The soft wall on that side releases the particle.
    LetGo(Sign),
    /// The Hertz wall on that side, which lags behind the particle, stops pushing it.
    Lags(Sign),
    /// It pushes again.
    CatchesUp(Sign),
    /// The particle is back inside the clearance after an early release by a soft wall.
    Inside(Sign),
    /// y′ − x′ reaches zero.
    SlideStops,
    /// x′ − z′ reaches zero.
    SlipStops,
    /// A held particle starts to slide in that direction; its holding guard falls below zero as τ to the power of
    /// `order`.
    HoldBreaks { direction: Sign, order: usize },
    /// A stuck structure starts to slip in that direction.
    GripBreaks(Sign),
}

/// The first event within `most` of the span, and its time.
pub(super) fn first(exact: &Exact, span: &Span, most: f64) -> (f64, Option<GuardEvent>) {
    let mut search = Search { at: most, event: None };
    let fresh = &exact.fresh;
    match exact.mode.contact {
        Contact::Absent => {}
        Contact::Free(direction) => {
            for side in [1, -1] {
                match exact.touch {
                    Touch::Pressing(_) => {}
                    Touch::Leaving(leaving) if leaving == side => {
                        search.consider(penetration(exact, span, side), 0, GuardEvent::Inside(side));
                        if let Some(lag) = lag(exact, span, side) {
                            search.consider(lag.map(|l| -l), fresh.lag, GuardEvent::CatchesUp(side));
                        }
                    }
                    Touch::Clear | Touch::Leaving(_) => {
                        let gap = penetration(exact, span, side).map(|p| -p);
                        // Σ|coefficients| bounds the change of the gap.
                        let reach: f64 = gap[1..].iter().map(|c| c.abs()).sum();
                        let order = if fresh.gap_side == side { fresh.gap } else { 0 };
                        if order > 0 || reach >= gap[0] {
                            search.consider(gap, order, GuardEvent::Wall(side));
                        }
                    }
                }
            }
            if exact.c.friction_acceleration > 0.0 {
                let slide = derivative(&span.offset).map(|s| signed(direction, s));
                search.consider(slide, fresh.slide, GuardEvent::SlideStops);
            }
            if let Touch::Pressing(side) = exact.touch
                && let Some(lag) = lag(exact, span, side)
            {
                search.consider(penetration(exact, span, side), fresh.press, GuardEvent::LetGo(side));
                search.consider(lag, fresh.lag, GuardEvent::Lags(side));
            } else if let Touch::Pressing(side) = exact.touch
                && let Some(release) = exact.soft(side)
            {
                let (press, link) = (penetration(exact, span, side), exact.flows.link(side));
                match release {
                    Release::ZeroPenetration => search.consider(press, fresh.press, GuardEvent::LetGo(side)),
                    Release::ZeroForce => {
                        let damping = link.damping;
                        let order = if damping > 0.0 { fresh.press.saturating_sub(1) } else { fresh.press };
                        let mut force = derivative(&press).map(|rate| damping / span.step_s * rate);
                        for n in 0..TERMS {
                            force[n] += link.stiffness * press[n];
                        }
                        search.consider(force, order, GuardEvent::LetGo(side));
                    }
                }
            }
        }
        Contact::Held(side) => {
            let per_square = 1.0 / (span.step_s * span.step_s);
            let acceleration = derivative(&derivative(&span.x)).map(|a| a * per_square);
            let (low, high) = exact.c.held_limits(side, exact.situation(0.0).joint_force);
            let sizes = exact.flows.sizes(&exact.leg, &exact.state, &exact.wave).unwrap_or([0.0; TERMS]);
            let sizes = derivative(&derivative(&sizes)).map(|a| a * per_square);
            let mut hold = |mut guard: Series, direction: Sign| {
                // A particle at rest at its limit: coefficients within rounding of zero are zero.
                let order = (0..TERMS).take_while(|&n| guard[n].abs() <= ROUNDINGS * sizes[n]).count();
                guard[..order].fill(0.0);
                // A guard that fails later crosses zero at first order.
                let fails_at_once = guard.get(order).is_some_and(|&next| next < 0.0);
                let order = if fails_at_once { order } else { 1 };
                search.consider(guard, 0, GuardEvent::HoldBreaks { direction, order });
            };
            if let Some(high) = high {
                let mut guard = acceleration.map(|a| -a);
                guard[0] += high;
                hold(guard, -1);
            }
            if let Some(low) = low {
                let mut guard = acceleration;
                guard[0] -= low;
                hold(guard, 1);
            }
        }
    }
    match exact.mode.grip {
        Grip::Absent => {}
        Grip::Slip(direction) => {
            let mut slip = derivative(&span.x);
            let base = derivative(&span.base);
            for n in 0..TERMS {
                slip[n] = signed(direction, slip[n] - base[n]);
            }
            search.consider(slip, fresh.slip, GuardEvent::SlipStops);
        }
        Grip::Stuck => {
            let needed = holding_force(exact, span);
            let mut above = needed.map(|n| -n);
            above[0] += exact.c.damper_force;
            search.consider(above, 0, GuardEvent::GripBreaks(-1));
            let mut below = needed;
            below[0] += exact.c.damper_force;
            search.consider(below, 0, GuardEvent::GripBreaks(1));
        }
    }
    (search.at, search.event)
}

/// Penetration of the particle into the wall of `side`.
fn penetration(exact: &Exact, span: &Span, side: Sign) -> Series {
    let mut series = span.offset.map(|w| signed(side, w));
    series[0] -= exact.c.end(side);
    series
}

/// 1 + β δ′ of the contact with a Hertz wall of `side`, which pushes while this is positive; `None` of another wall.
fn lag(exact: &Exact, span: &Span, side: Sign) -> Option<Series> {
    exact.squeeze.law(side)?;
    let rate = exact.squeeze.rate_s_per_m / span.step_s;
    let mut lag = derivative(&span.offset).map(|slide| signed(side, rate * slide));
    lag[0] += 1.0;
    Some(lag)
}

/// The force that keeps the structure on the base, N.
fn holding_force(exact: &Exact, span: &Span) -> Series {
    let contact = exact.mode.contact;
    let mass = exact.c.moving_mass(contact);
    let per_square = 1.0 / (span.step_s * span.step_s);
    let situation = exact.situation(0.0);
    let mut needed = derivative(&derivative(&span.base)).map(|a| mass * per_square * a);
    needed[0] += exact.c.stiffness * situation.stretch - exact.c.drag(contact);
    let joined = exact.has_tmd || matches!(exact.touch, Touch::Pressing(_));
    let is_free = !matches!(contact, Contact::Held(_));
    if exact.squeeze.law(exact.leg.pressed).is_some() && is_free {
        for (need, push) in needed.iter_mut().zip(&exact.squeeze.force) {
            *need -= signed(exact.leg.pressed, *push);
        }
    } else if joined && is_free {
        let link = exact.flows.link(exact.leg.pressed);
        let rate = derivative(&span.offset);
        for n in 0..TERMS {
            needed[n] -= link.stiffness * span.offset[n] + link.damping / span.step_s * rate[n];
        }
        needed[0] += link.stiffness * exact.leg.rest_offset;
    }
    let push = 1.0 - exact.flows.base_share;
    if push > 0.0 {
        let angle = exact.flows.turning * span.step_s;
        let force = super::oscillator::wave_series(exact.wave.sine, exact.wave.cosine, angle);
        for n in 0..TERMS {
            needed[n] -= push * force[n];
        }
    }
    needed
}

struct Search {
    at: f64,
    event: Option<GuardEvent>,
}

impl Search {
    /// Looks for a failure of `guard` earlier than the first one found so far. Its first `order` coefficients are zero
    /// by definition. The next one is not negative by definition, since the guard leaves its limit; rounding must not
    /// change that.
    fn consider(&mut self, mut guard: Series, order: usize, event: GuardEvent) {
        if order > 0 {
            guard[..order].fill(0.0);
            if let Some(next) = guard.get_mut(order) {
                *next = next.max(0.0);
            }
        }
        if let Some(at) = first_failure(&guard, self.at)
            && (self.event.is_none() || at < self.at)
        {
            (self.at, self.event) = (at, Some(event));
        }
    }
}
