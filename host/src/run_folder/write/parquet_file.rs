//! Writes whole Parquet files.
//!
//! A file is written beside its final name and renamed, so it appears under its name only when it is whole.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::{Metadata, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::errors::ParquetError;

use crate::run_folder::{StorageError, own_files};
use crate::table::parquet_properties::properties;

/// What a written file survives when the call returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Durability {
    /// The end of the program.
    Program,
    /// A power cut too.
    Disk,
}

/// A Parquet error as a storage error, with the system's message when there is one.
fn failure(path: &Path, error: ParquetError) -> StorageError {
    let message = match &error {
        ParquetError::External(inner) => inner.to_string(),
        other => other.to_string(),
    };
    StorageError::new("write", path, message)
}

/// A table with this metadata.
fn described(table: RecordBatch, about: Metadata) -> Result<RecordBatch, String> {
    let schema = Arc::new(table.schema().as_ref().clone().with_metadata(about));
    table.with_schema(schema).map_err(|e| e.to_string())
}

/// The bytes of a file of one table with this metadata.
///
/// # Errors
/// When it cannot be made: a defect of this program.
pub(crate) fn bytes_of(table: RecordBatch, about: Metadata) -> Result<Vec<u8>, String> {
    let table = described(table, about)?;
    let mut writer = ArrowWriter::try_new(Vec::new(), table.schema(), Some(properties(&table.schema())))
        .map_err(|e| e.to_string())?;
    writer.write(&table).map_err(|e| e.to_string())?;
    writer.into_inner().map_err(|e| e.to_string())
}

/// Writes a file of one table with this metadata; an earlier file of the name is replaced as a whole.
pub(super) fn write_table(
    path: &Path,
    table: Result<RecordBatch, String>,
    about: Metadata,
    durability: Durability,
) -> Result<(), StorageError> {
    let table = table.and_then(|table| described(table, about)).map_err(|e| StorageError::new("write", path, e))?;
    write_whole(path, &table.schema(), std::iter::once(Ok(table)), durability)
}

/// Writes a file beside `path`, then renames it.
pub(super) fn write_whole(
    path: &Path,
    schema: &SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, String>>,
    durability: Durability,
) -> Result<(), StorageError> {
    let beside = own_files::beside(path);
    let written = (|| {
        let file = own_files::create(&beside).map_err(|e| StorageError::new("create", &beside, e))?;
        let mut writer =
            ArrowWriter::try_new(file, schema.clone(), Some(properties(schema))).map_err(|e| failure(path, e))?;
        for batch in batches {
            let batch = batch.map_err(|e| StorageError::new("write", path, e))?;
            writer.write(&batch).map_err(|e| failure(path, e))?;
        }
        let file = writer.into_inner().map_err(|e| failure(path, e))?;
        if durability == Durability::Disk {
            file.sync_data().map_err(|e| StorageError::new("write", path, e))?;
            return own_files::name_for_good(&beside, path).map_err(|e| StorageError::new("name", path, e));
        }
        fs::rename(&beside, path).map_err(|e| StorageError::new("name", path, e))
    })();
    if written.is_err() {
        // The data that it was made from are kept elsewhere.
        own_files::remove_left(&beside);
    }
    written
}
