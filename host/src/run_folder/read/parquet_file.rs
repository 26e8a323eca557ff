//! Reads one Parquet file, batch by batch.

use std::path::Path;

use arrow_array::RecordBatch;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::input::regular;
use crate::run_folder::ReadError;

/// Batches of a Parquet file.
///
/// # Errors
/// When it is missing, or is not a whole Parquet file. A batch that cannot be decoded is an error in its place.
pub fn read(path: &Path) -> Result<impl Iterator<Item = Result<RecordBatch, ReadError>> + use<>, ReadError> {
    let shown = path.display().to_string();
    let failed = |message: String| ReadError(format!("{shown}: {message}"));
    let file = regular::open(path).map_err(|e| failed(format!("cannot read it: {e}")))?;
    let bytes = file.metadata().map_or(0, |m| m.len());
    let damaged = |e| failed(format!("not a whole Parquet file ({bytes} bytes; cut off or damaged): {e}"));
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).map_err(damaged)?;
    // A table without rows has its columns all the same.
    let is_empty = builder.metadata().file_metadata().num_rows() == 0;
    let columns = is_empty.then(|| Ok(RecordBatch::new_empty(builder.schema().clone())));
    let batches = builder.build().map_err(damaged)?;
    let batches = batches.map(move |batch| batch.map_err(|e| ReadError(format!("{shown}: a damaged part: {e}"))));
    Ok(columns.into_iter().chain(batches))
}
