//! One wall's channel as [`super::impacts`] follows it: idle, in a pulse, or in a contact that does not end.
//!
//! Samples are the converter's counts and stay whole numbers until a pulse has ended.

/// Samples before the crossing and after the end that belong to a pulse.
pub const GUARD: usize = 4;

/// Most samples in a block.
pub const LONGEST_BLOCK: usize = 64;

/// Readings of both walls at one instant in one word, the wall at −d in its lower half on a board: they are copied and
/// looked at together nearly always. So a converter that takes one wall after the other leaves them in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, align(4))]
pub struct Pair([u16; 2]);

impl Pair {
    /// Counts on the wall at −d and at +d.
    #[must_use]
    pub const fn new(low: u16, high: u16) -> Self {
        Self([low, high])
    }

    /// The reading of wall 0 (at −d) or 1.
    #[must_use]
    #[inline]
    pub fn of(&self, wall: usize) -> u16 {
        self.0[wall & 1]
    }

    /// Both in one word.
    #[inline]
    pub(super) fn both(&self) -> u32 {
        u32::from(self.0[0]) | u32::from(self.0[1]) << 16
    }
}

/// The last samples before a block: the guards of a pulse that begins at its start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Before([Pair; GUARD]);

impl Before {
    pub(super) fn new(resting: u16) -> Self {
        Self([Pair::new(resting, resting); GUARD])
    }

    /// The block is over.
    pub(super) fn push(&mut self, block: &[Pair]) {
        *self = self.up_to(block, block.len());
    }

    /// The guards before sample `at` of the block: all within it, nearly always.
    #[inline(always)]
    fn up_to(&self, block: &[Pair], at: usize) -> Self {
        match block.get(..at).and_then(<[Pair]>::last_chunk) {
            Some(guards) => Self(*guards),
            None => self.partly_from(block, at),
        }
    }

    #[inline(never)]
    fn partly_from(&self, block: &[Pair], at: usize) -> Self {
        Self(core::array::from_fn(|n| {
            // So many samples before `at`.
            let back = GUARD - n;
            let in_block = at.checked_sub(back).and_then(|place| block.get(place));
            *in_block.unwrap_or(&self.0[(GUARD + at).saturating_sub(back).min(GUARD - 1)])
        }))
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
    /// Between these the offset is followed.
    pub offset_low: f32,
    pub offset_high: f32,
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
    /// Samples below half the threshold at its end, at most [`GUARD`].
    low: usize,
}

/// Two sums and the highest of some samples: one pass, few instructions a sample.
struct Totals {
    /// Σ r.
    sum: u32,
    /// Σ k·r.
    moment: u32,
    highest: u16,
    /// The first that is as high.
    highest_at: usize,
}

impl Totals {
    /// Of at most [`LONGEST_BLOCK`] samples: the sums stay within their words.
    #[inline(always)]
    fn of(samples: &[Pair], wall: usize) -> Self {
        const GROUP: usize = 5;
        let (mut sum, mut sums, mut best) = (0u32, 0u32, 0u32);
        // The sums so far add up to Σ (n − k)·r.
        let mut add = |pair: &Pair| {
            let reading = u32::from(pair.of(wall));
            sum = sum.wrapping_add(reading);
            sums = sums.wrapping_add(sum);
            reading
        };
        let (groups, rest) = samples.as_chunks::<GROUP>();
        let mut left = groups.len() as u32 + 1;
        for group in groups {
            let top = group.iter().fold(0, |top, pair| add(pair).max(top));
            // The higher top, of equal ones the one with more groups left behind its own.
            best = best.max((top << 16) + left);
            left -= 1;
        }
        let top = rest.iter().fold(0, |top, pair| add(pair).max(top));
        best = best.max((top << 16) + left);
        let n = samples.len() as u32;
        let highest = (best >> 16) as u16;
        let group = GROUP * (groups.len() + 1).saturating_sub((best & 0xffff) as usize);
        let within = samples[group.min(samples.len())..].iter().position(|pair| pair.of(wall) == highest);
        let highest_at = group + within.unwrap_or(0);
        Self { sum, moment: n.wrapping_mul(sum).wrapping_sub(sums), highest, highest_at }
    }
}

impl Pulse {
    /// Takes the next samples of the wall; the highest reading among them.
    #[inline(always)]
    fn push(&mut self, samples: &[Pair], wall: usize) -> u16 {
        let Some(last) = samples.last() else { return 0 };
        let totals = Totals::of(samples, wall);
        let n = samples.len() as i32;
        let height = |at: usize| samples.get(at).map_or(self.last, |pair| i32::from(pair.of(wall)) - self.above);
        let sum = totals.sum.cast_signed() - n * self.above;
        let moment = totals.moment.cast_signed() - self.above * (n * (n - 1) / 2);
        let highest = i32::from(totals.highest) - self.above;
        if highest > self.peak {
            let at = totals.highest_at;
            self.peak = highest;
            // Before the first sample comes the last one of the samples before these.
            self.before_peak = height(at.wrapping_sub(1));
            self.peak_is_last = at + 1 == samples.len();
            self.after_peak = if self.peak_is_last { highest } else { height(at + 1) };
        } else if self.peak_is_last {
            self.after_peak = height(0);
            self.peak_is_last = false;
        }
        self.sum = self.sum.wrapping_add(sum);
        self.moment += i64::from(moment) + i64::from(self.count) * i64::from(sum);
        self.last = i32::from(last.of(wall)) - self.above;
        self.count += samples.len() as u32;
        totals.highest
    }

    /// How many of `rest` belong to it: up to the sample with which [`GUARD`] in a row were below `low`, and whether there
    /// is one. Looks at every fourth sample where the force is high: none of the four before it can be the last.
    fn extent(&mut self, rest: &[Pair], wall: usize, low: i32) -> (usize, bool) {
        let is_high = |pair: &Pair| i32::from(pair.of(wall)) >= low;
        // Where it ends if no sample before is high; the low ones that the samples before these ended with count.
        let mut end = GUARD - self.low;
        loop {
            while rest.get(end - 1).is_some_and(is_high) {
                end += GUARD;
            }
            let from = end.saturating_sub(GUARD);
            let Some(before) = rest.get(from..end).map(|run| &run[..run.len() - 1]) else { break };
            if let Some(high) = before.iter().rposition(is_high) {
                end = from + high + 1 + GUARD;
            } else {
                self.low = GUARD;
                return (end, true);
            }
        }
        let low_ones = rest.iter().rev().take(GUARD).take_while(|pair| !is_high(pair)).count();
        self.low = if low_ones == rest.len() { self.low + low_ones } else { low_ones };
        (rest.len(), false)
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

/// A pulse that is over and has not been looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Over {
    pulse: Pulse,
    /// Samples from the block's start to its end.
    end: usize,
    /// Samples between the pulse before it and this one.
    since: u32,
}

/// What a channel comes upon in a block.
#[derive(Clone, Copy, Debug)]
pub(super) enum Finding {
    /// A pulse begins with this sample.
    Began(usize),
    /// A pulse is over: [`Channel::look_at`] says what it was, before the channel takes idle samples.
    Over(Over),
}

/// One wall's channel.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    offset: f32,
    /// Mean of idle samples towards which the offset may not be followed further.
    drifted_to: Option<f32>,
    /// Readings from here on begin a pulse.
    limit: u16,
    phase: Phase,
    pulse: Pulse,
    /// Samples since the last pulse ended.
    since: u32,
    last_peak: f32,
    /// Highest reading in the present block while something touches.
    highest: u16,
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
            drifted_to: None,
            limit: limit(offset, paces),
            phase: Phase::Idle,
            pulse: Pulse::default(),
            since: u32::MAX,
            last_peak: 0.0,
            highest: 0,
        }
    }

    /// Forgets a pulse in progress.
    pub(super) fn reset(&mut self) {
        self.phase = Phase::Idle;
        self.since = u32::MAX;
    }

    /// The highest reading since it was last asked, above the offset: 0 if nothing touched.
    pub(super) fn take_highest(&mut self) -> f32 {
        match core::mem::take(&mut self.highest) {
            0 => 0.0,
            highest => f32::from(highest) - self.offset,
        }
    }

    /// The mean of idle samples, counts, where the offset may not be followed so far.
    pub(super) fn drifted_to(&self) -> Option<f32> {
        self.drifted_to
    }

    /// Nothing is in progress.
    pub(super) fn is_idle(&self) -> bool {
        self.phase == Phase::Idle
    }

    /// The reading from which on a pulse begins.
    pub(super) fn limit(&self) -> u16 {
        self.limit
    }

    /// Takes `count` idle samples of this mean.
    pub(super) fn idle(&mut self, mean: f32, count: usize, paces: &Paces) {
        self.since = self.since.saturating_add(count as u32);
        let followed = self.offset + (mean - self.offset) * (count as f32 * paces.offset_gain);
        self.offset = followed.max(paces.offset_low).min(paces.offset_high);
        self.drifted_to = (self.offset != followed).then_some(mean);
        self.limit = limit(self.offset, paces);
    }

    /// Goes on from sample `from` of the block to the next finding.
    pub(super) fn go_on(
        &mut self,
        wall: usize,
        block: &[Pair],
        from: &mut usize,
        before: &Before,
        paces: &Paces,
    ) -> Option<Finding> {
        while *from < block.len() {
            let rest = &block[*from..];
            match self.phase {
                Phase::Idle => {
                    let crossing = rest.iter().position(|pair| pair.of(wall) >= self.limit);
                    let quiet = crossing.unwrap_or(rest.len());
                    // The offset is followed in blocks without a pulse.
                    self.since = self.since.saturating_add(quiet as u32);
                    *from += quiet;
                    crossing?;
                    self.begin(wall, &before.up_to(block, *from));
                    return Some(Finding::Began(*from));
                }
                Phase::Pulse => {
                    let low = ceil(self.offset + 0.5 * paces.threshold);
                    let room = (paces.longest.saturating_sub(self.pulse.count) as usize).clamp(1, rest.len());
                    let (length, mut over) = self.pulse.extent(&rest[..room], wall, low);
                    let top = self.pulse.push(&rest[..length], wall);
                    self.highest = self.highest.max(top);
                    *from += length;
                    over |= self.pulse.count >= paces.longest;
                    if over {
                        return Some(Finding::Over(self.end(*from)));
                    }
                }
                Phase::Rest => {
                    let low = ceil(self.offset + 0.5 * paces.threshold);
                    let free = rest.iter().position(|pair| i32::from(pair.of(wall)) < low);
                    let length = free.map_or(rest.len(), |free| free + 1);
                    self.highest = self.highest.max(Totals::of(&rest[..length], wall).highest);
                    *from += length;
                    if free.is_some() {
                        self.phase = Phase::Idle;
                        self.since = 0;
                    }
                }
            }
        }
        None
    }

    /// A pulse begins after these samples. They are below what it begins with, so none of them is its peak.
    fn begin(&mut self, wall: usize, guards: &Before) {
        self.phase = Phase::Pulse;
        let above = self.offset as i32;
        let mut pulse = Pulse { above, count: GUARD as u32, ..Pulse::default() };
        for (n, pair) in guards.0.iter().enumerate() {
            pulse.last = i32::from(pair.of(wall)) - above;
            pulse.sum += pulse.last;
            pulse.moment += i64::from(n as i32 * pulse.last);
        }
        self.pulse = pulse;
    }

    /// The pulse has ended with the sample before `end`.
    fn end(&mut self, end: usize) -> Over {
        let held = self.pulse.low < GUARD;
        self.phase = if held { Phase::Rest } else { Phase::Idle };
        Over { pulse: self.pulse, end, since: core::mem::take(&mut self.since) }
    }

    /// What a pulse was that is over; none for ringing.
    #[inline(never)]
    pub(super) fn look_at(&mut self, over: &Over, paces: &Paces) -> Option<Ended> {
        let Over { pulse, end, since } = over;
        // What the whole number that was taken off leaves of the offset.
        let fraction = self.offset - pulse.above as f32;
        let count = pulse.count as f32;
        let sum = pulse.sum as f32 - count * fraction;
        let moment = pulse.moment as f32 - 0.5 * count * (count - 1.0) * fraction;
        if *since < paces.refractory && pulse.peak as f32 - fraction < paces.ringing * self.last_peak {
            return None;
        }
        let clipped = (pulse.peak + pulse.above) as f32 >= paces.clip;
        let peak = if clipped { pulse.peak as f32 } else { pulse.top() } - fraction;
        self.last_peak = peak;
        let centre = *end as f32 - (count - 1.0 - moment / sum);
        Some(Ended { sum, centre, peak, clipped, held: pulse.low < GUARD })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a look at one sample after the other makes of them.
    fn one_by_one(readings: &[u16], above: i32, low: i32) -> Option<(usize, Pulse)> {
        let mut pulse = Pulse { above, ..Pulse::default() };
        for (n, reading) in readings.iter().enumerate() {
            let height = i32::from(*reading) - above;
            pulse.sum += height;
            pulse.moment += i64::from(height) * n as i64;
            if pulse.peak_is_last {
                (pulse.after_peak, pulse.peak_is_last) = (height, false);
            }
            if height > pulse.peak {
                (pulse.peak, pulse.before_peak, pulse.peak_is_last) = (height, pulse.last, true);
            }
            pulse.last = height;
            pulse.count += 1;
            pulse.low = if i32::from(*reading) < low { pulse.low + 1 } else { 0 };
            if pulse.low == GUARD {
                return Some((n + 1, pulse));
            }
        }
        None
    }

    #[test]
    fn a_pulse_is_the_same_however_its_samples_are_cut_into_blocks() {
        let mut random = 7u32;
        let mut next = |most: u32| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) % most
        };
        let (mut ended, above, low) = (0, 400, 410);
        for round in 0..2000 {
            let wall = round % 2;
            let length = 5 + next(300) as usize;
            // Above the middle it stays mostly, below it falls, so ends come early and late.
            let readings: heapless::Vec<u16, 320> =
                (0..length).map(|_| if next(10) < 4 { 380 + next(29) } else { 380 + next(3700) } as u16).collect();
            let pairs: heapless::Vec<Pair, 320> =
                readings.iter().map(|r| if wall == 0 { Pair::new(*r, 4095) } else { Pair::new(4095, *r) }).collect();
            let (mut pulse, mut at, mut over) = (Pulse { above, ..Pulse::default() }, 0, false);
            while at < length && !over {
                let block = &pairs[at..(at + 1 + next(LONGEST_BLOCK as u32) as usize).min(length)];
                let extent;
                (extent, over) = pulse.extent(block, wall, low);
                let top = pulse.push(&block[..extent], wall);
                assert_eq!(Some(top), block[..extent].iter().map(|pair| pair.of(wall)).max());
                at += extent;
            }
            let expected = one_by_one(&readings, above, low);
            assert_eq!(over, expected.is_some());
            let Some((end, mut expected)) = expected else { continue };
            if expected.peak_is_last {
                // Nothing came after it: taken as level.
                expected.after_peak = expected.peak;
            }
            ended += 1;
            assert_eq!(at, end);
            let all = |p: &Pulse| (p.sum, p.moment, p.count, p.peak, p.before_peak, p.after_peak, p.last, p.low);
            assert_eq!(all(&pulse), all(&expected));
        }
        assert!(ended > 500, "{ended} ended");
    }
}
