//! Pulse detection on one wall's channel, for [`super::impacts`]: idle, in a pulse, or in a contact that does not end.
//!
//! Samples are converter counts and stay integers until a pulse has ended.

use crate::io::WallCounts;

/// Samples before the threshold crossing and after the end that belong to a pulse.
pub const GUARD: usize = 4;

/// Largest number of samples in a block.
pub const LONGEST_BLOCK: usize = 64;

/// The last samples before a block: the guards of a pulse that begins at the block's start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Before([WallCounts; GUARD]);

impl Before {
    pub(super) fn new(resting: u16) -> Self {
        Self([WallCounts::new(resting, resting); GUARD])
    }

    /// Takes a finished block.
    pub(super) fn push(&mut self, block: &[WallCounts]) {
        *self = self.up_to(block, block.len());
    }

    /// The guards before sample `at` of the block.
    fn up_to(&self, block: &[WallCounts], at: usize) -> Self {
        Self(core::array::from_fn(|n| {
            // Number of samples before `at`.
            let back = GUARD - n;
            let in_block = at.checked_sub(back).and_then(|place| block.get(place));
            *in_block.unwrap_or(&self.0[(GUARD + at).saturating_sub(back).min(GUARD - 1)])
        }))
    }
}

/// The detection constants in counts and samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paces {
    /// Threshold above the offset.
    pub threshold: f32,
    /// Readings of this or more are clipped.
    pub clip: f32,
    pub ringing: f32,
    pub refractory: u32,
    pub longest: u32,
    pub offset_gain: f32,
    /// Range within which the offset is followed.
    pub offset_low: f32,
    pub offset_high: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum PulsePhase {
    Idle,
    Pulse,
    /// A contact that has been recorded and has not ended.
    Rest,
}

/// A pulse so far, in counts above an integer near the offset. Its samples are numbered from the first guard.
#[derive(Clone, Copy, Debug, Default)]
struct Pulse {
    above: i32,
    sum: i32,
    moment: i64,
    peak: i32,
    before_peak: i32,
    after_peak: i32,
    peak_is_last: bool,
    last: i32,
    count: u32,
    /// Samples in a row below half the threshold at the pulse's end, at most [`GUARD`].
    low: usize,
}

impl Pulse {
    /// Takes the next sample. A reading below `low` counts as low.
    fn push(&mut self, reading: u16, low: i32) {
        let height = i32::from(reading) - self.above;
        if height > self.peak {
            (self.before_peak, self.peak, self.after_peak) = (self.last, height, height);
            self.peak_is_last = true;
        } else if self.peak_is_last {
            self.after_peak = height;
            self.peak_is_last = false;
        }
        self.sum += height;
        self.moment += i64::from(self.count) * i64::from(height);
        self.last = height;
        self.count += 1;
        self.low = if i32::from(reading) < low { self.low + 1 } else { 0 };
    }

    /// The top of the parabola through the highest sample and its neighbours, counts; the highest sample where the force
    /// jumps to it or from it, as at the first moment of a contact with a dashpot.
    fn top(&self) -> f32 {
        let curvature = 2 * self.peak - self.before_peak - self.after_peak;
        let jumps = 2 * self.before_peak.min(self.after_peak) < self.peak;
        if jumps || curvature <= 0 {
            return self.peak as f32;
        }
        let slope = (self.after_peak - self.before_peak) as f32;
        self.peak as f32 + slope * slope / (8.0 * curvature as f32)
    }
}

/// A pulse that has ended, in counts and samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ended {
    /// Σ of the force samples.
    pub sum: f32,
    /// Samples from the block's start to the pulse's centre.
    pub centre: f32,
    pub peak: f32,
    pub clipped: bool,
    pub held: bool,
}

/// What a channel finds in a block.
#[derive(Clone, Copy, Debug)]
pub(super) enum Finding {
    /// A pulse begins with the sample at this index.
    Began(usize),
    /// A pulse has ended.
    Ended(Ended),
    /// A pulse has ended and is rejected as ringing.
    Rang,
}

/// Share of the offset's time constant after a restart from which on a drift is told: 20 ms of 1 s. The mean of fewer idle samples may lie
/// beyond the limit because the sensor has just been lost, which 5 ms at a rail tell.
const DRIFT_TOLD_AFTER: f32 = 0.02;

/// One wall's channel.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    offset: f32,
    /// Idle samples that the offset was followed over since the last restart.
    followed: u32,
    /// Mean of the idle samples while the offset is held at an end of its range.
    drifted_to: Option<f32>,
    /// A reading of this or more begins a pulse.
    limit: u16,
    phase: PulsePhase,
    pulse: Pulse,
    /// Samples since the last pulse ended.
    since: u32,
    last_peak: f32,
    /// Highest reading in the present block during a contact; 0 without one.
    highest: u16,
}

/// The smallest integer that is not below `value`. Counts are far within the range of `i32`.
fn ceil(value: f32) -> i32 {
    let whole = value as i32;
    if whole as f32 >= value { whole } else { whole + 1 }
}

/// The reading that begins a pulse, clamped to possible readings.
fn limit(offset: f32, paces: &Paces) -> u16 {
    ceil(offset + paces.threshold).clamp(0, 0x7fff) as u16
}

impl Channel {
    pub(super) fn new(offset: f32, paces: &Paces) -> Self {
        Self {
            offset,
            followed: 0,
            drifted_to: None,
            limit: limit(offset, paces),
            phase: PulsePhase::Idle,
            pulse: Pulse::default(),
            since: u32::MAX,
            last_peak: 0.0,
            highest: 0,
        }
    }

    /// Drops a pulse in progress.
    pub(super) fn reset(&mut self) {
        self.phase = PulsePhase::Idle;
        self.restart();
    }

    /// Forgets what earlier samples say about offset and ringing: the offset becomes the mean of the next idle samples.
    pub(super) fn restart(&mut self) {
        self.followed = 0;
        self.drifted_to = None;
        self.since = u32::MAX;
    }

    /// The highest reading above the offset since the last call; 0 without a contact.
    pub(super) fn take_highest(&mut self) -> f32 {
        match core::mem::take(&mut self.highest) {
            0 => 0.0,
            highest => f32::from(highest) - self.offset,
        }
    }

    /// The mean of the idle samples, counts, while the offset is held at an end of its range.
    pub(super) fn drifted_to(&self) -> Option<f32> {
        self.drifted_to
    }

    /// No pulse or contact is in progress.
    pub(super) fn is_idle(&self) -> bool {
        self.phase == PulsePhase::Idle
    }

    /// The reading at and above which a pulse begins.
    pub(super) fn limit(&self) -> u16 {
        self.limit
    }

    /// Takes `count` idle samples with this mean. The offset is the mean of the idle samples since the last restart, and follows them
    /// with its time constant once there are more.
    pub(super) fn idle(&mut self, mean: f32, count: usize, paces: &Paces) {
        self.since = self.since.saturating_add(count as u32);
        let from = if self.followed == 0 { mean } else { self.offset };
        self.followed = self.followed.saturating_add(count as u32);
        let share = count as f32 * paces.offset_gain.max(1.0 / self.followed as f32);
        let followed = from + (mean - from) * share;
        self.offset = followed.max(paces.offset_low).min(paces.offset_high);
        let is_known = self.followed as f32 * paces.offset_gain >= DRIFT_TOLD_AFTER;
        self.drifted_to = (is_known && self.offset != followed).then_some(mean);
        self.limit = limit(self.offset, paces);
    }

    /// Continues from sample `from` of the block to the next finding.
    pub(super) fn go_on(
        &mut self,
        wall: usize,
        block: &[WallCounts],
        from: &mut usize,
        before: &Before,
        paces: &Paces,
    ) -> Option<Finding> {
        while *from < block.len() {
            let rest = &block[*from..];
            match self.phase {
                PulsePhase::Idle => {
                    let crossing = rest.iter().position(|pair| pair.of(wall) >= self.limit);
                    let quiet = crossing.unwrap_or(rest.len());
                    // The offset is updated only in blocks without a pulse.
                    self.since = self.since.saturating_add(quiet as u32);
                    *from += quiet;
                    crossing?;
                    self.begin(wall, &before.up_to(block, *from));
                    return Some(Finding::Began(*from));
                }
                PulsePhase::Pulse => {
                    let low = ceil(self.offset + 0.5 * paces.threshold);
                    for pair in rest {
                        let reading = pair.of(wall);
                        self.pulse.push(reading, low);
                        self.highest = self.highest.max(reading);
                        *from += 1;
                        if self.pulse.low == GUARD || self.pulse.count >= paces.longest {
                            return Some(self.end(*from, paces));
                        }
                    }
                }
                PulsePhase::Rest => {
                    let low = ceil(self.offset + 0.5 * paces.threshold);
                    let free = rest.iter().position(|pair| i32::from(pair.of(wall)) < low);
                    let length = free.map_or(rest.len(), |free| free + 1);
                    self.highest = rest[..length].iter().map(|pair| pair.of(wall)).fold(self.highest, u16::max);
                    *from += length;
                    if free.is_some() {
                        self.phase = PulsePhase::Idle;
                        self.since = 0;
                    }
                }
            }
        }
        None
    }

    /// Begins a pulse after these guard samples. They are below the crossing sample, so none of them is the peak.
    fn begin(&mut self, wall: usize, guards: &Before) {
        self.phase = PulsePhase::Pulse;
        let above = self.offset as i32;
        let mut pulse = Pulse { above, count: GUARD as u32, ..Pulse::default() };
        for (n, pair) in guards.0.iter().enumerate() {
            pulse.last = i32::from(pair.of(wall)) - above;
            pulse.sum += pulse.last;
            pulse.moment += i64::from(n as i32 * pulse.last);
        }
        self.pulse = pulse;
    }

    /// Ends the pulse with the sample before `end` of the block.
    fn end(&mut self, end: usize, paces: &Paces) -> Finding {
        let pulse = self.pulse;
        let held = pulse.low < GUARD;
        self.phase = if held { PulsePhase::Rest } else { PulsePhase::Idle };
        let since = core::mem::take(&mut self.since);
        // The part of the offset that the integer `above` does not remove.
        let fraction = self.offset - pulse.above as f32;
        if since < paces.refractory && pulse.peak as f32 - fraction < paces.ringing * self.last_peak {
            return Finding::Rang;
        }
        let count = pulse.count as f32;
        let sum = pulse.sum as f32 - count * fraction;
        let moment = pulse.moment as f32 - 0.5 * count * (count - 1.0) * fraction;
        let clipped = (pulse.peak + pulse.above) as f32 >= paces.clip;
        let peak = if clipped { pulse.peak as f32 } else { pulse.top() } - fraction;
        self.last_peak = peak;
        let centre = end as f32 - (count - 1.0 - moment / sum);
        Finding::Ended(Ended { sum, centre, peak, clipped, held })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn top(samples: &[u16]) -> f32 {
        let mut pulse = Pulse::default();
        samples.iter().for_each(|sample| pulse.push(*sample, 0));
        pulse.top()
    }

    /// A half-sine of ten samples, whose top lies between two of them.
    #[test]
    fn the_top_of_a_smooth_pulse_lies_on_the_parabola_through_its_highest_samples() {
        let samples: [u16; 10] =
            core::array::from_fn(|n| (1000.0 * libm::sinf(core::f32::consts::PI * (n as f32 + 0.5) / 10.0)) as u16);
        assert!(samples.iter().all(|sample| *sample < 990) && (top(&samples) - 1000.0).abs() < 3.0, "{samples:?}");
    }

    #[test]
    fn the_top_of_a_force_that_jumps_is_its_highest_sample() {
        assert_eq!(top(&[0, 0, 0, 0, 1000, 900, 800, 700, 0]), 1000.0);
        assert_eq!(top(&[0, 700, 800, 900, 1000, 0, 0]), 1000.0);
    }
}
