//! Free vibration: waits until the structure is held beyond a level and released, then measures its decay.
//!
//! A person deflects the structure and lets go. There is no drive; the closed relay with a drive of zero holds the
//! base. The structure counts as held when |x| is beyond the level and steady to a few hundredths for long enough. The
//! release is the fall of |x| below nine tenths of x0. x0 is the mean over half the hold time, taken at least that long
//! before the fall: 0.25 s of the usual 0.5 s, in which a structure of 0.3 Hz or faster falls that far. On a virtual
//! rig the plant is held at its start by a reset in every tick, and is then released.
//!
//! The host computes the decay's logarithmic decrement and loss from x0, the peak after whole cycles and their
//! duration. The core has no logarithm.

use super::{LONGEST_S, MIN, Measuring, ParameterLimit, ticks, within};
use crate::control::fault::{Fault, FaultCause};
use crate::control::outcome::{ExperimentStage, Outcome, TickInputs};
use crate::io::{Invalid, TICK_HZ, require};
use crate::measure::transient::Decay;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A free vibration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct FreeVibration {
    /// |x| beyond which the structure counts as held, m.
    pub level_m: f32,
    /// Time for which it must be held, s.
    pub hold_s: f32,
    /// Longest time until the release, s.
    pub timeout_s: f32,
    /// Time measured after the release, s.
    pub measure_s: f32,
    /// Cycles over which the decay is measured.
    pub cycles: u16,
    /// Index in the whole experiment; it determines the virtual rig's noise and marks the result.
    pub index: u16,
}

/// A time must be at least one tick.
const TICK_S: f32 = 1.0 / TICK_HZ;
const A_TICK_OR_MORE: &str = "a tick or more, at most 10⁹";

const LIMITS: [ParameterLimit; 5] = [
    ("level_m", MIN, f32::MAX, "greater than 0"),
    ("hold_s", TICK_S, LONGEST_S, A_TICK_OR_MORE),
    ("measure_s", TICK_S, LONGEST_S, A_TICK_OR_MORE),
    ("timeout_s", TICK_S, LONGEST_S, A_TICK_OR_MORE),
    ("cycles", 1.0, f32::MAX, "1 or more"),
];

impl FreeVibration {
    /// Checks every value.
    ///
    /// # Errors
    /// Names the first value out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        let values = [self.level_m, self.hold_s, self.measure_s, self.timeout_s, f32::from(self.cycles)];
        within(&LIMITS, &values)?;
        let soonest_s = self.hold_s + 2.0 * VIRTUAL_HOLD_S;
        require(self.timeout_s >= soonest_s, "timeout_s", f64::from(self.timeout_s), "hold_s and a second, or more")
    }

    /// Number of ticks that it takes on a virtual rig.
    #[must_use]
    pub fn expected_ticks(&self) -> u64 {
        u64::from(ticks(self.hold_s + VIRTUAL_HOLD_S)) + u64::from(ticks(self.measure_s))
    }
}

/// A virtual rig's structure is held for the required hold time plus this time, s.
const VIRTUAL_HOLD_S: f32 = 0.5;

/// While held, |x| stays within this share of its latest mean.
const STEADY: f32 = 0.03;

/// The release is a fall of |x| to this share of x0.
const RELEASED: f32 = 0.9;

/// A half-cycle counts when |x| has been beyond this share of x0 in it, so that noise about zero does not count.
const MIN_SWING: f32 = 0.01;

/// A checked free vibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeVibrationPlan {
    free: FreeVibration,
    hold_ticks: u32,
    put_back_ticks: u32,
    timeout_ticks: u32,
    measure_ticks: u32,
}

impl FreeVibrationPlan {
    /// Checks a free vibration.
    ///
    /// # Errors
    /// Names the first value out of range.
    pub fn new(free: FreeVibration) -> Result<Self, Invalid> {
        free.validate()?;
        Ok(Self {
            hold_ticks: ticks(free.hold_s),
            put_back_ticks: ticks(free.hold_s + VIRTUAL_HOLD_S),
            timeout_ticks: ticks(free.timeout_s),
            measure_ticks: ticks(free.measure_s),
            free,
        })
    }
}

/// Half-cycles of x about zero since the release.
#[derive(Clone, Copy, Debug, Default)]
struct Swings {
    start_m: f32,
    /// Side of zero of the present half-cycle, and the largest x on that side.
    positive: bool,
    peak_m: f32,
    half_cycles: u16,
    last_m: f32,
    /// Ticks from the release to the latest crossing of zero, and to the first that ended a half-cycle.
    crossing: f32,
    first_crossing: f32,
    decay: Decay,
}

impl Swings {
    fn from(x_m: f32, start_m: f32) -> Self {
        let decay = Decay { start_m, ..Decay::default() };
        Self { start_m, positive: x_m > 0.0, last_m: x_m, decay, ..Self::default() }
    }

    /// Takes the mean of a tick, `after` ticks after the release. The decay is measured over at most `cycles` cycles.
    fn push(&mut self, x_m: f32, after: u32, cycles: u16) {
        if (x_m > 0.0) != (self.last_m > 0.0) {
            self.crossing = after as f32 - x_m / (x_m - self.last_m);
        }
        self.last_m = x_m;
        let along = if self.positive { x_m } else { -x_m };
        self.peak_m = self.peak_m.max(along);
        if along > -MIN_SWING * self.start_m {
            return;
        }
        // x is beyond zero on the other side: a half-cycle ended at the latest crossing.
        let done = self.half_cycles;
        self.half_cycles = done.saturating_add(1);
        self.positive = !self.positive;
        let peak = core::mem::replace(&mut self.peak_m, -along);
        if done == 0 {
            self.first_crossing = self.crossing;
        } else if done.is_multiple_of(2) && done / 2 <= cycles {
            let span_s = (self.crossing - self.first_crossing) * (1.0 / TICK_HZ);
            self.decay = Decay { start_m: self.start_m, end_m: peak, cycles: done / 2, span_s };
        }
    }
}

/// The held structure: means over stretches of half the hold time.
#[derive(Clone, Copy, Debug, Default)]
struct Hold {
    ticks: u32,
    strayed_ticks: u32,
    sum_m: f32,
    count: u32,
    latest_m: f32,
    before_m: f32,
}

impl Hold {
    /// Takes one tick at `x_m`. A stretch has `stretch` ticks.
    fn take(&mut self, x_m: f32, stretch: u32) {
        if self.ticks == 0 {
            (self.latest_m, self.before_m) = (x_m, x_m);
        }
        self.ticks = self.ticks.saturating_add(1);
        self.strayed_ticks = 0;
        self.sum_m += x_m;
        self.count += 1;
        if self.count >= stretch {
            self.before_m = self.latest_m;
            self.latest_m = self.sum_m / self.count as f32;
            (self.sum_m, self.count) = (0.0, 0);
        }
    }
}

/// A free vibration in progress, with its plan.
#[derive(Clone, Debug)]
pub struct FreeVibrationRunner {
    plan: FreeVibrationPlan,
    stage: ExperimentStage,
    waited_ticks: u32,
    hold: Hold,
    put_back: Option<u16>,
    swings: Swings,
    measuring: Measuring,
}

impl FreeVibrationRunner {
    /// A runner at the beginning of the hold.
    #[must_use]
    pub fn new(plan: &FreeVibrationPlan) -> Self {
        Self {
            plan: *plan,
            stage: ExperimentStage::Hold,
            waited_ticks: 0,
            hold: Hold::default(),
            put_back: None,
            swings: Swings::default(),
            measuring: Measuring::default(),
        }
    }

    /// The present stage.
    #[must_use]
    pub fn stage(&self) -> ExperimentStage {
        self.stage
    }

    /// Index of the point that begins from rest in this tick. A simulated plant is reset to its start.
    #[must_use]
    pub fn begins_from_rest(&self) -> Option<u16> {
        self.put_back
    }

    /// Takes one tick's readings and returns the outcome of the tick. There is no drive.
    pub fn tick(&mut self, now: &TickInputs) -> Outcome {
        self.put_back = None;
        let x = now.readings.x.mean_m;
        if self.stage == ExperimentStage::Hold {
            self.waited_ticks += 1;
            if self.waited_ticks <= self.plan.put_back_ticks {
                self.put_back = Some(self.plan.free.index);
            }
            if self.is_released(libm::fabsf(x)) {
                self.stage = ExperimentStage::Dwell;
                self.measuring = Measuring::from(now);
                self.swings = Swings::from(x, self.hold.before_m);
            } else if self.waited_ticks > self.plan.timeout_ticks {
                let (value, limit) = (self.hold.latest_m, self.plan.free.level_m);
                return Outcome::Failed(Fault { cause: FaultCause::ReleaseTimeout, tick: now.tick, value, limit });
            }
        } else if self.measuring.meter.ticks() < self.plan.measure_ticks {
            self.measuring.push(now, 0.0);
            self.swings.push(x, self.measuring.meter.ticks(), self.plan.free.cycles);
            if self.measuring.meter.ticks() == self.plan.measure_ticks {
                return self.measuring.end(now, self.plan.free.index, false, &self.swings.decay);
            }
        }
        Outcome::Running
    }

    /// Takes |x| (m) of a tick and returns true if the structure has been released.
    fn is_released(&mut self, x_m: f32) -> bool {
        let hold = &mut self.hold;
        let is_known = hold.ticks >= self.plan.hold_ticks;
        if is_known && x_m < RELEASED * hold.before_m {
            return true;
        }
        let about = if hold.ticks > 0 { hold.latest_m } else { x_m };
        if x_m >= self.plan.free.level_m && libm::fabsf(x_m - about) <= STEADY * about {
            hold.take(x_m, self.plan.hold_ticks / 2);
        } else {
            // The structure was moved a little while held. If that is not a release, the hold starts again.
            hold.strayed_ticks += 1;
            if !is_known || hold.strayed_ticks > self.plan.hold_ticks {
                *hold = Hold::default();
            }
        }
        false
    }
}
