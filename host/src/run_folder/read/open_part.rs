//! Reads a part of the samples that was open when the program ended, up to its last whole batch that agrees with its checksum.

use std::path::Path;

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::UInt32Type;
use arrow_ipc::reader::StreamReader;
use arrow_schema::Metadata;

use super::arrow_salvage::sound_length;
use super::parquet_file::read;
use crate::failure::Failure;
use crate::input::regular;
use crate::run_folder::journal;
use crate::run_folder::journal::JournalEntry;
use crate::run_folder::schema::samples::{self, PointLabel, read_stream_schema};
use crate::run_folder::schema::stream_sums::{Difference, compare, sums_path};
use crate::table::values::numbers;

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

/// An open part: its bytes, and how far they can be relied on.
#[derive(Clone, Debug)]
pub struct OpenStream {
    bytes: Vec<u8>,
    sound: usize,
    /// What is wrong behind the sound bytes, in words.
    pub problem: Option<String>,
}

/// Reads an open part, and compares it with its checksums. A part of an older run has none: all that can be read of it counts as sound.
///
/// # Errors
/// When the file cannot be read.
pub fn read_stream(path: &Path) -> Result<OpenStream, Failure> {
    let bytes = regular::read(path).map_err(|e| Failure::cannot("read", path, e))?;
    if !has_sums(path) {
        let sound = sound_length(&bytes);
        let problem = (sound == 0 && !bytes.is_empty()).then(|| "nothing in it can be read".to_string());
        return Ok(OpenStream { bytes, sound, problem });
    }
    let (sound, difference) = compare(&bytes, &regular::read(&sums_path(path)).unwrap_or_default());
    let problem = difference.map(|difference| {
        let what = match difference {
            Difference::Length => {
                "its checksums do not end where it ends (a kill, a power cut, or a file that was cut)"
            }
            Difference::Content => "changed since it was written (its checksums differ)",
        };
        format!("{what}; the first {sound} of its {} bytes are sound", bytes.len())
    });
    Ok(OpenStream { bytes, sound, problem })
}

/// Whether an open part has checksums. The journal says so, in case their file was removed.
fn has_sums(path: &Path) -> bool {
    let begin = |entry: &JournalEntry| if let JournalEntry::Begin(begin) = entry { Some(begin.sums) } else { None };
    let lines = || journal::read(path.parent()?).ok();
    sums_path(path).exists() || lines().and_then(|lines| lines.entries.iter().rev().find_map(begin)).unwrap_or(false)
}

impl OpenStream {
    /// Bytes that can be relied on.
    #[must_use]
    pub fn sound_bytes(&self) -> usize {
        self.sound
    }

    /// Whether there are bytes that cannot be relied on.
    #[must_use]
    pub fn has_damage(&self) -> bool {
        self.problem.is_some() && self.sound < self.bytes.len()
    }

    /// Its rows up to the last whole batch that is sound; none of a stream that was cut off before its first.
    #[must_use]
    pub fn salvage(&self) -> Salvaged {
        let mut salvaged = Salvaged::default();
        let sound = &self.bytes[..self.sound];
        let Ok(reader) = StreamReader::try_new(&sound[..sound_length(sound)], None) else { return salvaged };
        let Some((label, tick_hz, signals)) = read_stream_schema(&reader.schema()) else { return salvaged };
        let schema = samples::schema(&signals, &Metadata::new());
        for batch in reader.map_while(Result::ok) {
            let gaps = batch.column(1).as_primitive::<UInt32Type>().values();
            salvaged.gap_ticks += gaps.iter().map(|gap| u64::from(*gap)).sum::<u64>();
            let Ok(batch) = samples::complete(&schema, &label, tick_hz, &batch) else { break };
            salvaged.rows += batch.num_rows() as u64;
            salvaged.batches.push(batch);
        }
        salvaged
    }
}

/// The sound rows of an open part.
///
/// # Errors
/// As [`read_stream`].
pub fn salvage(path: &Path) -> Result<Salvaged, Failure> {
    read_stream(path).map(|stream| stream.salvage())
}

/// Rows of a closed part, and ticks missing before or between them; `None` if it is missing or cannot be read whole.
#[must_use]
pub fn rows_and_gaps(part: &Path) -> Option<(u64, u64)> {
    let gaps: Result<Vec<Vec<f64>>, Failure> = read(part).ok()?.map(|batch| numbers(&batch?, GAP)).collect();
    let gaps = gaps.ok()?.concat();
    Some((gaps.len() as u64, gaps.iter().map(|gap| *gap as u64).fold(0, u64::saturating_add)))
}

/// The point to which the rows of an open part belong; `None` if it has no head that can be read.
#[must_use]
pub fn label_of(path: &Path) -> Option<PointLabel> {
    let bytes = regular::read(path).ok()?;
    let reader = StreamReader::try_new(&bytes[..sound_length(&bytes)], None).ok()?;
    read_stream_schema(&reader.schema()).map(|(label, ..)| label)
}
