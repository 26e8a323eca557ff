//! Steps: each is proved to hold no event, or ends at its first one.

use damprig_core::integrator::exact::time::Time;

use crate::Refused;
use crate::contacts::Event;
use crate::flight::Flight;
use crate::guard::{Here, Step, Verdict};
use crate::linear::C64;
use crate::motion::{Live, Motion, ROUNDINGS};
use crate::observe::{Observer, Piece};
use crate::polynomial::Polynomial;
use crate::system::Watched;

/// Events at one instant after which a step does without the guards of the joints that are at zero.
const MAX_EVENTS_AT_ONCE: u32 = 64;

/// Steps are the longest one divided by powers of two (levels). The first step that does without a guard has this one.
pub(crate) const FIRST_BLIND_LEVEL: usize = 48;

/// A step of this level is taken without any guard.
const LAST_LEVEL: usize = FIRST_BLIND_LEVEL + 8;

/// By so many levels the next step without a guard is longer, until the guards tell contacts apart; a step with all of them takes back one.
const LONGER_BLIND: usize = 2;

/// Steps of a length after a longer one was not decided.
const PATIENCE: u32 = 5;

/// Steps after which amplitudes and excitation are taken anew.
const STEPS_PER_ANCHOR: u32 = 16;

/// Roundings that a coordinate may have when a phase begins: it is a sum of the natural motions of the phase before.
const STORED: f64 = 8.0;

/// Turns up to this, rad, are taken by a series.
const NEAR: f64 = 0.02;

/// The root of a cubic is that of a guard to about this share of the step.
const NEAR_ROOT: f64 = 1e-4;

/// The highest derivative that is looked at where a guard begins at zero.
const HIGHEST: usize = 6;

/// Newton steps after which a bracket is halved only.
const MAX_NEWTON_STEPS: u32 = 60;

/// The first event within a step.
#[derive(Clone, Copy, Debug)]
struct First {
    at_s: f64,
    event: Event,
}

/// What is known of a step.
enum Judged {
    Clear,
    /// An event; the natural motions at it are in `ahead`.
    Event(First),
    Undecided,
}

/// A step of a level, or one of a length of its own that ends at the limit.
#[derive(Clone, Copy)]
enum Length {
    Level(usize),
    ToLimit(f64),
}

impl Motion {
    /// Advances by one step, at most to `limit_s`, and handles the event at its end, if any.
    pub(crate) fn advance<O: Observer>(&mut self, limit_s: f64, observer: &mut O) -> Result<(), Refused> {
        self.handled = None;
        let to_limit_s = self.time.until(limit_s);
        if self.piece.is_over(to_limit_s) {
            self.anchor();
            self.leave();
            self.phase(&[])?;
        }
        let rest_s = to_limit_s.min(self.piece.left_s);
        loop {
            if self.events_at_once >= MAX_EVENTS_AT_ONCE {
                self.level = self.level.max(self.blind_level);
            }
            if self.events_at_once >= MAX_EVENTS_AT_ONCE || self.level >= FIRST_BLIND_LEVEL {
                self.find_blind();
            }
            let system = &mut self.systems[self.system];
            let length = if system.length_s(self.level) < rest_s {
                system.make_steps(self.level);
                Length::Level(self.level)
            } else {
                Length::ToLimit(rest_s)
            };
            match self.judge(length) {
                Judged::Undecided => {
                    if let Some(event) = self.immediate() {
                        self.events_at_once += 1;
                        return self.handle(event, observer);
                    }
                    self.level += 1;
                    self.patience = PATIENCE;
                    // Less than the rest.
                    while self.systems[self.system].length_s(self.level) >= rest_s {
                        self.level += 1;
                    }
                }
                Judged::Clear => {
                    let is_at_limit = matches!(length, Length::ToLimit(length_s) if length_s == to_limit_s);
                    let end = if is_at_limit { Time::at(limit_s) } else { self.after(length) };
                    let slow = self.here.slow;
                    self.take(length.seconds(&self.systems[self.system]), end, observer);
                    if self.is_unguarded {
                        self.unresolved += 1;
                        self.blind_level = self.blind_level.saturating_sub(LONGER_BLIND).max(1);
                        self.level = self.blind_level - 1;
                        return Ok(());
                    }
                    self.blind_level = (self.blind_level + 1).min(FIRST_BLIND_LEVEL);
                    if self.blind_level == FIRST_BLIND_LEVEL {
                        self.blind.fill(false);
                    }
                    if self.steps_since_amplitudes > 1 {
                        std::mem::swap(&mut self.here.of_start, &mut self.here.of_end);
                        self.here.slow = slow;
                    }
                    self.patience = self.patience.saturating_sub(1);
                    if self.patience == 0 {
                        self.level = self.level.saturating_sub(1);
                    }
                    return Ok(());
                }
                Judged::Event(First { at_s, event }) => {
                    self.take(at_s, self.time.plus(at_s), observer);
                    self.anchor();
                    self.events_at_once += 1;
                    return self.handle(event, observer);
                }
            }
        }
    }

    fn after(&self, length: Length) -> Time {
        self.time.plus(length.seconds(&self.systems[self.system]))
    }

    /// Finds the joints that no step decides about: a guard of theirs is zero.
    fn find_blind(&mut self) {
        let system = &self.systems[self.system];
        let now = Now { z: &self.z, rates: &system.linear.natural.rates, roundings: &self.roundings };
        for (guard, live) in system.guards.iter().zip(&self.guards) {
            let cubic = guard.with_flight(&self.free, live.polynomial);
            if live.fresh > 0 || guard.is_zero(&now, cubic, &self.free) {
                self.blind[self.mount.joint_of_event(guard.event)] = true;
            }
        }
    }

    /// Whether the present step does without a guard: it is zero, and its joint one of those that no step decides about.
    fn does_without(&self, guard: &Watched, live: &Live, now: &Now, cubic: Polynomial) -> bool {
        self.level >= self.blind_level
            && self.blind[self.mount.joint_of_event(guard.event)]
            && (live.fresh > 0 || guard.is_zero(now, cubic, &self.free))
    }

    /// A guard that fails at once: its value is not above zero, and it falls. One that rises is zero by definition.
    fn immediate(&mut self) -> Option<Event> {
        let system = &self.systems[self.system];
        let now = Now { z: &self.z, rates: &system.linear.natural.rates, roundings: &self.roundings };
        for (n, (guard, live)) in system.guards.iter().zip(&mut self.guards).enumerate() {
            if live.fresh > 0 {
                continue;
            }
            let cubic = guard.with_flight(&self.free, live.polynomial);
            let here = guard.guard.at(&self.z, self.z.len(), cubic.at(0.0));
            let rounding = guard.rounding(&now, cubic, &self.free);
            // What does not change cannot fall, even where it is zero, as at a wall that touches a particle at rest.
            let is_constant = cubic.is_constant() && self.reaches[n - usize::from(guard.is_mirrored)].size() == 0.0;
            if here.value > rounding || is_constant {
                continue;
            }
            // Only the force of a dashpot jumps, with the velocities at an impact; all else below zero is rounding.
            if matches!(guard.event, Event::Releases(..)) && here.value < -rounding {
                return Some(guard.event);
            }
            if self.level >= self.blind_level && self.blind[self.mount.joint_of_event(guard.event)] {
                continue;
            }
            // What it does next: a particle at a wall may only touch it, or follow it.
            let (order, next) = guard.leading(&now, cubic, 1).unwrap_or((1, here.slope));
            if next > 0.0 {
                live.fresh = order;
                // Rounding has put a particle behind its wall, or its velocity behind zero.
                guard.lift(&mut self.free, (-here.value).max(0.0));
            } else if here.value <= 0.0 {
                return Some(guard.event);
            }
        }
        None
    }

    /// Judges over a step all guards that it does not do without; a step of the last level does without any.
    fn judge(&mut self, length: Length) -> Judged {
        let system = &self.systems[self.system];
        let own;
        let step = match length {
            Length::Level(level) => &system.steps[level],
            Length::ToLimit(length_s) => {
                own = Step::new(&system.linear.natural.rates, length_s);
                &own
            }
        };
        let h = step.length_s;
        self.ahead.clear();
        self.ahead.extend(self.z.iter().zip(&step.turn).map(|(z, turn)| z * turn));
        self.is_unguarded = self.level >= LAST_LEVEL;
        if self.is_unguarded {
            return Judged::Clear;
        }
        // What the guards' slow motions are at the start is what they were at the end of the last step.
        if self.here.slow != Some(step.slow) {
            self.here.slow = Some(step.slow);
            let guards = system.guards.iter();
            self.here.of_start.clear();
            for guard in guards {
                let here = guard.follow(&self.z, step.slow, self.here.of_start.last());
                self.here.of_start.push(here);
            }
        }
        self.here.of_end.clear();
        self.falls.clear();
        let now = Now { z: &self.z, rates: &system.linear.natural.rates, roundings: &self.roundings };
        for (n, (guard, live)) in system.guards.iter().zip(&self.guards).enumerate() {
            let reach = &self.reaches[n - usize::from(guard.is_mirrored)];
            let cubic = guard.with_flight(&self.free, live.polynomial);
            let of_end = guard.follow(&self.ahead, step.slow, self.here.of_end.last());
            self.here.of_end.push(of_end);
            if cubic.is_constant() && reach.size() == 0.0 {
                continue;
            }
            if self.does_without(guard, live, &now, cubic) {
                self.is_unguarded = true;
                continue;
            }
            if live.fresh > 1 {
                if guard.rises(&now, cubic, live.fresh, h) {
                    continue;
                }
                return Judged::Undecided;
            }
            let mut start = self.here.of_start[n].plus(cubic.at(0.0));
            let is_zero = live.fresh == 1;
            if is_zero && step.slow == self.z.len() {
                start.value = 0.0;
            }
            let end = of_end.plus(cubic.at(h));
            match reach.over(h, step.slow, cubic).judge(h, start, end, is_zero) {
                Verdict::Clear => {}
                Verdict::Falls => self.falls.push(n),
                Verdict::Unsure => return Judged::Undecided,
            }
        }
        let mut first: Option<First> = None;
        for fall in 0..self.falls.len() {
            let limit_s = first.map_or(h, |first| first.at_s);
            first = self.root(self.falls[fall], h, limit_s).or(first);
        }
        first.map_or(Judged::Clear, Judged::Event)
    }

    /// The root of a guard that falls through zero once within `length_s`, with the natural motions there in `ahead`; `None` if it is not
    /// before `limit_s`.
    fn root(&mut self, which: usize, length_s: f64, limit_s: f64) -> Option<First> {
        let system = &self.systems[self.system];
        let guard = &system.guards[which];
        let cubic = guard.with_flight(&self.free, self.guards[which].polynomial);
        let rates = &system.linear.natural.rates;
        // At the end of the step, or at the first event found so far.
        let end_s = limit_s.min(length_s);
        let start = guard.guard.at(&self.z, self.z.len(), cubic.at(0.0));
        let end = guard.guard.at(&self.ahead, self.z.len(), cubic.at(end_s));
        if end.value > 0.0 {
            return None;
        }
        let noise = 4.0 * f64::EPSILON * (self.reach(which).size() + cubic.size(end_s));
        let (mut low, mut high) = (0.0, end_s);
        let mut t = root_of_cubic(start, end, end_s);
        self.root.clear();
        self.root.extend(self.z.iter().zip(rates).map(|(z, rate)| z * (rate * t).exp()));
        for _ in 0..MAX_NEWTON_STEPS {
            let here = guard.guard.at(&self.root, self.root.len(), cubic.at(t));
            if here.value > 0.0 {
                low = t;
            } else {
                high = t;
            }
            if here.value.abs() <= noise {
                break;
            }
            // Halley's step: Newton's with the change of the slope.
            let bend = guard.guard.bend(&self.root) + cubic.bend_at(t);
            let newton = here.value / here.slope;
            let next = t - newton / (1.0 - 0.5 * newton * bend / here.slope);
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            let more = next - t;
            if more.abs() <= 4.0 * f64::EPSILON * t || !(low < next && next < high) {
                break;
            }
            for (z, (start, rate)) in self.root.iter_mut().zip(self.z.iter().zip(rates)) {
                let turn = rate * more;
                // Near its target a motion is turned by its series, which is exact there.
                *z = if turn.norm_sqr() < NEAR * NEAR { *z * exp_near_zero(turn) } else { start * (rate * next).exp() };
            }
            t = next;
        }
        // Equal times of two events: the first one found.
        if t >= limit_s && limit_s < length_s {
            return None;
        }
        std::mem::swap(&mut self.ahead, &mut self.root);
        Some(First { at_s: t, event: guard.event })
    }

    /// Moves to the end of a step, where the natural motions are `ahead`.
    fn take<O: Observer>(&mut self, length_s: f64, end: Time, observer: &mut O) {
        if O::PIECES && length_s > 0.0 {
            observer.piece(&Piece::new(self.parts(), self.time.seconds(), length_s));
        }
        self.pass_forces(length_s);
        std::mem::swap(&mut self.z, &mut self.ahead);
        self.here.slow = None;
        self.free.iter_mut().for_each(|flight| *flight = flight.after(length_s));
        if self.rest.drifts() {
            self.base_cubic = self.base_cubic.after(length_s);
            self.rest.advance(length_s);
            self.guards.iter_mut().for_each(|live| live.polynomial = live.polynomial.after(length_s));
        }
        self.time = end;
        let wave = self.z[self.systems[self.system].linear.natural.wave];
        (self.wave.sine, self.wave.cosine) = (wave.im, wave.re);
        if length_s > 0.0 {
            self.events_at_once = 0;
            self.zeros.clear();
            self.guards.iter_mut().for_each(|live| live.fresh = 0);
        }
        self.steps_since_amplitudes += 1;
        if self.steps_since_amplitudes >= STEPS_PER_ANCHOR {
            self.anchor();
            self.take_amplitudes();
            self.steps_since_amplitudes = 1;
        }
    }

    /// Computes the excitation from the time, so that rounding does not accumulate.
    fn anchor(&mut self) {
        if self.time.until(self.next_break_s) <= 0.0 {
            // The wave before the break, up to it.
            return;
        }
        self.wave = self.excitation.wave(self.time);
        let wave = self.systems[self.system].linear.natural.wave;
        self.z[wave] = C64::new(self.wave.cosine, self.wave.sine);
    }
}

/// What the slow motions of the guards are at the ends of a step.
#[derive(Clone, Debug, Default)]
pub(crate) struct AtEnds {
    of_start: Vec<Here>,
    of_end: Vec<Here>,
    /// How many motions count at the start; `None` where it is not known.
    pub slow: Option<usize>,
}

impl Length {
    fn seconds(self, system: &crate::system::System) -> f64 {
        match self {
            Self::Level(level) => system.length_s(level),
            Self::ToLimit(length_s) => length_s,
        }
    }
}

/// e^x for |x| up to [`NEAR`]: the next term is 0.02⁸/40320 = 6·10⁻¹⁹ at most.
fn exp_near_zero(x: C64) -> C64 {
    const PER: [f64; 7] = [1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0];
    let square = x * x;
    let even = square * (square * (square * PER[5] + PER[3]) + PER[1]);
    even + x * (square * (square * (square * PER[6] + PER[4]) + PER[2]) + PER[0]) + 1.0
}

/// A root of the cubic that falls from a positive value to one that is not, with these values and slopes at 0 and `end_s`: near that of the guard.
fn root_of_cubic(start: Here, end: Here, end_s: f64) -> f64 {
    let (rise, m0, m1) = (end.value - start.value, start.slope * end_s, end.slope * end_s);
    let (square, cube) = (3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise);
    let (mut low, mut high) = (0.0, 1.0);
    // Where the line through both ends is zero.
    let mut at = start.value / -rise;
    for _ in 0..8 {
        let value = start.value + at * (m0 + at * (square + at * cube));
        let slope = m0 + at * (2.0 * square + 3.0 * at * cube);
        if value > 0.0 {
            low = at;
        } else {
            high = at;
        }
        let newton = at - value / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - at).abs() < NEAR_ROOT {
            return next * end_s;
        }
        at = next;
    }
    at * end_s
}

impl Watched {
    /// Value and slope by the first `count` natural motions; `before`: those of the guard before this one.
    fn follow(&self, z: &[C64], count: usize, before: Option<&Here>) -> Here {
        match before {
            Some(Here { value, slope }) if self.is_mirrored => Here { value: -value, slope: -slope },
            _ => self.guard.at(z, count, Here::default()),
        }
    }

    /// What of its value may be rounding.
    fn rounding(&self, now: &Now, cubic: Polynomial, free: &[Flight]) -> f64 {
        self.derivative(now, cubic, 0).rounding + ROUNDINGS * self.scale(free)
    }

    /// Whether its value is zero but for rounding.
    fn is_zero(&self, now: &Now, cubic: Polynomial, free: &[Flight]) -> bool {
        self.derivative(now, cubic, 0).value.abs() <= self.rounding(now, cubic, free)
    }

    /// The first of its derivatives, from `order` on, that is more than rounding: its order and value. `None` if none is up to [`HIGHEST`].
    pub(crate) fn leading(&self, now: &Now, cubic: Polynomial, order: usize) -> Option<(usize, f64)> {
        (order..=HIGHEST).find_map(|order| {
            let Derivative { value, rounding, .. } = self.derivative(now, cubic, order);
            (value.abs() > rounding).then_some((order, value))
        })
    }

    /// A derivative by time with the polynomial's part.
    pub(crate) fn derivative(&self, now: &Now, cubic: Polynomial, order: usize) -> Derivative {
        let of_cubic = cubic.derivative(order);
        let mut of = Derivative { value: of_cubic, most: of_cubic.abs(), rounding: 0.0 };
        let power = i32::try_from(order).unwrap_or(i32::MAX);
        let roundings = now.roundings.iter().zip(now.rates);
        for ((z, c), (rounding, rate)) in now.z.iter().zip(&self.guard.coefficients).zip(roundings) {
            // An integer power of a complex number takes its time.
            let factor = if power == 0 { *c } else { c * rate.powi(power) };
            let size = factor.norm_sqr().sqrt();
            of.value += (factor * z).re;
            of.most += size * z.norm_sqr().sqrt();
            of.rounding += size * rounding;
        }
        of.rounding = ROUNDINGS * of.most + STORED * of.rounding;
        of
    }

    /// Whether a guard whose first `order` derivatives (from the value on) are zero by definition stays positive for `h`: by the
    /// next one and the largest one after it (Taylor).
    fn rises(&self, now: &Now, cubic: Polynomial, order: usize, h: f64) -> bool {
        let first = self.derivative(now, cubic, order);
        let next = self.derivative(now, cubic, order + 1);
        let most = next.most + h * cubic.most(order + 2, h);
        first.value > first.rounding && most * h < (order + 1) as f64 * first.value
    }
}

/// The natural motions now, with the rounding that they began the phase with.
#[derive(Clone, Copy)]
pub(crate) struct Now<'a> {
    pub z: &'a [C64],
    pub rates: &'a [C64],
    pub roundings: &'a [f64],
}

/// A derivative of a guard.
pub(crate) struct Derivative {
    pub value: f64,
    /// The largest magnitude that it can have from now on.
    most: f64,
    /// What of it may be rounding.
    rounding: f64,
}
