//! Parquet files of results and samples, units in the columns' metadata.
//!
//! Snappy compression, which every reader has. Files appear under their name only when they are whole: they
//! are written beside it and renamed.

use std::collections::HashMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::builder::StringDictionaryBuilder;
use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, RecordBatch, StringArray, UInt32Array, UInt64Array,
};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;

use super::row::{COLUMNS, Cell, Column, ResultRow};
use super::{Signal, StorageError};

/// A column that is never empty, with its unit.
pub(crate) fn field(name: &str, kind: DataType, unit: &str) -> Field {
    Field::new(name, kind, false).with_metadata(HashMap::from([("unit".to_string(), unit.to_string())]))
}

/// How every table is written.
pub(crate) fn properties() -> WriterProperties {
    WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(crate::VERSION_LINE.to_string())
        .build()
}

/// A parquet failure as the storage failure it is; the disk's own words when there are any.
fn failure(path: &Path, error: ParquetError) -> StorageError {
    let message = match &error {
        ParquetError::External(inner) => inner.to_string(),
        other => other.to_string(),
    };
    StorageError::new("write", path, message)
}

/// Writes a file beside `path`, then gives it its name.
fn write_whole(
    path: &Path,
    schema: &SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, String>>,
) -> Result<(), StorageError> {
    let beside = PathBuf::from(format!("{}.tmp", path.display()));
    let written = (|| {
        let file = File::create(&beside).map_err(|e| StorageError::new("create", &beside, e))?;
        let mut writer =
            ArrowWriter::try_new(file, schema.clone(), Some(properties())).map_err(|e| failure(path, e))?;
        for batch in batches {
            let batch = batch.map_err(|e| StorageError::new("write", path, e))?;
            writer.write(&batch).map_err(|e| failure(path, e))?;
        }
        writer.close().map_err(|e| failure(path, e))?;
        fs::rename(&beside, path).map_err(|e| StorageError::new("name", path, e))
    })();
    if written.is_err() {
        // A half-written file is of no use to anyone; what it was made of is kept elsewhere.
        let _ = fs::remove_file(&beside);
    }
    written
}

/// Writes all result rows; an earlier file of the name is replaced as a whole.
///
/// # Errors
/// When the file cannot be written; an earlier one stays as it is.
pub fn write_results(path: &Path, rows: &[ResultRow]) -> Result<(), StorageError> {
    let arrays: Vec<(Field, ArrayRef)> = COLUMNS.iter().map(|c| results_column(c, rows)).collect();
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = arrays.into_iter().unzip();
    let schema = Arc::new(Schema::new(fields));
    let batch = RecordBatch::try_new(schema.clone(), arrays).map_err(|e| e.to_string());
    write_whole(path, &schema, std::iter::once(batch))
}

fn results_column(column: &Column, rows: &[ResultRow]) -> (Field, ArrayRef) {
    macro_rules! gather {
        ($array:ty, $variant:path) => {{
            let values = rows.iter().filter_map(|r| match (column.get)(r) {
                $variant(value) => Some(value),
                _ => None,
            });
            Arc::new(<$array>::from_iter(values.map(Some))) as ArrayRef
        }};
    }
    // The type of a column is that of its value in any row.
    let array = match (column.get)(&ResultRow::SAMPLE) {
        Cell::Text(_) => gather!(StringArray, Cell::Text),
        Cell::F64(_) => gather!(Float64Array, Cell::F64),
        Cell::F32(_) => gather!(Float32Array, Cell::F32),
        Cell::U32(_) => gather!(UInt32Array, Cell::U32),
        Cell::U64(_) => gather!(UInt64Array, Cell::U64),
        Cell::Bool(_) => gather!(BooleanArray, Cell::Bool),
    };
    let mut field = field(column.name, array.data_type().clone(), column.unit);
    field.set_metadata(HashMap::from([
        ("unit".to_string(), column.unit.to_string()),
        ("description".to_string(), column.about.to_string()),
    ]));
    (field, array)
}

/// Samples being gathered for the next part.
#[derive(Debug, Default)]
struct Rows {
    set_up: Vec<u32>,
    experiment: Vec<u32>,
    frequency_hz: Vec<f64>,
    tick: Vec<u64>,
    t_s: Vec<f64>,
    signals: Vec<Vec<f32>>,
}

/// The telemetry of a run: parts while it runs, one file when it ends.
///
/// A Parquet file without its end cannot be read. So each point of a run is a whole file of its own in
/// `samples.parts/` (a folder that Parquet readers take as one data set), and [`SampleFile::close`] joins
/// them into `samples.parquet`. A run killed at any instant has lost the point it was at, and no more.
#[derive(Debug)]
pub struct SampleFile {
    path: PathBuf,
    parts: PathBuf,
    schema: SchemaRef,
    names: Vec<String>,
    rows: Rows,
    part: usize,
    written: u64,
}

/// Which point samples belong to.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    /// Name of the set-up.
    pub set_up: &'a str,
    /// Name of the experiment.
    pub experiment: &'a str,
    /// Drive frequency, Hz.
    pub frequency_hz: f64,
}

/// A part is written when it holds this many rows, if its point has not ended before.
const ROWS_PER_PART: usize = 100_000;

impl SampleFile {
    /// Begins `samples.parquet` in `folder` for these signals.
    ///
    /// # Errors
    /// When the folder of parts cannot be made.
    pub fn create(folder: &Path, signals: &[Signal]) -> Result<Self, StorageError> {
        let parts = folder.join("samples.parts");
        fs::create_dir_all(&parts).map_err(|e| StorageError::new("create", &parts, e))?;
        let name = || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let mut fields = vec![
            field("set_up", name(), ""),
            field("experiment", name(), ""),
            field("point_frequency_hz", DataType::Float64, "Hz"),
            field("tick", DataType::UInt64, "tick"),
            field("t_s", DataType::Float64, "s"),
        ];
        fields.extend(signals.iter().map(|s| field(&s.name, DataType::Float32, &s.unit)));
        let rows = Rows { signals: vec![Vec::new(); signals.len()], ..Rows::default() };
        let schema = Arc::new(Schema::new(fields));
        Ok(Self { path: folder.join("samples.parquet"), parts, schema, names: Vec::new(), rows, part: 0, written: 0 })
    }

    /// Samples taken so far, rows.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.written + self.rows.tick.len() as u64
    }

    /// Adds the signals' values at a tick; `values` are in the order of the signals given at the start.
    ///
    /// # Errors
    /// When a part was full and could not be written.
    pub fn push(
        &mut self,
        point: Point,
        tick: u64,
        t_s: f64,
        values: impl Iterator<Item = f32>,
    ) -> Result<(), StorageError> {
        let set_up = self.name(point.set_up);
        let experiment = self.name(point.experiment);
        self.rows.set_up.push(set_up);
        self.rows.experiment.push(experiment);
        self.rows.frequency_hz.push(point.frequency_hz);
        self.rows.tick.push(tick);
        self.rows.t_s.push(t_s);
        let mut values = values.into_iter();
        for column in &mut self.rows.signals {
            column.push(values.next().unwrap_or(f32::NAN));
        }
        if self.rows.tick.len() >= ROWS_PER_PART { self.flush() } else { Ok(()) }
    }

    fn name(&mut self, name: &str) -> u32 {
        if let Some(index) = self.names.iter().rposition(|n| n == name) {
            return index as u32;
        }
        self.names.push(name.to_string());
        self.names.len() as u32 - 1
    }

    /// Writes what has been gathered as a part.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn flush(&mut self) -> Result<(), StorageError> {
        if self.rows.tick.is_empty() {
            return Ok(());
        }
        let empty = Rows { signals: vec![Vec::new(); self.rows.signals.len()], ..Rows::default() };
        let rows = std::mem::replace(&mut self.rows, empty);
        let count = rows.tick.len() as u64;
        let names = |indices: &[u32]| {
            let mut builder = StringDictionaryBuilder::<Int32Type>::new();
            for index in indices {
                builder.append_value(&self.names[*index as usize]);
            }
            Arc::new(builder.finish()) as ArrayRef
        };
        let mut arrays: Vec<ArrayRef> = vec![
            names(&rows.set_up),
            names(&rows.experiment),
            Arc::new(Float64Array::from(rows.frequency_hz)),
            Arc::new(UInt64Array::from(rows.tick)),
            Arc::new(Float64Array::from(rows.t_s)),
        ];
        arrays.extend(rows.signals.into_iter().map(|s| Arc::new(Float32Array::from(s)) as ArrayRef));
        let batch = RecordBatch::try_new(self.schema.clone(), arrays).map_err(|e| e.to_string());
        self.part += 1;
        let path = self.parts.join(format!("{:06}.parquet", self.part));
        write_whole(&path, &self.schema, std::iter::once(batch))?;
        self.written += count;
        Ok(())
    }

    /// Joins the parts into `samples.parquet` and takes them away.
    ///
    /// # Errors
    /// When that cannot be written; the parts stay, and can be read as they are.
    pub fn close(&mut self) -> Result<(), StorageError> {
        let flushed = self.flush();
        let parts: Vec<PathBuf> =
            (1..=self.part).map(|i| self.parts.join(format!("{i:06}.parquet"))).filter(|p| p.exists()).collect();
        let batches = parts.iter().flat_map(|path| match read(path) {
            Ok(batches) => batches,
            Err(error) => vec![Err(error)],
        });
        write_whole(&self.path, &self.schema, batches)?;
        fs::remove_dir_all(&self.parts).map_err(|e| StorageError::new("remove", &self.parts, e))?;
        flushed
    }
}

/// All batches of a Parquet file.
fn read(path: &Path) -> Result<Vec<Result<RecordBatch, String>>, String> {
    let failed = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = File::open(path).map_err(|e| failed(&e))?;
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).and_then(ParquetRecordBatchReaderBuilder::build);
    Ok(reader.map_err(|e| failed(&e))?.map(|batch| batch.map_err(|e| e.to_string())).collect())
}
