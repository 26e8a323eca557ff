//! Linear range of the drive's output, and the checks of a demand against it.
//!
//! The output is linear over a part of its converter's span; the calibration gives the displacements of that part. An
//! experiment that demands more is rejected when it is configured and again when it starts ([`DriveRange::allow`]). A
//! demand can still leave the range in a closed loop or between two samples of a record; it is then cut
//! ([`DriveRange::limit`]) and reported as saturation.

/// Advice for a demand that the drive cannot deliver.
const ADVICE: &str = "ask for less: the drive's output is linear only up to there (settings, calibration.drive)";

/// The base displacements that the drive can demand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveRange {
    /// Lowest, m; below 0.
    pub low_m: f32,
    /// Highest, m; above 0.
    pub high_m: f32,
}

/// A value that is above its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AboveLimit {
    /// The parameter's name, with its unit.
    pub parameter: &'static str,
    /// Value of the parameter.
    pub value: f32,
    /// The limit, in the same unit.
    pub limit: f32,
    /// What to do, in words.
    pub advice: &'static str,
}

impl DriveRange {
    /// The largest amplitude about zero, m.
    #[must_use]
    pub fn amplitude_m(&self) -> f32 {
        self.high_m.min(-self.low_m)
    }

    /// The drive nearest to the demand, and whether the demand was cut. A NaN demand gives 0.
    #[must_use]
    pub fn limit(&self, demand_m: f32) -> (f32, bool) {
        let drive_m = if demand_m.is_nan() { 0.0 } else { demand_m.clamp(self.low_m, self.high_m) };
        (drive_m, drive_m != demand_m)
    }

    /// Checks that the drive can deliver an amplitude.
    ///
    /// # Errors
    /// The amplitude is above [`DriveRange::amplitude_m`].
    pub fn allow(&self, parameter: &'static str, amplitude_m: f32) -> Result<(), AboveLimit> {
        let limit = self.amplitude_m();
        if amplitude_m <= limit {
            return Ok(());
        }
        Err(AboveLimit { parameter, value: amplitude_m, limit, advice: ADVICE })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_demand_beyond_either_end_is_clipped_and_reported() {
        let range = DriveRange { low_m: -3e-3, high_m: 4e-3 };
        assert_eq!(range.amplitude_m(), 3e-3);
        for (demand, drive) in [(0.0, 0.0), (4e-3, 4e-3), (-3e-3, -3e-3)] {
            assert_eq!(range.limit(demand), (drive, false));
        }
        for (demand, drive) in [(5e-3, 4e-3), (f32::INFINITY, 4e-3), (-5e-3, -3e-3), (f32::NAN, 0.0)] {
            assert_eq!(range.limit(demand), (drive, true));
        }
        assert!(range.allow("amplitude_m", 3e-3).is_ok());
        let refused = range.allow("amplitude_m", 3.1e-3).unwrap_err();
        assert_eq!((refused.parameter, refused.value, refused.limit), ("amplitude_m", 3.1e-3, 3e-3));
        assert!(range.allow("amplitude_m", f32::NAN).is_err());
    }
}
