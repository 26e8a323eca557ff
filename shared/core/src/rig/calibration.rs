//! What the converters' counts mean on the rig, in one place: straight lines, checked here, used by the board.
//!
//! The scales are assumptions until a rig is calibrated: nobody has measured them. They are part of the rig's
//! [`crate::settings`]. The samples of the wall forces stay counts: their [`ForceScale`] is the impact meter's.
//! Every sensor has a live zero: its counts without a load lie inside the usable span ([`Usable`]), so that an open input is
//! no measurement.

use super::channels::{Rail, Usable};
use super::{CountedBlock, Reading, Readings, SUBSAMPLES, Sensors, WALL_SUBSAMPLES};
use crate::control::drive::DriveRange;
use crate::measure::impacts::{ForceScale, MOST_COUNTS};
use crate::model::{Invalid, finite, positive, require};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Largest count on a channel of the slow converter: sixteen conversions of twelve bits, added up.
pub const SLOW_FULL_SCALE_COUNTS: u16 = 16 * 4_095;

/// Largest count of the drive's output: twelve bits.
pub const OUTPUT_FULL_SCALE_COUNTS: u16 = 4_095;

/// The usable counts of a slow channel.
pub const SLOW_USABLE: Usable<u16> = Usable::of_counts(SLOW_FULL_SCALE_COUNTS);

/// The usable counts of a wall's channel.
pub const WALL_USABLE: Usable<u16> = Usable::of_counts(MOST_COUNTS);

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
    /// A sensor of ± `range_m` over the slow converter's whole span, zero in its middle.
    #[must_use]
    pub const fn over_whole_span(range_m: f32) -> Self {
        let full = SLOW_FULL_SCALE_COUNTS as f32;
        Self { zero_counts: 0.5 * full, metres_per_count: 2.0 * range_m / full }
    }

    /// Half of what the slow converter's whole span means, m: a sensor of ± this fills the span.
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

    /// The displacements between the rails, m.
    #[must_use]
    pub fn usable_m(&self) -> Usable<f32> {
        SLOW_USABLE.map(|counts| self.to_si(counts))
    }
}

/// What a count of the drive's output means: m = (counts − zero) · m per count, where the output is linear.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct DriveScale {
    /// m per count; not 0, negative for an amplifier that looks the other way.
    pub metres_per_count: f32,
    /// Counts at no drive; inside the linear range.
    pub zero_counts: f32,
    /// Lowest counts at which the output is linear; a whole number, 0 or greater.
    pub linear_low_counts: f32,
    /// Highest counts at which the output is linear; a whole number, at most 4095.
    pub linear_high_counts: f32,
}

impl Default for DriveScale {
    /// Assumed: ±5 mm of the base over the output's span.
    fn default() -> Self {
        Self::assumed(0.005)
    }
}

impl DriveScale {
    /// ± `range_m` over the whole span of a 12-bit output of 0 V to 3.3 V, whose buffer is linear from 0.2 V to 0.2 V below the
    /// supply (STM32G474, data sheet).
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

    /// The counts nearest to a demand, inside the linear range; the zero's for a demand that is not a number.
    #[must_use]
    pub fn to_counts(&self, demand_m: f32) -> u16 {
        let demand_m = if demand_m.is_nan() { 0.0 } else { demand_m };
        let counts = demand_m / self.metres_per_count + self.zero_counts + 0.5;
        // The cast drops the fraction and saturates at both ends.
        counts.min(self.linear_high_counts).max(self.linear_low_counts) as u16
    }

    fn validate(&self) -> Result<(), Invalid> {
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

fn not_zero(name: &'static str, per_count: f32) -> Result<(), Invalid> {
    let is_scale = per_count.is_finite() && per_count != 0.0;
    require(is_scale, name, f64::from(per_count), "a finite number other than 0")
}

/// A zero that an open input does not read.
fn live_zero(name: &'static str, counts: f32, usable: &Usable<u16>) -> Result<(), Invalid> {
    finite(name, f64::from(counts))?;
    let is_live = f32::from(2 * usable.low) <= counts && counts < f32::from(usable.high);
    require(is_live, name, f64::from(counts), "a live zero: 2 % to 99 % of the converter's span")
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
    pub drive: DriveScale,
}

impl Default for Calibration {
    /// The two lasers: ±80 mm as 0 V to 5 V (source document), which a divider (assumed exact) brings to the
    /// converter's span. The spring's force sensor: 0.5 V to 5 V for 0 N to 50 N (assumed), so 0 N is a tenth of the span: 0.33 V at
    /// the pin. The walls' as [`ForceScale::assumed`]. The drive as [`DriveScale::default`].
    fn default() -> Self {
        let laser = DisplacementScale::over_whole_span(0.08);
        let full = f32::from(SLOW_FULL_SCALE_COUNTS);
        Self {
            x: laser,
            z: laser,
            spring: ForceScale { newtons_per_count: 50.0 / (0.9 * full), zero_counts: 0.1 * full },
            walls: ForceScale::assumed(),
            drive: DriveScale::default(),
        }
    }
}

impl Calibration {
    /// The spring forces between the rails, N.
    #[must_use]
    pub fn usable_spring_n(&self) -> Usable<f32> {
        SLOW_USABLE.map(|counts| self.spring.to_force_n(f32::from(counts)))
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        for (names, scale) in [
            (["calibration.x.metres_per_count", "calibration.x.zero_counts"], &self.x),
            (["calibration.z.metres_per_count", "calibration.z.zero_counts"], &self.z),
        ] {
            not_zero(names[0], scale.metres_per_count)?;
            live_zero(names[1], scale.zero_counts, &SLOW_USABLE)?;
        }
        for (names, scale, usable) in [
            (["calibration.spring.newtons_per_count", "calibration.spring.zero_counts"], &self.spring, SLOW_USABLE),
            (["calibration.walls.newtons_per_count", "calibration.walls.zero_counts"], &self.walls, WALL_USABLE),
        ] {
            positive(names[0], f64::from(scale.newtons_per_count))?;
            live_zero(names[1], scale.zero_counts, &usable)?;
        }
        self.drive.validate()
    }

    /// What a tick's block comes to.
    #[must_use]
    pub fn readings(&self, slow: &SlowBlock) -> Readings {
        let [x, z, spring] = [0, 1, 2].map(|channel| CountedBlock::of(slow, channel));
        let (spring_n, spring_rail) = spring.force(&self.spring);
        Readings {
            x: x.reading(self.x.zero_counts, self.x.metres_per_count),
            z: z.reading(self.z.zero_counts, self.z.metres_per_count),
            spring_n,
            spring_rail,
        }
    }
}

/// A block that could not be taken: not numbers, so an experiment under way ends with a sensor fault.
#[must_use]
pub fn lost_block() -> Sensors {
    let none = Reading { mean_m: f32::NAN, peak_m: f32::NAN, ..Reading::default() };
    Sensors { readings: Readings { x: none, z: none, spring_n: 0.0, spring_rail: Rail::Clear }, ..Sensors::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_the_span_are_the_ends_of_the_range() {
        let laser = Calibration::default().x;
        assert!((laser.to_si(0) + 0.08).abs() < 1e-7);
        assert!((laser.to_si(65_520) - 0.08).abs() < 1e-7);
        assert_eq!(laser.to_si(32_760), 0.0);
    }

    #[test]
    fn no_drive_is_the_middle_of_the_output() {
        let drive = Calibration::default().drive;
        assert_eq!(drive.to_counts(0.0), 2_048);
        assert_eq!(drive.to_counts(f32::NAN), 2_048);
    }

    /// 0.2 V to 3.1 V of 3.3 V are 248.2 to 3846.8 counts.
    #[test]
    fn a_demand_beyond_the_linear_range_stays_at_its_end() {
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

    #[test]
    fn a_dead_zero_is_refused_by_name() {
        let good = Calibration::default();
        assert!(good.validate().is_ok());
        let spring = ForceScale { zero_counts: 0.0, ..good.spring };
        let drive = DriveScale { zero_counts: 200.0, ..good.drive };
        let far = DriveScale { linear_high_counts: 4_096.0, ..good.drive };
        for (bad, name) in [
            (Calibration { spring, ..good }, "calibration.spring.zero_counts"),
            (
                Calibration { walls: ForceScale { zero_counts: 41.0, ..good.walls }, ..good },
                "calibration.walls.zero_counts",
            ),
            (
                Calibration { x: DisplacementScale { zero_counts: 65_000.0, ..good.x }, ..good },
                "calibration.x.zero_counts",
            ),
            (Calibration { drive, ..good }, "calibration.drive.zero_counts"),
            (Calibration { drive: far, ..good }, "calibration.drive.linear_high_counts"),
        ] {
            assert_eq!(bad.validate().unwrap_err().parameter, name);
        }
    }

    #[test]
    fn no_spring_force_is_a_tenth_of_the_span() {
        let rig = Calibration::default();
        let block = |counts: u16| rig.readings(&[[32_760, 32_760, counts]; SUBSAMPLES]);
        assert_eq!((block(6_552).spring_n, block(6_552).spring_rail), (0.0, Rail::Clear));
        assert!((block(36_036).spring_n - 25.0).abs() < 1e-4, "half of the rest of the span");
        // 3 mV on an open input are 60 counts.
        let Rail::All { reading, edge } = block(60).spring_rail else { panic!("an open input is no force") };
        assert!((reading + 5.505).abs() < 1e-3 && (edge + 5.0).abs() < 1e-3, "{reading} {edge}");
    }

    #[test]
    fn a_rail_is_found_in_the_counts_of_every_slow_channel() {
        let (rig, quiet) = (Calibration::default(), [[32_760, 32_760, 6_552]; SUBSAMPLES]);
        for (channel, counts) in [(0, 0), (0, 65_520), (1, 655), (1, 64_865), (2, 655), (2, 64_865)] {
            let mut some = quiet;
            some[3][channel] = counts;
            let all = quiet.map(|mut triple| {
                triple[channel] = counts;
                triple
            });
            for (block, is_all) in [(some, false), (all, true)] {
                let Readings { x, z, spring_rail, .. } = rig.readings(&block);
                for (place, rail) in [x.rail, z.rail, spring_rail].into_iter().enumerate() {
                    let expected = (place == channel, place == channel && is_all);
                    assert_eq!((rail != Rail::Clear, rail.is_all()), expected, "{channel} at {counts}");
                }
            }
        }
        let inside = [[656, 64_864, 64_864]; SUBSAMPLES];
        let Readings { x, z, spring_rail, .. } = rig.readings(&inside);
        assert_eq!([x.rail, z.rail, spring_rail], [Rail::Clear; 3]);
    }

    #[test]
    fn the_converters_samples_go_to_their_channels_in_order() {
        let rig = Calibration::default();
        let slow =
            core::array::from_fn(|k| [32_760 + 3 * k as u16, 32_760 - (3 * k as u16 + 1), 6_552 + 3 * k as u16 + 2]);
        // Triple k holds 3k, −(3k + 1) and 3k + 2 counts: their means over k from 0 to 9, and their farthest.
        let Readings { x, z, spring_n, .. } = rig.readings(&slow);
        assert_eq!((x.mean_m, x.peak_m), (13.5 * rig.x.metres_per_count, 27.0 * rig.x.metres_per_count));
        assert_eq!((z.mean_m, z.peak_m), (-14.5 * rig.z.metres_per_count, 28.0 * rig.z.metres_per_count));
        assert_eq!(spring_n, 15.5 * rig.spring.newtons_per_count);
    }

    #[test]
    fn a_lost_block_is_no_number() {
        let readings = lost_block().readings;
        assert!(readings.x.peak_m.is_nan() && readings.z.mean_m.is_nan());
    }
}
