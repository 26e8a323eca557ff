//! A calibration bench around the simulated sensors: true scales that differ from the board's settings, targets at known
//! positions in front of the displacement sensors, weights on the force sensor.
//!
//! With true scales a tick's samples pass through the converters' counts, as on a real board: the truth makes counts of
//! the plant's SI values, the board's settings make readings of the counts.

use damprig_core::io::{
    Calibration, DisplacementScale, DriveScale, ForceScale, Invalid, OUTPUT_FULL_SCALE_COUNTS, SLOW_FULL_SCALE_COUNTS,
    SUBSAMPLES, SlowBlock, finite, positive, require,
};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The true scales of sensors, converters and drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct TrueScales {
    /// Structure displacement x.
    pub x: DisplacementScale,
    /// Base displacement z.
    pub z: DisplacementScale,
    /// Force in the friction damper's spring.
    pub spring: ForceScale,
    /// Force on the wall at −d and at +d. They replace the scale of the wall sensors.
    pub walls: [ForceScale; 2],
    /// Base displacement per count of the drive's output.
    pub drive: DriveScale,
}

impl TrueScales {
    /// The scales of a board whose settings are right.
    #[must_use]
    pub fn as_set(settings: &Calibration) -> Self {
        let Calibration { x, z, spring, walls, drive } = *settings;
        Self { x, z, spring, walls: [walls; 2], drive }
    }

    /// Checks that every value can be a scale.
    ///
    /// # Errors
    /// Names the first value that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        for (name, per_count, zero_counts) in [
            ("scales.x", self.x.metres_per_count, self.x.zero_counts),
            ("scales.z", self.z.metres_per_count, self.z.zero_counts),
            ("scales.drive", self.drive.metres_per_count, self.drive.zero_counts),
        ] {
            let is_scale = per_count.is_finite() && per_count != 0.0;
            require(is_scale, name, f64::from(per_count), "a finite number of metres per count other than 0")?;
            finite(name, f64::from(zero_counts))?;
        }
        let [low, high] = &self.walls;
        for (name, scale) in [("scales.spring", &self.spring), ("scales.walls", low), ("scales.walls", high)] {
            positive(name, f64::from(scale.newtons_per_count))?;
            finite(name, f64::from(scale.zero_counts))?;
        }
        Ok(())
    }

    /// The displacement that the drive makes of a demand of this board.
    pub(super) fn driven_m(&self, demand_m: f32, settings: &Calibration) -> f32 {
        let counts = settings.drive.to_counts(demand_m).min(OUTPUT_FULL_SCALE_COUNTS);
        (f32::from(counts) - self.drive.zero_counts) * self.drive.metres_per_count
    }

    /// The slow converter's counts of samples of x and z, m, and of the spring force, N.
    pub(super) fn counts(
        &self,
        x_m: &[f32; SUBSAMPLES],
        z_m: &[f32; SUBSAMPLES],
        spring_n: &[f32; SUBSAMPLES],
    ) -> SlowBlock {
        let displacement = |value: f32, scale: &DisplacementScale| value / scale.metres_per_count + scale.zero_counts;
        let force = |value: f32, scale: &ForceScale| value / scale.newtons_per_count + scale.zero_counts;
        core::array::from_fn(|n| {
            let exact =
                [displacement(x_m[n], &self.x), displacement(z_m[n], &self.z), force(spring_n[n], &self.spring)];
            // The cast drops the fraction and saturates at 0.
            exact.map(|counts| ((counts + 0.5) as u16).min(SLOW_FULL_SCALE_COUNTS))
        })
    }
}

/// What a displacement sensor looks at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub enum Target {
    /// Its own part of the rig.
    #[default]
    Rig,
    /// The base.
    Base,
    /// A target at this position, m.
    At(f32),
}

/// What the sensors measure in place of the rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Bench {
    /// Target of the sensor of x.
    pub x: Target,
    /// Target of the sensor of z.
    pub z: Target,
    /// Force of weights on the force sensor, N; `None` for the friction damper's spring.
    pub spring_n: Option<f32>,
}

/// A blow on a wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Blow {
    /// +1 for the wall at +d, −1 for the one at −d.
    pub side: i8,
    /// Impulse, N·s.
    pub impulse_n_s: f32,
}

impl Target {
    /// Replaces the samples of the sensor's own part of the rig.
    pub(super) fn seen<S: Copy>(
        self,
        own: [S; SUBSAMPLES],
        base: [S; SUBSAMPLES],
        of_m: impl Fn(f32) -> S,
    ) -> [S; SUBSAMPLES] {
        match self {
            Self::Rig => own,
            Self::Base => base,
            Self::At(position_m) => [of_m(position_m); SUBSAMPLES],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_settings_read_the_truth_to_half_a_count() {
        let settings = Calibration::default();
        let truth = TrueScales::as_set(&settings);
        let (x_m, z_m, spring_n) = ([0.0312; SUBSAMPLES], [-0.0007; SUBSAMPLES], [12.3; SUBSAMPLES]);
        let readings = settings.readings(&truth.counts(&x_m, &z_m, &spring_n));
        // Half a count, and f32's rounding of 65 520 counts.
        assert!((readings.x.mean_m - 0.0312).abs() < 0.51 * settings.x.metres_per_count, "{readings:?}");
        assert!((readings.z.mean_m + 0.0007).abs() < 0.51 * settings.z.metres_per_count, "{readings:?}");
        assert!((readings.spring_n - 12.3).abs() < 0.51 * settings.spring.newtons_per_count, "{readings:?}");
        assert!((truth.driven_m(1e-3, &settings) - 1e-3).abs() < 0.51 * settings.drive.metres_per_count);
    }

    #[test]
    fn a_true_scale_shows_in_the_reading() {
        let settings = Calibration::default();
        let mut truth = TrueScales::as_set(&settings);
        truth.x.metres_per_count *= 1.02;
        truth.x.zero_counts += 100.0;
        let readings = settings.readings(&truth.counts(&[0.02; SUBSAMPLES], &[0.0; SUBSAMPLES], &[0.0; SUBSAMPLES]));
        let expected = 0.02 / 1.02 + 100.0 * settings.x.metres_per_count;
        assert!((readings.x.mean_m - expected).abs() < 0.51 * settings.x.metres_per_count, "{readings:?}");
    }
}
