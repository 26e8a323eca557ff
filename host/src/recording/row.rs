//! One row of the results: what was measured at one frequency of one set-up, and in which unit.
//!
//! [`COLUMNS`] is the one list of what a results file holds: the Parquet schema, the manifest's units and
//! the figures all follow from it.

use serde::{Deserialize, Serialize};

use super::number;

/// What the rig measured at one point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResultRow {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// Drive frequency, Hz.
    #[serde(with = "number")]
    pub frequency_hz: f64,
    /// Lock-in amplitude of the base, m.
    #[serde(with = "number")]
    pub z_amplitude_m: f32,
    /// Distortion of the base: 2nd to 5th harmonic over the first.
    #[serde(with = "number")]
    pub z_distortion: f32,
    /// Lock-in amplitude of the drive, m.
    #[serde(with = "number")]
    pub drive_amplitude_m: f32,
    /// Whether the drive was at its limit.
    pub drive_saturated: bool,
    /// Names of the sensors that were clipped (a sample was at an end of the span), or `none`; empty in older runs.
    #[serde(default)]
    pub sensors_clipped: String,
    /// Clearance, m; NaN without a particle.
    #[serde(with = "number")]
    pub clearance_m: f64,
    /// Lock-in amplitude of the structure, m.
    #[serde(with = "number")]
    pub x_amplitude_m: f32,
    /// Phase of x relative to z, rad.
    #[serde(with = "number")]
    pub phase_rad: f32,
    /// RMS of x over the dwell, m.
    #[serde(with = "number")]
    pub x_rms_m: f32,
    /// Mean over the cycles of the dwell of max|x|, m.
    #[serde(with = "number")]
    pub x_mean_cycle_max_m: f32,
    /// Largest |x| of the dwell, m.
    #[serde(with = "number")]
    pub x_max_m: f32,
    /// max|x| of the last whole cycle, m.
    #[serde(with = "number")]
    pub x_last_cycle_max_m: f32,
    /// Trend of the cycle maximum, relative change in a cycle.
    #[serde(with = "number")]
    pub change_per_cycle: f32,
    /// Scatter of the cycle maxima around that trend, relative.
    #[serde(with = "number")]
    pub scatter: f32,
    /// Whole cycles in the dwell.
    pub cycles: u32,
    /// Whether the point counts as steady.
    pub steady: bool,
    /// First tick of the dwell.
    pub start_tick: u64,
    /// First tick after the dwell.
    pub end_tick: u64,
    /// d/Z with Z as set; NaN without a particle.
    #[serde(with = "number")]
    pub d_over_z: f64,
    /// Place in the experiment's frequency list, from 0.
    pub point_index: u32,
    /// How many times the experiment had been taken up again on this set-up when the point was measured; ticks count
    /// from 0 in each segment.
    pub segment: u32,
}

impl ResultRow {
    /// A row without values, to ask the columns for their types.
    pub(super) const SAMPLE: Self = Self {
        set_up: String::new(),
        experiment: String::new(),
        frequency_hz: 0.0,
        z_amplitude_m: 0.0,
        z_distortion: 0.0,
        drive_amplitude_m: 0.0,
        drive_saturated: false,
        sensors_clipped: String::new(),
        clearance_m: 0.0,
        x_amplitude_m: 0.0,
        phase_rad: 0.0,
        x_rms_m: 0.0,
        x_mean_cycle_max_m: 0.0,
        x_max_m: 0.0,
        x_last_cycle_max_m: 0.0,
        change_per_cycle: 0.0,
        scatter: 0.0,
        cycles: 0,
        steady: false,
        start_tick: 0,
        end_tick: 0,
        d_over_z: 0.0,
        point_index: 0,
        segment: 0,
    };

    /// X/Z as the literature's tables have it: mean cycle maximum over the measured base amplitude.
    #[must_use]
    pub fn x_over_z(&self) -> f64 {
        f64::from(self.x_mean_cycle_max_m) / f64::from(self.z_amplitude_m)
    }

    /// d/Z with Z as measured; NaN without a particle.
    #[must_use]
    pub fn actual_d_over_z(&self) -> f64 {
        self.clearance_m / f64::from(self.z_amplitude_m)
    }
}

/// A value of a results file.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A name.
    Text(String),
    /// Double precision.
    F64(f64),
    /// Single precision, as the controller computed it.
    F32(f32),
    /// A count.
    U32(u32),
    /// A tick.
    U64(u64),
    /// Yes or no.
    Bool(bool),
}

/// A column of a results file.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its name, with the unit.
    pub name: &'static str,
    /// Its unit; "1" for a ratio or a count, "" for names and flags.
    pub unit: &'static str,
    /// What it holds.
    pub about: &'static str,
    /// Its value in a row.
    pub get: fn(&ResultRow) -> Cell,
}

const fn column(name: &'static str, unit: &'static str, about: &'static str, get: fn(&ResultRow) -> Cell) -> Column {
    Column { name, unit, about, get }
}

/// The columns, in the order of the file.
pub const COLUMNS: &[Column] = &[
    column("set_up", "", "name of the set-up", |r| Cell::Text(r.set_up.clone())),
    column("experiment", "", "name of the experiment", |r| Cell::Text(r.experiment.clone())),
    column("frequency_hz", "Hz", "drive frequency", |r| Cell::F64(r.frequency_hz)),
    column("x_over_z", "1", "x_mean_cycle_max_m / z_amplitude_m", |r| Cell::F64(r.x_over_z())),
    column("d_over_z", "1", "clearance over base amplitude as set; NaN without a particle", |r| Cell::F64(r.d_over_z)),
    column("actual_d_over_z", "1", "clearance over base amplitude as measured; NaN without a particle", |r| {
        Cell::F64(r.actual_d_over_z())
    }),
    column("z_amplitude_m", "m", "base: lock-in amplitude", |r| Cell::F32(r.z_amplitude_m)),
    column("z_distortion", "1", "base: 2nd to 5th harmonic over the first", |r| Cell::F32(r.z_distortion)),
    column("drive_amplitude_m", "m", "drive: lock-in amplitude", |r| Cell::F32(r.drive_amplitude_m)),
    column("drive_saturated", "", "whether the drive was at its limit", |r| Cell::Bool(r.drive_saturated)),
    column("sensors_clipped", "", "sensors with a sample at an end of their span, or none", |r| {
        Cell::Text(r.sensors_clipped.clone())
    }),
    column("x_amplitude_m", "m", "structure: lock-in amplitude", |r| Cell::F32(r.x_amplitude_m)),
    column("phase_rad", "rad", "phase of x relative to z", |r| Cell::F32(r.phase_rad)),
    column("x_rms_m", "m", "structure: RMS over the dwell", |r| Cell::F32(r.x_rms_m)),
    column("x_mean_cycle_max_m", "m", "structure: mean over cycles of max|x|", |r| Cell::F32(r.x_mean_cycle_max_m)),
    column("x_max_m", "m", "structure: largest |x| of the dwell", |r| Cell::F32(r.x_max_m)),
    column("x_last_cycle_max_m", "m", "structure: max|x| of the last whole cycle", |r| Cell::F32(r.x_last_cycle_max_m)),
    column("change_per_cycle", "1", "trend of the cycle maximum, relative, in a cycle", |r| {
        Cell::F32(r.change_per_cycle)
    }),
    column("scatter", "1", "scatter of the cycle maxima around the trend, relative", |r| Cell::F32(r.scatter)),
    column("cycles", "1", "whole cycles in the dwell", |r| Cell::U32(r.cycles)),
    column("steady", "", "whether the point counts as steady", |r| Cell::Bool(r.steady)),
    column("start_tick", "tick", "first tick of the dwell", |r| Cell::U64(r.start_tick)),
    column("end_tick", "tick", "first tick after the dwell", |r| Cell::U64(r.end_tick)),
    column("point_index", "1", "place in the experiment's frequency list, from 0", |r| Cell::U32(r.point_index)),
    column("segment", "1", "times that the experiment had been taken up again; ticks count from 0 in each", |r| {
        Cell::U32(r.segment)
    }),
];
