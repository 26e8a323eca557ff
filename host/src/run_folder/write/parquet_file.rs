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

use crate::failure::Failure;
use crate::run_folder::own_files;
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
fn failure(path: &Path, error: ParquetError) -> Failure {
    Failure::cannot("write", path, Failure::from(error))
}

/// A table with this metadata.
fn described(table: RecordBatch, about: Metadata) -> Result<RecordBatch, Failure> {
    let schema = Arc::new(table.schema().as_ref().clone().with_metadata(about));
    Ok(table.with_schema(schema)?)
}

/// The bytes of a file of one table with this metadata.
///
/// # Errors
/// When it cannot be made: a defect of this program.
pub(crate) fn bytes_of(table: RecordBatch, about: Metadata) -> Result<Vec<u8>, Failure> {
    let table = described(table, about)?;
    let mut writer = ArrowWriter::try_new(Vec::new(), table.schema(), Some(properties(&table.schema())))?;
    writer.write(&table)?;
    Ok(writer.into_inner()?)
}

/// Writes a file of one table with this metadata; an earlier file of the name is replaced as a whole.
pub(super) fn write_table(
    path: &Path,
    table: Result<RecordBatch, Failure>,
    about: Metadata,
    durability: Durability,
) -> Result<(), Failure> {
    let table = table.and_then(|table| described(table, about)).map_err(|e| Failure::cannot("write", path, e))?;
    write_whole(path, &table.schema(), std::iter::once(Ok(table)), durability)
}

/// Writes a file beside `path`, then renames it.
pub(super) fn write_whole(
    path: &Path,
    schema: &SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, Failure>>,
    durability: Durability,
) -> Result<(), Failure> {
    let beside = own_files::beside(path);
    let written = (|| {
        let file = own_files::create(&beside).map_err(|e| Failure::cannot("create", &beside, e))?;
        let mut writer =
            ArrowWriter::try_new(file, schema.clone(), Some(properties(schema))).map_err(|e| failure(path, e))?;
        for batch in batches {
            let batch = batch.map_err(|e| Failure::cannot("write", path, e))?;
            writer.write(&batch).map_err(|e| failure(path, e))?;
        }
        let file = writer.into_inner().map_err(|e| failure(path, e))?;
        if durability == Durability::Disk {
            file.sync_data().map_err(|e| Failure::cannot("write", path, e))?;
            return own_files::name_for_good(&beside, path).map_err(|e| Failure::cannot("name", path, e));
        }
        fs::rename(&beside, path).map_err(|e| Failure::cannot("name", path, e))
    })();
    if written.is_err() {
        // The data that it was made from are kept elsewhere.
        own_files::remove_left(&beside);
    }
    written
}
