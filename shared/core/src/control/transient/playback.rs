//! Playback of an uploaded record as base displacement.
//!
//! The caller passes the record to every tick: counts of [`Playback::scale_m`] at the record's own sample rate. Between
//! the samples the demand is a cubic with continuous velocity (Catmull–Rom, as in [`crate::integrator::base`]). A sine
//! of angular frequency Ω sampled every h is reproduced to (Ωh)³/50 of its amplitude, and the counts round to half a
//! count. The record is zero before its first sample and after its last. Playing begins two samples early and ends two
//! samples late, so the demand starts and ends at rest for every record. [`Playback::ramp_s`] makes the ends of a
//! record gentler. A record whose samples exceed what the drive delivers is rejected. A demand that exceeds it between
//! two samples is cut, which counts as saturation.
//!
//! `damprig-device` receives the record; the host makes it from a shape or a file.

use super::{LONGEST_S, MIN, Measuring, ParameterLimit, ticks, within};
use crate::control::fault::{Fault, FaultCause};
use crate::control::outcome::{ExperimentStage, Outcome, TickInputs};
use crate::control::rest::{RestWait, Waited};
use crate::control::stepped_sine::FADE_S;
use crate::io::{DriveRange, Invalid, TICK_HZ, require};
use crate::measure::transient::Decay;
use crate::sine::Phase;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most samples of a record: the controller's buffer of 40 KiB holds this many.
pub const MAX_SAMPLES: usize = 20_480;

/// Identifies a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RecordId {
    /// Length of the record, samples.
    pub samples: u16,
    /// CRC-32 (ISO-HDLC) of its samples, each in two bytes, little endian.
    pub crc32: u32,
}

/// The playback of a record.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Playback {
    /// The record; it must be completely loaded when the experiment starts.
    pub record: RecordId,
    /// Sample rate of the record, Hz; at most the tick rate.
    pub sample_rate_hz: f32,
    /// Displacement of one count, m; greater than 0.
    pub scale_m: f32,
    /// Time over which the drive rises at the beginning and falls at the end, s; 0 for a record with gentle ends.
    pub ramp_s: f32,
    /// Time measured after the record's end, s.
    pub tail_s: f32,
    /// |x| below which the structure counts as at rest before the record begins, m.
    pub rest_level_m: f32,
    /// Index in the whole experiment; it determines the virtual rig's noise and marks the result.
    pub index: u16,
}

const LIMITS: [ParameterLimit; 5] = [
    ("sample_rate_hz", 0.1, TICK_HZ, "from 0.1 Hz to the tick rate of 1000 Hz"),
    ("scale_m", MIN, f32::MAX, "greater than 0"),
    ("rest_level_m", MIN, f32::MAX, "greater than 0"),
    ("ramp_s", 0.0, LONGEST_S, "0 or greater, at most half the record"),
    ("tail_s", 0.0, LONGEST_S, "from 0 to 10⁹ ticks"),
];

impl Playback {
    /// Checks every value.
    ///
    /// # Errors
    /// Names the first value out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        let samples = usize::from(self.record.samples);
        require(
            (2..=MAX_SAMPLES).contains(&samples),
            "record.samples",
            f64::from(self.record.samples),
            "from 2 to 20480: the controller's record buffer holds 40 KiB",
        )?;
        let rate = self.sample_rate_hz;
        let values = [rate, self.scale_m, self.rest_level_m, self.ramp_s, self.tail_s];
        within(&LIMITS, &values)?;
        let longest_s = 0.5 * f32::from(self.record.samples) / rate;
        require(self.ramp_s <= longest_s, "ramp_s", f64::from(self.ramp_s), "at most half the record")
    }

    /// Number of ticks that it takes when the structure is at rest at once, as on a virtual rig.
    #[must_use]
    pub fn expected_ticks(&self) -> u64 {
        let play_s = (f32::from(self.record.samples) + 3.0) / self.sample_rate_hz;
        u64::from(ticks(play_s)) + u64::from(ticks(self.tail_s + crate::control::rest::REST_HOLD_S))
    }
}

/// A checked playback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaybackPlan {
    playback: Playback,
    /// Samples per tick, in units of 2⁻³².
    increment: u32,
    /// Change of the ramp's position per tick.
    ramp: f32,
    /// Tick of playing at which the ramp starts to fall.
    falls_from: u32,
    tail_ticks: u32,
}

/// Spline nodes beyond either end of the record. From the second node on the demand is at rest.
const MARGIN: u32 = 2;

impl PlaybackPlan {
    /// Checks a playback.
    ///
    /// # Errors
    /// Names the first value out of range.
    pub fn new(playback: Playback) -> Result<Self, Invalid> {
        playback.validate()?;
        let per_tick = TICK_HZ / playback.sample_rate_hz;
        // At the tick rate the increment saturates at 2⁻³² below a whole sample.
        let increment = Phase::increment(playback.sample_rate_hz, TICK_HZ);
        let intervals = f32::from(playback.record.samples) + (2 * MARGIN - 1) as f32;
        let ramp_ticks = ticks(playback.ramp_s);
        Ok(Self {
            increment,
            ramp: if ramp_ticks > 0 { 1.0 / ramp_ticks as f32 } else { 1.0 },
            falls_from: ((intervals * per_tick) as u32).saturating_sub(ramp_ticks),
            tail_ticks: ticks(playback.tail_s),
            playback,
        })
    }

    /// The parameters of the playback.
    #[must_use]
    pub fn playback(&self) -> &Playback {
        &self.playback
    }
}

/// The base moves visibly while the demand changes by more than this per tick, m: 0.8 mm/s, that is 20 steps of a laser
/// of 10 µm in the quarter of a second below. In slower parts of a record the frozen-sensor check is suspended.
const VISIBLE_M: f32 = 0.8e-6;

/// Time for which the base still counts as moving after a visible change. It bridges a turning point, and is shorter
/// than the time after which a sensor counts as frozen.
const VISIBLE_TICKS: u32 = (0.25 * TICK_HZ) as u32;

const FADE_PER_TICK: f32 = 1.0 / (FADE_S * TICK_HZ);

/// A playback in progress, with its plan. The caller keeps the record and passes it to every call.
#[derive(Clone, Debug)]
pub struct PlaybackRunner {
    plan: PlaybackPlan,
    drive: DriveRange,
    stage: ExperimentStage,
    rest: RestWait,
    put_back: Option<u16>,
    /// The spline node before the present position, counted from [`MARGIN`] samples before the record, and the fraction
    /// of the way to the next node.
    node: u32,
    fraction: Phase,
    played_ticks: u32,
    tail_left: u32,
    gain: f32,
    driving: bool,
    /// The drive fades out after a stop.
    fading: bool,
    last_demand: f32,
    visible_ticks: u32,
    saturated: bool,
    was_saturated: bool,
    measuring: Measuring,
}

impl PlaybackRunner {
    /// A runner at the beginning of the playback. `drive` is the range that the drive can deliver.
    #[must_use]
    pub fn new(plan: &PlaybackPlan, drive: &DriveRange) -> Self {
        Self {
            plan: *plan,
            drive: *drive,
            stage: ExperimentStage::Rest,
            rest: RestWait::default(),
            put_back: None,
            node: 0,
            fraction: Phase::default(),
            played_ticks: 0,
            tail_left: 0,
            gain: 0.0,
            driving: false,
            fading: false,
            last_demand: 0.0,
            visible_ticks: 0,
            saturated: false,
            was_saturated: false,
            measuring: Measuring::default(),
        }
    }

    /// The present stage.
    #[must_use]
    pub fn stage(&self) -> ExperimentStage {
        self.stage
    }

    /// The demand changes visibly.
    #[must_use]
    pub fn is_swinging(&self) -> bool {
        self.driving && self.visible_ticks > 0
    }

    /// The drive is on.
    #[must_use]
    pub fn is_driving(&self) -> bool {
        self.driving
    }

    /// The demand was cut in the last tick.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.saturated
    }

    /// Index of the point that begins from rest in this tick. A simulated plant is reset to its start.
    #[must_use]
    pub fn begins_from_rest(&self) -> Option<u16> {
        self.put_back
    }

    /// Starts the final fade-out of the drive.
    pub fn release_drive(&mut self) {
        self.driving = false;
        self.fading = true;
    }

    /// The drive has faded out.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.gain == 0.0 && !self.driving
    }

    /// The drive for this tick, m, while it fades out after a stop.
    pub fn fade(&mut self, record: &[i16]) -> f32 {
        self.drive_m(record)
    }

    /// Runs one tick. Takes this tick's readings; returns the demanded base displacement (m) and the outcome of the
    /// tick.
    pub fn tick(&mut self, record: &[i16], now: &TickInputs) -> (f32, Outcome) {
        let mut outcome = Outcome::Running;
        self.put_back = None;
        if self.stage == ExperimentStage::Rest {
            let (value, limit) = (now.readings.x.peak_m, self.plan.playback.rest_level_m);
            match self.rest.tick(value, limit) {
                Waited::NotYet => {}
                Waited::Begun => self.put_back = Some(self.plan.playback.index),
                Waited::Quiet => self.begin(now),
                Waited::TimedOut => {
                    outcome = Outcome::Failed(Fault { cause: FaultCause::RestTimeout, tick: now.tick, value, limit });
                }
            }
        }
        let drive = self.drive_m(record);
        if self.stage == ExperimentStage::Dwell && self.driving {
            self.measuring.push(now, drive);
            if self.is_over(record) {
                if self.tail_left == 0 {
                    outcome = self.measuring.end(now, self.plan.playback.index, self.was_saturated, &Decay::default());
                    self.driving = false;
                    self.gain = 0.0;
                } else {
                    self.tail_left -= 1;
                }
            }
        }
        (drive, outcome)
    }

    fn begin(&mut self, now: &TickInputs) {
        self.stage = ExperimentStage::Dwell;
        self.driving = true;
        self.tail_left = self.plan.tail_ticks;
        self.measuring = Measuring::from(now);
    }

    fn is_over(&self, record: &[i16]) -> bool {
        self.node as usize >= record.len() + (2 * MARGIN - 1) as usize
    }

    /// The demand at the present position of the record; advances the position.
    fn drive_m(&mut self, record: &[i16]) -> f32 {
        self.saturated = false;
        if !self.driving && self.gain == 0.0 {
            return 0.0;
        }
        let falls = self.played_ticks >= self.plan.falls_from;
        let step = match (self.fading, falls) {
            (true, _) => -FADE_PER_TICK,
            (false, true) if self.plan.playback.ramp_s > 0.0 => -self.plan.ramp,
            _ => self.plan.ramp,
        };
        self.gain = (self.gain + step).clamp(0.0, 1.0);
        // A smooth ramp: its slope is zero at both ends.
        let ramp = self.gain * self.gain * (3.0 - 2.0 * self.gain);
        let wanted = ramp * self.plan.playback.scale_m * self.counts(record);
        let demand;
        (demand, self.saturated) = self.drive.limit(wanted);
        self.was_saturated |= self.saturated;
        self.visible_ticks = if libm::fabsf(demand - self.last_demand) > VISIBLE_M {
            VISIBLE_TICKS
        } else {
            self.visible_ticks.saturating_sub(1)
        };
        self.last_demand = demand;
        self.played_ticks = self.played_ticks.saturating_add(1);
        if !self.is_over(record) {
            self.node += u32::from(self.fraction.advance(self.plan.increment));
        }
        demand
    }

    /// The spline through the samples at the present position, in counts.
    fn counts(&self, record: &[i16]) -> f32 {
        let at = |beside: u32| {
            let place = self.node.wrapping_add(beside).wrapping_sub(MARGIN + 1);
            record.get(place as usize).map_or(0.0, |sample| f32::from(*sample))
        };
        let (before, start, end, after) = (at(0), at(1), at(2), at(3));
        let t = self.fraction.0 as f32 * (1.0 / 4_294_967_296.0);
        let (v0, v1) = (0.5 * (end - before), 0.5 * (after - start));
        let rise = end - start;
        start + t * (v0 + t * ((3.0 * rise - 2.0 * v0 - v1) + t * (v0 + v1 - 2.0 * rise)))
    }
}
