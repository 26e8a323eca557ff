//! Reduction of one tick's block of converter counts to a [`Reading`] or a force.

use super::rail::Rail;
use super::rate::SUBSAMPLES;
use super::reading::Reading;
use super::scale::{ForceScale, SLOW_USABLE};

/// Running sum and extremes of one slow channel's counts over a tick.
#[derive(Clone, Copy, Debug)]
pub struct CountedBlock {
    sum: u32,
    low: u16,
    high: u16,
    /// Lowest and highest count among the samples that are not at a rail.
    inside: [u16; 2],
    at_rail: u8,
}

impl Default for CountedBlock {
    fn default() -> Self {
        Self { sum: 0, low: u16::MAX, high: 0, inside: [u16::MAX, 0], at_rail: 0 }
    }
}

impl CountedBlock {
    /// Reduces one channel of a block in which the channels are interleaved.
    #[must_use]
    pub fn of<const CHANNELS: usize>(block: &[[u16; CHANNELS]; SUBSAMPLES], channel: usize) -> Self {
        let mut counted = Self::default();
        block.iter().filter_map(|samples| samples.get(channel)).for_each(|counts| counted.push(*counts));
        counted
    }

    /// Adds the next of [`SUBSAMPLES`] samples.
    #[inline]
    pub fn push(&mut self, counts: u16) {
        self.sum += u32::from(counts);
        self.low = self.low.min(counts);
        self.high = self.high.max(counts);
        if SLOW_USABLE.is_at_rail(counts) {
            self.at_rail += 1;
        } else {
            self.inside = [self.inside[0].min(counts), self.inside[1].max(counts)];
        }
    }

    fn mean(&self) -> f32 {
        self.sum as f32 * (1.0 / SUBSAMPLES as f32)
    }

    fn rail(&self, mean: f32, to_si: impl Fn(u16) -> f32) -> Rail {
        SLOW_USABLE.map(to_si).rail(usize::from(self.at_rail), SUBSAMPLES, mean)
    }

    /// The displacement reading, with zero at `zero_counts` and `per_count` m per count.
    #[must_use]
    pub fn reading(&self, zero_counts: f32, per_count: f32) -> Reading {
        let at = |counts: u16| (f32::from(counts) - zero_counts) * per_count;
        let farthest = |low: u16, high: u16| {
            let (low, high) = (libm::fabsf(at(low)), libm::fabsf(at(high)));
            if low > high { low } else { high }
        };
        let mean_m = (self.mean() - zero_counts) * per_count;
        let [low, high] = self.inside;
        Reading {
            mean_m,
            peak_m: farthest(self.low, self.high),
            inside_peak_m: if low <= high { farthest(low, high) } else { 0.0 },
            still_at: (self.low == self.high).then_some(at(self.low)),
            rail: self.rail(mean_m, at),
        }
    }

    /// The mean force, N, and how much of the block is at a rail.
    #[must_use]
    pub fn force(&self, scale: &ForceScale) -> (f32, Rail) {
        let mean_n = scale.to_force_n(self.mean());
        (mean_n, self.rail(mean_n, |counts| scale.to_force_n(f32::from(counts))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_of_counts_gives_the_reading_of_its_values() {
        let (zero_counts, per_count) = (32_760.0, 2.5e-6);
        let to_si = |counts: u16| (f32::from(counts) - zero_counts) * per_count;
        let usable = SLOW_USABLE.map(to_si);
        for block in [[32_000, 33_000, 40, 65_520, 32_760, 9, 8, 7, 6, 5], [32_761; SUBSAMPLES], [12; SUBSAMPLES]] {
            let mut counted = CountedBlock::default();
            block.iter().for_each(|counts| counted.push(*counts));
            let numbers = Reading::within(&block.map(to_si), &usable);
            let reading = counted.reading(zero_counts, per_count);
            let same = |reading: &Reading| (reading.peak_m, reading.inside_peak_m, reading.still_at);
            assert_eq!(same(&reading), same(&numbers));
            assert_eq!((reading.rail.is_all(), reading.rail), (numbers.rail.is_all(), rail_at(&reading, numbers.rail)));
            // Ten roundings of a sum at half the span, compared with one.
            assert!((reading.mean_m - numbers.mean_m).abs() <= 10.0 * f32::EPSILON * 0.08, "{reading:?}, {numbers:?}");
        }
    }

    /// The same rail with the mean of `reading`: the two means round differently.
    fn rail_at(reading: &Reading, rail: Rail) -> Rail {
        match rail {
            Rail::All { edge, .. } => Rail::All { reading: reading.mean_m, edge },
            other => other,
        }
    }
}
