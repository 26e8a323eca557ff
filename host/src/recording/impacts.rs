//! `impacts.parquet`: every impact that the device reported, a row each. The lines of the journal are what it is made
//! of.

use std::path::Path;
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, Int32Array, RecordBatch, StringArray, UInt32Array, UInt64Array,
};
use arrow_schema::{DataType, Schema};
use damprig_core::measure::impacts::ImpactRecord;
use serde::{Deserialize, Serialize};

use super::StorageError;
use super::parquet::{Kept, field, write_whole};

/// The file's name in a run folder.
pub const IMPACTS: &str = "impacts.parquet";

/// Some impacts of one segment, in the order in which they were reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Impacts {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// Which segment of it.
    pub segment: u32,
    /// The impacts.
    pub impacts: Vec<ImpactRecord>,
}

/// Writes all impacts; an earlier file of the name is replaced as a whole.
///
/// # Errors
/// When the file cannot be written; an earlier one stays as it is.
pub fn write(path: &Path, all: &[Impacts], tick_hz: f64) -> Result<(), StorageError> {
    let batch = table(all, tick_hz).map_err(|e| StorageError::new("write", path, e))?;
    write_whole(path, &batch.schema(), std::iter::once(Ok(batch)), Kept::ByTheSystem)
}

fn table(all: &[Impacts], tick_hz: f64) -> Result<RecordBatch, String> {
    let rows = || all.iter().flat_map(|some| some.impacts.iter().map(move |impact| (some, impact)));
    let impact = || rows().map(|(_, impact)| impact);
    let t_s = |i: &ImpactRecord| (f64::from(i.tick) + f64::from(i.centre_ticks)) / tick_hz;
    let columns: Vec<(&str, &str, ArrayRef)> = vec![
        ("set_up", "", Arc::new(StringArray::from_iter_values(rows().map(|(some, _)| some.set_up.as_str())))),
        ("experiment", "", Arc::new(StringArray::from_iter_values(rows().map(|(some, _)| some.experiment.as_str())))),
        ("segment", "1", Arc::new(UInt32Array::from_iter_values(rows().map(|(some, _)| some.segment)))),
        ("tick", "tick", Arc::new(UInt64Array::from_iter_values(impact().map(|i| u64::from(i.tick))))),
        ("t_s", "s", Arc::new(Float64Array::from_iter_values(impact().map(t_s)))),
        ("side", "1", Arc::new(Int32Array::from_iter_values(impact().map(|i| i32::from(i.side))))),
        ("peak_n", "N", Arc::new(Float32Array::from_iter_values(impact().map(|i| i.peak_n)))),
        ("impulse_n_s", "N·s", Arc::new(Float32Array::from_iter_values(impact().map(|i| i.impulse_n_s)))),
        ("contact_s", "s", Arc::new(Float32Array::from_iter_values(impact().map(|i| i.contact_s)))),
        ("clipped", "", Arc::new(BooleanArray::from_iter(impact().map(|i| Some(i.clipped))))),
        ("held", "", Arc::new(BooleanArray::from_iter(impact().map(|i| Some(i.held))))),
    ];
    let fields: Vec<_> =
        columns.iter().map(|(name, unit, a)| field(name, DataType::clone(a.data_type()), unit)).collect();
    let arrays = columns.into_iter().map(|(_, _, array)| array).collect();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).map_err(|e| e.to_string())
}
