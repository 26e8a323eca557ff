//! What the converters' counts mean on the rig, in one place: straight lines, checked here, used by the board.
//!
//! The scales are stated assumptions until a rig is calibrated: nobody has measured them.

use damprig_core::rig::{SUBSAMPLES, Sensors};

/// A displacement channel: metres = (counts − zero) · metres per count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channel {
    /// Counts at zero displacement.
    pub zero_counts: f32,
    /// m per count; greater than 0.
    pub metres_per_count: f32,
}

impl Channel {
    /// A sensor of ± `range_m` over the converter's whole span, zero in its middle.
    #[must_use]
    pub const fn over_whole_span(range_m: f32, full_scale_counts: u16) -> Self {
        let full = full_scale_counts as f32;
        Self { zero_counts: 0.5 * full, metres_per_count: 2.0 * range_m / full }
    }

    /// The displacement, m.
    #[must_use]
    pub fn to_m(&self, counts: u16) -> f32 {
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Structure displacement x.
    pub x: Channel,
    /// Base displacement z.
    pub z: Channel,
    /// Demanded base displacement.
    pub drive: Channel,
}

impl Calibration {
    /// The two lasers: ±80 mm as 0 V to 5 V (source document), which a divider (assumed exact) brings to the
    /// converter's span. The drive: ±`drive_range_m` over the output's span (assumed).
    #[must_use]
    pub const fn assumed(input_full_scale_counts: u16, output_full_scale_counts: u16, drive_range_m: f32) -> Self {
        let laser = Channel::over_whole_span(0.08, input_full_scale_counts);
        Self { x: laser, z: laser, drive: Channel::over_whole_span(drive_range_m, output_full_scale_counts) }
    }

    /// A tick's block as the converter leaves it (x, z, x, z, … oldest first) in SI units.
    #[must_use]
    pub fn sensors(&self, block: &[u16; 2 * SUBSAMPLES]) -> Sensors {
        let mut sensors = Sensors::default();
        for (n, pair) in block.as_chunks::<2>().0.iter().enumerate() {
            sensors.x_m[n] = self.x.to_m(pair[0]);
            sensors.z_m[n] = self.z.to_m(pair[1]);
        }
        sensors
    }
}

/// A block that could not be taken: not numbers, so an experiment under way ends with a sensor fault.
pub const LOST_BLOCK: Sensors = Sensors { x_m: [f32::NAN; SUBSAMPLES], z_m: [f32::NAN; SUBSAMPLES] };

#[cfg(test)]
mod tests {
    use super::*;

    const RIG: Calibration = Calibration::assumed(65_520, 4_095, 0.005);

    #[test]
    fn the_ends_of_the_span_are_the_ends_of_the_range() {
        assert!((RIG.x.to_m(0) + 0.08).abs() < 1e-7);
        assert!((RIG.x.to_m(65_520) - 0.08).abs() < 1e-7);
        assert_eq!(RIG.x.to_m(32_760), 0.0);
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
            let error_m = RIG.drive.to_m(RIG.drive.to_counts(demand_m, 4_095)) - demand_m;
            assert!(error_m.abs() <= 0.5001 * RIG.drive.metres_per_count, "{demand_m}: {error_m}");
        }
    }

    #[test]
    fn the_converters_pairs_go_to_their_channels_in_order() {
        let block = core::array::from_fn(|n| if n % 2 == 0 { 32_760 + n as u16 } else { 32_760 - n as u16 });
        let sensors = RIG.sensors(&block);
        for n in 0..SUBSAMPLES {
            assert_eq!(sensors.x_m[n], 2.0 * n as f32 * RIG.x.metres_per_count);
            assert_eq!(sensors.z_m[n], -(2.0 * n as f32 + 1.0) * RIG.z.metres_per_count);
        }
    }

    #[test]
    fn a_lost_block_is_no_number() {
        assert!(!LOST_BLOCK.all_finite());
    }
}
