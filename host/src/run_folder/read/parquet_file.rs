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
    let reader = ParquetRecordBatchReaderBuilder::try_new(file)
        .and_then(ParquetRecordBatchReaderBuilder::build)
        .map_err(|e| failed(format!("not a whole Parquet file ({bytes} bytes; cut off or damaged): {e}")))?;
    Ok(reader.map(move |batch| batch.map_err(|e| ReadError(format!("{shown}: a damaged part: {e}")))))
}
