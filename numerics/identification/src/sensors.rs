//! Errors of the displacement sensors that no reading shows: linearity, and the scale that follows from it.
//!
//! The deviation from the straight line through the ends of the range R is taken as
//! odd and cubic, L·2.6·R·(r − r³) with r = x/R, as that of the simulated sensors: it changes the scale by up to 2.6 L, and the scale
//! at r by (1 − r²) of that.

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
