//! Errors of the displacement sensors that no reading shows: linearity, and the scale that follows from it.
//!
//! `identify` and `compare` take them from here. The deviation from the straight line through the ends of the range R is taken as
//! odd and cubic, L·2.6·R·(r − r³) with r = x/R, as that of the simulated sensors: it changes the scale by up to 2.6 L, and the scale
//! at r by (1 − r²) of that.

use std::f64::consts::TAU;

use damprig_core::io::{SUBSAMPLES, TICK_HZ};
use damprig_simulator::plant::DataSheet;

use crate::campaign::RigSettings;
use crate::run_folder::RunFolder;
use crate::run_folder::read::campaign_copy;

/// Linearity of a real sensor whose calibration is not known, of its range: that of usual triangulation lasers and load cells.
pub(crate) const ASSUMED_LINEARITY: f64 = 1e-3;

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
pub(crate) fn rectangular(half_width: f64) -> f64 {
    half_width / 3.0_f64.sqrt()
}

/// Relative standard uncertainty of the scale of a sensor of this linearity: 2.6 L over √3.
pub(crate) const fn by_linearity(linearity: f64) -> f64 {
    1.5 * linearity
}

/// Delay of the readings of this data sheet: that of both first-order lags, and of the mean of the conversions before the instant of a
/// sample.
fn delay_s(sheet: &DataSheet) -> f64 {
    let of_conversions = 0.5 * (1.0 - 1.0 / f64::from(sheet.oversampling)) / (f64::from(TICK_HZ) * SUBSAMPLES as f64);
    f64::from(sheet.response_s) + 1.0 / (TAU * f64::from(sheet.anti_alias_hz)) + of_conversions
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

    /// Of the rig of a run.
    #[must_use]
    pub fn of(rig: &RigSettings, is_simulated: bool) -> Self {
        let range_m = f64::from(rig.sensor_range_m()[0]);
        let own = match (is_simulated, &rig.data_sheet) {
            (true, None) => Self {
                scale_from: "sensors of the simulated rig, without an error of scale",
                step_m: rig.sensor_resolution_m,
                ..Self::EXACT
            },
            (true, Some(sheet)) => Self {
                linearity: f64::from(sheet.linearity),
                scale: by_linearity(f64::from(sheet.linearity)),
                scale_from: "linearity of the simulated sensors' data sheet",
                step_m: 2.0 * range_m / f64::from(1_u32 << sheet.bits.min(31)),
                skew_s: f64::from(sheet.skew_s),
                delay_s: delay_s(sheet),
                range_m: None,
            },
            (false, _) => Self { step_m: f64::from(rig.board.calibration.x.metres_per_count.abs()), ..Self::ASSUMED },
        };
        Self { range_m: Some(range_m), ..own }
    }

    /// Of a run folder; those of a table where its campaign cannot be read.
    #[must_use]
    pub fn of_run(run: &RunFolder) -> Self {
        let device = run.manifest().device.as_ref();
        let is_simulated = device.is_some_and(|device| device.simulated);
        let Ok(mut campaign) = campaign_copy::campaign(run.path()) else { return Self::ASSUMED };
        if let Some(board) = device.and_then(|device| device.settings.as_ref()) {
            // Limits were checked before the run.
            let _ = campaign.on_board(&board.settings, is_simulated);
        }
        Self::of(&campaign.rig, is_simulated)
    }

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
