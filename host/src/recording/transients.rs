//! `transients.parquet`: a row for every record, pulse or free vibration. The lines of the journal are what it is made of.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, RecordBatch, StringArray, UInt32Array, UInt64Array,
};
use arrow_schema::{DataType, Schema};
use serde::{Deserialize, Serialize};

use super::parquet::{Kept, field, write_whole};
use super::{StorageError, number};

/// The file's name in a run folder.
pub const TRANSIENTS: &str = "transients.parquet";

/// What was measured of one record, pulse or free vibration. Figures of nothing (a decay of a record, a demand of a free
/// vibration) are NaN.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransientRow {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// `playback`, `impulse` or `free_vibration`.
    pub kind: String,
    /// max |x|, m.
    #[serde(with = "number")]
    pub x_peak_m: f32,
    /// RMS of x, m.
    #[serde(with = "number")]
    pub x_rms_m: f32,
    /// max |z|, m.
    #[serde(with = "number")]
    pub z_peak_m: f32,
    /// RMS of z, m.
    #[serde(with = "number")]
    pub z_rms_m: f32,
    /// max |x − z|, m.
    #[serde(with = "number")]
    pub relative_peak_m: f32,
    /// RMS of x − z, m.
    #[serde(with = "number")]
    pub relative_rms_m: f32,
    /// RMS of the demanded z, m.
    #[serde(with = "number")]
    pub wanted_rms_m: f32,
    /// RMS of z less the demand at its best delay, m.
    #[serde(with = "number")]
    pub base_error_rms_m: f32,
    /// That delay, s.
    #[serde(with = "number")]
    pub base_delay_s: f32,
    /// The demand was cut at its limit.
    pub drive_saturated: bool,
    /// Names of the sensors that were clipped (a sample was at an end of the span), or `none`; empty in older runs.
    #[serde(default)]
    pub sensors_clipped: String,
    /// Measured impacts.
    pub impacts: u32,
    /// x0 of a free vibration, m.
    #[serde(with = "number")]
    pub start_m: f64,
    /// max |x| after `cycles`, m.
    #[serde(with = "number")]
    pub end_m: f64,
    /// Whole cycles over which the decay is told.
    pub cycles: u32,
    /// ln(start/end)/cycles.
    #[serde(with = "number")]
    pub log_decrement: f64,
    /// δ/√(4π² + δ²) of that decrement: the damping ratio of the linear structure that would decay so.
    #[serde(with = "number")]
    pub damping_ratio: f64,
    /// Frequency over these cycles, Hz.
    #[serde(with = "number")]
    pub frequency_hz: f64,
    /// max |x| of the simulation of the same, m.
    #[serde(with = "number")]
    pub predicted_x_peak_m: f64,
    /// RMS of x of the simulation, m.
    #[serde(with = "number")]
    pub predicted_x_rms_m: f64,
    /// First tick measured.
    pub start_tick: u64,
    /// First tick after.
    pub end_tick: u64,
    /// Always 0: such an experiment has one point.
    pub point_index: u32,
    /// How many times the experiment had been started on this set-up before.
    pub segment: u32,
}

/// Writes all rows; an earlier file of the name is replaced as a whole.
///
/// # Errors
/// When the file cannot be written; an earlier one stays as it is.
pub fn write(path: &Path, rows: &[TransientRow]) -> Result<(), StorageError> {
    let batch = table(rows).map_err(|e| StorageError::new("write", path, e))?;
    write_whole(path, &batch.schema(), std::iter::once(Ok(batch)), Kept::ByTheSystem)
}

/// The rows as a table.
///
/// # Errors
/// When the columns do not fit each other: then this function is wrong.
pub fn table(rows: &[TransientRow]) -> Result<RecordBatch, String> {
    let text =
        |get: fn(&TransientRow) -> &str| -> ArrayRef { Arc::new(StringArray::from_iter_values(rows.iter().map(get))) };
    let single =
        |get: fn(&TransientRow) -> f32| -> ArrayRef { Arc::new(Float32Array::from_iter_values(rows.iter().map(get))) };
    let double =
        |get: fn(&TransientRow) -> f64| -> ArrayRef { Arc::new(Float64Array::from_iter_values(rows.iter().map(get))) };
    let count =
        |get: fn(&TransientRow) -> u32| -> ArrayRef { Arc::new(UInt32Array::from_iter_values(rows.iter().map(get))) };
    let tick =
        |get: fn(&TransientRow) -> u64| -> ArrayRef { Arc::new(UInt64Array::from_iter_values(rows.iter().map(get))) };
    let saturated: ArrayRef = Arc::new(BooleanArray::from_iter(rows.iter().map(|r| Some(r.drive_saturated))));
    let columns: Vec<(&str, &str, &str, ArrayRef)> = vec![
        ("set_up", "", "name of the set-up", text(|r| &r.set_up)),
        ("experiment", "", "name of the experiment", text(|r| &r.experiment)),
        ("kind", "", "playback, impulse or free_vibration", text(|r| &r.kind)),
        ("x_peak_m", "m", "structure: largest |x|", single(|r| r.x_peak_m)),
        ("x_rms_m", "m", "structure: RMS", single(|r| r.x_rms_m)),
        ("z_peak_m", "m", "base: largest |z|", single(|r| r.z_peak_m)),
        ("z_rms_m", "m", "base: RMS", single(|r| r.z_rms_m)),
        ("relative_peak_m", "m", "largest |x − z|, of the ticks' means", single(|r| r.relative_peak_m)),
        ("relative_rms_m", "m", "RMS of x − z", single(|r| r.relative_rms_m)),
        ("wanted_rms_m", "m", "RMS of the demanded z", single(|r| r.wanted_rms_m)),
        ("base_error_rms_m", "m", "RMS of z less the demand, at its best delay", single(|r| r.base_error_rms_m)),
        ("base_delay_s", "s", "that delay, from demand to reading", single(|r| r.base_delay_s)),
        ("drive_saturated", "", "whether the demand was cut at its limit", saturated),
        ("sensors_clipped", "", "sensors with a sample at an end of their span, or none", text(|r| &r.sensors_clipped)),
        ("impacts", "1", "measured impacts on both walls", count(|r| r.impacts)),
        ("start_m", "m", "x0 of a free vibration; NaN of others", double(|r| r.start_m)),
        ("end_m", "m", "largest |x| after `cycles`, on the side of x0", double(|r| r.end_m)),
        ("cycles", "1", "whole cycles of the decay", count(|r| r.cycles)),
        ("log_decrement", "1", "ln(start_m/end_m)/cycles", double(|r| r.log_decrement)),
        ("damping_ratio", "1", "of the linear structure that would decay so", double(|r| r.damping_ratio)),
        ("frequency_hz", "Hz", "over these cycles", double(|r| r.frequency_hz)),
        ("predicted_x_peak_m", "m", "largest |x| of the simulation", double(|r| r.predicted_x_peak_m)),
        ("predicted_x_rms_m", "m", "RMS of x of the simulation", double(|r| r.predicted_x_rms_m)),
        ("start_tick", "tick", "first tick measured", tick(|r| r.start_tick)),
        ("end_tick", "tick", "first tick after", tick(|r| r.end_tick)),
        ("point_index", "1", "always 0", count(|r| r.point_index)),
        ("segment", "1", "times that the experiment had been started before", count(|r| r.segment)),
    ];
    let described = |name: &str, unit: &str, about: &str, kind: DataType| {
        let metadata =
            [("unit", unit), ("description", about)].map(|(key, value)| (key.to_string(), value.to_string()));
        field(name, kind, unit).with_metadata(HashMap::from(metadata))
    };
    let fields: Vec<_> =
        columns.iter().map(|(name, unit, about, a)| described(name, unit, about, a.data_type().clone())).collect();
    let arrays = columns.into_iter().map(|(.., array)| array).collect();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).map_err(|e| e.to_string())
}
