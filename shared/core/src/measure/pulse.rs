//! One wall's channel as [`super::impacts`] follows it: idle, in a pulse, or in a contact that does not end.
//!
//! Samples are the converter's counts and stay whole numbers until a pulse has ended.

/// Samples before the crossing and after the end that belong to a pulse.
pub const GUARD: usize = 4;

/// Samples of each channel that are kept: what a snippet shows from before its trigger.
pub const HISTORY: usize = 64;

/// Most samples in a block.
pub const LONGEST_BLOCK: usize = 64;

const RING: usize = HISTORY + LONGEST_BLOCK;

/// Readings of both walls at one instant in one word, the wall at −d in its lower half: they are copied and looked at
/// together nearly always.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pair(pub u32);

impl Pair {
    /// Counts on the wall at −d and at +d.
    #[must_use]
    pub const fn new(low: u16, high: u16) -> Self {
        Self(low as u32 | (high as u32) << 16)
    }

    /// The reading of wall 0 (at −d) or 1.
    #[must_use]
    #[inline]
    pub fn of(self, wall: usize) -> u16 {
        (self.0 >> (16 * wall)) as u16
    }
}

/// The newest samples of both walls.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    samples: [Pair; RING],
    at: usize,
}

impl Ring {
    pub(super) fn new(resting: u16) -> Self {
        Self { samples: [Pair::new(resting, resting); RING], at: 0 }
    }

    pub(super) fn push(&mut self, block: &[Pair]) {
        let (first, rest) = block.split_at(block.len().min(RING - self.at));
        self.samples[self.at..self.at + first.len()].copy_from_slice(first);
        self.samples[..rest.len()].copy_from_slice(rest);
        self.at = (self.at + block.len()) % RING;
    }

    /// The [`HISTORY`] samples before the last `newest` ones, oldest first, in two parts.
    pub(super) fn before(&self, newest: usize) -> [&[Pair]; 2] {
        let start = (self.at + RING - HISTORY - newest.min(RING - HISTORY)) % RING;
        let (newer, older) = self.samples.split_at(start);
        let first = &older[..older.len().min(HISTORY)];
        [first, &newer[..HISTORY - first.len()]]
    }

    /// The sample taken `back` samples ago, 1 for the newest.
    pub(super) fn back(&self, back: usize) -> Pair {
        self.samples[(self.at + RING - back % RING) % RING]
    }
}

/// The constants in counts and samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paces {
    /// Above the offset.
    pub threshold: f32,
    /// A reading of this is clipped.
    pub clip: f32,
    pub ringing: f32,
    pub refractory: u32,
    pub longest: u32,
    pub offset_gain: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Idle,
    Pulse,
    /// A contact that has been reported and has not ended.
    Rest,
}

/// A pulse as far as it has been seen, counted above a whole number near the offset. Its samples are numbered from the
/// first guard.
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
    low: u32,
}

impl Pulse {
    #[inline]
    fn push(&mut self, reading: u16) {
        let height = i32::from(reading) - self.above;
        self.sum = self.sum.wrapping_add(height);
        self.moment = self.moment.wrapping_add(i64::from(height) * i64::from(self.count.cast_signed()));
        if self.peak_is_last {
            self.after_peak = height;
            self.peak_is_last = false;
        }
        if height > self.peak {
            self.peak = height;
            self.before_peak = self.last;
            self.peak_is_last = true;
        }
        self.last = height;
        self.count += 1;
    }

    /// The top of the parabola through the highest sample and its neighbours, counts.
    fn top(&self) -> f32 {
        let curvature = 2 * self.peak - self.before_peak - self.after_peak;
        if curvature <= 0 {
            return self.peak as f32;
        }
        let slope = (self.after_peak - self.before_peak) as f32;
        self.peak as f32 + slope * slope / (8.0 * curvature as f32)
    }
}

/// A pulse that has ended, in counts and samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ended {
    /// Σ of the force.
    pub sum: f32,
    /// From the block's start to the pulse's centre.
    pub centre: f32,
    pub peak: f32,
    pub clipped: bool,
    pub held: bool,
}

/// What a channel comes upon in a block.
#[derive(Clone, Copy, Debug)]
pub(super) enum Finding {
    /// A pulse begins with this sample.
    Began(usize),
    Ended(Ended),
    /// What ended was ringing.
    Rung,
}

/// One wall's channel.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    offset: f32,
    /// Readings from here on begin a pulse.
    limit: u16,
    phase: Phase,
    pulse: Pulse,
    /// Samples since the last pulse ended.
    since: u32,
    last_peak: f32,
}

/// The smallest whole number that is not below; counts are far within an `i32`.
fn ceil(value: f32) -> i32 {
    let whole = value as i32;
    if whole as f32 >= value { whole } else { whole + 1 }
}

/// Where a pulse begins, within what a reading can be.
fn limit(offset: f32, paces: &Paces) -> u16 {
    ceil(offset + paces.threshold).clamp(0, 0x7fff) as u16
}

impl Channel {
    pub(super) fn new(offset: f32, paces: &Paces) -> Self {
        Self {
            offset,
            limit: limit(offset, paces),
            phase: Phase::Idle,
            pulse: Pulse::default(),
            since: u32::MAX,
            last_peak: 0.0,
        }
    }

    /// Forgets a pulse in progress.
    pub(super) fn reset(&mut self) {
        self.phase = Phase::Idle;
        self.since = u32::MAX;
    }

    pub(super) fn offset(&self) -> f32 {
        self.offset
    }

    /// Nothing is in progress.
    pub(super) fn is_idle(&self) -> bool {
        self.phase == Phase::Idle
    }

    /// The reading from which on a pulse begins.
    pub(super) fn limit(&self) -> u16 {
        self.limit
    }

    /// Takes `count` idle samples of this sum.
    pub(super) fn idle(&mut self, sum: u32, count: usize, paces: &Paces) {
        self.since = self.since.saturating_add(count as u32);
        self.offset += (sum as f32 - count as f32 * self.offset) * paces.offset_gain;
        self.limit = limit(self.offset, paces);
    }

    /// Goes on from sample `from` of the block, which `ring` holds already, to the next finding.
    pub(super) fn go_on(
        &mut self,
        wall: usize,
        block: &[Pair],
        from: &mut usize,
        ring: &Ring,
        paces: &Paces,
    ) -> Option<Finding> {
        while *from < block.len() {
            let rest = &block[*from..];
            match self.phase {
                Phase::Idle => {
                    let crossing = rest.iter().position(|pair| pair.of(wall) >= self.limit);
                    let quiet = &rest[..crossing.unwrap_or(rest.len())];
                    let sum = quiet.iter().map(|pair| u32::from(pair.of(wall))).sum();
                    self.idle(sum, quiet.len(), paces);
                    *from += quiet.len();
                    crossing?;
                    self.begin(wall, block.len() - *from, ring);
                    return Some(Finding::Began(*from));
                }
                Phase::Pulse => {
                    let low = ceil(self.offset + 0.5 * paces.threshold);
                    let mut pulse = self.pulse;
                    let mut over = false;
                    for pair in rest {
                        pulse.push(pair.of(wall));
                        *from += 1;
                        pulse.low = if i32::from(pair.of(wall)) < low { pulse.low + 1 } else { 0 };
                        over = pulse.low as usize >= GUARD || pulse.count >= paces.longest;
                        if over {
                            break;
                        }
                    }
                    self.pulse = pulse;
                    if over {
                        return Some(self.end(*from, paces));
                    }
                }
                Phase::Rest => {
                    let low = ceil(self.offset + 0.5 * paces.threshold);
                    let free = rest.iter().position(|pair| i32::from(pair.of(wall)) < low);
                    *from += free.map_or(rest.len(), |free| free + 1);
                    if free.is_some() {
                        self.phase = Phase::Idle;
                        self.since = 0;
                    }
                }
            }
        }
        None
    }

    /// A pulse begins `back` samples before the end of what the ring holds.
    fn begin(&mut self, wall: usize, back: usize, ring: &Ring) {
        self.phase = Phase::Pulse;
        self.pulse = Pulse { above: self.offset as i32, ..Pulse::default() };
        for guard in (1..=GUARD).rev() {
            self.pulse.push(ring.back(back + guard).of(wall));
        }
    }

    /// The pulse has ended with the sample before `end`.
    fn end(&mut self, end: usize, paces: &Paces) -> Finding {
        let pulse = &self.pulse;
        let held = (pulse.low as usize) < GUARD;
        self.phase = if held { Phase::Rest } else { Phase::Idle };
        // What the whole number that was taken off leaves of the offset.
        let fraction = self.offset - pulse.above as f32;
        let count = pulse.count as f32;
        let sum = pulse.sum as f32 - count * fraction;
        let moment = pulse.moment as f32 - 0.5 * count * (count - 1.0) * fraction;
        let ringing = self.since < paces.refractory && pulse.peak as f32 - fraction < paces.ringing * self.last_peak;
        self.since = 0;
        if ringing {
            return Finding::Rung;
        }
        let clipped = (pulse.peak + pulse.above) as f32 >= paces.clip;
        let peak = if clipped { pulse.peak as f32 } else { pulse.top() } - fraction;
        self.last_peak = peak;
        let centre = end as f32 - (count - 1.0 - moment / sum);
        Finding::Ended(Ended { sum, centre, peak, clipped, held })
    }
}
