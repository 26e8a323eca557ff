//! The stages of a checked stepped sine, point by point.

use super::drive::Drive;
use super::{Start, SteppedSinePlan};
use crate::control::fault::{Fault, FaultCause};
use crate::control::outcome::{ExperimentStage, Outcome, StageProgress, TickInputs};
use crate::control::rest::{RestWait, Waited};
use crate::io::{DriveRange, SensorSet, TICK_HZ};
use crate::measure::point::{Place, PointMeter};
use crate::measure::running::DriveReference;

/// A stepped sine in progress, with its plan.
#[derive(Clone, Debug)]
pub struct SteppedSineRunner {
    plan: SteppedSinePlan,
    drive: Drive,
    index: usize,
    stage: ExperimentStage,
    rest: RestWait,
    /// Ticks since the present point began to settle.
    driven_ticks: u32,
    /// The present point goes on until a person releases it.
    held: bool,
    /// The drive was at its limit, and these sensors were clipped, since the dwell began.
    was_saturated: bool,
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
            drive: Drive::new(plan, drive),
            index: 0,
            stage: ExperimentStage::Rest,
            rest: RestWait::default(),
            driven_ticks: 0,
            held: false,
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
                let cycles = self.cycles.saturating_sub(self.meter.cycles()) as f32 - self.drive.share_of_cycle();
                cycles.max(0.0) / self.drive.frequency_hz()
            }
            ExperimentStage::Rest | ExperimentStage::Hold => 0.0,
        };
        StageProgress { left_s, dwells: self.dwells }
    }

    /// The present drive frequency, Hz; 0 while resting.
    #[must_use]
    pub fn frequency_hz(&self) -> f32 {
        if self.stage == ExperimentStage::Rest { 0.0 } else { self.drive.frequency_hz() }
    }

    /// The drive's reference in the last tick; `None` while resting.
    #[must_use]
    pub fn reference(&self) -> Option<DriveReference> {
        let reference = DriveReference { wave: self.drive.last_wave(), cycle_ended: self.cycle_ended };
        (self.stage != ExperimentStage::Rest).then_some(reference)
    }

    /// A cycle of the drive ended in the last tick.
    #[must_use]
    pub fn cycle_ended(&self) -> bool {
        self.cycle_ended
    }

    /// The drive is strong enough for the base to move visibly: it is on, and more than half up its ramp.
    #[must_use]
    pub fn is_swinging(&self) -> bool {
        self.drive.is_swinging()
    }

    /// The drive is on.
    #[must_use]
    pub fn is_driving(&self) -> bool {
        self.drive.is_on()
    }

    /// The drive was at its limit in the last tick.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.drive.is_saturated()
    }

    /// Base amplitude that the response's loop demands now, m; `None` of other drives.
    #[must_use]
    pub fn demanded_m(&self) -> Option<f32> {
        self.drive.regulator.demanded_m()
    }

    /// Base amplitude that the response's loop demands next, m; 0 of other drives.
    #[must_use]
    pub fn base_foreseen_m(&self) -> f32 {
        self.drive.regulator.base_foreseen_m()
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
        self.drive.release();
    }

    /// The drive has faded out.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.drive.is_silent()
    }

    fn begin_point(&mut self) {
        match self.plan.sine.start {
            Start::FromRest { .. } => {
                self.stage = ExperimentStage::Rest;
                self.drive.end(self.plan.fall);
                self.rest = RestWait::default();
            }
            Start::CarryOver => self.begin_settling(),
        }
    }

    fn begin_settling(&mut self) {
        self.drive.begin_point(&self.plan.sine, self.index);
        self.stage = ExperimentStage::Settle;
        self.driven_ticks = 0;
        (self.first_dwell, self.dwells) = (None, 0);
    }

    /// Whether, in a dwell, an amplitude or the phase has left its tolerance and there is time to restart the dwell.
    fn has_slipped(&self) -> bool {
        !self.drive.is_kept() && self.driven_ticks <= self.plan.held_by_ticks
    }

    /// The point has settled: the measurement may begin at the next cycle.
    fn is_settled(&self) -> bool {
        !self.held
            && self.driven_ticks > self.plan.settle_ticks
            && (self.drive.is_locked() || self.driven_ticks > self.plan.held_by_ticks)
    }

    fn begin_dwelling(&mut self, now: &TickInputs) {
        self.stage = ExperimentStage::Dwell;
        self.cycles = (self.plan.sine.dwell_s * self.drive.frequency_hz()) as u32;
        self.start_tick = now.tick;
        self.impacts_before = now.impacts;
        self.first_dwell.get_or_insert(now.tick);
        self.dwells = self.dwells.saturating_add(1);
        self.meter = PointMeter::new(self.cycles, self.drive.over());
        (self.was_saturated, self.clipped) = (false, SensorSet::default());
    }

    /// The drive for this tick, m, without measuring. Used for the fade after a stop.
    pub fn fade(&mut self) -> f32 {
        let (drive, _) = self.drive.tick(&self.plan, None);
        self.cycle_ended = self.drive.advance();
        drive
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
        if self.stage == ExperimentStage::Settle && self.drive.begins_cycle() && self.is_settled() {
            self.begin_dwelling(now);
        }
        let (drive, runaway) = self.drive.tick(&self.plan, Some(now));
        self.was_saturated |= self.drive.is_saturated();
        let fault = runaway.or(unrest);
        // After the last point only the fade-out of the drive continues.
        let measuring = self.stage == ExperimentStage::Dwell && self.index < self.plan.sine.points.len();
        if measuring {
            self.meter.push(now.readings, drive, self.drive.last_wave());
            self.clipped.extend(now.clipped);
        }
        self.cycle_ended = self.drive.advance();
        if self.cycle_ended && measuring {
            self.meter.end_cycle(self.drive.over());
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
        if !self.drive.is_silent() {
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
                self.drive.restart();
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
            frequency_hz: if self.drive.is_tracking() { self.meter.frequency_hz() } else { self.drive.frequency_hz() },
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
        let longest = self.plan.longest_dwell_ticks.saturating_add(self.drive.cycle_ticks());
        if !result.steadiness.is_settled() && with_another <= longest {
            self.stage = ExperimentStage::Settle;
            return Outcome::Running;
        }
        self.index += 1;
        if self.index == self.plan.sine.points.len() {
            self.drive.end(self.plan.fall);
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
    use crate::control::base_loop::{ClosedLoop, DELAY_TICKS};
    use crate::control::phase_lock::PhaseLock;
    use crate::control::stepped_sine::{DriveMode, Points, SteppedSine};
    use crate::io::{DriveScale, Readings};
    use crate::measure::steadiness::SteadyLimits;
    use crate::sine::Phase;

    fn plan(drive: DriveMode, points: Points, dwell_s: f32) -> SteppedSinePlan {
        SteppedSinePlan::new(SteppedSine {
            start: Start::CarryOver,
            amplitude_m: 1e-3,
            drive,
            ramp_s: 0.1,
            settle_s: 1.0,
            dwell_s,
            steady: SteadyLimits::default(),
            points,
            first_index: 0,
        })
        .unwrap()
    }

    #[test]
    fn the_stored_wave_of_the_drive_is_older_by_the_delay_of_a_reading() {
        let plan = plan(DriveMode::ClosedLoop(ClosedLoop::default()), [2.5].into_iter().collect(), 4.0);
        let (mut runner, readings) =
            (SteppedSineRunner::new(&plan, &DriveScale::default().range()), Readings::default());
        for tick in 0..1000 {
            runner.tick(&TickInputs { tick, readings: &readings, impacts: 0, clipped: SensorSet::default() });
            if tick >= DELAY_TICKS {
                // The phase is already that of the next tick.
                let then = runner.drive.phase_of_reading();
                assert_eq!(runner.drive.oldest_wave(), (then, then.sin_cos()), "tick {tick}");
            }
        }
    }

    #[test]
    fn the_time_that_is_told_is_left_in_settling_and_in_the_dwell() {
        let plan = plan(DriveMode::Constant, [2.3].into_iter().collect(), 4.0);
        let mut runner = SteppedSineRunner::new(&plan, &DriveScale::default().range());
        let mut told = heapless::Vec::<_, 8192>::new();
        for tick in 0.. {
            told.push((runner.stage(), runner.progress())).unwrap();
            // The base follows the drive.
            let z = 1e-3 * runner.drive.phase_of_reading().sin_cos().0;
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
        let plan = plan(DriveMode::Constant, Points::Resonance { lock, amplitudes: [1e-3].into_iter().collect() }, 8.0);
        let mut runner = SteppedSineRunner::new(&plan, &DriveScale::default().range());
        let (mut stages, mut lost_until) = (heapless::Vec::<ExperimentStage, 8>::new(), None);
        for tick in 0..60_000 {
            let is_lost = lost_until.is_some_and(|until| (until - 2000..until).contains(&tick));
            let lag = if is_lost { 0x2aaa_aaab_u32 } else { 0x4000_0000 };
            let then = runner.drive.phase_of_reading().0;
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
