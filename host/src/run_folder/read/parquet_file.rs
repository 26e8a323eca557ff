//! Reads one Parquet file, batch by batch.
//!
//! The `parquet` crate panics on some damaged files, for example where a page header names an encoding without a dictionary.
//! Here such a panic is an error of the file, without the panic's own message.

use std::collections::HashMap;
use std::path::Path;

use arrow_array::RecordBatch;
use bytes::Bytes;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::file::reader::ChunkReader;

use crate::failure::Failure;
use crate::input::{regular, without_panic};
use crate::run_folder::sealed_parquet;
use crate::table::with_present_names;

/// Batches of a Parquet file. The first call installs a panic hook that passes on every panic but those of the `parquet` crate in
/// here.
///
/// # Errors
/// When it is missing, or is not a whole Parquet file. A batch that cannot be decoded is an error in its place.
pub fn read(path: &Path) -> Result<impl Iterator<Item = Result<RecordBatch, Failure>> + use<>, Failure> {
    open(path, None)
}

/// As [`read`], only some columns: cheap where the others are large.
///
/// # Errors
/// As [`read`].
pub fn read_columns(
    path: &Path,
    names: &[&str],
) -> Result<impl Iterator<Item = Result<RecordBatch, Failure>> + use<>, Failure> {
    open(path, Some(names))
}

/// The columns of a file, as a table without rows. Only the end of the file is read.
///
/// # Errors
/// As [`read`].
pub fn columns(path: &Path) -> Result<RecordBatch, Failure> {
    let failed = |message: String| Failure::Storage(format!("{}: {message}", path.display()));
    let file = regular::open(path).map_err(|e| failed(format!("cannot read it: {e}")))?;
    let opened = without_panic(|| ParquetRecordBatchReaderBuilder::try_new(file).map_err(|e| e.to_string()));
    let builder = opened.and_then(|opened| opened).map_err(|e| failed(format!("not a whole Parquet file: {e}")))?;
    Ok(with_present_names(RecordBatch::new_empty(builder.schema().clone())))
}

/// A Parquet file in memory.
#[derive(Clone, Debug)]
pub struct Content {
    /// The metadata of its schema.
    pub metadata: HashMap<String, String>,
    /// Its batches.
    pub batches: Vec<RecordBatch>,
    /// It has a digest, and is as it was written; one of an older version has none.
    pub has_digest: bool,
}

/// A Parquet file in memory.
///
/// # Errors
/// As [`read`], and when it has changed since it was written; `shown` names the file.
pub fn content(shown: &str, bytes: Bytes) -> Result<Content, Failure> {
    let damaged = |e| {
        Failure::Storage(format!("{shown}: not a whole Parquet file ({} bytes; cut off or damaged): {e}", bytes.len()))
    };
    let opened = without_panic(|| ParquetRecordBatchReaderBuilder::try_new(bytes.clone()).map_err(|e| e.to_string()));
    let schema = opened.and_then(|opened| opened).map_err(damaged)?.schema().clone();
    let has_digest = match sealed_parquet::is_as_written(&bytes, &schema) {
        Some(false) => {
            return Err(Failure::Storage(format!("{shown}: changed since it was written (SHA-256 differs)")));
        }
        digest => digest.is_some(),
    };
    let batches = batches(shown.to_string(), bytes.len() as u64, bytes, None)?.collect::<Result<Vec<_>, Failure>>()?;
    Ok(Content { metadata: schema.metadata().clone().into(), batches, has_digest })
}

fn open(
    path: &Path,
    names: Option<&[&str]>,
) -> Result<impl Iterator<Item = Result<RecordBatch, Failure>> + use<>, Failure> {
    let shown = path.display().to_string();
    let file = regular::open(path).map_err(|e| Failure::Storage(format!("{shown}: cannot read it: {e}")))?;
    let length = file.metadata().map_or(0, |m| m.len());
    batches(shown, length, file, names)
}

fn batches<R: ChunkReader + 'static>(
    shown: String,
    length: u64,
    file: R,
    names: Option<&[&str]>,
) -> Result<impl Iterator<Item = Result<RecordBatch, Failure>> + use<R>, Failure> {
    let damaged =
        |e| Failure::Storage(format!("{shown}: not a whole Parquet file ({length} bytes; cut off or damaged): {e}"));
    let opened = without_panic(|| {
        let builder = ParquetRecordBatchReaderBuilder::try_new(file).map_err(|e| e.to_string())?;
        // By place: a name with a dot would be taken for one within another.
        let mask = names.map(|names| {
            let fields = builder.schema().fields().iter().enumerate();
            let places = fields.filter(|(_, field)| names.contains(&field.name().as_str())).map(|(place, _)| place);
            ProjectionMask::roots(builder.parquet_schema(), places)
        });
        let builder = builder.with_projection(mask.unwrap_or_else(ProjectionMask::all));
        // A table without rows has its columns all the same.
        let is_empty = builder.metadata().file_metadata().num_rows() == 0;
        let columns = is_empty.then(|| Ok(with_present_names(RecordBatch::new_empty(builder.schema().clone()))));
        Ok((columns, builder.build().map_err(|e| e.to_string())?))
    });
    let (columns, reader) = opened.and_then(|opened| opened).map_err(damaged)?;
    Ok(columns.into_iter().chain(Batches { shown, reader: Some(reader) }))
}

/// The batches of a file.
struct Batches {
    shown: String,
    /// `None` after a panic, which leaves it in an unknown state.
    reader: Option<ParquetRecordBatchReader>,
}

impl Iterator for Batches {
    type Item = Result<RecordBatch, Failure>;

    fn next(&mut self) -> Option<Self::Item> {
        let reader = self.reader.as_mut()?;
        let batch = match without_panic(|| reader.next()) {
            Ok(next) => next?.map_err(|e| e.to_string()),
            Err(said) => {
                self.reader = None;
                Err(said)
            }
        };
        let batch = batch.map(with_present_names);
        Some(batch.map_err(|e| Failure::Storage(format!("{}: a damaged part: {e}", self.shown))))
    }
}
