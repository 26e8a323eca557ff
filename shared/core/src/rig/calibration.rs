//! What the converters' counts mean on the rig, in one place: straight lines, checked here, used by the board.
//!
//! The scales are stated assumptions until a rig is calibrated: nobody has measured them. They are part of the rig's
//! [`crate::settings`]. The samples of the wall forces stay counts: their [`ForceScale`] is the impact meter's.

use super::{CountedBlock, Reading, Readings, SUBSAMPLES, Sensors, WALL_SUBSAMPLES};
use crate::measure::impacts::ForceScale;
use crate::model::{Invalid, finite, positive, require};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Channels of the slow converter: x, z and the friction damper's spring.
pub const SLOW_CHANNELS: usize = 3;

/// A tick's block of the slow channels, oldest first: counts of x, z and the spring.
pub type SlowBlock = [[u16; SLOW_CHANNELS]; SUBSAMPLES];

/// Its conversions.
pub const SLOW_BLOCK: usize = SLOW_CHANNELS * SUBSAMPLES;

/// Conversions of a tick's block of both wall forces.
pub const WALL_BLOCK: usize = 2 * WALL_SUBSAMPLES;

/// What a count on a displacement's channel means: m = (counts − zero) · m per count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct DisplacementScale {
    /// m per count; not 0, negative for a sensor that looks the other way.
    pub metres_per_count: f32,
    /// Counts at zero.
    pub zero_counts: f32,
}

impl DisplacementScale {
    /// A sensor of ± `range_m` over the converter's whole span, zero in its middle.
    #[must_use]
    pub const fn over_whole_span(range_m: f32, full_scale_counts: u16) -> Self {
        let full = full_scale_counts as f32;
        Self { zero_counts: 0.5 * full, metres_per_count: 2.0 * range_m / full }
    }

    /// The displacement, m.
    #[must_use]
    pub fn to_si(&self, counts: u16) -> f32 {
        (f32::from(counts) - self.zero_counts) * self.metres_per_count
    }

    /// The counts nearest to a displacement, at most `most`; what lies beyond either end stays there.
    /// The zero's for a value that is not a number.
    #[must_use]
    pub fn to_counts(&self, displacement_m: f32, most: u16) -> u16 {
        let displacement_m = if displacement_m.is_nan() { 0.0 } else { displacement_m };
        // The cast drops the fraction and saturates at both ends.
        let counts = (displacement_m / self.metres_per_count + self.zero_counts + 0.5) as u16;
        counts.min(most)
    }
}

/// The rig's channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Calibration {
    /// Structure displacement x.
    pub x: DisplacementScale,
    /// Base displacement z.
    pub z: DisplacementScale,
    /// Force in the friction damper's spring.
    pub spring: ForceScale,
    /// Forces on both walls.
    pub walls: ForceScale,
    /// Demanded base displacement.
    pub drive: DisplacementScale,
}

impl Calibration {
    /// The two lasers: ±80 mm as 0 V to 5 V (source document), which a divider (assumed exact) brings to the
    /// converter's span. The spring's force sensor: 0 V to 5 V for 0 to 50 N (assumed). The walls' as
    /// [`ForceScale::assumed`]. The drive: ±`drive_range_m` over the output's span (assumed).
    #[must_use]
    pub const fn assumed(input_full_scale_counts: u16, output_full_scale_counts: u16, drive_range_m: f32) -> Self {
        let laser = DisplacementScale::over_whole_span(0.08, input_full_scale_counts);
        Self {
            x: laser,
            z: laser,
            spring: ForceScale { newtons_per_count: 50.0 / input_full_scale_counts as f32, zero_counts: 0.0 },
            walls: ForceScale::assumed(),
            drive: DisplacementScale::over_whole_span(drive_range_m, output_full_scale_counts),
        }
    }

    /// Checks every value but the walls', which the impact meter looks at.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        for (names, scale) in [
            (["calibration.x.metres_per_count", "calibration.x.zero_counts"], &self.x),
            (["calibration.z.metres_per_count", "calibration.z.zero_counts"], &self.z),
            (["calibration.drive.metres_per_count", "calibration.drive.zero_counts"], &self.drive),
        ] {
            let per_count = scale.metres_per_count;
            let is_scale = per_count.is_finite() && per_count != 0.0;
            require(is_scale, names[0], f64::from(per_count), "a finite number other than 0")?;
            finite(names[1], f64::from(scale.zero_counts))?;
        }
        positive("calibration.spring.newtons_per_count", f64::from(self.spring.newtons_per_count))?;
        finite("calibration.spring.zero_counts", f64::from(self.spring.zero_counts))
    }

    /// What a tick's block comes to.
    #[must_use]
    pub fn readings(&self, slow: &SlowBlock) -> Readings {
        let [x, z] = [0, 1].map(|channel| CountedBlock::of(slow, channel));
        let mut spring = 0;
        for triple in slow {
            spring += u32::from(triple[2]);
        }
        Readings {
            x: x.reading(self.x.zero_counts, self.x.metres_per_count),
            z: z.reading(self.z.zero_counts, self.z.metres_per_count),
            spring_n: self.spring.to_force_n(spring as f32 * (1.0 / SUBSAMPLES as f32)),
        }
    }
}

/// A block that could not be taken: not numbers, so an experiment under way ends with a sensor fault.
#[must_use]
pub fn lost_block() -> Sensors {
    let none = Reading { mean_m: f32::NAN, peak_m: f32::NAN, still_at: None };
    Sensors { readings: Readings { x: none, z: none, spring_n: 0.0 }, ..Sensors::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIG: Calibration = Calibration::assumed(65_520, 4_095, 0.005);

    #[test]
    fn the_ends_of_the_span_are_the_ends_of_the_range() {
        assert!((RIG.x.to_si(0) + 0.08).abs() < 1e-7);
        assert!((RIG.x.to_si(65_520) - 0.08).abs() < 1e-7);
        assert_eq!(RIG.x.to_si(32_760), 0.0);
    }

    #[test]
    fn no_drive_is_the_middle_of_the_output() {
        assert_eq!(RIG.drive.to_counts(0.0, 4_095), 2_048);
        assert_eq!(RIG.drive.to_counts(f32::NAN, 4_095), 2_048);
    }

    #[test]
    fn a_demand_beyond_the_output_stays_at_its_end() {
        for (demand_m, counts) in [(1.0, 4_095), (f32::INFINITY, 4_095), (-1.0, 0), (f32::NEG_INFINITY, 0)] {
            assert_eq!(RIG.drive.to_counts(demand_m, 4_095), counts, "{demand_m}");
        }
    }

    #[test]
    fn an_output_count_is_the_nearest_to_the_demand() {
        for demand in -49..=49 {
            let demand_m = demand as f32 * 1e-4;
            let error_m = RIG.drive.to_si(RIG.drive.to_counts(demand_m, 4_095)) - demand_m;
            assert!(error_m.abs() <= 0.5001 * RIG.drive.metres_per_count, "{demand_m}: {error_m}");
        }
    }

    #[test]
    fn the_converters_samples_go_to_their_channels_in_order() {
        let slow = core::array::from_fn(|k| [32_760 + 3 * k as u16, 32_760 - (3 * k as u16 + 1), 3 * k as u16 + 2]);
        // Triple k holds 3k, −(3k + 1) and 3k + 2 counts: their means over k from 0 to 9, and their farthest.
        let Readings { x, z, spring_n } = RIG.readings(&slow);
        assert_eq!((x.mean_m, x.peak_m), (13.5 * RIG.x.metres_per_count, 27.0 * RIG.x.metres_per_count));
        assert_eq!((z.mean_m, z.peak_m), (-14.5 * RIG.z.metres_per_count, 28.0 * RIG.z.metres_per_count));
        assert_eq!(spring_n, 15.5 * RIG.spring.newtons_per_count);
    }

    #[test]
    fn a_lost_block_is_no_number() {
        let readings = lost_block().readings;
        assert!(readings.x.peak_m.is_nan() && readings.z.mean_m.is_nan());
    }
}
