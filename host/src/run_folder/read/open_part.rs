//! Reads a part of the samples that was open when the program ended, up to its last whole batch.

use std::path::Path;

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::UInt32Type;
use arrow_ipc::reader::StreamReader;
use arrow_schema::Metadata;

use super::arrow_salvage::sound_length;
use super::columns::numbers;
use super::parquet_file::read;
use crate::input::regular;
use crate::run_folder::schema::samples::{self, PointLabel, read_stream_schema};
use crate::run_folder::schema::stream_sums::{agree, sums_path};
use crate::run_folder::{ReadError, StorageError};

/// The column of the ticks missing before a row.
const GAP: &str = "gap_before_ticks";

/// The readable contents of a part that was open when the program ended.
#[derive(Clone, Debug, Default)]
pub struct Salvaged {
    /// Its rows with all columns.
    pub batches: Vec<RecordBatch>,
    /// Number of rows.
    pub rows: u64,
    /// Ticks missing before or between them.
    pub gap_ticks: u64,
}

/// Reads an open part up to its last whole batch. A stream that was cut off before its first is empty.
///
/// # Errors
/// When the file cannot be opened.
pub fn salvage(path: &Path) -> Result<Salvaged, StorageError> {
    let bytes = regular::read(path).map_err(|e| StorageError::new("read", path, e))?;
    let mut salvaged = Salvaged::default();
    let Ok(reader) = StreamReader::try_new(&bytes[..sound_length(&bytes)], None) else { return Ok(salvaged) };
    let Some((label, tick_hz, signals)) = read_stream_schema(&reader.schema()) else { return Ok(salvaged) };
    let schema = samples::schema(&signals, &Metadata::new());
    for batch in reader.map_while(Result::ok) {
        let gaps = batch.column(1).as_primitive::<UInt32Type>().values();
        salvaged.gap_ticks += gaps.iter().map(|gap| u64::from(*gap)).sum::<u64>();
        let Ok(batch) = samples::complete(&schema, &label, tick_hz, &batch) else { break };
        salvaged.rows += batch.num_rows() as u64;
        salvaged.batches.push(batch);
    }
    Ok(salvaged)
}

/// Rows of a closed part, and ticks missing before or between them; `None` if it is missing or cannot be read whole.
#[must_use]
pub fn rows_and_gaps(part: &Path) -> Option<(u64, u64)> {
    let gaps: Result<Vec<Vec<f64>>, ReadError> = read(part).ok()?.map(|batch| numbers(&batch?, GAP)).collect();
    let gaps = gaps.ok()?.concat();
    Some((gaps.len() as u64, gaps.iter().map(|gap| *gap as u64).fold(0, u64::saturating_add)))
}

/// Whether an open part is as its checksums say; one of an older run has none.
#[must_use]
pub fn is_sound(path: &Path) -> bool {
    let (stream, sums) = (regular::read(path), regular::read(&sums_path(path)));
    sums.is_err() || stream.is_ok_and(|stream| agree(&stream, &sums.unwrap_or_default()))
}

/// Head of an open part: its schema, which states the point of its rows.
#[derive(Clone, Debug, PartialEq)]
pub enum StreamHead {
    /// The point to which the rows belong.
    Of(PointLabel),
    /// The file is empty: the program ended before it wrote anything.
    Empty,
    /// The file is not a stream of samples.
    Unreadable,
}

/// Reads the head of an open part.
#[must_use]
pub fn read_head(path: &Path) -> StreamHead {
    let Ok(bytes) = regular::read(path) else { return StreamHead::Unreadable };
    if bytes.is_empty() {
        return StreamHead::Empty;
    }
    let reader = StreamReader::try_new(&bytes[..sound_length(&bytes)], None).ok();
    let head = reader.and_then(|reader| read_stream_schema(&reader.schema()));
    head.map_or(StreamHead::Unreadable, |(label, ..)| StreamHead::Of(label))
}
