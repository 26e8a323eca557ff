//! End-point proofs: decide from the states at both ends of an arc whether it contains an event, without its series.
//!
//! The documentation of [`super`] contains the proofs. The walk handles the arcs that they do not decide.

use super::arc_roots::{ArcMotion, back_after, inverse_cubic};
use super::excitation::Wave;
use super::flow::ExactState;
use super::motion::{ARCS_PER_ANCHOR, Exact, Fresh, Touch};
use super::observe::Observer;
use super::oscillator::{Oscillator, dot};
use crate::integrator::modes::{Contact, Grip, Sign, sign, signed};

/// Outcome of the end-point proof for an arc.
#[derive(PartialEq, Eq)]
enum Proof {
    /// The arc contains no event.
    Clear,
    /// The first event is an impact on that side, and it occurs within the arc.
    Hit(Sign),
    /// Undecided.
    Unsure,
}

/// The particle reaches the hard wall of `side` at fraction `at` of a full arc.
pub(super) struct Hit {
    pub at: f64,
    pub side: Sign,
    pub state: ExactState,
    pub wave: Wave,
    /// Newton steps taken to find it.
    steps: u32,
}

/// The motion of an oscillator over a full arc from a given state.
struct Full<'a> {
    table: &'a Oscillator,
    /// Displacement, velocity, constant acceleration, sine, cosine; and their magnitudes.
    unit: [f64; 5],
    size: [f64; 5],
    /// Displacement at the end minus displacement at the start; the same for the velocity.
    shift: f64,
    gain: f64,
}

impl<'a> Full<'a> {
    #[inline(always)]
    fn new(table: &'a Oscillator, acceleration: f64, state: &ExactState, wave: &Wave) -> Self {
        let unit = [state.x_m, state.v_m_per_s, acceleration, wave.sine, wave.cosine];
        let (shift, gain) = (dot(&table.shift, &unit), dot(&table.gain, &unit));
        Self { table, unit, size: unit.map(f64::abs), shift, gain }
    }

    /// Largest amount by which a velocity can lie below its chord, m/s.
    #[inline(always)]
    fn sag(&self) -> f64 {
        dot(&self.table.sag, &self.size)
    }

    /// Acceleration × step² at both ends, and the largest deviation from its chord, m.
    #[inline(always)]
    fn accelerations(&self, end: &ExactState, end_wave: &Wave) -> (f64, f64, f64) {
        let at_end = [end.x_m, end.v_m_per_s, self.unit[2], end_wave.sine, end_wave.cosine];
        let row = &self.table.rates[0];
        (dot(row, &self.unit), dot(row, &at_end), dot(&self.table.fourth, &self.size) * 0.125)
    }
}

impl Exact {
    /// Takes full arcs for as long as the end-point proof decides them: up to `limit_s`, to an impact, or to the first
    /// arc that must be walked.
    #[inline]
    pub(super) fn fly<O: Observer>(&mut self, limit_s: f64, observer: &mut O) -> Option<Hit> {
        let ready = self.touch == Touch::Clear && self.fresh.gap <= 1 && self.fresh.slide == 0 && self.fresh.slip == 0;
        let table = self.flows.oscillator(self.leg.path).filter(|_| ready && !self.has_tmd)?;
        let h = table.step_s;
        let (mut state, mut wave, mut time, mut arcs) = (self.state, self.wave, self.time, self.arcs_since_anchor);
        let (mut meets, mut proved, mut sines) = (None, 0, 0);
        while time.until(limit_s) > h && observer.goes_on(time.seconds()) {
            let full = Full::new(table, self.leg.structure_acceleration, &state, &wave);
            let end = self.after(&full, &state);
            let end_wave = wave.turned_by(table.turn.0, table.turn.1);
            match self.judge(&full, &state, &end, &wave, &end_wave) {
                Proof::Clear => {}
                Proof::Unsure => break,
                Proof::Hit(side) => {
                    meets = Some(side);
                    break;
                }
            }
            self.report((&state, &wave), (&end, &end_wave), (time, h), None, observer);
            (state, wave) = (end, end_wave);
            time = time.plus(h);
            arcs += 1;
            proved += 1;
            if arcs >= ARCS_PER_ANCHOR {
                (wave, arcs) = (self.excitation.wave(time), 0);
                sines += 1;
            }
        }
        let hit = meets.and_then(|side| self.find_hit(table, &state, &wave, side));
        if let Some(found) = &hit {
            let length_s = h * found.at;
            self.report((&state, &wave), (&found.state, &found.wave), (time, length_s), None, observer);
            (state, wave) = (found.state, found.wave);
            time = time.plus(length_s);
            arcs += 1;
            proved += 1;
            self.work.impacts_located += 1;
            self.work.newton_steps += u64::from(found.steps);
        }
        self.work.arcs_proved += proved;
        self.work.sines += sines;
        if time != self.time {
            (self.state, self.wave, self.time, self.arcs_since_anchor) = (state, wave, time, arcs);
            self.fresh = Fresh::default();
            self.events_at_once = 0;
        }
        hit
    }

    /// The state after a full arc.
    #[inline(always)]
    fn after(&self, full: &Full<'_>, state: &ExactState) -> ExactState {
        let h = full.table.step_s;
        let mut end = *state;
        end.x_m += full.shift;
        end.v_m_per_s += full.gain;
        if self.leg.sliding {
            let dragged = self.leg.particle_acceleration * h;
            end.offset_m += (state.slide_m_per_s + 0.5 * dragged) * h - (full.shift - full.unit[1] * h);
            end.slide_m_per_s += dragged - full.gain;
        }
        end
    }

    /// Decides what happens on a full arc from `state` to `end`.
    #[inline(always)]
    fn judge(&self, full: &Full<'_>, state: &ExactState, end: &ExactState, wave: &Wave, end_wave: &Wave) -> Proof {
        if let Grip::Slip(direction) = self.mode.grip
            && !self.slips_on(full, (state, wave), (end, end_wave), direction)
        {
            return Proof::Unsure;
        }
        if !self.leg.sliding {
            return if self.stays_held(full, end, end_wave) { Proof::Clear } else { Proof::Unsure };
        }
        let (slide, slide_end) = (state.slide_m_per_s, end.slide_m_per_s);
        let side = sign(slide);
        if signed(side, slide_end).min(slide.abs()) > full.sag() {
            // The particle moves towards that side throughout the arc.
            let (gap, gap_end) = (self.c.gap(side, state.offset_m), self.c.gap(side, end.offset_m));
            return if gap_end > 0.0 {
                Proof::Clear
            } else if gap > 0.0 && self.soft(side).is_none() {
                Proof::Hit(side)
            } else {
                Proof::Unsure
            };
        }
        if self.c.friction_acceleration > 0.0 {
            return Proof::Unsure;
        }
        let gaps = |offset: f64| self.c.gap(-1, offset).min(self.c.gap(1, offset));
        if gaps(end.offset_m) < 0.0 {
            return self.bounces(full, state, end, end_wave);
        }
        let third = full.table.step_s * (1.0 / 3.0);
        let (half, middle) = (0.5 * (self.c.end(-1) + self.c.end(1)), self.c.middle());
        let inner = half - dot(&full.table.fourth, &full.size) * (1.0 / 288.0);
        let (first, second) = (state.offset_m + slide * third, end.offset_m - slide_end * third);
        let inside = (first - middle).abs() < inner && (second - middle).abs() < inner;
        let clear = inside && gaps(state.offset_m) >= 0.0 && gaps(end.offset_m) > 0.0;
        if clear { Proof::Clear } else { Proof::Unsure }
    }

    /// Whether a particle that ends beyond a wall is pressed towards it throughout the arc; it then crosses the wall
    /// once.
    #[inline(always)]
    fn bounces(&self, full: &Full<'_>, state: &ExactState, end: &ExactState, end_wave: &Wave) -> Proof {
        let side = if self.c.gap(1, end.offset_m) < 0.0 { 1 } else { -1 };
        let gap = self.c.gap(side, state.offset_m);
        let (start, last, beyond) = full.accelerations(end, end_wave);
        let pull = signed(side, self.leg.particle_acceleration * (full.table.step_s * full.table.step_s));
        let pressed = signed(side, start).max(signed(side, last)) - pull < -beyond;
        // The gap lies below its first tangent, so the particle cannot reach the other wall.
        let highest = gap - signed(side, state.slide_m_per_s).min(0.0) * full.table.step_s;
        if pressed && gap >= 0.0 && highest < self.c.end(-1) + self.c.end(1) && self.soft(side).is_none() {
            Proof::Hit(side)
        } else {
            Proof::Unsure
        }
    }

    /// Whether the structure slips in `direction` on the damper throughout the arc.
    #[inline(always)]
    fn slips_on(
        &self,
        full: &Full<'_>,
        start: (&ExactState, &Wave),
        end: (&ExactState, &Wave),
        direction: Sign,
    ) -> bool {
        let turning = self.flows.base_share * self.flows.turning;
        let slip = |(state, wave): (&ExactState, &Wave)| signed(direction, state.v_m_per_s - turning * wave.cosine);
        let angle = full.table.angle;
        let base_sag = turning * angle * angle * (full.size[3] + full.size[4]) * 0.125;
        slip(start).min(slip(end)) > full.sag() + base_sag
    }

    /// Whether a particle that moves with the structure stays held throughout the arc.
    #[inline(always)]
    fn stays_held(&self, full: &Full<'_>, end: &ExactState, end_wave: &Wave) -> bool {
        let Contact::Held(side) = self.mode.contact else {
            return true;
        };
        if self.soft != [None; 2] {
            return false;
        }
        let (start, last, beyond) = full.accelerations(end, end_wave);
        let square = full.table.step_s * full.table.step_s;
        let (low, high) = self.c.held_limits(side, 0.0);
        high.is_none_or(|high| start.max(last) + beyond < high * square)
            && low.is_none_or(|low| start.min(last) - beyond > low * square)
    }

    /// Finds the single root of a gap that is positive, or zero and growing, at the start and negative at the end.
    #[inline(never)]
    fn find_hit(&self, table: &Oscillator, state: &ExactState, wave: &Wave, side: Sign) -> Option<Hit> {
        let full = Full::new(table, self.leg.structure_acceleration, state, wave);
        let h = table.step_s;
        let gap = self.c.gap(side, state.offset_m);
        let closing = signed(side, state.slide_m_per_s) * h;
        let pull = signed(side, 0.5 * self.leg.particle_acceleration * (h * h));
        let travel = closing + pull - signed(side, full.shift - full.unit[1] * h);
        let guess = if closing > 0.0 {
            inverse_cubic(gap, travel, closing, closing + 2.0 * pull - signed(side, full.gain) * h)
        } else {
            back_after(gap, -closing, 2.0 * pull - signed(side, dot(&table.rates[0], &full.unit)), travel)
        };
        let motion = ArcMotion::new(table, &full.unit, wave);
        let (at, near, steps) = motion.gap_closes(side, gap, closing, pull, guess)?;
        let rate = near.rate * table.per_step;
        let state = ExactState {
            x_m: near.x,
            v_m_per_s: state.v_m_per_s + rate,
            offset_m: self.c.wall(side),
            slide_m_per_s: state.slide_m_per_s + (self.leg.particle_acceleration * h * at - rate),
        };
        Some(Hit { at, side, state, wave: near.wave, steps })
    }
}
