//! Calibration of the rig's channels: the scales between converter counts and SI units.

use super::counted_block::CountedBlock;
use super::invalid::{Invalid, finite, positive, require};
use super::rail::Usable;
use super::rate::{SUBSAMPLES, WALL_SUBSAMPLES};
use super::reading::Readings;
use super::scale::{
    DisplacementScale, DriveScale, ForceScale, SLOW_FULL_SCALE_COUNTS, SLOW_USABLE, WALL_USABLE, not_zero,
};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Channels of the slow converter: x, z and the friction damper's spring.
pub const SLOW_CHANNELS: usize = 3;

/// One tick's samples of the slow channels, oldest first: counts of x, z and the spring.
pub type SlowBlock = [[u16; SLOW_CHANNELS]; SUBSAMPLES];

/// Conversions in one [`SlowBlock`].
pub const SLOW_BLOCK: usize = SLOW_CHANNELS * SUBSAMPLES;

/// Conversions in one tick's block of both wall forces.
pub const WALL_BLOCK: usize = 2 * WALL_SUBSAMPLES;

/// Requires a live zero: a zero reading that differs from what an open input reads.
fn live_zero(name: &'static str, counts: f32, usable: &Usable<u16>) -> Result<(), Invalid> {
    finite(name, f64::from(counts))?;
    let is_live = f32::from(2 * usable.low) <= counts && counts < f32::from(usable.high);
    require(is_live, name, f64::from(counts), "a live zero: 2 % to 99 % of the converter's span")
}

/// The scales of all channels of the rig.
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
    /// Defaults. The two lasers give 0 V to 5 V for ±80 mm (source document), which a divider (assumed exact) maps to
    /// the converter's span. The spring's force sensor gives 0.5 V to 5 V for 0 N to 50 N (assumed), so 0 N is a tenth
    /// of the span: 0.33 V at the pin. The walls use [`ForceScale::assumed`], the drive [`DriveScale::default`].
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
    /// The spring forces inside the usable span, N.
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

    /// Reduces one tick's block to readings in SI units.
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

#[cfg(test)]
mod tests {
    use super::super::rail::Rail;
    use super::*;

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
    fn zero_spring_force_is_at_a_tenth_of_the_span() {
        let rig = Calibration::default();
        let block = |counts: u16| rig.readings(&[[32_760, 32_760, counts]; SUBSAMPLES]);
        assert_eq!((block(6_552).spring_n, block(6_552).spring_rail), (0.0, Rail::Clear));
        assert!((block(36_036).spring_n - 25.0).abs() < 1e-4, "half of the rest of the span");
        // 3 mV on an open input is 60 counts.
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
        // Triple k holds 3k, −(3k + 1) and 3k + 2 counts. Expected: their means over k from 0 to 9, and their farthest
        // values.
        let Readings { x, z, spring_n, .. } = rig.readings(&slow);
        assert_eq!((x.mean_m, x.peak_m), (13.5 * rig.x.metres_per_count, 27.0 * rig.x.metres_per_count));
        assert_eq!((z.mean_m, z.peak_m), (-14.5 * rig.z.metres_per_count, 28.0 * rig.z.metres_per_count));
        assert_eq!(spring_n, 15.5 * rig.spring.newtons_per_count);
    }
}
