//! The samples' columns, and the one file that the parts of a complete run become.
//!
//! A Parquet file without its end cannot be read. So samples arrive in a [`super::part`] that can be cut off anywhere,
//! become a Parquet file of `samples.parts/` when their point is over, and one file when the run is complete.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, DictionaryArray, Float64Array, Int32Array, RecordBatch, StringArray, UInt32Array, UInt64Array,
};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::parquet::{Kept, field, write_whole};
use super::{Signal, StorageError};

/// The joined samples of a complete run.
pub const JOINED: &str = "samples.parquet";

/// Folder of the closed parts of a run that is not complete. Parquet readers take it as one data set.
pub const PARTS: &str = "samples.parts";

/// Which point samples belong to.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// How often the experiment had been started on the set-up before.
    pub segment: u32,
    /// Place of the point in the experiment's frequency list.
    pub point_index: u32,
    /// Its drive frequency, Hz.
    pub frequency_hz: f64,
}

/// The columns before the signals.
fn leading() -> Vec<Field> {
    let name = || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    vec![
        field("set_up", name(), ""),
        field("experiment", name(), ""),
        field("segment", DataType::UInt32, "1"),
        field("point_index", DataType::UInt32, "1"),
        field("point_frequency_hz", DataType::Float64, "Hz"),
        field("tick", DataType::UInt64, "tick"),
        field("gap_before_ticks", DataType::UInt32, "tick"),
        field("t_s", DataType::Float64, "s"),
    ]
}

/// The columns of samples with these signals.
#[must_use]
pub fn schema(signals: &[Signal]) -> SchemaRef {
    let signals = signals.iter().map(|s| field(&s.name, DataType::Float32, &s.unit));
    Arc::new(Schema::new(leading().into_iter().chain(signals).collect::<Vec<_>>()))
}

/// All columns of rows of one point: `ticks`, `gaps` and the signals' values are as long as each other.
///
/// # Errors
/// When they are not.
pub(super) fn rows(
    schema: &SchemaRef,
    label: &Label,
    tick_hz: f64,
    ticks: &UInt64Array,
    gaps: ArrayRef,
    signals: &[ArrayRef],
) -> Result<RecordBatch, String> {
    let count = ticks.len();
    let name = |name: &str| -> Result<ArrayRef, String> {
        let names = Arc::new(StringArray::from(vec![name]));
        let keys = Int32Array::from(vec![0; count]);
        Ok(Arc::new(DictionaryArray::<Int32Type>::try_new(keys, names).map_err(|e| e.to_string())?))
    };
    let t_s: Float64Array = ticks.values().iter().map(|tick| Some(*tick as f64 / tick_hz)).collect();
    let mut columns: Vec<ArrayRef> = vec![
        name(&label.set_up)?,
        name(&label.experiment)?,
        Arc::new(UInt32Array::from(vec![label.segment; count])),
        Arc::new(UInt32Array::from(vec![label.point_index; count])),
        Arc::new(Float64Array::from(vec![label.frequency_hz; count])),
        Arc::new(ticks.clone()),
        gaps,
        Arc::new(t_s),
    ];
    columns.extend_from_slice(signals);
    RecordBatch::try_new(schema.clone(), columns).map_err(|e| e.to_string())
}

/// The file of a closed part, relative to the run folder.
#[must_use]
pub fn part_name(part: u32) -> String {
    format!("{PARTS}/{part:06}.parquet")
}

/// Numbers and files of the closed parts, in order.
#[must_use]
pub fn parts(folder: &Path) -> Vec<(u32, PathBuf)> {
    let entries = fs::read_dir(folder.join(PARTS)).into_iter().flatten().flatten().map(|e| e.path());
    let numbered = entries.filter(|p| p.extension().is_some_and(|e| e == "parquet")).filter_map(|path| {
        let number = path.file_stem()?.to_str()?.parse().ok()?;
        Some((number, path))
    });
    let mut parts: Vec<(u32, PathBuf)> = numbered.collect();
    parts.sort();
    parts
}

/// Joins the closed parts into `samples.parquet`; gives the number of rows. The parts stay.
///
/// # Errors
/// When a part cannot be read or the file cannot be written.
pub fn join(folder: &Path, signals: &[Signal]) -> Result<u64, StorageError> {
    let mut rows = 0;
    let batches = parts(folder).into_iter().flat_map(|(_, path)| read(&path).unwrap_or_else(|e| vec![Err(e)]));
    let counted = batches.inspect(|batch| rows += batch.as_ref().map_or(0, |b| b.num_rows() as u64));
    write_whole(&folder.join(JOINED), &schema(signals), counted, Kept::OnTheDisk)?;
    Ok(rows)
}

/// Takes the parts away, once they are joined and the journal says so.
///
/// # Errors
/// When they cannot be removed.
pub fn remove_parts(folder: &Path) -> Result<(), StorageError> {
    let path = folder.join(PARTS);
    match fs::remove_dir_all(&path) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(StorageError::new("remove", &path, error)),
    }
}

/// All batches of a Parquet file.
fn read(path: &Path) -> Result<Vec<Result<RecordBatch, String>>, String> {
    let failed = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = fs::File::open(path).map_err(|e| failed(&e))?;
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).and_then(ParquetRecordBatchReaderBuilder::build);
    Ok(reader.map_err(|e| failed(&e))?.map(|batch| batch.map_err(|e| e.to_string())).collect())
}
