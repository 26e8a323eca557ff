//! Whole Parquet files, units in the columns' metadata, and the results as one.
//!
//! Snappy compression, which every reader has. Files appear under their name only when they are whole: they
//! are written beside it and renamed. The samples' columns are [`super::samples`]'s.

use std::collections::HashMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, RecordBatch, StringArray, UInt32Array, UInt64Array,
};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;

use super::StorageError;
use super::row::{COLUMNS, Cell, Column, ResultRow};

/// A column that is never empty, with its unit.
pub(crate) fn field(name: &str, kind: DataType, unit: &str) -> Field {
    Field::new(name, kind, false).with_metadata(HashMap::from([("unit".to_string(), unit.to_string())]))
}

/// How much a written file has to survive before the call returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kept {
    /// The end of the program.
    ByTheSystem,
    /// The end of the machine too.
    OnTheDisk,
}

/// How every table is written. Measured values hardly ever repeat: a dictionary of them is only longer. Ticks rise
/// evenly: their differences are short.
pub(crate) fn properties(schema: &Schema) -> WriterProperties {
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(crate::VERSION_LINE.to_string());
    for field in schema.fields() {
        let encoding = match field.data_type() {
            DataType::Float32 => Encoding::PLAIN,
            DataType::UInt64 => Encoding::DELTA_BINARY_PACKED,
            _ => continue,
        };
        let column = field.name().as_str();
        properties = properties.set_column_dictionary_enabled(column.into(), false);
        properties = properties.set_column_encoding(column.into(), encoding);
    }
    properties.build()
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
pub(super) fn write_whole(
    path: &Path,
    schema: &SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, String>>,
    kept: Kept,
) -> Result<(), StorageError> {
    let beside = PathBuf::from(format!("{}.tmp", path.display()));
    let written = (|| {
        let file = File::create(&beside).map_err(|e| StorageError::new("create", &beside, e))?;
        let mut writer =
            ArrowWriter::try_new(file, schema.clone(), Some(properties(schema))).map_err(|e| failure(path, e))?;
        for batch in batches {
            let batch = batch.map_err(|e| StorageError::new("write", path, e))?;
            writer.write(&batch).map_err(|e| failure(path, e))?;
        }
        let file = writer.into_inner().map_err(|e| failure(path, e))?;
        if kept == Kept::OnTheDisk {
            file.sync_data().map_err(|e| StorageError::new("write", path, e))?;
        }
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
    let batch = results(rows).map_err(|e| StorageError::new("write", path, e))?;
    write_whole(path, &batch.schema(), std::iter::once(Ok(batch)), Kept::ByTheSystem)
}

/// Result rows as a table.
///
/// # Errors
/// When the columns do not fit each other: then [`COLUMNS`] is wrong.
pub fn results(rows: &[ResultRow]) -> Result<RecordBatch, String> {
    let arrays: Vec<(Field, ArrayRef)> = COLUMNS.iter().map(|c| results_column(c, rows)).collect();
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = arrays.into_iter().unzip();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).map_err(|e| e.to_string())
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
