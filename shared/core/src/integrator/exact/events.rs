//! Event handling of the exact driver: start, impact, soft contact and release, stick and slip, end of a chatter.

use super::flow::Path;
use super::guards::GuardEvent;
use super::motion::{Exact, ROUNDINGS, Touch};
use super::observe::{Accumulation, ContactEnd, Impact, Observer};
use super::oscillator::dot;
use super::series::TERMS;
use crate::integrator::modes::{self, Contact, Grip, Mode, Sign, sign, signed};
use crate::model::Release;

/// Largest effect that a summed chatter may neglect, relative to the motion: one rounding.
const LEFT_OUT: f64 = f64::EPSILON;

/// Impacts are summed instead of listed only when slower than this fraction of the fastest impact of the run.
const SLOW: f64 = 1e-4;

/// Flights of a summed chatter, of impacts whose e is not yet that of slow ones, whose durations are added up one by one.
const MAX_UNEVEN_FLIGHTS: u32 = 1_000;

/// Largest relative change of the pressing acceleration until the chatter ends.
const PRESSING_CHANGE: f64 = 0.125;

impl Exact {
    /// Settles the initial state: contacts, sticking, and an impact at t = 0.
    pub(super) fn start<O: Observer>(&mut self, observer: &mut O) {
        observer.start(self.time.seconds(), &self.state);
        let slip = self.state.v_m_per_s - self.base_velocity();
        let side = self.end_of_travel();
        let contact = if self.has_particle { Contact::Free(sign(self.state.slide_m_per_s)) } else { Contact::Absent };
        self.mode = Mode { grip: self.c.grip_at(slip), contact };
        self.set_leg();
        observer.mode(self.time.seconds(), self.mode);
        if side == 0 || self.touch != Touch::Clear {
            self.resolve(slip, observer);
        } else {
            self.reach_wall(side, slip, observer);
        }
    }

    pub(super) fn handle<O: Observer>(&mut self, event: GuardEvent, observer: &mut O) {
        let slip = self.slip();
        match event {
            GuardEvent::Wall(side) => {
                self.state.offset_m = self.c.wall(side);
                self.reach_wall(side, slip, observer);
            }
            GuardEvent::LetGo(side) => self.let_go(side, slip, observer),
            GuardEvent::Lags(side) => {
                self.touch = Touch::Leaving(side);
                self.fresh.lag = 1;
                self.resolve(slip, observer);
            }
            GuardEvent::CatchesUp(side) => {
                self.touch = Touch::Pressing(side);
                self.fresh.lag = 1;
                self.resolve(slip, observer);
            }
            GuardEvent::Inside(side) if self.squeeze.law(side).is_some() => self.let_go(side, slip, observer),
            GuardEvent::Inside(side) => {
                self.touch = Touch::Clear;
                self.state.offset_m = self.c.wall(side);
                (self.fresh.gap_side, self.fresh.gap) = (side, 1);
                self.set_leg();
            }
            GuardEvent::SlideStops => {
                self.state.slide_m_per_s = 0.0;
                // Clears the direction, so that the next one counts as a release.
                self.mode.contact = Contact::Free(0);
                self.resolve(slip, observer);
            }
            GuardEvent::SlipStops => {
                self.state.v_m_per_s = self.base_velocity();
                self.resolve(0.0, observer);
            }
            GuardEvent::HoldBreaks { direction, order } => {
                // Friction or the wall is at its limit and its force is continuous: velocity and acceleration of the
                // slide start from zero.
                self.fresh.slide = order + 1;
                self.state.slide_m_per_s = 0.0;
                let side = self.end_of_travel();
                if self.touch == Touch::Clear && side != 0 {
                    self.leave_rest(side, direction == side, order + 2);
                }
                self.set_mode(Mode { contact: Contact::Free(direction), ..self.mode }, observer);
            }
            GuardEvent::GripBreaks(direction) => {
                self.fresh.slip = 2;
                self.state.v_m_per_s = self.base_velocity();
                self.set_mode(Mode { grip: Grip::Slip(direction), ..self.mode }, observer);
            }
        }
    }

    /// The particle is at the wall of `side`: it hits the wall, leaves it or rests on it.
    pub(super) fn reach_wall<O: Observer>(&mut self, side: Sign, slip: f64, observer: &mut O) {
        let approach = signed(side, self.state.slide_m_per_s);
        if self.soft(side).is_some() {
            self.touch_soft(side, approach, slip, observer);
        } else if approach > 0.0 {
            self.hit(side, approach, slip, observer);
        } else {
            (self.fresh.gap_side, self.fresh.gap) = (side, 1);
            self.resolve(slip, observer);
        }
    }

    fn hit<O: Observer>(&mut self, side: Sign, approach: f64, slip: f64, observer: &mut O) {
        let before = self.state;
        let (v, slide) =
            modes::impact(&self.c, self.c.restitution(side).at(approach), before.v_m_per_s, before.slide_m_per_s);
        self.state.v_m_per_s = v;
        self.state.slide_m_per_s = slide;
        let time_s = self.time.seconds();
        let after = self.state;
        observer.impact(&Impact { time_s, side, approach_speed_m_per_s: approach, before, after });
        self.fastest_m_per_s = self.fastest_m_per_s.max(approach);
        if slide != 0.0 {
            (self.fresh.gap_side, self.fresh.gap) = (side, 1);
        }
        let slip = slip + (v - before.v_m_per_s);
        // The common case needs no mode decision: the particle flies back and nothing can stick.
        if slide != 0.0 && self.c.damper_force == 0.0 {
            let mode = Mode { contact: Contact::Free(sign(slide)), ..self.mode };
            if self.c.friction_acceleration == 0.0 && mode != self.mode {
                // Without friction the equations of motion stay the same.
                observer.mode(self.time.seconds(), mode);
                self.mode = mode;
            } else {
                self.set_mode(mode, observer);
            }
        } else {
            self.mode.contact = Contact::Free(0);
            self.resolve(slip, observer);
        }
        if slide != 0.0 {
            self.settle(side, slip, observer);
        }
    }

    /// Ends a chatter when the remaining impacts can be summed; see the module documentation of `exact`.
    fn settle<O: Observer>(&mut self, side: Sign, slip: f64, observer: &mut O) {
        let h = self.leg.step_s;
        // The remaining impacts are slower, so that none has a larger e.
        let law = self.c.restitution(side);
        let is_slow = law.is_slow(self.state.slide_m_per_s.abs());
        let e = if is_slow { law.slow() } else { law.maximum() };
        let lift = self.state.slide_m_per_s.abs() * h;
        let pressing_out = self.pressing(side, slip) * h * h;
        let (mass, light) = (self.c.mass, self.c.particle_mass);
        // Friction slows the particle on its way out and on its way back.
        let both_ways = 2.0 * self.c.friction_acceleration * (1.0 + light / mass) * h * h;
        let pressing = pressing_out - both_ways;
        if pressing <= 0.0 || lift > 0.1 * pressing {
            return;
        }
        let height = lift * lift / (2.0 * pressing);
        let returned = e * libm::sqrt(pressing / pressing_out);
        let lasts = 2.0 * lift / (pressing * (1.0 - returned));
        let unit =
            [self.state.x_m, self.state.v_m_per_s, self.leg.structure_acceleration, self.wave.sine, self.wave.cosine]
                .map(f64::abs);
        let jerk = dot(&self.flows.alone.third, &unit);
        let size = unit[0] + unit[1] * h + self.c.reach;
        let together = mass + light;
        let hop = 2.0 / 3.0 * lift * lift * lift / (pressing * pressing);
        let kick = self.c.stiffness * h * h * light / (together * together) * hop / (1.0 - e * e * e);
        let sure = lasts <= 1.0 && jerk * lasts <= PRESSING_CHANGE * pressing;
        let is_even = both_ways == 0.0 && is_slow;
        let left_out = if is_even { kick * (jerk * lasts / pressing + lasts) } else { kick };
        // With a friction damper the impulses may make the structure stick and slip. The error in its position is of
        // the order of the height.
        let damper_matters = self.c.damper_force > 0.0 && {
            let change = (light / mass + lasts) * (lift + pressing + self.c.damper_force / mass * h * h) * 4.0;
            slip.abs() * h <= change
        };
        let slow = self.state.slide_m_per_s.abs() <= SLOW * self.fastest_m_per_s;
        let summed =
            slow && sure && left_out <= LEFT_OUT * size && (!damper_matters || height <= 64.0 * LEFT_OUT * size);
        let invisible = height <= 4.0 * f64::EPSILON * self.c.reach;
        if !summed && !invisible {
            return;
        }
        let before = self.state;
        let (v, _) = modes::impact(&self.c, 0.0, before.v_m_per_s, before.slide_m_per_s);
        let correction = if summed && is_even && !damper_matters { signed(side, kick / h) } else { 0.0 };
        let slip = slip + (v - correction - before.v_m_per_s);
        let tail_s = if lasts > 1.0 { 0.0 } else { h * self.tail(side, lift, (pressing_out, pressing)) };
        self.state.v_m_per_s = v - correction;
        self.state.slide_m_per_s = 0.0;
        self.fresh.gap = 0;
        let time_s = self.time.seconds();
        observer.accumulation(&Accumulation {
            time_s,
            ended_s: time_s + tail_s,
            side,
            before,
            after: self.state,
            spring_m_per_s: -correction,
        });
        self.mode.contact = Contact::Free(0);
        self.resolve(slip, observer);
    }

    /// Duration of the remaining accumulating impacts, in arcs. The particle leaves with `lift` (speed × arc, m), is
    /// pressed back with these accelerations (× arc², m) on its way out and back.
    fn tail(&self, side: Sign, lift: f64, (out, back): (f64, f64)) -> f64 {
        let law = self.c.restitution(side);
        let (flight, slowed) = (1.0 / out + 1.0 / libm::sqrt(out * back), libm::sqrt(back / out));
        let (mut speed, mut first) = (lift, 0.0);
        // Flights until e is that of slow impacts; from there they are shortened by the same factor each.
        for _ in 0..MAX_UNEVEN_FLIGHTS {
            let approach = speed * slowed / self.leg.step_s;
            if law.is_slow(approach) {
                break;
            }
            first += speed * flight;
            speed *= law.at(approach) * slowed;
        }
        let even = first + speed * flight / (1.0 - law.slow() * slowed);
        if self.leg.path != Path::Alone {
            return even;
        }
        // The pressing changes at the rate j. To first order each flight, and so their sum T, is scaled by 1 − j T/(3
        // pressing).
        let unit =
            [self.state.x_m, self.state.v_m_per_s, self.leg.structure_acceleration, self.wave.sine, self.wave.cosine];
        let rate = -signed(side, dot(&self.flows.alone.rates[1], &unit));
        even * (1.0 - rate * even / (3.0 * back))
    }

    /// The closing acceleration of the gap, m/s².
    fn pressing(&self, side: Sign, slip: f64) -> f64 {
        let structure = match self.leg.path {
            Path::Carried => self.situation(0.0).base_acceleration,
            _ => {
                let s = self.situation(slip);
                let spring = -(self.c.stiffness * s.stretch + self.c.damping * slip) + s.applied_force;
                // The constant part contains k times the base's offset, which the stretch already includes.
                self.leg.structure_acceleration + (spring - self.c.stiffness * self.wave.offset) / self.c.mass
            }
        };
        signed(side, self.leg.particle_acceleration - structure)
    }

    fn touch_soft<O: Observer>(&mut self, side: Sign, approach: f64, slip: f64, observer: &mut O) {
        if approach > 0.0 {
            self.touch = Touch::Pressing(side);
            self.squeeze.begin(self.time, approach);
            self.fresh.press = 1;
            let (time_s, before) = (self.time.seconds(), self.state);
            observer.impact(&Impact { time_s, side, approach_speed_m_per_s: approach, before, after: before });
        } else if approach < 0.0 {
            (self.fresh.gap_side, self.fresh.gap) = (side, 1);
        } else {
            self.mode.contact = Contact::Free(0);
            self.fresh.gap = 0;
        }
        self.resolve(slip, observer);
    }

    /// Starts the motion of a particle at rest at a soft wall that does not push yet, when nothing holds the particle.
    pub(super) fn depart(&mut self) {
        let side = self.end_of_travel();
        let at_rest = side != 0
            && self.soft(side).is_some()
            && self.touch == Touch::Clear
            && self.state.slide_m_per_s == 0.0
            && self.fresh.gap == 0;
        if at_rest && matches!(self.mode.contact, Contact::Free(_)) {
            let (order, presses) = self.departure(side);
            self.leave_rest(side, presses, order);
            self.set_leg();
        }
    }

    /// A particle at rest at the wall of `side` starts to move relative to it, into the wall or away from it, as τ to
    /// the power of `order`.
    fn leave_rest(&mut self, side: Sign, presses: bool, order: usize) {
        if presses && self.soft(side).is_some() {
            self.touch = Touch::Pressing(side);
            self.squeeze.begin(self.time, 0.0);
            self.fresh.press = order;
        } else {
            (self.fresh.gap_side, self.fresh.gap) = (side, order);
        }
    }

    /// How a particle at rest at a soft wall starts to move relative to it: the power of τ, and whether it moves into
    /// the wall. Coefficients within rounding of zero count as zero; if all do, the particle stays at rest.
    fn departure(&self, side: Sign) -> (usize, bool) {
        let offset = self.flows.span(&self.leg, &self.state, &self.wave).offset;
        let sizes = self.flows.sizes(&self.leg, &self.state, &self.wave).unwrap_or([0.0; TERMS]);
        let moved = |n: &usize| offset[*n].abs() > ROUNDINGS * sizes[*n];
        (2..TERMS).find(moved).map_or((TERMS, false), |order| (order, signed(side, offset[order]) > 0.0))
    }

    fn let_go<O: Observer>(&mut self, side: Sign, slip: f64, observer: &mut O) {
        let past = signed(side, self.state.offset_m) - self.c.end(side);
        // A Hertz wall is left where the penetration ends.
        if self.soft(side) == Some(Release::ZeroForce) && past > 0.0 && self.squeeze.law(side).is_none() {
            self.touch = Touch::Leaving(side);
            self.left_past_m = past;
        } else {
            self.touch = Touch::Clear;
            self.state.offset_m = self.c.wall(side);
            (self.fresh.gap_side, self.fresh.gap) = (side, 1);
        }
        let separation_speed_m_per_s = self.state.slide_m_per_s.abs();
        let hertz = self.squeeze.end(side, self.time);
        observer.contact_end(&ContactEnd { time_s: self.time.seconds(), side, separation_speed_m_per_s, hertz });
        self.resolve(slip, observer);
    }
}
