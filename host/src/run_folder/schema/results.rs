//! `results.parquet`: a row per measured point (set-up, experiment, frequency).
//!
//! [`table`] is the one list of its columns: the Parquet schema and the manifest's `results_columns` follow from it.

use arrow_array::RecordBatch;
use arrow_schema::Metadata;
use damprig_core::measure::steadiness::Steadiness;
use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};

use super::{json_float, table_rows};
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::table::TableBuilder;

/// The file's name in a run folder.
pub const RESULTS: &str = "results.parquet";

/// What a row is.
pub const ROW: &str = "a row for each point of a stepped sine";

/// Results of one measured point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResultRow {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// Drive frequency, Hz.
    #[serde(with = "json_float")]
    pub frequency_hz: f64,
    /// Lock-in amplitude of the base, m.
    #[serde(with = "json_float")]
    pub z_amplitude_m: f32,
    /// Distortion of the base: 2nd to 5th harmonic over the first.
    #[serde(with = "json_float")]
    pub z_distortion: f32,
    /// Lock-in amplitude of the drive, m.
    #[serde(with = "json_float")]
    pub drive_amplitude_m: f32,
    /// Whether the drive was at its limit.
    pub drive_saturated: bool,
    /// Names of the sensors that were clipped (a sample was at an end of the span), or `none`; empty in older runs.
    #[serde(default)]
    pub sensors_clipped: String,
    /// Clearance, m; NaN without a particle.
    #[serde(with = "json_float")]
    pub clearance_m: f64,
    /// Lock-in amplitude of the structure, m.
    #[serde(with = "json_float")]
    pub x_amplitude_m: f32,
    /// Phase of x relative to z, rad.
    #[serde(with = "json_float")]
    pub phase_rad: f32,
    /// RMS of x over the dwell, m.
    #[serde(with = "json_float", alias = "x_rms_m")]
    pub rms_x_m: f32,
    /// Mean over the cycles of the dwell of max|x|, m.
    #[serde(with = "json_float", alias = "x_mean_cycle_max_m")]
    pub mean_cycle_max_m: f32,
    /// Largest |x| of the dwell, m.
    #[serde(with = "json_float", alias = "x_max_m")]
    pub max_abs_x_m: f32,
    /// max|x| of the last whole cycle, m.
    #[serde(with = "json_float", alias = "x_last_cycle_max_m")]
    pub last_cycle_max_m: f32,
    /// Trend of the cycle maximum, relative change in a cycle.
    #[serde(with = "json_float")]
    pub change_per_cycle: f32,
    /// Scatter of the cycle maxima around that trend, relative.
    #[serde(with = "json_float")]
    pub scatter: f32,
    /// Whole cycles in the dwell.
    pub cycles: u32,
    /// RMS noise of a tick's x, m.
    #[serde(with = "json_float", default)]
    pub x_noise_rms_m: f32,
    /// Deviation of X/Z (cycle maxima) from its extrapolated limit, relative.
    #[serde(with = "json_float", default)]
    pub deviation: f32,
    /// Uncertainty of that deviation (95 %), relative.
    #[serde(with = "json_float", default)]
    pub deviation_uncertainty: f32,
    /// Half-width of the 95 % interval of X/Z as a mean over cycles, relative.
    #[serde(with = "json_float", default)]
    pub interval: f32,
    /// Whether X/Z is within its tolerance of its limit.
    #[serde(default)]
    pub steadiness: Steadiness,
    /// First tick of the dwell.
    pub start_tick: u64,
    /// First tick after the dwell.
    pub end_tick: u64,
    /// d/Z with Z as set; NaN without a particle.
    #[serde(with = "json_float")]
    pub d_over_z: f64,
    /// Place in the experiment's frequency list, from 0.
    pub point_index: u32,
    /// How many times the experiment had been started on this set-up before the point was measured; ticks count
    /// from 0 in each segment.
    pub segment: u32,
}

impl ResultRow {
    /// X/Z (cycle maxima), as the literature's tables have it: mean cycle maximum over the measured base amplitude.
    #[must_use]
    pub fn x_over_z(&self) -> f64 {
        f64::from(self.mean_cycle_max_m) / f64::from(self.z_amplitude_m)
    }

    /// X/Z (lock-in): the ratio of the amplitudes at the drive frequency. Smaller than that of the cycle maxima where the motion
    /// has harmonics or is not steady.
    #[must_use]
    pub fn x_over_z_lock_in(&self) -> f64 {
        f64::from(self.x_amplitude_m) / f64::from(self.z_amplitude_m)
    }

    /// d/Z with Z as measured; NaN without a particle.
    #[must_use]
    pub fn actual_d_over_z(&self) -> f64 {
        self.clearance_m / f64::from(self.z_amplitude_m)
    }
}

/// A verdict as the column `steadiness` has it.
#[must_use]
pub fn steadiness_text(steadiness: Steadiness) -> &'static str {
    match steadiness {
        Steadiness::NotSteady => "not steady",
        Steadiness::Stationary => "stationary",
        Steadiness::Steady => "steady",
    }
}

/// The verdict that a text of the column `steadiness` stands for; not steady for any other text.
#[must_use]
pub fn steadiness_of(text: &str) -> Steadiness {
    let all = [Steadiness::Steady, Steadiness::Stationary];
    all.into_iter().find(|known| steadiness_text(*known) == text).unwrap_or_default()
}

/// The rows as a table, columns in the order of the file.
///
/// # Errors
/// When the columns differ in length: a defect of this function.
pub fn table(rows: &[ResultRow]) -> Result<RecordBatch, Failure> {
    TableBuilder::new(rows)
        .column(Quantity::SetUp, |r| r.set_up.as_str())
        .column(Quantity::Experiment, |r| r.experiment.as_str())
        .column(Quantity::FrequencyHz, |r| r.frequency_hz)
        .column(Quantity::XOverZ, |r| r.x_over_z())
        .column(Quantity::XOverZLockIn, |r| r.x_over_z_lock_in())
        .column(Quantity::DOverZ, |r| r.d_over_z)
        .column(Quantity::ActualDOverZ, |r| r.actual_d_over_z())
        .column(Quantity::ZAmplitudeM, |r| r.z_amplitude_m)
        .column(Quantity::ZDistortion, |r| r.z_distortion)
        .column(Quantity::DriveAmplitudeM, |r| r.drive_amplitude_m)
        .column(Quantity::DriveSaturated, |r| r.drive_saturated)
        .column(Quantity::SensorsClipped, |r| r.sensors_clipped.as_str())
        .column(Quantity::XAmplitudeM, |r| r.x_amplitude_m)
        .column(Quantity::PhaseRad, |r| r.phase_rad)
        .column(Quantity::RmsXM, |r| r.rms_x_m)
        .column(Quantity::MeanCycleMaxM, |r| r.mean_cycle_max_m)
        .column(Quantity::MaxAbsXM, |r| r.max_abs_x_m)
        .column(Quantity::LastCycleMaxM, |r| r.last_cycle_max_m)
        .column(Quantity::ChangePerCycle, |r| r.change_per_cycle)
        .column(Quantity::Scatter, |r| r.scatter)
        .column(Quantity::Cycles, |r| r.cycles)
        .column(Quantity::XNoiseRmsM, |r| r.x_noise_rms_m)
        .column(Quantity::Deviation, |r| r.deviation)
        .column(Quantity::DeviationUncertainty, |r| r.deviation_uncertainty)
        .column(Quantity::Interval, |r| r.interval)
        .column(Quantity::Steady, |r| r.steadiness == Steadiness::Steady)
        .column(Quantity::Steadiness, |r| steadiness_text(r.steadiness))
        .column(Quantity::StartTick, |r| r.start_tick)
        .column(Quantity::EndTick, |r| r.end_tick)
        .column(Quantity::PointIndex, |r| r.point_index)
        .column(Quantity::Segment, |r| r.segment)
        .finish(Metadata::new())
}

/// The rows of a table that [`table`] or an earlier version made. Without its column the clearance is that of the table's ratio.
///
/// # Errors
/// A table that lacks a column that every version wrote, or has one of another type.
pub fn rows(batch: &RecordBatch) -> Result<Vec<ResultRow>, Failure> {
    table_rows::rows(batch, |fields| {
        let number = |own: Quantity| fields.get(own.name()).and_then(Json::as_f64).unwrap_or(f64::NAN);
        let clearance_m = number(Quantity::ActualDOverZ) * number(Quantity::ZAmplitudeM);
        let steadiness = match fields.get(Quantity::Steadiness.name()) {
            Some(text) => steadiness_of(text.as_str().unwrap_or_default()),
            // Older runs have only the column `steady`.
            None if fields.get(Quantity::Steady.name()) == Some(&Json::Bool(true)) => Steadiness::Steady,
            None => Steadiness::NotSteady,
        };
        fields.insert("clearance_m".into(), table_rows::number(clearance_m));
        fields.insert("steadiness".into(), json!(steadiness));
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_of_a_table_are_those_that_it_was_made_of() {
        let point = ResultRow {
            set_up: "a".into(),
            experiment: "e".into(),
            frequency_hz: 2.4,
            z_amplitude_m: 4e-4,
            mean_cycle_max_m: 0.012_345,
            x_amplitude_m: 0.012,
            phase_rad: -1.57,
            drive_saturated: true,
            sensors_clipped: "x".into(),
            clearance_m: 4e-3,
            d_over_z: 10.0,
            steadiness: Steadiness::Stationary,
            cycles: 20,
            end_tick: 9_000,
            segment: 2,
            ..ResultRow::default()
        };
        let bare = ResultRow { clearance_m: f64::NAN, d_over_z: f64::NAN, interval: f32::INFINITY, ..point.clone() };
        let read = rows(&table(&[point.clone(), bare.clone()]).unwrap()).unwrap();
        // The clearance is computed from its ratio.
        assert!((read[0].clearance_m / 4e-3 - 1.0).abs() < 1e-15);
        assert_eq!(ResultRow { clearance_m: 4e-3, ..read[0].clone() }, point);
        assert_eq!(format!("{:?}", read[1]), format!("{bare:?}"));
    }
}
