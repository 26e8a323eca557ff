//! `transients.parquet`: a row per record, pulse and free vibration. It is made from the journal's lines.

use arrow_array::RecordBatch;
use serde::{Deserialize, Serialize};

use super::json_float;
use super::table::TableBuilder;

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
    #[serde(with = "json_float")]
    pub x_peak_m: f32,
    /// RMS of x, m.
    #[serde(with = "json_float")]
    pub x_rms_m: f32,
    /// max |z|, m.
    #[serde(with = "json_float")]
    pub z_peak_m: f32,
    /// RMS of z, m.
    #[serde(with = "json_float")]
    pub z_rms_m: f32,
    /// max |x − z|, m.
    #[serde(with = "json_float")]
    pub relative_peak_m: f32,
    /// RMS of x − z, m.
    #[serde(with = "json_float")]
    pub relative_rms_m: f32,
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
    #[serde(with = "json_float")]
    pub predicted_x_peak_m: f64,
    /// Predicted RMS of x, m.
    #[serde(with = "json_float")]
    pub predicted_x_rms_m: f64,
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
pub fn table(rows: &[TransientRow]) -> Result<RecordBatch, String> {
    TableBuilder::new(rows)
        .text(("set_up", "", "name of the set-up"), |r| &r.set_up)
        .text(("experiment", "", "name of the experiment"), |r| &r.experiment)
        .text(("kind", "", "playback, impulse or free_vibration"), |r| &r.kind)
        .f32(("x_peak_m", "m", "structure: largest |x|"), |r| r.x_peak_m)
        .f32(
            (
                "x_rms_m",
                "m",
                "structure: RMS over the measured ticks; those of a release begin when |x| has fallen by a tenth of x0",
            ),
            |r| r.x_rms_m,
        )
        .f32(("z_peak_m", "m", "base: largest |z|"), |r| r.z_peak_m)
        .f32(("z_rms_m", "m", "base: RMS"), |r| r.z_rms_m)
        .f32(("relative_peak_m", "m", "largest |x − z|, of the ticks' means"), |r| r.relative_peak_m)
        .f32(("relative_rms_m", "m", "RMS of x − z"), |r| r.relative_rms_m)
        .f32(("wanted_rms_m", "m", "RMS of the demanded z"), |r| r.wanted_rms_m)
        .f32(("base_error_rms_m", "m", "RMS of z less the demand, at its best delay"), |r| r.base_error_rms_m)
        .f32(("base_delay_s", "s", "that delay, from demand to reading"), |r| r.base_delay_s)
        .bool(("drive_saturated", "", "whether the demand was cut at its limit"), |r| r.drive_saturated)
        .text(("sensors_clipped", "", "sensors with a sample at an end of their span, or none"), |r| &r.sensors_clipped)
        .u32(("impacts", "1", "measured impacts on both walls"), |r| r.impacts)
        .f64(("start_m", "m", "x0 of a free vibration; NaN of others"), |r| r.start_m)
        .f64(("end_m", "m", "largest |x| after `cycles`, on the side of x0"), |r| r.end_m)
        .u32(("cycles", "1", "whole cycles of the decay"), |r| r.cycles)
        .f64(("log_decrement", "1", "ln(start_m/end_m)/cycles"), |r| r.log_decrement)
        .f64(("damping_ratio", "1", "of the linear structure that would decay so"), |r| r.damping_ratio)
        .f64(("frequency_hz", "Hz", "over these cycles"), |r| r.frequency_hz)
        .f64(("predicted_x_peak_m", "m", "largest |x| of the simulation"), |r| r.predicted_x_peak_m)
        .f64(("predicted_x_rms_m", "m", "RMS of x of the simulation, over the same window"), |r| r.predicted_x_rms_m)
        .u32(("predicted_impacts", "1", "impacts of the simulation that are strong enough to be counted"), |r| {
            r.predicted_impacts
        })
        .u64(("start_tick", "tick", "first tick measured"), |r| r.start_tick)
        .u64(("end_tick", "tick", "first tick after"), |r| r.end_tick)
        .u32(("point_index", "1", "always 0"), |r| r.point_index)
        .u32(("segment", "1", "times that the experiment had been started before"), |r| r.segment)
        .finish()
}
