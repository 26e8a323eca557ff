//! Stepped sine: one frequency after another, each settled, measured over whole cycles and marked as steady or not.
//!
//! A point has the stages *rest* (only when it starts from rest), *settle* and *dwell*. When the motion is carried
//! over, the drive is phase-continuous from one frequency to the next. From rest it starts at phase zero, so the base
//! starts without a step in displacement. The drive rises and falls on a smooth ramp if one is requested. Its amplitude
//! is constant, or is set by [`super::base_loop`] to keep the base amplitude constant, or by [`super::response_loop`]
//! to keep the structure's amplitude constant. The points are frequencies, or amplitudes at the resonance, whose
//! frequency [`super::phase_lock`] finds.
//!
//! [`SteppedSine`] is the host's request and [`SteppedSinePlan`] the checked plan. A plan is made outside the control
//! tick, which has no time to check a hundred frequencies. The [`SteppedSineRunner`] runs it.

mod drive;
mod regulator;
mod runner;

use crate::control::base_loop::ClosedLoop;
use crate::control::phase_lock::PhaseLock;
use crate::control::response_loop::ResponseLoop;
use crate::control::rest::REST_HOLD_S;
use crate::io::{Invalid, TICK_HZ, not_negative, positive, require};
use crate::measure::steadiness::SteadyLimits;
use heapless::Vec;
use postcard_schema::Schema;
pub use runner::SteppedSineRunner;
use serde::{Deserialize, Serialize};

/// Most points in one experiment, enough for 2 to 3 Hz in steps of 0.01 Hz. Each costs the controller 4 bytes in
/// several places.
pub const MAX_POINTS: usize = 400;

/// Fewest ticks in a cycle of the drive. The highest frequency is the tick rate divided by this.
pub const MIN_TICKS_PER_CYCLE: f32 = 20.0;

/// Fewest whole cycles in a dwell: the trend of the cycle maxima needs three in the second half of the dwell.
pub const MIN_CYCLES: f32 = 6.0;

/// Time of the drive's fade-out after a stop or a fault, and its least fade-out time before a rest, s.
pub const FADE_S: f32 = 0.2;

/// How a point begins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Start {
    /// The drive stops, and the next point begins once |x| has stayed below this level, m. A virtual rig resets its
    /// plant to the start.
    FromRest {
        /// |x| below which the structure counts as at rest, m.
        level_m: f32,
    },
    /// The frequency changes while the drive continues.
    CarryOver,
}

/// The quantity that is kept at the demanded amplitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub enum DriveMode {
    /// The drive, as in the source document. A base that is loaded by the structure sags near resonance.
    #[default]
    Constant,
    /// The measured base displacement.
    ClosedLoop(ClosedLoop),
    /// The response of the structure: Z is the result.
    Response(ResponseLoop),
}

/// A stepped-sine experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SteppedSine {
    /// How each point begins.
    pub start: Start,
    /// Demanded base amplitude Z, m; greater than 0. Where the points have amplitudes of their own or the response is kept: the Z for
    /// which the set-up is stated, the scale of the check that the base follows.
    pub amplitude_m: f32,
    /// The quantity that is kept at that amplitude.
    pub drive: DriveMode,
    /// Time over which the drive rises from zero and, between points and at the end, fades, s; from 0 (at once) to
    /// settle_s.
    pub ramp_s: f32,
    /// Time from the start of a frequency to its measurement, s; 0 or more.
    pub settle_s: f32,
    /// Time of the measurement at each frequency, s. The whole cycles in it are used.
    pub dwell_s: f32,
    /// When a point counts as steady, and how long the measurement may wait for that.
    pub steady: SteadyLimits,
    /// Index of the first frequency in the whole experiment: above 0 when an interrupted experiment is resumed. Results
    /// and the virtual rig's noise depend on the index in the whole experiment, so both are the same as without the
    /// interruption.
    pub first_index: u16,
    /// Its points in their order.
    pub points: Points,
}

/// What the points of an experiment differ in. Collects frequencies, Hz.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Points {
    /// Frequencies, Hz.
    Frequencies(Vec<f32, MAX_POINTS>),
    /// Amplitudes at the frequency that the phase of x asks for.
    Resonance {
        /// The loop that finds the frequency.
        lock: PhaseLock,
        /// Amplitudes of the base, m, or of the response that is kept, in its unit.
        amplitudes: Vec<f32, MAX_POINTS>,
    },
}

impl Points {
    /// How many.
    #[must_use]
    pub fn len(&self) -> usize {
        self.list().len()
    }

    /// There are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list().is_empty()
    }

    fn list(&self) -> &[f32] {
        match self {
            Self::Frequencies(list) | Self::Resonance { amplitudes: list, .. } => list,
        }
    }

    /// The loop that finds the frequency.
    #[must_use]
    pub fn lock(&self) -> Option<&PhaseLock> {
        if let Self::Resonance { lock, .. } = self { Some(lock) } else { None }
    }

    /// The frequency at which a point starts, Hz, unless the resonance of the point before is known.
    fn frequency_hz(&self, index: usize) -> f32 {
        match self {
            Self::Frequencies(list) => list.get(index).copied().unwrap_or(0.0),
            Self::Resonance { lock, .. } => lock.start_hz,
        }
    }

    /// A point's own amplitude.
    fn amplitude(&self, index: usize) -> Option<f32> {
        if let Self::Resonance { amplitudes, .. } = self { amplitudes.get(index).copied() } else { None }
    }

    /// Lowest and highest frequency, Hz.
    fn range_hz(&self) -> (f32, f32) {
        match self {
            Self::Frequencies(list) => {
                list.iter().fold((f32::INFINITY, 0.0), |(low, high), f| (f.min(low), f.max(high)))
            }
            Self::Resonance { lock, .. } => (lock.low_hz, lock.high_hz),
        }
    }
}

impl FromIterator<f32> for Points {
    fn from_iter<I: IntoIterator<Item = f32>>(frequencies_hz: I) -> Self {
        Self::Frequencies(frequencies_hz.into_iter().collect())
    }
}

impl SteppedSine {
    /// Checks every value against the tick rate `tick_hz`.
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
        match &self.drive {
            DriveMode::Constant => {}
            DriveMode::ClosedLoop(parameters) => {
                parameters.validate()?;
                let limit = f64::from(parameters.drive_limit_m);
                let is_above = self.largest_amplitude_m() < parameters.drive_limit_m;
                require(is_above, "drive.drive_limit_m", limit, "greater than amplitude_m")?;
            }
            DriveMode::Response(parameters) => parameters.validate()?,
        }
        if let Start::FromRest { level_m } = self.start {
            positive("rest_level_m", f64::from(level_m))?;
        }
        positive("steady.tolerance", f64::from(self.steady.tolerance))?;
        positive("steady.scatter", f64::from(self.steady.scatter))?;
        let longest = f64::from(self.steady.longest_dwell_s);
        let allowed = "0, or from dwell_s to 10⁹ ticks";
        let is_allowed = longest == 0.0 || (longest >= f64::from(self.dwell_s) && longest <= longest_s);
        require(is_allowed, "steady.longest_dwell_s", longest, allowed)?;
        require(
            usize::from(self.first_index) + self.points.len() <= usize::from(u16::MAX),
            "first_index",
            f64::from(self.first_index),
            "small enough for 65535 points in all",
        )?;
        self.validate_points(tick_hz)
    }

    fn validate_points(&self, tick_hz: f32) -> Result<(), Invalid> {
        let name = match &self.points {
            Points::Frequencies(_) => "frequencies_hz",
            Points::Resonance { lock, .. } => {
                lock.validate()?;
                "amplitudes"
            }
        };
        require(!self.points.is_empty(), name, 0.0, "a list with at least one value")?;
        for &value in self.points.list() {
            positive(name, f64::from(value))?;
        }
        let highest = self.points.lock().map_or("frequencies_hz", |_| "lock.high_hz");
        let (low_hz, high_hz) = self.points.range_hz();
        let is_slow = high_hz * MIN_TICKS_PER_CYCLE <= tick_hz;
        require(is_slow, highest, f64::from(high_hz), "at most a twentieth of the tick rate")?;
        let is_long = low_hz * self.dwell_s >= MIN_CYCLES;
        require(is_long, "dwell_s", f64::from(self.dwell_s), "long enough for 6 cycles of every frequency")
    }

    /// The largest amplitude of the base that is demanded without a loop, m.
    #[must_use]
    pub fn largest_amplitude_m(&self) -> f32 {
        match &self.points {
            Points::Frequencies(_) => self.amplitude_m,
            Points::Resonance { amplitudes, .. } => amplitudes.iter().copied().fold(0.0, f32::max),
        }
    }

    /// Number of ticks that the whole experiment takes when every rest is immediate, as on a virtual rig, and a closed
    /// loop never waits for its base.
    #[must_use]
    pub fn expected_ticks(&self, tick_hz: f32) -> u64 {
        let rest_s = match self.start {
            Start::FromRest { .. } => self.ramp_s.max(FADE_S) + REST_HOLD_S,
            Start::CarryOver => 0.0,
        };
        let point_s = f64::from(rest_s + self.settle_s + self.dwell_s);
        (point_s * f64::from(tick_hz) * self.points.len() as f64) as u64
    }
}

/// A checked experiment with its times in ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct SteppedSinePlan {
    sine: SteppedSine,
    settle_ticks: u32,
    /// Settling time plus the longest wait for the loops.
    held_by_ticks: u32,
    /// Longest time of all dwells of a point.
    longest_dwell_ticks: u32,
    /// Changes of the ramp's position per tick while driving, and while fading.
    rise: f32,
    fall: f32,
}

impl SteppedSinePlan {
    /// Checks an experiment against the rig's tick rate.
    ///
    /// # Errors
    /// Names the first value out of range.
    pub fn new(sine: SteppedSine) -> Result<Self, Invalid> {
        sine.validate(TICK_HZ)?;
        let ticks = |seconds: f32| (f64::from(seconds) * f64::from(TICK_HZ) + 0.5) as u32;
        let per_tick = |seconds: f32| if seconds > 0.0 { 1.0 / (seconds * TICK_HZ) } else { 1.0 };
        let wait_s: f32 = match &sine.drive {
            DriveMode::Constant => 0.0,
            DriveMode::ClosedLoop(parameters) => parameters.wait_s,
            DriveMode::Response(parameters) => parameters.wait_s,
        };
        let wait_s = wait_s.max(sine.points.lock().map_or(0.0, |lock| lock.wait_s));
        Ok(Self {
            settle_ticks: ticks(sine.settle_s),
            held_by_ticks: ticks(sine.settle_s + wait_s),
            longest_dwell_ticks: ticks(sine.steady.longest_dwell_s),
            rise: per_tick(sine.ramp_s),
            fall: per_tick(sine.ramp_s.max(FADE_S)),
            sine,
        })
    }

    /// The parameters of the experiment.
    #[must_use]
    pub fn sine(&self) -> &SteppedSine {
        &self.sine
    }
}
