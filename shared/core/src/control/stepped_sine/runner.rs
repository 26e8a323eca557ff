//! Runs a checked stepped sine, one tick at a time.

use super::regulator::{DrivePhase, Regulator};
use super::{FADE_S, Start, SteppedSine, SteppedSinePlan};
use crate::control::base_follow::BaseFollow;
use crate::control::base_loop::DELAY_TICKS;
use crate::control::fault::{Fault, FaultCause};
use crate::control::outcome::{ExperimentStage, Outcome, StageProgress, TickInputs};
use crate::control::phase_lock::{PhaseTracker, Sample};
use crate::control::rest::{RestWait, Waited};
use crate::io::{DriveRange, Rail, Readings, SensorSet, TICK_HZ};
use crate::measure::point::{Place, PointMeter};
use crate::measure::running::DriveReference;
use crate::sine::Phase;

const FADE_PER_TICK: f32 = 1.0 / (FADE_S * TICK_HZ);

/// Cycles after a change of the base's amplitude in which it may still move by the one before.
const CYCLES_OF_CHANGE: u32 = 3;

/// A stepped sine in progress, with its plan.
#[derive(Clone, Debug)]
pub struct SteppedSineRunner {
    plan: SteppedSinePlan,
    index: usize,
    stage: ExperimentStage,
    rest: RestWait,
    /// Ticks since the present frequency began.
    driven_ticks: u32,
    phase: Phase,
    /// The drive's phase in the last ticks with its sine and cosine, oldest first.
    waves: [(Phase, (f32, f32)); DELAY_TICKS as usize],
    increment: u32,
    frequency_hz: f32,
    /// Position on the ramp, 0 to 1.
    gain: f32,
    fall: f32,
    driving: bool,
    /// The present point goes on until a person releases it.
    held: bool,
    /// The range that the drive can deliver.
    range: DriveRange,
    /// Base amplitude that this point demands without a loop of the response, m.
    amplitude_m: f32,
    /// That of the point before, m, and the cycles since it changed.
    amplitude_before_m: f32,
    cycles_since: u32,
    regulator: Regulator,
    /// The loop that finds the resonance.
    tracker: Option<PhaseTracker>,
    follow: BaseFollow,
    /// The drive was at its limit in the last tick, and at any time since the dwell began.
    saturated: bool,
    was_saturated: bool,
    /// Sensors that were clipped since the dwell began.
    clipped: SensorSet,
    meter: PointMeter,
    cycles: u32,
    cycle_ended: bool,
    start_tick: u32,
    /// Tick of the point's first dwell, once it has begun, and the dwells that have begun.
    first_dwell: Option<u32>,
    dwells: u16,
    impacts_before: u32,
    put_back: Option<u16>,
}

impl SteppedSineRunner {
    /// A runner at the beginning of the first point. `drive` is the range that the drive can deliver.
    #[must_use]
    pub fn new(plan: &SteppedSinePlan, drive: &DriveRange) -> Self {
        let mut runner = Self {
            plan: plan.clone(),
            index: 0,
            stage: ExperimentStage::Rest,
            rest: RestWait::default(),
            driven_ticks: 0,
            phase: Phase::default(),
            waves: Default::default(),
            increment: 0,
            frequency_hz: 0.0,
            gain: 0.0,
            fall: FADE_PER_TICK,
            driving: false,
            held: false,
            range: *drive,
            amplitude_m: plan.sine.amplitude_m,
            amplitude_before_m: plan.sine.amplitude_m,
            cycles_since: u32::MAX,
            regulator: Regulator::new(&plan.sine.drive),
            tracker: None,
            follow: BaseFollow::default(),
            saturated: false,
            was_saturated: false,
            clipped: SensorSet::default(),
            meter: PointMeter::default(),
            cycles: 0,
            cycle_ended: false,
            start_tick: 0,
            first_dwell: None,
            dwells: 0,
            impacts_before: 0,
            put_back: None,
        };
        runner.begin_point();
        runner
    }

    /// Index of the present point in the list.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index
    }

    /// Stage of the present point.
    #[must_use]
    pub fn stage(&self) -> ExperimentStage {
        self.stage
    }

    /// How far it is in the present point.
    #[must_use]
    pub fn progress(&self) -> StageProgress {
        let left_s = match self.stage {
            _ if self.held => 0.0,
            ExperimentStage::Settle => self.plan.settle_ticks.saturating_sub(self.driven_ticks) as f32 / TICK_HZ,
            ExperimentStage::Dwell => {
                let cycles =
                    self.cycles.saturating_sub(self.meter.cycles()) as f32 - self.phase.0 as f32 / 4_294_967_296.0;
                cycles.max(0.0) / self.frequency_hz
            }
            ExperimentStage::Rest | ExperimentStage::Hold => 0.0,
        };
        StageProgress { left_s, dwells: self.dwells }
    }

    /// The present drive frequency, Hz; 0 while resting.
    #[must_use]
    pub fn frequency_hz(&self) -> f32 {
        if self.stage == ExperimentStage::Rest { 0.0 } else { self.frequency_hz }
    }

    /// The drive's reference in the last tick; `None` while resting.
    #[must_use]
    pub fn reference(&self) -> Option<DriveReference> {
        let (_, wave) = self.waves[DELAY_TICKS as usize - 1];
        (self.stage != ExperimentStage::Rest).then_some(DriveReference { wave, cycle_ended: self.cycle_ended })
    }

    /// A cycle of the drive ended in the last tick.
    #[must_use]
    pub fn cycle_ended(&self) -> bool {
        self.cycle_ended
    }

    /// The drive is strong enough for the base to move visibly: it is on, and more than half up its ramp.
    #[must_use]
    pub fn is_swinging(&self) -> bool {
        self.driving && self.gain > 0.5
    }

    /// The drive is on.
    #[must_use]
    pub fn is_driving(&self) -> bool {
        self.driving
    }

    /// The drive was at its limit in the last tick.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.saturated
    }

    /// Base amplitude that the response's loop demands now, m; `None` of other drives.
    #[must_use]
    pub fn demanded_m(&self) -> Option<f32> {
        self.regulator.demanded_m()
    }

    /// Base amplitude that the response's loop demands next, m; 0 of other drives.
    #[must_use]
    pub fn base_foreseen_m(&self) -> f32 {
        self.regulator.base_foreseen_m()
    }

    /// Index of the point in the whole experiment.
    fn place(&self) -> u16 {
        self.plan.sine.first_index.wrapping_add(self.index as u16)
    }

    /// Index of the point that begins from rest in this tick. A simulated plant is reset to its start.
    #[must_use]
    pub fn begins_from_rest(&self) -> Option<u16> {
        self.put_back
    }

    /// Holds the present point, or releases it. While held, the drive continues at the point's frequency and nothing is
    /// measured: a measurement in progress is dropped. After the release the point is measured from the beginning.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
        if held && self.stage == ExperimentStage::Dwell {
            self.stage = ExperimentStage::Settle;
            self.dwells = self.dwells.saturating_sub(1);
        }
    }

    /// The present point is held.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// Starts the final fade-out of the drive. It ends a hold.
    pub fn release_drive(&mut self) {
        self.held = false;
        self.driving = false;
        self.fall = FADE_PER_TICK;
    }

    /// The drive has faded out.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.gain == 0.0 && !self.driving
    }

    fn begin_point(&mut self) {
        match self.plan.sine.start {
            Start::FromRest { .. } => {
                self.stage = ExperimentStage::Rest;
                self.end_driving();
                self.rest = RestWait::default();
            }
            Start::CarryOver => self.begin_settling(),
        }
    }

    fn end_driving(&mut self) {
        self.driving = false;
        self.fall = self.plan.fall;
    }

    fn begin_settling(&mut self) {
        let SteppedSine { points, drive, amplitude_m, .. } = &self.plan.sine;
        if self.gain == 0.0 {
            self.regulator = Regulator::new(drive);
            self.tracker = points.lock().map(|lock| PhaseTracker::new(lock, TICK_HZ));
        }
        let own = points.amplitude(self.index);
        let demanded_m = own.filter(|_| !self.regulator.keeps_response()).unwrap_or(*amplitude_m);
        if demanded_m != self.amplitude_m {
            (self.amplitude_before_m, self.cycles_since) = (self.amplitude_m, 0);
        }
        self.amplitude_m = demanded_m;
        // The resonance is where it was in the point before.
        self.frequency_hz = self.tracker.as_mut().map_or_else(
            || points.frequency_hz(self.index),
            |tracker| {
                tracker.begin_point();
                tracker.frequency_hz()
            },
        );
        self.increment = Phase::increment(self.frequency_hz, TICK_HZ);
        self.regulator.begin_point(drive, self.frequency_hz, own);
        self.stage = ExperimentStage::Settle;
        self.driven_ticks = 0;
        (self.first_dwell, self.dwells) = (None, 0);
        self.driving = true;
    }

    /// Whether, in a dwell, an amplitude or the phase has left its tolerance and there is time to restart the dwell.
    fn has_slipped(&self) -> bool {
        let is_kept = self.regulator.is_held() && !self.tracker.as_ref().is_some_and(PhaseTracker::is_lost);
        !is_kept && self.driven_ticks <= self.plan.held_by_ticks
    }

    /// The point has settled: the measurement may begin at the next cycle.
    fn is_settled(&self) -> bool {
        let is_kept = self.regulator.is_held() && self.tracker.as_ref().is_none_or(PhaseTracker::is_locked);
        !self.held
            && self.driven_ticks > self.plan.settle_ticks
            && (is_kept || self.driven_ticks > self.plan.held_by_ticks)
    }

    /// Fraction of the last tick, at whose end a cycle ended, that belongs to the present cycle.
    fn over(&self) -> f32 {
        self.phase.0 as f32 / self.increment as f32
    }

    fn begin_dwelling(&mut self, now: &TickInputs) {
        self.stage = ExperimentStage::Dwell;
        self.cycles = (self.plan.sine.dwell_s * self.frequency_hz) as u32;
        self.start_tick = now.tick;
        self.impacts_before = now.impacts;
        self.first_dwell.get_or_insert(now.tick);
        self.dwells = self.dwells.saturating_add(1);
        self.meter = PointMeter::new(self.cycles, self.over());
        (self.was_saturated, self.clipped) = (false, SensorSet::default());
    }

    /// The drive for this tick, m, without measuring. Used for the fade after a stop.
    pub fn fade(&mut self) -> f32 {
        let drive = self.drive_m(None).0;
        self.cycle_ended = self.phase.advance(self.increment);
        drive
    }

    /// The drive at the present phase, m, limited to what can be delivered, and a fault of the base. The drive fades
    /// after its release; then, and without readings of z, the loop is open.
    fn drive_m(&mut self, now: Option<&TickInputs>) -> (f32, Option<Fault>) {
        let step = if self.driving { self.plan.rise } else { -self.fall };
        self.gain = (self.gain + step).clamp(0.0, 1.0);
        let wave = self.phase.sin_cos();
        let (demand, fault) = self.demand_m(now.filter(|_| self.driving), wave);
        let (drive, is_cut) = self.range.limit(demand);
        self.saturated |= is_cut;
        self.was_saturated |= self.saturated;
        (drive, fault.or_else(|| self.follow(now?, drive, wave)))
    }

    /// The demand, m, and a fault of the closed loop.
    fn demand_m(&mut self, now: Option<&TickInputs>, wave: (f32, f32)) -> (f32, Option<Fault>) {
        // A smooth ramp: its slope is zero at both ends.
        let ramp = self.gain * self.gain * (3.0 - 2.0 * self.gain);
        let [(then, wave_then), (next, _)] = self.waves;
        self.waves.rotate_left(1);
        self.waves[DELAY_TICKS as usize - 1] = (self.phase, wave);
        self.saturated = false;
        let Some(now) = now else { return (ramp * self.regulator.open(self.amplitude_m, wave), None) };
        let before_m = if self.has_just_changed() { self.amplitude_before_m } else { 0.0 };
        let recent_m = self.amplitude_m.max(before_m);
        let at = DrivePhase { wave, then: then.0, increment_then: next.0.wrapping_sub(then.0), wave_then, recent_m };
        self.track(now, &at);
        let (drive, fault) = self.regulator.tick(ramp, self.amplitude_m, now, &at);
        self.saturated = self.regulator.is_saturated();
        (drive, fault)
    }

    /// Sets the frequency that the phase of x asks for.
    fn track(&mut self, now: &TickInputs, at: &DrivePhase) {
        let Some(tracker) = &mut self.tracker else { return };
        let Readings { x, z, .. } = now.readings;
        let is_read = x.rail == Rail::Clear && z.rail == Rail::Clear;
        let reading = is_read.then_some((x.mean_m, z.mean_m));
        let sample = Sample { reading, phase: at.then, increment: at.increment_then, wave: at.wave_then };
        let is_full = self.gain >= 1.0;
        if let Some(frequency_hz) = tracker.tick(&sample, is_full, self.regulator.keeps_response()) {
            self.frequency_hz = frequency_hz;
            self.increment = Phase::increment(frequency_hz, TICK_HZ);
            self.regulator.tune(&self.plan.sine.drive, frequency_hz);
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
        if !self.driving || self.gain < 1.0 || z.rail != Rail::Clear || self.has_just_changed() {
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

    /// Runs one tick. Takes this tick's readings; returns the demanded base displacement (m) and the outcome of the
    /// tick.
    pub fn tick(&mut self, now: &TickInputs) -> (f32, Outcome) {
        self.put_back = None;
        self.driven_ticks = self.driven_ticks.saturating_add(1);
        if self.held {
            // After the release a closed loop has its whole waiting time again.
            self.driven_ticks = self.driven_ticks.min(self.plan.settle_ticks);
        }
        let unrest = if self.stage == ExperimentStage::Rest { self.rest(now) } else { None };
        // A dwell begins at the start of a cycle, and so does a drive from rest.
        if self.stage == ExperimentStage::Settle && self.phase.0 < self.increment && self.is_settled() {
            self.begin_dwelling(now);
        }
        let (drive, runaway) = self.drive_m(Some(now));
        let fault = runaway.or(unrest);
        // After the last point only the fade-out of the drive continues.
        let measuring = self.stage == ExperimentStage::Dwell && self.index < self.plan.sine.points.len();
        if measuring {
            self.meter.push(now.readings, drive, self.phase.sin_cos());
            self.clipped.extend(now.clipped);
        }
        self.cycle_ended = self.phase.advance(self.increment);
        if self.cycle_ended && measuring {
            self.meter.end_cycle(self.over());
            if self.has_slipped() {
                self.stage = ExperimentStage::Settle;
            }
            if self.meter.cycles() == self.cycles && fault.is_none() {
                return (drive, self.end_dwell(now));
            }
        }
        (drive, fault.map_or(Outcome::Running, Outcome::Failed))
    }

    fn rest(&mut self, now: &TickInputs) -> Option<Fault> {
        if self.gain > 0.0 {
            // The drive is still fading out: the rest has not begun.
            return None;
        }
        let level = match self.plan.sine.start {
            Start::FromRest { level_m } => level_m,
            Start::CarryOver => f32::MAX,
        };
        let value = now.readings.x.peak_m;
        match self.rest.tick(value, level) {
            Waited::NotYet => {}
            Waited::Begun => self.put_back = Some(self.place()),
            Waited::Quiet => {
                self.phase = Phase::default();
                // As at the start of an experiment: a point from rest does not depend on the point before it.
                self.waves = [(self.phase, self.phase.sin_cos()); DELAY_TICKS as usize];
                self.begin_settling();
                self.driven_ticks = 1;
            }
            Waited::TimedOut => {
                return Some(Fault { cause: FaultCause::RestTimeout, tick: now.tick, value, limit: level });
            }
        }
        None
    }

    /// Ends a dwell: the point has its result, or begins another dwell.
    fn end_dwell(&mut self, now: &TickInputs) -> Outcome {
        let place = Place {
            index: self.place(),
            frequency_hz: if self.tracker.is_some() { self.meter.frequency_hz() } else { self.frequency_hz },
            start_tick: self.start_tick,
            end_tick: now.tick + 1,
            drive_saturated: self.was_saturated,
            clipped: self.clipped,
            impacts: now.impacts.wrapping_sub(self.impacts_before),
        };
        let result = self.meter.result(&place, &self.plan.sine.steady);
        let dwell_ticks = place.end_tick.wrapping_sub(self.start_tick);
        let with_another =
            place.end_tick.wrapping_sub(self.first_dwell.unwrap_or(now.tick)).saturating_add(dwell_ticks);
        // Whole cycles in ticks are rounded: a cycle more than the longest time is allowed. A dwell has at least six.
        let longest = self.plan.longest_dwell_ticks.saturating_add(u32::MAX / self.increment.max(1));
        if !result.steadiness.is_settled() && with_another <= longest {
            self.stage = ExperimentStage::Settle;
            return Outcome::Running;
        }
        self.index += 1;
        if self.index == self.plan.sine.points.len() {
            self.end_driving();
            Outcome::Finished(result)
        } else {
            self.begin_point();
            Outcome::Point(result)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::base_loop::ClosedLoop;
    use crate::control::phase_lock::PhaseLock;
    use crate::control::stepped_sine::{DriveMode, Points, SteppedSine};
    use crate::io::{DriveScale, Readings};
    use crate::measure::steadiness::SteadyLimits;

    #[test]
    fn the_stored_wave_of_the_drive_is_older_by_the_delay_of_a_reading() {
        let plan = SteppedSinePlan::new(SteppedSine {
            start: Start::CarryOver,
            amplitude_m: 1e-3,
            drive: DriveMode::ClosedLoop(ClosedLoop::default()),
            ramp_s: 0.1,
            settle_s: 1.0,
            dwell_s: 4.0,
            steady: SteadyLimits::default(),
            points: [2.5].into_iter().collect(),
            first_index: 0,
        })
        .unwrap();
        let (mut runner, readings) =
            (SteppedSineRunner::new(&plan, &DriveScale::default().range()), Readings::default());
        for tick in 0..1000 {
            runner.tick(&TickInputs { tick, readings: &readings, impacts: 0, clipped: SensorSet::default() });
            if tick >= DELAY_TICKS {
                // The phase is already that of the next tick.
                let then = Phase(runner.phase.0.wrapping_sub(DELAY_TICKS * runner.increment));
                assert_eq!(runner.waves[0], (then, then.sin_cos()), "tick {tick}");
            }
        }
    }

    #[test]
    fn the_time_that_is_told_is_left_in_settling_and_in_the_dwell() {
        let plan = SteppedSinePlan::new(SteppedSine {
            start: Start::CarryOver,
            amplitude_m: 1e-3,
            drive: DriveMode::Constant,
            ramp_s: 0.1,
            settle_s: 1.0,
            dwell_s: 4.0,
            steady: SteadyLimits::default(),
            points: [2.3].into_iter().collect(),
            first_index: 0,
        })
        .unwrap();
        let mut runner = SteppedSineRunner::new(&plan, &DriveScale::default().range());
        let mut told = heapless::Vec::<_, 8192>::new();
        for tick in 0.. {
            told.push((runner.stage(), runner.progress())).unwrap();
            // The base follows the drive.
            let z = 1e-3 * Phase(runner.phase.0.wrapping_sub(DELAY_TICKS * runner.increment)).sin_cos().0;
            let readings = Readings { z: crate::io::Reading::still(z), ..Readings::default() };
            let (_, outcome) =
                runner.tick(&TickInputs { tick, readings: &readings, impacts: 0, clipped: SensorSet::default() });
            if let Outcome::Finished(_) = outcome {
                break;
            }
        }
        let end = told.len() as f32 / TICK_HZ;
        let dwells_from = told.iter().position(|(stage, _)| *stage == ExperimentStage::Dwell).unwrap();
        for (tick, (stage, progress)) in told.iter().enumerate() {
            let now = tick as f32 / TICK_HZ;
            let is_measuring = *stage == ExperimentStage::Dwell;
            assert_eq!(progress.dwells, u16::from(is_measuring), "{tick}");
            // A tick early or late by the time of the telling; settling is prolonged to the start of a cycle.
            let late = if is_measuring { end - now } else { dwells_from as f32 / TICK_HZ - now } - progress.left_s;
            let most = if is_measuring { 1.5e-3 } else { 1.0 / 2.3 + 1.5e-3 };
            assert!((-1.5e-3..most).contains(&late), "{tick}: {late}");
        }
    }

    /// x lags z by a quarter of a cycle at every frequency, but for two seconds in the first dwell.
    #[test]
    fn a_lost_phase_begins_the_dwell_again() {
        let lock = PhaseLock::new(2.0, 3.0);
        let plan = SteppedSinePlan::new(SteppedSine {
            start: Start::CarryOver,
            amplitude_m: 1e-3,
            drive: DriveMode::Constant,
            ramp_s: 0.1,
            settle_s: 1.0,
            dwell_s: 8.0,
            steady: SteadyLimits::default(),
            points: Points::Resonance { lock, amplitudes: [1e-3].into_iter().collect() },
            first_index: 0,
        })
        .unwrap();
        let mut runner = SteppedSineRunner::new(&plan, &DriveScale::default().range());
        let (mut stages, mut lost_until) = (heapless::Vec::<ExperimentStage, 8>::new(), None);
        for tick in 0..60_000 {
            let is_lost = lost_until.is_some_and(|until| (until - 2000..until).contains(&tick));
            let lag = if is_lost { 0x2aaa_aaab_u32 } else { 0x4000_0000 };
            let then = runner.phase.0.wrapping_sub(DELAY_TICKS * runner.increment);
            let of = |phase: u32| Phase(phase).sin_cos().0;
            let readings = Readings {
                x: crate::io::Reading::still(5e-3 * of(then.wrapping_sub(lag))),
                z: crate::io::Reading::still(1e-3 * of(then)),
                ..Readings::default()
            };
            let now = TickInputs { tick, readings: &readings, impacts: 0, clipped: SensorSet::default() };
            let (_, outcome) = runner.tick(&now);
            if let Outcome::Finished(result) = outcome {
                assert!(lost_until.is_some_and(|until| result.start_tick > until), "{result:?}");
                // The readings are two ticks older than the reference of the result for both.
                assert!((result.phase_rad + core::f32::consts::FRAC_PI_2).abs() < 1e-3, "{result:?}");
                assert_eq!(runner.progress().dwells, 2);
                assert_eq!(
                    stages[..],
                    [ExperimentStage::Settle, ExperimentStage::Dwell, ExperimentStage::Settle, ExperimentStage::Dwell]
                );
                return;
            }
            if stages.last() != Some(&runner.stage()) {
                stages.push(runner.stage()).unwrap();
                if runner.stage() == ExperimentStage::Dwell {
                    lost_until.get_or_insert(tick + 4000);
                }
            }
        }
        panic!("no result: {stages:?}");
    }
}
