//! The errors of a rig's displacement sensors, from its settings or from a run folder. `identify` and `compare` take them from here.

use std::f64::consts::TAU;

use damprig_core::io::{SUBSAMPLES, TICK_HZ};
pub(crate) use damprig_identification::sensors::{ASSUMED_LINEARITY, Sensors, by_linearity, rectangular};
use damprig_simulator::plant::DataSheet;

use crate::campaign::RigSettings;
use crate::run_folder::RunFolder;
use crate::run_folder::read::campaign_copy;

/// Delay of the readings of this data sheet: that of both first-order lags, and of the mean of the conversions before the instant of a
/// sample.
fn delay_s(sheet: &DataSheet) -> f64 {
    let of_conversions = 0.5 * (1.0 - 1.0 / f64::from(sheet.oversampling)) / (f64::from(TICK_HZ) * SUBSAMPLES as f64);
    f64::from(sheet.response_s) + 1.0 / (TAU * f64::from(sheet.anti_alias_hz)) + of_conversions
}

/// Of the rig of a run.
#[must_use]
pub fn of(rig: &RigSettings, is_simulated: bool) -> Sensors {
    let range_m = f64::from(rig.sensor_range_m()[0]);
    let own = match (is_simulated, &rig.data_sheet) {
        (true, None) => Sensors {
            scale_from: "sensors of the simulated rig, without an error of scale",
            step_m: rig.sensor_resolution_m,
            ..Sensors::EXACT
        },
        (true, Some(sheet)) => Sensors {
            linearity: f64::from(sheet.linearity),
            scale: by_linearity(f64::from(sheet.linearity)),
            scale_from: "linearity of the simulated sensors' data sheet",
            step_m: 2.0 * range_m / f64::from(1_u32 << sheet.bits.min(31)),
            skew_s: f64::from(sheet.skew_s),
            delay_s: delay_s(sheet),
            range_m: None,
        },
        (false, _) => Sensors { step_m: f64::from(rig.board.calibration.x.metres_per_count.abs()), ..Sensors::ASSUMED },
    };
    Sensors { range_m: Some(range_m), ..own }
}

/// Of a run folder; those of a table where its campaign cannot be read.
#[must_use]
pub fn of_run(run: &RunFolder) -> Sensors {
    let device = run.manifest().device.as_ref();
    let is_simulated = run.manifest().is_simulated();
    let Ok(mut campaign) = campaign_copy::campaign(run.path()) else { return Sensors::ASSUMED };
    if let Some(board) = device.and_then(|device| device.settings.as_ref()) {
        // Limits were checked before the run.
        let _ = campaign.on_board(&board.settings, is_simulated);
    }
    of(&campaign.rig, is_simulated)
}
