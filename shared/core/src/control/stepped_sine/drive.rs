//! The drive of a stepped sine, one tick at a time: its phase, its ramp, its loops, and the check that the base follows.

use super::regulator::{DrivePhase, Regulator};
use super::{FADE_S, SteppedSine, SteppedSinePlan};
use crate::control::base_follow::BaseFollow;
use crate::control::base_loop::DELAY_TICKS;
use crate::control::fault::Fault;
use crate::control::outcome::TickInputs;
use crate::control::phase_lock::{PhaseTracker, Sample};
use crate::io::{DriveRange, Rail, Readings, TICK_HZ};
use crate::sine::Phase;

const FADE_PER_TICK: f32 = 1.0 / (FADE_S * TICK_HZ);

/// Cycles after a change of the base's amplitude in which it may still move by the one before.
const CYCLES_OF_CHANGE: u32 = 3;

/// The drive.
#[derive(Clone, Debug)]
pub(super) struct Drive {
    phase: Phase,
    /// The phase in the last ticks with its sine and cosine, oldest first.
    waves: [(Phase, (f32, f32)); DELAY_TICKS as usize],
    increment: u32,
    frequency_hz: f32,
    /// Position on the ramp, 0 to 1.
    gain: f32,
    fall: f32,
    is_on: bool,
    /// The range that can be delivered.
    range: DriveRange,
    /// Base amplitude that this point demands without a loop of the response, m.
    amplitude_m: f32,
    /// That of the point before, m, and the cycles since it changed.
    amplitude_before_m: f32,
    cycles_since: u32,
    pub regulator: Regulator,
    /// The loop that finds the resonance.
    tracker: Option<PhaseTracker>,
    follow: BaseFollow,
    /// It was at its limit in the last tick.
    is_saturated: bool,
}

impl Drive {
    /// A drive that is off.
    pub fn new(plan: &SteppedSinePlan, range: &DriveRange) -> Self {
        Self {
            phase: Phase::default(),
            waves: Default::default(),
            increment: 0,
            frequency_hz: 0.0,
            gain: 0.0,
            fall: FADE_PER_TICK,
            is_on: false,
            range: *range,
            amplitude_m: plan.sine.amplitude_m,
            amplitude_before_m: plan.sine.amplitude_m,
            cycles_since: u32::MAX,
            regulator: Regulator::new(&plan.sine.drive),
            tracker: None,
            follow: BaseFollow::default(),
            is_saturated: false,
        }
    }

    /// Its frequency, Hz.
    pub fn frequency_hz(&self) -> f32 {
        self.frequency_hz
    }

    /// It follows a resonance.
    pub fn is_tracking(&self) -> bool {
        self.tracker.is_some()
    }

    /// Sine and cosine of its phase in the last tick.
    pub fn last_wave(&self) -> (f32, f32) {
        self.waves[DELAY_TICKS as usize - 1].1
    }

    /// Ticks of a cycle, rounded down.
    pub fn cycle_ticks(&self) -> u32 {
        u32::MAX / self.increment.max(1)
    }

    /// Share of the present cycle that has passed, 0 to 1.
    pub fn share_of_cycle(&self) -> f32 {
        self.phase.0 as f32 / 4_294_967_296.0
    }

    /// A cycle begins in this tick.
    pub fn begins_cycle(&self) -> bool {
        self.phase.0 < self.increment
    }

    /// Fraction of the last tick, at whose end a cycle ended, that belongs to the present cycle.
    pub fn over(&self) -> f32 {
        self.phase.0 as f32 / self.increment as f32
    }

    /// It is on.
    pub fn is_on(&self) -> bool {
        self.is_on
    }

    /// It is strong enough for the base to move visibly: on, and more than half up its ramp.
    pub fn is_swinging(&self) -> bool {
        self.is_on && self.gain > 0.5
    }

    /// It has faded out.
    pub fn is_silent(&self) -> bool {
        self.gain == 0.0 && !self.is_on
    }

    /// It was at its limit in the last tick.
    pub fn is_saturated(&self) -> bool {
        self.is_saturated
    }

    /// The amplitude is held, and the phase of a resonance has not been lost.
    pub fn is_kept(&self) -> bool {
        self.regulator.is_held() && !self.tracker.as_ref().is_some_and(PhaseTracker::is_lost)
    }

    /// The amplitude is held, and the phase of a resonance is locked.
    pub fn is_locked(&self) -> bool {
        self.regulator.is_held() && self.tracker.as_ref().is_none_or(PhaseTracker::is_locked)
    }

    /// Begins with phase 0, as at the start of an experiment: a point from rest does not depend on the point before it.
    pub fn restart(&mut self) {
        self.phase = Phase::default();
        self.waves = [(self.phase, self.phase.sin_cos()); DELAY_TICKS as usize];
    }

    /// Turns it on for a point, or takes it to the next one.
    pub fn begin_point(&mut self, sine: &SteppedSine, index: usize) {
        let SteppedSine { points, drive, amplitude_m, .. } = sine;
        if self.gain == 0.0 {
            self.regulator = Regulator::new(drive);
            self.tracker = points.lock().map(|lock| PhaseTracker::new(lock, TICK_HZ));
        }
        let own = points.amplitude(index);
        let demanded_m = own.filter(|_| !self.regulator.keeps_response()).unwrap_or(*amplitude_m);
        if demanded_m != self.amplitude_m {
            (self.amplitude_before_m, self.cycles_since) = (self.amplitude_m, 0);
        }
        self.amplitude_m = demanded_m;
        // The resonance is where it was in the point before.
        self.frequency_hz = self.tracker.as_mut().map_or_else(
            || points.frequency_hz(index),
            |tracker| {
                tracker.begin_point();
                tracker.frequency_hz()
            },
        );
        self.increment = Phase::increment(self.frequency_hz, TICK_HZ);
        self.regulator.begin_point(drive, self.frequency_hz, own);
        self.is_on = true;
    }

    /// Turns it off: it fades by this much of the ramp in a tick.
    pub fn end(&mut self, fall: f32) {
        self.is_on = false;
        self.fall = fall;
    }

    /// Turns it off in the shortest fade.
    pub fn release(&mut self) {
        self.end(FADE_PER_TICK);
    }

    /// Goes on to the next tick. Returns whether a cycle has ended.
    pub fn advance(&mut self) -> bool {
        self.phase.advance(self.increment)
    }

    /// The drive at the present phase, m, limited to what can be delivered, and a fault of the base. It fades after its
    /// end; then, and without readings of z, the loop is open.
    pub fn tick(&mut self, plan: &SteppedSinePlan, now: Option<&TickInputs>) -> (f32, Option<Fault>) {
        let step = if self.is_on { plan.rise } else { -self.fall };
        self.gain = (self.gain + step).clamp(0.0, 1.0);
        let wave = self.phase.sin_cos();
        let (demand, fault) = self.demand_m(plan, now.filter(|_| self.is_on), wave);
        let (drive, is_cut) = self.range.limit(demand);
        self.is_saturated |= is_cut;
        (drive, fault.or_else(|| self.follow(now?, drive, wave)))
    }

    /// The demand, m, and a fault of the closed loop.
    fn demand_m(&mut self, plan: &SteppedSinePlan, now: Option<&TickInputs>, wave: (f32, f32)) -> (f32, Option<Fault>) {
        // A smooth ramp: its slope is zero at both ends.
        let ramp = self.gain * self.gain * (3.0 - 2.0 * self.gain);
        let [(then, wave_then), (next, _)] = self.waves;
        self.waves.rotate_left(1);
        self.waves[DELAY_TICKS as usize - 1] = (self.phase, wave);
        self.is_saturated = false;
        let Some(now) = now else { return (ramp * self.regulator.open(self.amplitude_m, wave), None) };
        let before_m = if self.has_just_changed() { self.amplitude_before_m } else { 0.0 };
        let recent_m = self.amplitude_m.max(before_m);
        let at = DrivePhase { wave, then: then.0, increment_then: next.0.wrapping_sub(then.0), wave_then, recent_m };
        self.track(plan, now, &at);
        let (drive, fault) = self.regulator.tick(ramp, self.amplitude_m, now, &at);
        self.is_saturated = self.regulator.is_saturated();
        (drive, fault)
    }

    /// Sets the frequency that the phase of x asks for.
    fn track(&mut self, plan: &SteppedSinePlan, now: &TickInputs, at: &DrivePhase) {
        let Some(tracker) = &mut self.tracker else { return };
        let Readings { x, z, .. } = now.readings;
        let is_read = x.rail == Rail::Clear && z.rail == Rail::Clear;
        let reading = is_read.then_some((x.mean_m, z.mean_m));
        let sample = Sample { reading, phase: at.then, increment: at.increment_then, wave: at.wave_then };
        let is_full = self.gain >= 1.0;
        if let Some(frequency_hz) = tracker.tick(&sample, is_full, self.regulator.keeps_response()) {
            self.frequency_hz = frequency_hz;
            self.increment = Phase::increment(frequency_hz, TICK_HZ);
            self.regulator.tune(&plan.sine.drive, frequency_hz);
        }
    }

    /// The base still moves by the amplitude of the point before.
    fn has_just_changed(&self) -> bool {
        self.cycles_since < CYCLES_OF_CHANGE
    }

    /// Checks that the base follows the drive.
    fn follow(&mut self, now: &TickInputs, drive: f32, wave: (f32, f32)) -> Option<Fault> {
        let z = &now.readings.z;
        self.follow.push(z.mean_m, drive, wave);
        if !self.is_on || self.gain < 1.0 || z.rail != Rail::Clear || self.has_just_changed() {
            self.follow.disturb();
        }
        if self.phase.0.checked_add(self.increment).is_some() {
            return None;
        }
        self.cycles_since = self.cycles_since.saturating_add(1);
        let followed = self.follow.end_cycle()?;
        let demand_m = self.regulator.demand_m(self.amplitude_m);
        let (cause, value, limit) = followed.fault(demand_m)?;
        Some(Fault { cause, tick: now.tick, value, limit })
    }
}

/// The phase that the readings of the next tick belong to; for tests.
#[cfg(test)]
impl Drive {
    pub fn phase_of_reading(&self) -> Phase {
        Phase(self.phase.0.wrapping_sub(DELAY_TICKS * self.increment))
    }

    pub fn oldest_wave(&self) -> (Phase, (f32, f32)) {
        self.waves[0]
    }
}
