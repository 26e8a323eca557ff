//! The stepped sine: one frequency after another, each settled, measured over whole cycles and marked steady
//! or not.
//!
//! A point runs through *rest* (only when it starts from rest), *settle* and *dwell*. The drive is phase-continuous
//! from one frequency to the next when the motion is carried over; from rest it starts at phase zero, so the base
//! leaves its place without a step in displacement. The drive comes and goes on a smooth ramp if one is asked for, and
//! is constant, or whatever [`super::base_loop`] needs for a constant base amplitude.

use crate::control::base_loop::{BaseLoop, ClosedLoop, DELAY_TICKS, RUNAWAY};
use crate::control::limits::{Cause, Fault};
use crate::measure::point::{PointMeter, PointResult, SteadyLimits};
use crate::model::{Invalid, not_negative, positive, require};
use crate::rig::Sensors;
use crate::sine::Phase;
use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most frequencies in one experiment: what the controller's memory holds.
pub const MOST_POINTS: usize = 201;

/// Fewest ticks in a cycle of the drive, so the highest frequency is the tick rate over this.
pub const FEWEST_TICKS_PER_CYCLE: f32 = 20.0;

/// Fewest whole cycles in a dwell: the trend of the cycle maxima needs three in its second half.
pub const FEWEST_CYCLES: f32 = 6.0;

/// Time over which the drive fades out after a stop or a fault, and at least before a rest, s.
pub const FADE_S: f32 = 0.2;

/// How long |x| must stay below the rest level, s.
const REST_HOLD_S: f32 = 0.5;

/// How long the structure may take to come to rest, s: a structure of ζ = 0.0038 needs about 80 s from 50 mm.
const REST_TIMEOUT_S: f32 = 600.0;

/// How a point begins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Start {
    /// The drive stops, and the next point begins once |x| has stayed below this level, m. A virtual rig puts
    /// its plant back to the start.
    FromRest {
        /// |x| below which the structure counts as at rest, m.
        level_m: f32,
    },
    /// The frequency changes while the drive runs on.
    CarryOver,
}

/// What is held at the demanded amplitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub enum Drive {
    /// The drive, as in the source document: a base that feels its load sags near resonance.
    #[default]
    Constant,
    /// The measured base displacement.
    ClosedLoop(ClosedLoop),
}

/// A stepped-sine experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SteppedSine {
    /// How each point begins.
    pub start: Start,
    /// Demanded base amplitude Z, m; greater than 0.
    pub amplitude_m: f32,
    /// What is held at that amplitude.
    pub drive: Drive,
    /// Time over which the drive rises from silence and, between points and at the end, fades, s; 0 (at once) to settle_s.
    pub ramp_s: f32,
    /// Time after a frequency begins before it is measured, s; 0 or more.
    pub settle_s: f32,
    /// Time measured at each frequency, s: its whole cycles are used.
    pub dwell_s: f32,
    /// When a point counts as steady.
    pub steady: SteadyLimits,
    /// Place of the first frequency in the whole experiment: above 0 when an interrupted one is taken up again. Results
    /// and the virtual rig's noise go by the place in the whole, so both are the same as without the interruption.
    pub first_index: u16,
    /// Frequencies in order, Hz.
    pub frequencies_hz: Vec<f32, MOST_POINTS>,
}

impl SteppedSine {
    /// Checks every value against what a tick of `tick_hz` can carry.
    ///
    /// # Errors
    /// Names the first value out of range.
    pub fn validate(&self, tick_hz: f32) -> Result<(), Invalid> {
        positive("amplitude_m", f64::from(self.amplitude_m))?;
        not_negative("settle_s", f64::from(self.settle_s))?;
        positive("dwell_s", f64::from(self.dwell_s))?;
        let longest_s = 1e6 / f64::from(tick_hz) * 1000.0;
        require(f64::from(self.settle_s) <= longest_s, "settle_s", f64::from(self.settle_s), "at most 10⁹ ticks")?;
        require(f64::from(self.dwell_s) <= longest_s, "dwell_s", f64::from(self.dwell_s), "at most 10⁹ ticks")?;
        let ramp_s = f64::from(self.ramp_s);
        not_negative("ramp_s", ramp_s)?;
        require(self.ramp_s <= self.settle_s, "ramp_s", ramp_s, "at most settle_s: nothing is measured on the ramp")?;
        if let Drive::ClosedLoop(parameters) = &self.drive {
            parameters.validate()?;
            require(
                self.amplitude_m < parameters.drive_limit_m,
                "drive.drive_limit_m",
                f64::from(parameters.drive_limit_m),
                "greater than amplitude_m",
            )?;
        }
        if let Start::FromRest { level_m } = self.start {
            positive("rest_level_m", f64::from(level_m))?;
        }
        positive("steady.change_per_cycle", f64::from(self.steady.change_per_cycle))?;
        positive("steady.scatter", f64::from(self.steady.scatter))?;
        require(
            usize::from(self.first_index) + self.frequencies_hz.len() <= usize::from(u16::MAX),
            "first_index",
            f64::from(self.first_index),
            "small enough for 65535 points in all",
        )?;
        require(!self.frequencies_hz.is_empty(), "frequencies_hz", 0.0, "a list with at least one frequency")?;
        for &frequency in &self.frequencies_hz {
            positive("frequencies_hz", f64::from(frequency))?;
            require(
                frequency * FEWEST_TICKS_PER_CYCLE <= tick_hz,
                "frequencies_hz",
                f64::from(frequency),
                "at most a twentieth of the tick rate",
            )?;
            require(
                frequency * self.dwell_s >= FEWEST_CYCLES,
                "dwell_s",
                f64::from(self.dwell_s),
                "long enough for 6 cycles of every frequency",
            )?;
        }
        Ok(())
    }

    /// Ticks that the whole experiment takes when every rest is immediate, as on a virtual rig, and a closed loop never
    /// waits for its base.
    #[must_use]
    pub fn expected_ticks(&self, tick_hz: f32) -> u64 {
        let rest_s = match self.start {
            Start::FromRest { .. } => self.ramp_s.max(FADE_S) + REST_HOLD_S,
            Start::CarryOver => 0.0,
        };
        let point_s = f64::from(rest_s + self.settle_s + self.dwell_s);
        (point_s * f64::from(tick_hz) * self.frequencies_hz.len() as f64) as u64
    }
}

/// Where a point stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Stage {
    /// Waiting for the structure to come to rest.
    Rest,
    /// Driving, not yet measuring.
    Settle,
    /// Driving and measuring.
    Dwell,
}

/// What a tick of the experiment led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It goes on.
    Running,
    /// A point is complete.
    Point(PointResult),
    /// The last point is complete.
    Finished(PointResult),
    /// It cannot go on.
    Failed(Fault),
}

/// A stepped sine in progress.
#[derive(Clone, Debug)]
pub struct Runner {
    plan: SteppedSine,
    tick_hz: f32,
    index: usize,
    stage: Stage,
    ticks_in_stage: u32,
    /// Since the present frequency began.
    driven_ticks: u32,
    quiet_ticks: u32,
    phase: Phase,
    increment: u32,
    /// Place on the ramp, 0 to 1.
    gain: f32,
    fade_s: f32,
    driving: bool,
    /// Used by [`Drive::ClosedLoop`] alone.
    base: BaseLoop,
    meter: PointMeter,
    cycles: u32,
    start_tick: u32,
    put_back: bool,
}

impl Runner {
    /// A validated plan, at the beginning of its first point.
    #[must_use]
    pub fn new(plan: SteppedSine, tick_hz: f32) -> Self {
        let mut runner = Self {
            plan,
            tick_hz,
            index: 0,
            stage: Stage::Rest,
            ticks_in_stage: 0,
            driven_ticks: 0,
            quiet_ticks: 0,
            phase: Phase::default(),
            increment: 0,
            gain: 0.0,
            fade_s: FADE_S,
            driving: false,
            base: BaseLoop::default(),
            meter: PointMeter::default(),
            cycles: 0,
            start_tick: 0,
            put_back: false,
        };
        runner.begin_point();
        runner
    }

    /// The present point's place in the list.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index
    }

    /// Where the present point stands.
    #[must_use]
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// The present drive frequency, Hz; 0 while resting.
    #[must_use]
    pub fn frequency_hz(&self) -> f32 {
        if self.stage == Stage::Rest { 0.0 } else { self.point_frequency_hz() }
    }

    /// The point's place in the whole experiment.
    fn place(&self) -> u16 {
        self.plan.first_index.wrapping_add(self.index as u16)
    }

    /// A simulated plant should be put back to its start in this tick, for the point of this place.
    #[must_use]
    pub fn wants_plant_put_back(&self) -> Option<u16> {
        self.put_back.then(|| self.place())
    }

    /// Lets the drive fade out, whatever comes after.
    pub fn release_drive(&mut self) {
        self.driving = false;
        self.fade_s = FADE_S;
    }

    /// The drive has faded out.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.gain == 0.0 && !self.driving
    }

    fn point_frequency_hz(&self) -> f32 {
        self.plan.frequencies_hz.get(self.index).copied().unwrap_or(0.0)
    }

    fn ticks(&self, seconds: f32) -> u32 {
        (f64::from(seconds) * f64::from(self.tick_hz) + 0.5) as u32
    }

    fn begin_point(&mut self) {
        self.ticks_in_stage = 0;
        match self.plan.start {
            Start::FromRest { .. } => {
                self.stage = Stage::Rest;
                self.end_driving();
                self.quiet_ticks = 0;
            }
            Start::CarryOver => self.begin_settling(),
        }
    }

    fn end_driving(&mut self) {
        self.driving = false;
        self.fade_s = self.plan.ramp_s.max(FADE_S);
    }

    fn begin_settling(&mut self) {
        let frequency = self.point_frequency_hz();
        self.increment = Phase::increment(frequency, self.tick_hz);
        self.cycles = (self.plan.dwell_s * frequency) as u32;
        self.stage = Stage::Settle;
        self.driven_ticks = 0;
        self.driving = true;
        if let Drive::ClosedLoop(parameters) = &self.plan.drive {
            if self.gain == 0.0 {
                self.base = BaseLoop::new(parameters);
            }
            self.base.tune(parameters, frequency, self.tick_hz);
        }
    }

    /// In a dwell of a closed loop: the base has left its tolerance, and there is time to begin anew.
    fn base_slipped(&self) -> bool {
        match &self.plan.drive {
            Drive::Constant => false,
            Drive::ClosedLoop(parameters) => {
                !self.base.is_held() && self.driven_ticks <= self.ticks(self.plan.settle_s + parameters.wait_s)
            }
        }
    }

    /// Settled: measuring may begin at the next cycle.
    fn is_settled(&self) -> bool {
        self.driven_ticks > self.ticks(self.plan.settle_s)
            && match &self.plan.drive {
                Drive::Constant => true,
                Drive::ClosedLoop(parameters) => {
                    self.base.is_held() || self.driven_ticks > self.ticks(self.plan.settle_s + parameters.wait_s)
                }
            }
    }

    fn begin_dwelling(&mut self, tick: u32) {
        self.stage = Stage::Dwell;
        self.start_tick = tick;
        self.meter = PointMeter::new(self.cycles);
        self.base.take_saturated();
    }

    /// The drive for this tick, m, without measuring: for the fade after a stop.
    pub fn fade(&mut self) -> f32 {
        let drive = self.drive_m(None, 0).0;
        self.phase.advance(self.increment);
        drive
    }

    /// The drive at the present phase, m, and a fault of the closed loop. Fades while the drive is released: then, and
    /// without samples, the loop is open.
    fn drive_m(&mut self, sensors: Option<&Sensors>, tick: u32) -> (f32, Option<Fault>) {
        let ramp_s = if self.driving { self.plan.ramp_s } else { self.fade_s };
        let step = if ramp_s > 0.0 { 1.0 / (ramp_s * self.tick_hz) } else { 1.0 };
        self.gain = (self.gain + if self.driving { step } else { -step }).clamp(0.0, 1.0);
        // Without a corner at either end.
        let ramp = self.gain * self.gain * (3.0 - 2.0 * self.gain);
        let now = self.phase.sin_cos();
        let amplitude = self.plan.amplitude_m;
        let (Drive::ClosedLoop(_), Some(sensors), true) = (&self.plan.drive, sensors, self.driving) else {
            let full = match self.plan.drive {
                Drive::Constant => amplitude * now.0,
                Drive::ClosedLoop(_) => self.base.open(now),
            };
            return (ramp * full, None);
        };
        let then = Phase(self.phase.0.wrapping_sub(self.increment.wrapping_mul(DELAY_TICKS)));
        let drive = self.base.tick(ramp * amplitude, sensors.mean_z_m(), then.sin_cos(), now);
        if then.0.checked_add(self.increment).is_none() {
            self.base.end_cycle(amplitude);
            if let Some(value) = self.base.runaway(amplitude) {
                let limit = RUNAWAY * amplitude;
                return (drive, Some(Fault { cause: Cause::BaseRunaway, tick, value, limit }));
            }
        }
        (drive, None)
    }

    /// One tick: this tick's samples in, the demanded base displacement (m) out.
    pub fn tick(&mut self, sensors: &Sensors, tick: u32) -> (f32, Outcome) {
        let mut outcome = Outcome::Running;
        self.put_back = false;
        self.ticks_in_stage += 1;
        self.driven_ticks = self.driven_ticks.saturating_add(1);
        match self.stage {
            Stage::Rest => outcome = self.rest(sensors, tick),
            Stage::Settle | Stage::Dwell => {}
        }
        // A dwell begins at the start of a cycle, and so does a drive from rest.
        if self.stage == Stage::Settle && self.phase.0 < self.increment && self.is_settled() {
            self.begin_dwelling(tick);
        }
        let (drive, fault) = self.drive_m(Some(sensors), tick);
        if let Some(fault) = fault {
            outcome = Outcome::Failed(fault);
        }
        if self.stage == Stage::Dwell {
            self.meter.push(sensors, drive, self.phase.sin_cos());
        }
        if self.phase.advance(self.increment) && self.stage == Stage::Dwell {
            self.meter.end_cycle();
            if self.base_slipped() {
                self.stage = Stage::Settle;
            }
            if self.meter.cycles() == self.cycles && outcome == Outcome::Running {
                outcome = self.end_point(tick + 1);
            }
        }
        (drive, outcome)
    }

    fn rest(&mut self, sensors: &Sensors, tick: u32) -> Outcome {
        if self.gain > 0.0 {
            // The drive is still fading out: resting has not begun.
            self.ticks_in_stage = 0;
            return Outcome::Running;
        }
        let level = match self.plan.start {
            Start::FromRest { level_m } => level_m,
            Start::CarryOver => f32::MAX,
        };
        // The samples of the tick in which a plant is put back are still of the motion before.
        self.put_back = self.ticks_in_stage == 1;
        let quiet = sensors.peak_x_m() < level && !self.put_back;
        self.quiet_ticks = if quiet { self.quiet_ticks + 1 } else { 0 };
        if self.quiet_ticks >= self.ticks(REST_HOLD_S) {
            self.phase = Phase::default();
            self.begin_settling();
            self.driven_ticks = 1;
        } else if self.ticks_in_stage > self.ticks(REST_TIMEOUT_S) {
            let value = sensors.peak_x_m();
            return Outcome::Failed(Fault { cause: Cause::RestTimeout, tick, value, limit: level });
        }
        Outcome::Running
    }

    fn end_point(&mut self, end_tick: u32) -> Outcome {
        let mut result =
            self.meter.result(self.place(), self.point_frequency_hz(), self.start_tick, end_tick, &self.plan.steady);
        result.drive_saturated = self.base.take_saturated();
        self.index += 1;
        if self.index < self.plan.frequencies_hz.len() {
            self.begin_point();
            Outcome::Point(result)
        } else {
            self.end_driving();
            Outcome::Finished(result)
        }
    }
}
