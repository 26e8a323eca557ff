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
//! amplifiers drift) is followed while nothing touches. Following one channel is [`super::pulse`]'s business, recording a
//! pulse's shape [`super::snippet`]'s.
//!
//! Everything before a pulse's end is done in the converter's whole counts: fifty samples a tick and wall leave a
//! controller no time to turn each into a force, and sums of whole numbers lose nothing.

use super::pulse::{Channel, Ended, Finding, LONGEST_BLOCK, Paces, Ring};
pub use super::pulse::{GUARD, HISTORY};
use super::snippet::Snippet;
use crate::model::{Invalid, finite, positive, require};
use crate::rig::TICK_HZ;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

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
    /// Assumed: 0.16 kg on a structure of up to 10 m/s² presses with 1.6 N; a wall rings for a millisecond or two. Clipped
    /// just below the end of [`ForceScale`]'s span.
    fn default() -> Self {
        Self { threshold_n: 2.5, clip_n: 455.0, refractory_s: 2e-3, ringing: 0.3, longest_contact_s: 0.06 }
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
            require((1e-5..=0.5).contains(&value), name, f64::from(value), "from 10 µs to 0.5 s")?;
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

/// What a converter's count on a wall's channel means.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ForceScale {
    /// N per count; greater than 0.
    pub newtons_per_count: f32,
    /// Counts without a force, −32768 to 32767; what drifts from there is followed.
    pub zero_counts: f32,
}

impl Default for ForceScale {
    /// Assumed: a sensor of 460 N over a 12-bit converter, its zero set to a tenth of the span.
    fn default() -> Self {
        Self { newtons_per_count: 0.125, zero_counts: 410.0 }
    }
}

impl ForceScale {
    /// The counts nearest to a force, within those of `lowest` to `highest`.
    #[must_use]
    pub fn to_counts(&self, force_n: f32, lowest: i16, highest: i16) -> i16 {
        let counts = force_n / self.newtons_per_count + self.zero_counts;
        // A cast drops the fraction and saturates.
        let nearest = if counts < 0.0 { counts - 0.5 } else { counts + 0.5 } as i16;
        nearest.clamp(lowest, highest)
    }
}

/// Finds impacts in both channels.
#[derive(Clone, Debug)]
pub struct ImpactMeter {
    scale: ForceScale,
    samples_per_tick: usize,
    paces: Paces,
    channels: [Channel; 2],
    ring: Ring,
    /// Highest reading of each wall in the last block, counts above its offset.
    highest: [f32; 2],
    counts: ImpactCounts,
    counted_before_cycle: u32,
    snippet: Snippet,
}

impl ImpactMeter {
    /// For channels of `samples_per_tick` samples a tick (1 to 64) on this scale.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(config: &ImpactConfig, scale: &ForceScale, samples_per_tick: u8) -> Result<Self, Invalid> {
        config.validate()?;
        positive("impacts.newtons_per_count", f64::from(scale.newtons_per_count))?;
        finite("impacts.zero_counts", f64::from(scale.zero_counts))?;
        let within = (1..=LONGEST_BLOCK).contains(&usize::from(samples_per_tick));
        require(within, "impacts.samples_per_tick", f64::from(samples_per_tick), "from 1 to 64")?;
        let rate_hz = TICK_HZ * f32::from(samples_per_tick);
        let samples = |seconds: f32| (seconds * rate_hz + 0.5) as u32;
        let paces = Paces {
            threshold: config.threshold_n / scale.newtons_per_count,
            clip: config.clip_n / scale.newtons_per_count + scale.zero_counts,
            ringing: config.ringing,
            refractory: samples(config.refractory_s),
            // Sums of this many counts stay within their whole numbers.
            longest: samples(config.longest_contact_s).clamp(GUARD as u32 + 2, 1 << 15),
            offset_gain: 1.0 / (OFFSET_S * rate_hz),
        };
        let channels = [Channel::new(scale.zero_counts, &paces), Channel::new(scale.zero_counts, &paces)];
        Ok(Self {
            scale: *scale,
            samples_per_tick: usize::from(samples_per_tick),
            paces,
            channels,
            ring: Ring::new(scale.to_counts(0.0, i16::MIN, i16::MAX)),
            highest: [0.0; 2],
            counts: ImpactCounts::default(),
            counted_before_cycle: 0,
            snippet: Snippet::new(),
        })
    }

    /// Counts since the last reset.
    #[must_use]
    pub fn counts(&self) -> &ImpactCounts {
        &self.counts
    }

    /// What its counts mean.
    #[must_use]
    pub fn scale(&self) -> &ForceScale {
        &self.scale
    }

    /// Highest force on each wall in the last block above its offset, N.
    #[must_use]
    pub fn highest_n(&self) -> [f32; 2] {
        self.highest.map(|counts| counts * self.scale.newtons_per_count)
    }

    /// Counts from zero again; pulses in progress are forgotten.
    pub fn reset(&mut self) {
        self.channels.iter_mut().for_each(Channel::reset);
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

    /// Takes one tick's block of pairs, the wall at −d first. A sample n of N was taken at (n + 1)/N of the tick. A block
    /// longer than announced is cut.
    pub fn push(&mut self, tick: u32, block: &[[i16; 2]], mut found: impl FnMut(&ImpactRecord)) {
        let block = &block[..block.len().min(self.samples_per_tick)];
        let (highest, sum) = survey(block);
        self.ring.push(block);
        for wall in 0..2 {
            self.highest[wall] = highest[wall] as f32 - self.channels[wall].offset();
            if self.channels[wall].stays_idle(highest[wall]) {
                self.channels[wall].idle(sum[wall], block.len(), &self.paces);
            } else {
                self.follow(tick, wall, block, &mut found);
            }
        }
        self.snippet.push(block);
    }

    fn follow(&mut self, tick: u32, wall: usize, block: &[[i16; 2]], found: &mut impl FnMut(&ImpactRecord)) {
        let mut from = 0;
        while let Some(finding) = self.channels[wall].go_on(wall, block, &mut from, &self.ring, &self.paces) {
            match finding {
                Finding::Began(at) => self.snippet.trigger(wall, at, block.len(), &self.ring),
                Finding::Rung => self.counts.suppressed = self.counts.suppressed.wrapping_add(1),
                Finding::Ended(ended) => {
                    self.counts.impacts[wall] = self.counts.impacts[wall].wrapping_add(1);
                    self.counts.clipped += u32::from(ended.clipped);
                    self.counts.held += u32::from(ended.held);
                    found(&self.record(tick, wall, &ended));
                }
            }
        }
    }

    fn record(&self, tick: u32, wall: usize, ended: &Ended) -> ImpactRecord {
        let per_tick = self.samples_per_tick as f32;
        let peak_n = ended.peak * self.scale.newtons_per_count;
        let impulse_n_s = ended.sum * self.scale.newtons_per_count / (per_tick * TICK_HZ);
        ImpactRecord {
            tick,
            centre_ticks: ended.centre / per_tick,
            side: if wall == 0 { -1 } else { 1 },
            peak_n,
            impulse_n_s,
            contact_s: core::f32::consts::FRAC_PI_2 * impulse_n_s / peak_n,
            clipped: ended.clipped,
            held: ended.held,
        }
    }
}

/// Highest reading and sum of each wall; what nearly every block ends with.
#[inline]
fn survey(block: &[[i16; 2]]) -> ([i32; 2], [i32; 2]) {
    let (mut highest, mut sum) = ([i32::from(i16::MIN); 2], [0; 2]);
    for pair in block {
        for wall in 0..2 {
            let reading = i32::from(pair[wall]);
            sum[wall] += reading;
            if reading > highest[wall] {
                highest[wall] = reading;
            }
        }
    }
    (highest, sum)
}
