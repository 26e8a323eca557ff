//! Linear scales between converter counts and SI units.

use super::drive_range::DriveRange;
use super::invalid::{Invalid, require};
use super::rail::Usable;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Largest count on a channel of the slow converter: the sum of sixteen twelve-bit conversions.
pub const SLOW_FULL_SCALE_COUNTS: u16 = 16 * 4_095;

/// Largest count of the drive's output: twelve bits.
pub const OUTPUT_FULL_SCALE_COUNTS: u16 = 4_095;

/// Largest count on a wall's channel: twelve bits.
pub const WALL_FULL_SCALE_COUNTS: u16 = 4095;

/// The usable counts of a slow channel.
pub const SLOW_USABLE: Usable<u16> = Usable::of_counts(SLOW_FULL_SCALE_COUNTS);

/// The usable counts of a wall's channel.
pub const WALL_USABLE: Usable<u16> = Usable::of_counts(WALL_FULL_SCALE_COUNTS);

/// Scale of a displacement channel: m = (counts − zero) · m per count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct DisplacementScale {
    /// m per count; not 0, negative for a sensor that is mounted the other way round.
    pub metres_per_count: f32,
    /// Counts at zero.
    pub zero_counts: f32,
}

impl DisplacementScale {
    /// The scale of a sensor of ± `range_m` over the slow converter's whole span, with zero in its middle.
    #[must_use]
    pub const fn over_whole_span(range_m: f32) -> Self {
        let full = SLOW_FULL_SCALE_COUNTS as f32;
        Self { zero_counts: 0.5 * full, metres_per_count: 2.0 * range_m / full }
    }

    /// Half of the slow converter's whole span, m: a sensor of ± this range fills the span.
    #[must_use]
    pub fn range_m(&self) -> f32 {
        let range_m = 0.5 * f32::from(SLOW_FULL_SCALE_COUNTS) * self.metres_per_count;
        if range_m < 0.0 { -range_m } else { range_m }
    }

    /// The displacement, m.
    #[must_use]
    pub fn to_si(&self, counts: u16) -> f32 {
        (f32::from(counts) - self.zero_counts) * self.metres_per_count
    }

    /// The displacements inside the usable span, m.
    #[must_use]
    pub fn usable_m(&self) -> Usable<f32> {
        SLOW_USABLE.map(|counts| self.to_si(counts))
    }
}

/// Scale of the drive's output: m = (counts − zero) · m per count, over the linear range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct DriveScale {
    /// m per count; not 0, negative for an inverting amplifier.
    pub metres_per_count: f32,
    /// Counts at no drive; inside the linear range.
    pub zero_counts: f32,
    /// Lowest counts at which the output is linear; a whole number, 0 or greater.
    pub linear_low_counts: f32,
    /// Highest counts at which the output is linear; a whole number, at most 4095.
    pub linear_high_counts: f32,
}

impl Default for DriveScale {
    /// Assumed: ±5 mm of the base over the whole span of the output.
    fn default() -> Self {
        Self::assumed(0.005)
    }
}

impl DriveScale {
    /// ± `range_m` over the whole span of a 12-bit output of 0 V to 3.3 V. Its buffer is linear from 0.2 V to 0.2 V
    /// below the supply (STM32G474, data sheet).
    #[must_use]
    pub const fn assumed(range_m: f32) -> Self {
        let full = OUTPUT_FULL_SCALE_COUNTS as f32;
        // The first whole count above 0.2 V, and its mirror image.
        let low = (full * 0.2 / 3.3) as u16 + 1;
        Self {
            metres_per_count: 2.0 * range_m / full,
            zero_counts: 0.5 * full,
            linear_low_counts: low as f32,
            linear_high_counts: (OUTPUT_FULL_SCALE_COUNTS - low) as f32,
        }
    }

    /// The displacements that can be demanded.
    #[must_use]
    pub fn range(&self) -> DriveRange {
        let at = |counts: f32| (counts - self.zero_counts) * self.metres_per_count;
        let (low_m, high_m) = (at(self.linear_low_counts), at(self.linear_high_counts));
        if low_m < high_m { DriveRange { low_m, high_m } } else { DriveRange { low_m: high_m, high_m: low_m } }
    }

    /// The counts nearest to a demand, inside the linear range. A NaN demand gives the counts of zero.
    #[must_use]
    pub fn to_counts(&self, demand_m: f32) -> u16 {
        let demand_m = if demand_m.is_nan() { 0.0 } else { demand_m };
        let counts = demand_m / self.metres_per_count + self.zero_counts + 0.5;
        // The cast drops the fraction and saturates at both ends.
        counts.min(self.linear_high_counts).max(self.linear_low_counts) as u16
    }

    pub(super) fn validate(&self) -> Result<(), Invalid> {
        not_zero("calibration.drive.metres_per_count", self.metres_per_count)?;
        let Self { zero_counts, linear_low_counts, linear_high_counts, .. } = *self;
        let most = f32::from(OUTPUT_FULL_SCALE_COUNTS);
        let is_count = |counts: f32| (0.0..=most).contains(&counts) && f32::from(counts as u16) == counts;
        for (name, counts) in [
            ("calibration.drive.linear_low_counts", linear_low_counts),
            ("calibration.drive.linear_high_counts", linear_high_counts),
        ] {
            require(is_count(counts), name, f64::from(counts), "a whole number from 0 to 4095")?;
        }
        require(
            linear_low_counts < zero_counts && zero_counts < linear_high_counts,
            "calibration.drive.zero_counts",
            f64::from(zero_counts),
            "between linear_low_counts and linear_high_counts",
        )
    }
}

pub(super) fn not_zero(name: &'static str, per_count: f32) -> Result<(), Invalid> {
    let is_scale = per_count.is_finite() && per_count != 0.0;
    require(is_scale, name, f64::from(per_count), "a finite number other than 0")
}

/// Scale of a force channel: N = (counts − zero) · N per count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ForceScale {
    /// N per count; greater than 0.
    pub newtons_per_count: f32,
    /// Counts without a force, 0 to [`WALL_FULL_SCALE_COUNTS`]. Drift from there is followed.
    pub zero_counts: f32,
}

impl Default for ForceScale {
    /// Assumed: a sensor of 460 N on a 12-bit converter, with its zero at a tenth of the span.
    fn default() -> Self {
        Self::assumed()
    }
}

impl ForceScale {
    /// The default scale.
    #[must_use]
    pub const fn assumed() -> Self {
        Self { newtons_per_count: 0.125, zero_counts: 410.0 }
    }

    /// The force, N, for counts or a mean of counts.
    #[must_use]
    pub fn to_force_n(&self, counts: f32) -> f32 {
        (counts - self.zero_counts) * self.newtons_per_count
    }

    /// The counts nearest to a force, clamped to `lowest` to `highest`.
    #[must_use]
    pub fn to_counts(&self, force_n: f32, lowest: u16, highest: u16) -> u16 {
        // A cast drops the fraction and saturates.
        ((force_n / self.newtons_per_count + self.zero_counts + 0.5) as u16).clamp(lowest, highest)
    }
}

#[cfg(test)]
mod tests {
    use super::super::calibration::Calibration;

    #[test]
    fn the_ends_of_the_span_are_the_ends_of_the_range() {
        let laser = Calibration::default().x;
        assert!((laser.to_si(0) + 0.08).abs() < 1e-7);
        assert!((laser.to_si(65_520) - 0.08).abs() < 1e-7);
        assert_eq!(laser.to_si(32_760), 0.0);
    }

    #[test]
    fn zero_drive_is_the_middle_of_the_output() {
        let drive = Calibration::default().drive;
        assert_eq!(drive.to_counts(0.0), 2_048);
        assert_eq!(drive.to_counts(f32::NAN), 2_048);
    }

    /// 0.2 V to 3.1 V of 3.3 V is 248.2 to 3846.8 counts.
    #[test]
    fn a_demand_beyond_the_linear_range_is_clipped_to_its_end() {
        let drive = Calibration::default().drive;
        for (demand_m, counts) in [(1.0, 3_846), (f32::INFINITY, 3_846), (-1.0, 249), (f32::NEG_INFINITY, 249)] {
            assert_eq!(drive.to_counts(demand_m), counts, "{demand_m}");
        }
        // (3846 − 2047.5) counts of 10 mm/4095.
        assert!((drive.range().amplitude_m() - 4.391_941e-3).abs() < 1e-9, "{:?}", drive.range());
    }

    #[test]
    fn an_output_count_is_the_nearest_to_the_demand() {
        let drive = Calibration::default().drive;
        for demand in -43..=43 {
            let demand_m = demand as f32 * 1e-4;
            let put_m = (f32::from(drive.to_counts(demand_m)) - drive.zero_counts) * drive.metres_per_count;
            assert!((put_m - demand_m).abs() <= 0.5001 * drive.metres_per_count, "{demand_m}: {put_m}");
        }
    }
}
