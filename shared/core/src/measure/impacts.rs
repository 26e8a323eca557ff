//! Impact detection on the cavity's walls from the two wall-force channels.
//!
//! A pulse begins where the force passes a threshold and ends where it has stayed below half of it. A few guard samples
//! on either side belong to the pulse, so that its foot is included. An impact record holds:
//! - **time**: the pulse's centre of area. For a symmetric pulse it is exact to a small part of a sample for every
//!   threshold, while a crossing time depends on threshold, peak and phase. The contact began half a contact time
//!   earlier.
//! - **impulse**: the sum of the samples. The kinks at the ends of a half-sine of n samples make it wrong by at most
//!   π²/(12 n²): 0.8 % with ten samples in the contact, 0.03 % with fifty.
//! - **peak**: the parabola through the three highest samples, unless they are clipped; the highest sample of a force that
//!   begins with a jump (the dashpot of a simulated soft wall).
//!
//! A hard wall rings. Within the refractory time a new pulse must therefore exceed a part of the last peak. A contact
//! that does not end is a particle that came to rest on the wall: one impact, marked as held. The channels' slow offset
//! (charge amplifiers drift) is measured at each start and followed while there is no contact, within [`ImpactConfig::offset_limit_n`] of the
//! calibrated zero, so that an open input is never taken as a new zero. `pulse` follows one channel; [`super::snippet`]
//! records a pulse's shape.
//!
//! Until a pulse ends, all arithmetic is on the converter's integer counts, so the sums are exact.

pub use super::pulse::GUARD;
use super::pulse::{Before, Channel, Ended, Finding, LONGEST_BLOCK, Paces};
use super::snippet::Snippet;
use crate::io::{
    ForceScale, Invalid, Rail, TICK_HZ, WALL_FULL_SCALE_COUNTS, WALL_SUBSAMPLES, WALL_USABLE, WallCounts, positive,
    require,
};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Time constant of the offset tracking, s.
const OFFSET_S: f32 = 1.0;

/// Thresholds that separate impacts from noise, ringing and resting contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ImpactConfig {
    /// Force that begins a pulse, N: well above the noise, and above m·|x″| of a particle resting on a wall.
    pub threshold_n: f32,
    /// Readings of this force or more are clipped, N.
    pub clip_n: f32,
    /// Time after a pulse in which ringing is rejected, s.
    pub refractory_s: f32,
    /// Largest ringing as a part of the last peak, 0 to 1.
    pub ringing: f32,
    /// Longest contact of an impact, s; a longer one is a particle at rest.
    pub longest_contact_s: f32,
    /// Largest offset from the calibrated zero that is followed, N; a larger one is a sensor fault.
    pub offset_limit_n: f32,
}

impl Default for ImpactConfig {
    /// Assumed: 0.16 kg on a structure of up to 10 m/s² presses with 1.6 N; a wall rings for one or two milliseconds.
    /// The clipping force is just below the end of [`ForceScale`]'s usable span. The offset may drift by 5 % of the
    /// span; the live zero is 10 %.
    fn default() -> Self {
        Self {
            threshold_n: 2.5,
            clip_n: 455.0,
            refractory_s: 2e-3,
            ringing: 0.3,
            longest_contact_s: 0.06,
            offset_limit_n: 25.0,
        }
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
        positive("impacts.offset_limit_n", f64::from(self.offset_limit_n))?;
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
    /// Tick in which the pulse ended.
    pub tick: u32,
    /// The pulse's centre in ticks from the start of `tick`; negative if it lies in an earlier tick.
    pub centre_ticks: f32,
    /// +1 for the wall at y − x = +d, −1 for the wall at −d.
    pub side: i8,
    /// Highest force, N; a lower bound if clipped.
    pub peak_n: f32,
    /// ∫ F dt, N·s; a lower bound if clipped.
    pub impulse_n_s: f32,
    /// Contact time of the half-sine with this peak and impulse, πJ/(2F), s.
    pub contact_s: f32,
    /// A reading reached the clipping force.
    pub clipped: bool,
    /// The contact lasted longer than the longest contact time.
    pub held: bool,
}

/// Counts since the last [`ImpactMeter::reset`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ImpactCounts {
    /// Impacts on the wall at −d and at +d.
    pub impacts: [u32; 2],
    /// Impacts that were clipped.
    pub clipped: u32,
    /// Impacts that were held.
    pub held: u32,
    /// Pulses rejected as ringing.
    pub suppressed: u32,
}

impl ImpactCounts {
    /// Impacts on both walls.
    #[must_use]
    pub fn total(&self) -> u32 {
        self.impacts[0].wrapping_add(self.impacts[1])
    }
}

/// Checked detection constants in counts and samples.
#[derive(Clone, Copy, Debug)]
pub struct ImpactSettings {
    config: ImpactConfig,
    scale: ForceScale,
    samples_per_tick: usize,
    paces: Paces,
}

impl ImpactSettings {
    /// The constants for channels on this scale with `samples_per_tick` samples per tick (1 to 64).
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(config: &ImpactConfig, scale: &ForceScale, samples_per_tick: u8) -> Result<Self, Invalid> {
        config.validate()?;
        positive("calibration.walls.newtons_per_count", f64::from(scale.newtons_per_count))?;
        let zero = f64::from(scale.zero_counts);
        require(
            (0.0..=f64::from(WALL_FULL_SCALE_COUNTS)).contains(&zero),
            "calibration.walls.zero_counts",
            zero,
            "from 0 to 4095",
        )?;
        let within = (1..=LONGEST_BLOCK).contains(&usize::from(samples_per_tick));
        require(within, "impacts.samples_per_tick", f64::from(samples_per_tick), "from 1 to 64")?;
        Ok(Self::of(config, scale, samples_per_tick))
    }

    /// Converts checked constants.
    fn of(config: &ImpactConfig, scale: &ForceScale, samples_per_tick: u8) -> Self {
        let rate_hz = TICK_HZ * f32::from(samples_per_tick);
        let samples = |seconds: f32| (seconds * rate_hz + 0.5) as u32;
        let drift = config.offset_limit_n / scale.newtons_per_count;
        let paces = Paces {
            threshold: config.threshold_n / scale.newtons_per_count,
            clip: config.clip_n / scale.newtons_per_count + scale.zero_counts,
            ringing: config.ringing,
            refractory: samples(config.refractory_s),
            // Sums over this many counts fit their integer types.
            longest: samples(config.longest_contact_s).clamp(GUARD as u32 + 2, 1 << 15),
            offset_gain: 1.0 / (OFFSET_S * rate_hz),
            offset_low: scale.zero_counts - drift,
            offset_high: scale.zero_counts + drift,
        };
        Self { config: *config, scale: *scale, samples_per_tick: usize::from(samples_per_tick), paces }
    }

    /// The same constants for a sensor with another scale.
    #[must_use]
    pub fn on(&self, scale: &ForceScale) -> Self {
        Self::of(&self.config, scale, self.samples_per_tick as u8)
    }
}

impl Default for ImpactSettings {
    /// The default constants at the rig's rate.
    fn default() -> Self {
        Self::of(&ImpactConfig::default(), &ForceScale::default(), WALL_SUBSAMPLES as u8)
    }
}

/// Detects impacts on both walls.
#[derive(Clone, Debug)]
pub struct ImpactMeter {
    settings: ImpactSettings,
    channels: [Channel; 2],
    before: Before,
    /// Highest reading of each wall in the last block during a contact, in counts above its offset; 0 without a
    /// contact.
    highest: [f32; 2],
    /// How much of each wall's last block is at a rail.
    rails: [Rail; 2],
    counts: ImpactCounts,
    counted_before_cycle: u32,
    snippet: Snippet,
}

impl Default for ImpactMeter {
    fn default() -> Self {
        Self::of(&ImpactSettings::default())
    }
}

impl ImpactMeter {
    /// Checks the constants as [`ImpactSettings::new`] does and makes the meter.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(config: &ImpactConfig, scale: &ForceScale, samples_per_tick: u8) -> Result<Self, Invalid> {
        Ok(Self::of(&ImpactSettings::new(config, scale, samples_per_tick)?))
    }

    /// A meter with no contact on either wall.
    #[must_use]
    pub fn of(settings: &ImpactSettings) -> Self {
        Self {
            settings: *settings,
            channels: [settings, settings].map(|s| Channel::new(s.scale.zero_counts, &s.paces)),
            before: Before::new(settings.scale.to_counts(0.0, 0, WALL_FULL_SCALE_COUNTS)),
            highest: [0.0; 2],
            rails: [Rail::Clear; 2],
            counts: ImpactCounts::default(),
            counted_before_cycle: 0,
            snippet: Snippet::new(),
        }
    }

    /// Continues with other settings. Pulses in progress are dropped.
    pub fn adopt(&mut self, settings: &ImpactSettings) {
        self.settings = *settings;
        self.channels = [settings, settings].map(|s| Channel::new(s.scale.zero_counts, &s.paces));
    }

    /// Counts since the last reset.
    #[must_use]
    pub fn counts(&self) -> &ImpactCounts {
        &self.counts
    }

    /// The scale of the wall channels.
    #[must_use]
    pub fn scale(&self) -> &ForceScale {
        &self.settings.scale
    }

    /// Highest force above the offset on each wall in the last block during a contact, N; 0 without a contact.
    #[must_use]
    pub fn highest_n(&self) -> [f32; 2] {
        self.highest.map(|counts| counts * self.settings.scale.newtons_per_count)
    }

    /// How much of each wall's last block is at a rail of the converter.
    #[must_use]
    pub fn rails(&self) -> [Rail; 2] {
        self.rails
    }

    /// For each wall whose zero has drifted beyond the limit: the mean idle reading and the limit, N.
    #[must_use]
    pub fn drift_n(&self) -> [Option<(f32, f32)>; 2] {
        [0, 1].map(|wall: usize| {
            let counts = self.channels[wall].drifted_to()?;
            Some((self.settings.scale.to_force_n(counts), self.settings.config.offset_limit_n))
        })
    }

    /// Resets the counts to zero. Pulses in progress are dropped.
    pub fn reset(&mut self) {
        self.channels.iter_mut().for_each(Channel::reset);
        self.counts = ImpactCounts::default();
        self.counted_before_cycle = 0;
    }

    /// Measures the channels' offsets anew from the next idle samples: what follows does not depend on what was measured before.
    pub fn restart(&mut self) {
        self.channels.iter_mut().for_each(Channel::restart);
    }

    /// Closes a cycle of the drive and returns the number of impacts that ended in it.
    pub fn end_cycle(&mut self) -> u32 {
        let total = self.counts.total();
        total.wrapping_sub(core::mem::replace(&mut self.counted_before_cycle, total))
    }

    /// The recorder of one pulse's shape.
    #[must_use]
    pub fn snippet(&self) -> &Snippet {
        &self.snippet
    }

    /// Arms the recorder for the next impact's shape.
    pub fn arm_snippet(&mut self) {
        self.snippet.arm();
    }

    /// Takes one tick's block of pairs, the wall at −d first. Sample n of N was taken at (n + 1)/N of the tick. A block
    /// longer than `samples_per_tick` is cut. `found` is called for every impact that ends in the block.
    pub fn push(&mut self, tick: u32, block: &[WallCounts], mut found: impl FnMut(&ImpactRecord)) {
        let block = &block[..block.len().min(self.settings.samples_per_tick)];
        let (lowest, highest) = extremes(block);
        self.rails = [0, 1].map(|wall| {
            let is_clear = !WALL_USABLE.is_at_rail(lowest[wall]) && !WALL_USABLE.is_at_rail(highest[wall]);
            if is_clear { Rail::Clear } else { self.rail(block, wall) }
        });
        for (wall, highest) in highest.into_iter().enumerate() {
            let channel = &mut self.channels[wall];
            let limit = channel.limit();
            if channel.is_idle() && highest < limit {
                self.highest[wall] = 0.0;
                channel.idle(mean_of_some(block, wall), block.len(), &self.settings.paces);
            } else {
                self.follow(tick, wall, block, &mut found);
                self.highest[wall] = self.channels[wall].take_highest();
            }
        }
        self.before.push(block);
        self.snippet.push(block);
    }

    fn rail(&self, block: &[WallCounts], wall: usize) -> Rail {
        let at_rail = block.iter().filter(|pair| WALL_USABLE.is_at_rail(pair.of(wall))).count();
        if at_rail == 0 {
            return Rail::Clear;
        }
        let sum: u32 = block.iter().map(|pair| u32::from(pair.of(wall))).sum();
        let to_si = |counts: u16| self.settings.scale.to_force_n(f32::from(counts));
        let mean_n = self.settings.scale.to_force_n(sum as f32 / block.len() as f32);
        WALL_USABLE.map(to_si).rail(at_rail, block.len(), mean_n)
    }

    fn follow(&mut self, tick: u32, wall: usize, block: &[WallCounts], found: &mut impl FnMut(&ImpactRecord)) {
        let mut from = 0;
        while let Some(finding) = self.channels[wall].go_on(wall, block, &mut from, &self.before, &self.settings.paces)
        {
            match finding {
                Finding::Began(at) => self.snippet.trigger(wall, at),
                Finding::Rang => self.counts.suppressed = self.counts.suppressed.wrapping_add(1),
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
        let per_tick = self.settings.samples_per_tick as f32;
        let peak_n = ended.peak * self.settings.scale.newtons_per_count;
        let impulse_n_s = ended.sum * self.settings.scale.newtons_per_count / (per_tick * TICK_HZ);
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

/// Decimation of the samples that track a channel's offset.
const OFFSET_EVERY: usize = 10;

/// Lowest and highest counts on each wall, in one pass: most blocks need no closer look.
fn extremes(block: &[WallCounts]) -> ([u16; 2], [u16; 2]) {
    let (mut lowest, mut highest) = ([u16::MAX; 2], [0; 2]);
    for pair in block {
        for wall in 0..2 {
            lowest[wall] = lowest[wall].min(pair.of(wall));
            highest[wall] = highest[wall].max(pair.of(wall));
        }
    }
    (lowest, highest)
}

/// The mean of every [`OFFSET_EVERY`]th of a wall's readings, from the first.
fn mean_of_some(block: &[WallCounts], wall: usize) -> f32 {
    let sum: u32 = block.iter().step_by(OFFSET_EVERY).map(|pair| u32::from(pair.of(wall))).sum();
    sum as f32 * (1.0 / block.len().div_ceil(OFFSET_EVERY).max(1) as f32)
}
