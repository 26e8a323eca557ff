//! Errors of the displacement sensors that no reading shows: linearity, and the scale that follows from it.
//!
//! The deviation from the straight line through the ends of the range R is taken as
//! odd and cubic, L·2.6·R·(r − r³) with r = x/R, as that of the simulated sensors: it changes the scale by up to 2.6 L, and the scale
//! at r by (1 − r²) of that.

use std::f64::consts::{PI, TAU};

/// Linearity of a real sensor whose calibration is not known, of its range: that of usual triangulation lasers and load cells.
pub const ASSUMED_LINEARITY: f64 = 1e-3;

/// Time between the conversions of x and z of a real board, s.
const ASSUMED_SKEW_S: f64 = 1e-5;

const ASSUMED: &str = "assumed linearity of 0.1 % of the sensors' range; --scale-uncertainty states another value";

/// What the displacement sensors contribute to the uncertainty of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Largest deviation from the straight line, as a share of the range; 0 for none.
    pub linearity: f64,
    /// Relative standard uncertainty of the scale of x, and of z.
    pub scale: f64,
    /// Where that comes from, in words.
    pub scale_from: &'static str,
    /// Range of x, ± m; none if it is not known.
    pub range_m: Option<f64>,
    /// Smallest step, m.
    pub step_m: f64,
    /// Largest delay between x and z, s.
    pub skew_s: f64,
    /// Delay of the readings of both after the motion, s; 0 where it is not known.
    pub delay_s: f64,
}

/// Standard uncertainty of a value that is anywhere within ± `half_width`.
pub fn rectangular(half_width: f64) -> f64 {
    half_width / 3.0_f64.sqrt()
}

/// Relative standard uncertainty of the scale of a sensor of this linearity: 2.6 L over √3.
pub const fn by_linearity(linearity: f64) -> f64 {
    1.5 * linearity
}

impl Sensors {
    /// Half-width of the 95 % interval of a sine's amplitude over so many samples with this RMS noise, m, without the error of the scale:
    /// noise and steps. The steps q make an error with parts (2q/πn) J₁(2πnA/q) (Widrow and Kollár, Quantization Noise, 2008); |J₁(y)|
    /// is at most 0.58 and about √(2/πy). The first seven at their largest cover the sum of all; noise of the size of a step makes it
    /// smaller.
    #[must_use]
    pub fn amplitude_error_95_m(&self, amplitude_m: f64, noise_rms_m: f64, samples: f64) -> f64 {
        let part = |n: f64| {
            let argument = TAU * n * amplitude_m / self.step_m;
            2.0 * self.step_m / (PI * n) * (2.0 / (PI * argument)).sqrt().min(0.58)
        };
        let of_steps = if self.step_m > 0.0 { (1..=7).map(|n| part(f64::from(n))).sum() } else { 0.0_f64 };
        of_steps.hypot(2.0 * noise_rms_m * (2.0 / samples).sqrt())
    }

    /// Sensors without errors.
    pub const EXACT: Self =
        Self { linearity: 0.0, scale: 0.0, scale_from: "exact", range_m: None, step_m: 0.0, skew_s: 0.0, delay_s: 0.0 };

    /// Those of a table or of a real rig, which are not known.
    pub const ASSUMED: Self = Self {
        linearity: ASSUMED_LINEARITY,
        scale: by_linearity(ASSUMED_LINEARITY),
        scale_from: ASSUMED,
        skew_s: ASSUMED_SKEW_S,
        ..Self::EXACT
    };

    /// With the relative standard uncertainty of the scales that a person states.
    #[must_use]
    pub fn stated(self, scale: Option<f64>) -> Self {
        scale.map_or(self, |scale| Self { scale, scale_from: "--scale-uncertainty", ..self })
    }

    /// Whether the deviation from the straight line is to be fitted with the motion.
    #[must_use]
    pub fn has_cubic(&self) -> bool {
        self.linearity > 0.0
    }

    /// By how much the error of the scale falls up to the amplitude `x_m`, as a share of it. Where the range is not known, the largest
    /// amplitude counts as its end.
    #[must_use]
    pub fn share_of_cubic(&self, x_m: f64, largest_m: f64) -> f64 {
        let range_m = self.range_m.unwrap_or(largest_m).max(f64::MIN_POSITIVE);
        if self.has_cubic() { (x_m / range_m).powi(2) } else { 0.0 }
    }

    /// What a person has to know about them.
    #[must_use]
    pub fn remark(&self) -> String {
        let scale =
            format!("standard uncertainty of the sensors' scale: {:.3} % ({})", 100.0 * self.scale, self.scale_from);
        let cubic = if self.has_cubic() { "" } else { "; their third-order error counts as 0" };
        format!("{scale}{cubic}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_stepped_sine_is_within_its_bound() {
        let sensors = Sensors { step_m: 1.0, ..Sensors::EXACT };
        let samples = 40_001;
        let mut largest = 0.0_f64;
        for n in 1..400 {
            let amplitude = 0.05 * f64::from(n);
            let read = |k: i32| (amplitude * (TAU * f64::from(k) / f64::from(samples)).sin()).round();
            let sum: f64 = (0..samples).map(|k| read(k) * (TAU * f64::from(k) / f64::from(samples)).sin()).sum();
            let error = (2.0 * sum / f64::from(samples) - amplitude).abs();
            let bound = sensors.amplitude_error_95_m(amplitude, 0.0, 1e4);
            assert!(error <= bound, "{amplitude}: {error}, {bound}");
            largest = largest.max(error / bound);
        }
        assert!(largest > 0.5, "{largest}");
    }
}
