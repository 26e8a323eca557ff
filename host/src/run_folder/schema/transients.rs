//! `transients.parquet`: a row per record, pulse and free vibration. It is made from the journal's lines.

use arrow_array::RecordBatch;
use arrow_schema::Metadata;
use serde::{Deserialize, Serialize};

use super::{json_float, table_rows};
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::table::TableBuilder;

/// The file's name in a run folder.
pub const TRANSIENTS: &str = "transients.parquet";

/// What a row is.
pub const ROW: &str = "a row for each record, pulse and free vibration";

/// Results of one record, pulse or free vibration. Quantities that an experiment does not have (a decay of a record,
/// a demand of a free vibration) are NaN.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransientRow {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// `playback`, `impulse` or `free_vibration`.
    pub kind: String,
    /// max |x|, m.
    #[serde(with = "json_float", alias = "x_peak_m")]
    pub max_abs_x_m: f32,
    /// RMS of x, m.
    #[serde(with = "json_float", alias = "x_rms_m")]
    pub rms_x_m: f32,
    /// max |z|, m.
    #[serde(with = "json_float", alias = "z_peak_m")]
    pub max_abs_z_m: f32,
    /// RMS of z, m.
    #[serde(with = "json_float", alias = "z_rms_m")]
    pub rms_z_m: f32,
    /// max |x − z|, m.
    #[serde(with = "json_float", alias = "relative_peak_m")]
    pub max_abs_x_minus_z_m: f32,
    /// RMS of x − z, m.
    #[serde(with = "json_float", alias = "relative_rms_m")]
    pub rms_x_minus_z_m: f32,
    /// RMS of the demanded z, m.
    #[serde(with = "json_float")]
    pub wanted_rms_m: f32,
    /// RMS of z less the demand at its best delay, m.
    #[serde(with = "json_float")]
    pub base_error_rms_m: f32,
    /// That delay, s.
    #[serde(with = "json_float")]
    pub base_delay_s: f32,
    /// The demand was cut at its limit.
    pub drive_saturated: bool,
    /// Names of the sensors that were clipped (a sample was at an end of the span), or `none`; empty in older runs.
    #[serde(default)]
    pub sensors_clipped: String,
    /// Measured impacts.
    pub impacts: u32,
    /// x0 of a free vibration, m.
    #[serde(with = "json_float")]
    pub start_m: f64,
    /// max |x| after `cycles`, m.
    #[serde(with = "json_float")]
    pub end_m: f64,
    /// Whole cycles over which the decay is measured.
    pub cycles: u32,
    /// ln(start/end)/cycles.
    #[serde(with = "json_float")]
    pub log_decrement: f64,
    /// δ/√(4π² + δ²) of that decrement: the damping ratio of a linear structure with the same decay.
    #[serde(with = "json_float")]
    pub damping_ratio: f64,
    /// Frequency over these cycles, Hz.
    #[serde(with = "json_float")]
    pub frequency_hz: f64,
    /// Predicted max |x|, from the simulation of the same experiment, m.
    #[serde(with = "json_float", alias = "predicted_x_peak_m")]
    pub predicted_max_abs_x_m: f64,
    /// Predicted RMS of x, m.
    #[serde(with = "json_float", alias = "predicted_x_rms_m")]
    pub predicted_rms_x_m: f64,
    /// Predicted impacts, of those that are strong enough to be counted; 0 in older runs.
    #[serde(default)]
    pub predicted_impacts: u32,
    /// First tick measured.
    pub start_tick: u64,
    /// First tick after the measurement.
    pub end_tick: u64,
    /// Always 0: such an experiment has one point.
    pub point_index: u32,
    /// Number of earlier starts of the experiment on this set-up.
    pub segment: u32,
}

/// The rows as a table.
///
/// # Errors
/// When the columns differ in length: a defect of this function.
pub fn table(rows: &[TransientRow]) -> Result<RecordBatch, Failure> {
    TableBuilder::new(rows)
        .column(Quantity::SetUp, |r| r.set_up.as_str())
        .column(Quantity::Experiment, |r| r.experiment.as_str())
        .column(Quantity::Kind, |r| r.kind.as_str())
        .column(Quantity::MaxAbsXM, |r| r.max_abs_x_m)
        .column(Quantity::RmsXM, |r| r.rms_x_m)
        .column(Quantity::MaxAbsZM, |r| r.max_abs_z_m)
        .column(Quantity::RmsZM, |r| r.rms_z_m)
        .column(Quantity::MaxAbsXMinusZM, |r| r.max_abs_x_minus_z_m)
        .column(Quantity::RmsXMinusZM, |r| r.rms_x_minus_z_m)
        .column(Quantity::WantedRmsM, |r| r.wanted_rms_m)
        .column(Quantity::BaseErrorRmsM, |r| r.base_error_rms_m)
        .column(Quantity::BaseDelayS, |r| r.base_delay_s)
        .column(Quantity::DriveSaturated, |r| r.drive_saturated)
        .column(Quantity::SensorsClipped, |r| r.sensors_clipped.as_str())
        .column(Quantity::Impacts, |r| r.impacts)
        .column(Quantity::StartM, |r| r.start_m)
        .column(Quantity::EndM, |r| r.end_m)
        .column(Quantity::Cycles, |r| r.cycles)
        .column(Quantity::LogDecrement, |r| r.log_decrement)
        .column(Quantity::DampingRatio, |r| r.damping_ratio)
        .column(Quantity::FrequencyHz, |r| r.frequency_hz)
        .column(Quantity::PredictedMaxAbsXM, |r| r.predicted_max_abs_x_m)
        .column(Quantity::PredictedRmsXM, |r| r.predicted_rms_x_m)
        .column(Quantity::PredictedImpacts, |r| r.predicted_impacts)
        .column(Quantity::StartTick, |r| r.start_tick)
        .column(Quantity::EndTick, |r| r.end_tick)
        .column(Quantity::PointIndex, |r| r.point_index)
        .column(Quantity::Segment, |r| r.segment)
        .finish(Metadata::new())
}

/// The rows of a table that [`table`] or an earlier version made.
///
/// # Errors
/// A table that lacks a column that every version wrote, or has one of another type.
pub fn rows(batch: &RecordBatch) -> Result<Vec<TransientRow>, Failure> {
    table_rows::rows(batch, |_| {})
}
