//! Impacts on the cavity's walls, read off the two wall-force channels.
//!
//! A pulse begins where the force passes a threshold and ends where it has stayed below half of it; a few samples on
//! either side belong to it, so that its foot is not lost. What is reported:
//! - **time**: the pulse's centre of area. For a symmetric pulse that is exact to a small part of a sample, whatever
//!   the threshold, while a crossing depends on threshold, peak and phase. The contact began half a contact time before.
//! - **impulse**: the sum of the samples. The kinks at the ends of a half-sine of n samples make that wrong by at most
//!   π²/(12 n²): 0.8 % with ten samples in the contact, 0.03 % with fifty.
//! - **peak**: the parabola through the three highest samples, unless they are clipped.
//!
//! A hard wall rings: within the refractory time a new pulse must exceed a part of the last peak. A contact that does not
//! end is a particle that came to rest on the wall: one impact, marked as held. The channels' slow offset (charge
//! amplifiers drift) is followed while nothing touches. Recording a pulse's shape is [`super::snippet`]'s business.

use super::snippet::Snippet;
use crate::model::{Invalid, positive, require};
use crate::rig::{SUBSAMPLES, TICK_HZ};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Samples before the crossing and after the end that belong to a pulse.
pub const GUARD: usize = 4;

/// Samples of each channel that are kept: what a snippet shows from before its trigger.
pub const HISTORY: usize = 64;

/// Time constant with which the offset is followed, s.
const OFFSET_S: f32 = 1.0;

/// How impacts are told from noise, ringing and rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ImpactConfig {
    /// Force that begins a pulse, N: well above the noise, and above m·|x″| of a particle that rests on a wall.
    pub threshold_n: f32,
    /// Readings from here on are clipped, N.
    pub clip_n: f32,
    /// After a pulse, the time in which the next must be more than ringing, s.
    pub refractory_s: f32,
    /// Part of the last peak that ringing may reach, 0 to 1.
    pub ringing: f32,
    /// A contact longer than this is a particle at rest, s.
    pub longest_contact_s: f32,
}

impl Default for ImpactConfig {
    /// Assumed: 0.16 kg on a structure of up to 10 m/s² presses with 1.6 N; a wall rings for a millisecond or two.
    fn default() -> Self {
        Self { threshold_n: 2.5, clip_n: 500.0, refractory_s: 2e-3, ringing: 0.3, longest_contact_s: 0.06 }
    }
}

impl ImpactConfig {
    /// Checks every value.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("impacts.threshold_n", f64::from(self.threshold_n))?;
        positive("impacts.clip_n", f64::from(self.clip_n))?;
        let (clip, ringing) = (f64::from(self.clip_n), f64::from(self.ringing));
        require(self.clip_n > 2.0 * self.threshold_n, "impacts.clip_n", clip, "above twice impacts.threshold_n")?;
        require((0.0..=1.0).contains(&self.ringing), "impacts.ringing", ringing, "from 0 to 1")?;
        for (name, value) in
            [("impacts.refractory_s", self.refractory_s), ("impacts.longest_contact_s", self.longest_contact_s)]
        {
            require((1e-5..=1.0).contains(&value), name, f64::from(value), "from 10 µs to 1 s")?;
        }
        Ok(())
    }
}

/// One impact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ImpactRecord {
    /// The tick in which the pulse ended.
    pub tick: u32,
    /// The pulse's centre in ticks from the start of `tick`: negative where it lies in an earlier one.
    pub centre_ticks: f32,
    /// +1 on the wall at y − x = +d.
    pub side: i8,
    /// Highest force, N; a lower bound where clipped.
    pub peak_n: f32,
    /// ∫ F dt, N·s; a lower bound where clipped.
    pub impulse_n_s: f32,
    /// Contact time of the half-sine with this peak and impulse, πJ/(2F), s.
    pub contact_s: f32,
    /// A reading reached the sensor's limit.
    pub clipped: bool,
    /// The contact did not end within the longest contact time.
    pub held: bool,
}

/// Counts since the last [`ImpactMeter::reset`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ImpactCounts {
    /// On the wall at −d and at +d.
    pub impacts: [u32; 2],
    /// Of these, clipped.
    pub clipped: u32,
    /// Of these, held.
    pub held: u32,
    /// Pulses that were taken for ringing.
    pub suppressed: u32,
}

impl ImpactCounts {
    /// On both walls.
    #[must_use]
    pub fn total(&self) -> u32 {
        self.impacts[0].wrapping_add(self.impacts[1])
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Idle,
    Pulse,
    /// A contact that has been reported and has not ended.
    Rest,
}

/// A pulse as far as it has been seen. Its samples are numbered from the crossing.
#[derive(Clone, Copy, Debug, Default)]
struct Pulse {
    sum: f32,
    moment: f32,
    peak: f32,
    /// The samples next to the highest.
    neighbours: [f32; 2],
    peak_is_last: bool,
    last: f32,
    count: u32,
    below: u32,
}

impl Pulse {
    #[inline]
    fn push(&mut self, force: f32) {
        self.sum += force;
        self.moment += force * self.count as f32;
        if self.peak_is_last {
            self.neighbours[1] = force;
            self.peak_is_last = false;
        }
        if force > self.peak {
            self.peak = force;
            self.neighbours[0] = self.last;
            self.peak_is_last = true;
        }
        self.last = force;
        self.count += 1;
    }

    /// The top of the parabola through the highest sample and its neighbours.
    fn top(&self) -> f32 {
        let [before, after] = self.neighbours;
        let curvature = 2.0 * self.peak - before - after;
        if curvature <= 0.0 {
            return self.peak;
        }
        let slope = after - before;
        self.peak + slope * slope / (8.0 * curvature)
    }
}

/// One wall's channel.
#[derive(Clone, Debug)]
struct Channel {
    history: [f32; HISTORY],
    at: usize,
    offset: f32,
    phase: Phase,
    pulse: Pulse,
    /// Samples since the last pulse ended.
    since: u32,
    last_peak: f32,
}

impl Channel {
    fn new() -> Self {
        Self {
            history: [0.0; HISTORY],
            at: 0,
            offset: 0.0,
            phase: Phase::Idle,
            pulse: Pulse::default(),
            since: u32::MAX,
            last_peak: 0.0,
        }
    }

    /// Takes a block in which nothing happens, which is nearly every one, at a fraction of the cost; false, and nothing is
    /// taken, where something does.
    #[inline]
    fn is_idle(&mut self, block: &[f32], config: &ImpactConfig, paces: &Paces) -> bool {
        let limit = config.threshold_n + self.offset;
        let mut sum = 0.0;
        let mut quiet = self.phase == Phase::Idle;
        for &reading in block {
            quiet &= reading < limit;
            sum += reading;
        }
        // −∞ is below every limit.
        if !quiet || !sum.is_finite() {
            return false;
        }
        let count = block.len();
        self.offset += (sum - count as f32 * self.offset) * paces.offset_gain;
        self.since = self.since.saturating_add(count as u32);
        let kept = &block[count.saturating_sub(HISTORY)..];
        let (first, rest) = kept.split_at(kept.len().min(HISTORY - self.at));
        self.history[self.at..self.at + first.len()].copy_from_slice(first);
        self.history[..rest.len()].copy_from_slice(rest);
        self.at = (self.at + kept.len()) % HISTORY;
        true
    }

    fn begin(&mut self) {
        self.phase = Phase::Pulse;
        self.pulse = Pulse::default();
        for back in (1..=GUARD).rev() {
            let force = self.history[(self.at + HISTORY - back) % HISTORY] - self.offset;
            self.pulse.push(force);
        }
    }
}

/// The constants in samples.
#[derive(Clone, Copy, Debug)]
struct Paces {
    samples_per_tick: usize,
    refractory: u32,
    longest: u32,
    offset_gain: f32,
}

/// Finds impacts in both channels.
#[derive(Clone, Debug)]
pub struct ImpactMeter {
    config: ImpactConfig,
    paces: Paces,
    channels: [Channel; 2],
    counts: ImpactCounts,
    counted_before_cycle: u32,
    snippet: Snippet,
}

impl Default for ImpactMeter {
    /// The default constants at the rig's sampling rate.
    fn default() -> Self {
        Self::of(&ImpactConfig::default(), SUBSAMPLES as u8)
    }
}

impl ImpactMeter {
    /// For channels of `samples_per_tick` samples a tick.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(config: &ImpactConfig, samples_per_tick: u8) -> Result<Self, Invalid> {
        config.validate()?;
        require(samples_per_tick > 0, "impacts.samples_per_tick", f64::from(samples_per_tick), "at least 1")?;
        Ok(Self::of(config, samples_per_tick))
    }

    /// From checked constants.
    fn of(config: &ImpactConfig, samples_per_tick: u8) -> Self {
        let rate_hz = TICK_HZ * f32::from(samples_per_tick);
        let samples = |seconds: f32| (seconds * rate_hz + 0.5) as u32;
        let paces = Paces {
            samples_per_tick: usize::from(samples_per_tick),
            refractory: samples(config.refractory_s),
            longest: samples(config.longest_contact_s).max(GUARD as u32 + 2),
            offset_gain: 1.0 / (OFFSET_S * rate_hz),
        };
        let channels = [Channel::new(), Channel::new()];
        let (counts, snippet) = (ImpactCounts::default(), Snippet::new());
        Self { config: *config, paces, channels, counts, counted_before_cycle: 0, snippet }
    }

    /// Counts since the last reset.
    #[must_use]
    pub fn counts(&self) -> &ImpactCounts {
        &self.counts
    }

    /// Counts from zero again; pulses in progress are forgotten.
    pub fn reset(&mut self) {
        for channel in &mut self.channels {
            channel.phase = Phase::Idle;
            channel.since = u32::MAX;
        }
        self.counts = ImpactCounts::default();
        self.counted_before_cycle = 0;
    }

    /// Closes a cycle of the drive: the impacts that ended in it.
    pub fn end_cycle(&mut self) -> u32 {
        let total = self.counts.total();
        total.wrapping_sub(core::mem::replace(&mut self.counted_before_cycle, total))
    }

    /// The recorder of one pulse's shape.
    #[must_use]
    pub fn snippet(&self) -> &Snippet {
        &self.snippet
    }

    /// Records the next impact's shape.
    pub fn arm_snippet(&mut self) {
        self.snippet.arm();
    }

    /// Takes one tick's blocks: the wall at −d first. A sample n of N was taken at (n + 1)/N of the tick. Blocks of another
    /// length than announced are cut to the shorter.
    pub fn push(&mut self, tick: u32, blocks: [&[f32]; 2], mut found: impl FnMut(&ImpactRecord)) {
        for (wall, block) in blocks.into_iter().enumerate() {
            let block = &block[..block.len().min(self.paces.samples_per_tick)];
            if !self.snippet.is_filling(wall) && self.channels[wall].is_idle(block, &self.config, &self.paces) {
                continue;
            }
            for (n, &reading) in block.iter().enumerate() {
                if let Some(record) = self.sample(wall, tick, n, reading) {
                    self.counts.impacts[wall] = self.counts.impacts[wall].wrapping_add(1);
                    self.counts.clipped += u32::from(record.clipped);
                    self.counts.held += u32::from(record.held);
                    found(&record);
                }
            }
        }
    }

    #[inline]
    fn sample(&mut self, wall: usize, tick: u32, n: usize, reading: f32) -> Option<ImpactRecord> {
        let channel = &mut self.channels[wall];
        // What is no number is for the sensor watch: here the last reading stands in.
        let before = channel.history[(channel.at + HISTORY - 1) % HISTORY];
        let reading = if reading.is_finite() { reading } else { before };
        let force = reading - channel.offset;
        let mut record = None;
        match channel.phase {
            Phase::Idle => {
                channel.since = channel.since.saturating_add(1);
                if force >= self.config.threshold_n {
                    channel.begin();
                    channel.pulse.push(force);
                    self.snippet.trigger(wall, &channel.history, channel.at);
                } else {
                    channel.offset += force * self.paces.offset_gain;
                }
            }
            Phase::Pulse => {
                channel.pulse.push(force);
                let low = force < 0.5 * self.config.threshold_n;
                channel.pulse.below = if low { channel.pulse.below + 1 } else { 0 };
                let held = channel.pulse.count >= self.paces.longest;
                if channel.pulse.below as usize >= GUARD || held {
                    channel.phase = if held { Phase::Rest } else { Phase::Idle };
                    record = self.end(wall, tick, n, held);
                }
            }
            Phase::Rest => {
                if force < 0.5 * self.config.threshold_n {
                    channel.phase = Phase::Idle;
                    channel.since = 0;
                }
            }
        }
        let channel = &mut self.channels[wall];
        channel.history[channel.at] = reading;
        channel.at = (channel.at + 1) % HISTORY;
        self.snippet.push(wall, reading);
        record
    }

    /// The pulse is complete with sample `n` of `tick`; `None` where it was ringing.
    fn end(&mut self, wall: usize, tick: u32, n: usize, held: bool) -> Option<ImpactRecord> {
        let channel = &mut self.channels[wall];
        let pulse = &channel.pulse;
        let ringing = channel.since < self.paces.refractory && pulse.peak < self.config.ringing * channel.last_peak;
        channel.since = 0;
        if ringing {
            self.counts.suppressed = self.counts.suppressed.wrapping_add(1);
            return None;
        }
        let clipped = pulse.peak + channel.offset >= self.config.clip_n;
        let peak_n = if clipped { pulse.peak } else { pulse.top() };
        channel.last_peak = peak_n;
        let per_tick = self.paces.samples_per_tick as f32;
        let impulse_n_s = pulse.sum / (per_tick * TICK_HZ);
        let back = (pulse.count - 1) as f32 - pulse.moment / pulse.sum;
        let side = if wall == 0 { -1 } else { 1 };
        Some(ImpactRecord {
            tick,
            centre_ticks: ((n + 1) as f32 - back) / per_tick,
            side,
            peak_n,
            impulse_n_s,
            contact_s: core::f32::consts::FRAC_PI_2 * impulse_n_s / peak_n,
            clipped,
            held,
        })
    }
}
