//! The samples' columns, and the one file that the parts of a complete run become.
//!
//! A Parquet file without its end cannot be read. So samples arrive in a [`super::part`] that can be cut off anywhere,
//! become a Parquet file of `samples.parts/` when their point is over, and one file when the run is complete.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, DictionaryArray, Float64Array, Int32Array, RecordBatch, StringArray, UInt32Array, UInt64Array,
};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::journal::Sealed;
use super::parquet::{Kept, field, write_whole};
use super::{Signal, StorageError, checksum};
use crate::input::regular;

/// The joined samples of a complete run.
pub const JOINED: &str = "samples.parquet";

/// The joined samples once more, to compare them with a file that has their name.
const AGAIN: &str = "samples.again.parquet";

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

/// What came of joining.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Join {
    /// Rows of the joined file.
    pub rows: u64,
    /// Numbers of the parts that are not as the journal says, so that they are not in it.
    pub left: Vec<u32>,
}

/// Joins the parts that the journal knows into `samples.parquet`. The parts stay. One that is not what it was when it
/// was closed is left out, and costs its own rows alone.
///
/// # Errors
/// When the file cannot be written; or another one has its name that is not what the parts join into.
pub fn join(folder: &Path, signals: &[Signal], sealed: &[Sealed]) -> Result<Join, StorageError> {
    let is_sound = |s: &&Sealed| {
        let is_same = checksum::of_file(folder, &s.file.name).is_ok_and(|now| now == s.file);
        is_same && read(&folder.join(&s.file.name)).is_ok_and(|batches| batches.iter().all(Result::is_ok))
    };
    let (mut sound, left): (Vec<&Sealed>, Vec<&Sealed>) = sealed.iter().partition(is_sound);
    sound.sort_by_key(|s| s.part);
    let mut join = Join { rows: 0, left: left.iter().map(|s| s.part).collect() };
    let batches = sound.iter().flat_map(|s| read(&folder.join(&s.file.name)).unwrap_or_else(|e| vec![Err(e)]));
    let counted = batches.inspect(|batch| join.rows += batch.as_ref().map_or(0, |b| b.num_rows() as u64));
    let path = folder.join(JOINED);
    if !path.exists() {
        write_whole(&path, &schema(signals), counted, Kept::OnTheDisk)?;
        return Ok(join);
    }
    // A kill came between the joined file and its line in the journal, or somebody put a file there.
    let again = folder.join(AGAIN);
    write_whole(&again, &schema(signals), counted, Kept::ByTheSystem)?;
    let sum = |name: &str| checksum::of_file(folder, name).map(|f| f.sha256);
    let is_own = matches!((sum(JOINED), sum(AGAIN)), (Ok(there), Ok(own)) if there == own);
    fs::remove_file(&again).map_err(|e| StorageError::new("remove", &again, e))?;
    if is_own {
        return Ok(join);
    }
    let message =
        format!("a file of this name is there, and it is not what {PARTS} join into; move it elsewhere and resume");
    Err(StorageError::new("write", &path, message))
}

/// Takes away the parts that are joined, once the journal says so. Whatever else stands beside them stays.
///
/// # Errors
/// When they cannot be removed.
pub fn remove_parts<'a>(folder: &Path, joined: impl Iterator<Item = &'a Sealed>) -> Result<(), StorageError> {
    for part in joined {
        let path = folder.join(&part.file.name);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(StorageError::new("remove", &path, error));
            }
            _ => {}
        }
    }
    let path = folder.join(PARTS);
    match fs::remove_dir(&path) {
        Err(error) if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::DirectoryNotEmpty) => {
            Err(StorageError::new("remove", &path, error))
        }
        _ => Ok(()),
    }
}

/// All batches of a Parquet file.
fn read(path: &Path) -> Result<Vec<Result<RecordBatch, String>>, String> {
    let failed = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = regular::open(path).map_err(|e| failed(&e))?;
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).and_then(ParquetRecordBatchReaderBuilder::build);
    Ok(reader.map_err(|e| failed(&e))?.map(|batch| batch.map_err(|e| e.to_string())).collect())
}
