//! Rail detection: which samples lie at an end of a converter's span, and how much of a block does.
//!
//! Every sensor has a live zero: its signal without load lies inside the usable span ([`Usable`]). An open input reads
//! a rail. A sample within [`RAIL_SHARE`] of the span from either end is *at a rail*. The board detects rails in the
//! converter's counts, a simulated plant in its sensors' SI readings; both give the same [`Rail`].

/// Share of a converter's span, at either end, within which a sample is at a rail. 3 mV on an open input is 0.1 %.
pub const RAIL_SHARE: f32 = 0.01;

/// The part of a channel's span between the rails. A sample at or beyond either end is at a rail. `T` is `u16` for
/// counts and `f32` for SI readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usable<T> {
    /// Lower end.
    pub low: T,
    /// Upper end.
    pub high: T,
}

impl<T: Copy + PartialOrd> Usable<T> {
    /// The sample is at a rail. NaN is not at a rail.
    #[inline]
    #[must_use]
    pub fn is_at_rail(&self, sample: T) -> bool {
        sample <= self.low || sample >= self.high
    }
}

impl Usable<u16> {
    /// The usable counts of a converter that gives 0 to `full_scale`.
    #[must_use]
    pub const fn of_counts(full_scale: u16) -> Self {
        let margin = (full_scale as f32 * RAIL_SHARE) as u16;
        Self { low: margin, high: full_scale - margin }
    }

    /// The usable span in the sensor's unit.
    #[must_use]
    pub fn map(&self, to_si: impl Fn(u16) -> f32) -> Usable<f32> {
        let (low, high) = (to_si(self.low), to_si(self.high));
        // A scale may be negative.
        if low < high { Usable { low, high } } else { Usable { low: high, high: low } }
    }
}

impl Usable<f32> {
    /// The usable part of a span from `low` to `high`.
    #[must_use]
    pub fn of_span(low: f32, high: f32) -> Self {
        let margin = RAIL_SHARE * (high - low);
        Self { low: low + margin, high: high - margin }
    }

    /// The largest amplitude about zero that stays inside; negative if zero lies outside.
    #[must_use]
    pub fn amplitude(&self) -> f32 {
        self.high.min(-self.low)
    }

    /// The [`Rail`] of a block: `at_rail` of `samples` samples are at a rail, and `mean` is the block's mean.
    #[must_use]
    pub fn rail(&self, at_rail: usize, samples: usize, mean: f32) -> Rail {
        if at_rail == 0 {
            return Rail::Clear;
        } else if at_rail < samples {
            return Rail::Some;
        }
        let edge = if mean - self.low < self.high - mean { self.low } else { self.high };
        Rail::All { reading: mean, edge }
    }
}

/// How much of a tick's block of samples is at a rail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Rail {
    /// No sample is at a rail.
    #[default]
    Clear,
    /// Some samples are at a rail: the signal is clipped.
    Some,
    /// Every sample is at a rail: there is no signal.
    All {
        /// Mean of the block, in the sensor's unit.
        reading: f32,
        /// The end of the usable span that the reading is beyond.
        edge: f32,
    },
}

impl Rail {
    /// Every sample is at a rail.
    #[must_use]
    pub fn is_all(self) -> bool {
        matches!(self, Self::All { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundredth_of_the_span_at_either_end_counts_as_rail() {
        let counts = Usable::of_counts(4_095);
        assert_eq!((counts.low, counts.high), (40, 4_055));
        assert!(
            counts.is_at_rail(40) && counts.is_at_rail(4_055) && !counts.is_at_rail(41) && !counts.is_at_rail(4_054)
        );
        let metres = Usable::of_span(-0.08, 0.08);
        assert!((metres.low + 0.0784).abs() < 1e-8 && (metres.amplitude() - 0.0784).abs() < 1e-8);
        assert!(metres.is_at_rail(f32::INFINITY) && !metres.is_at_rail(f32::NAN));
        // A sensor with a negative scale.
        let reversed = counts.map(|counts| -f32::from(counts));
        assert_eq!((reversed.low, reversed.high), (-4_055.0, -40.0));
    }

    #[test]
    fn a_block_is_clear_clipped_or_lost() {
        let usable = Usable::of_span(0.0, 100.0);
        assert_eq!(usable.rail(0, 10, 50.0), Rail::Clear);
        assert_eq!(usable.rail(9, 10, 99.0), Rail::Some);
        assert_eq!(usable.rail(10, 10, 0.1), Rail::All { reading: 0.1, edge: 1.0 });
        assert_eq!(usable.rail(10, 10, 99.9), Rail::All { reading: 99.9, edge: 99.0 });
    }
}
