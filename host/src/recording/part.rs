//! The part of the samples that is being taken: an Arrow stream that is good up to wherever it ends.
//!
//! It holds the rows of one point, or the first hundred thousand of them. When its point is over it becomes a Parquet
//! file; when the program was killed it is read up to its last whole batch. What is the same in all its rows stands
//! once, in the stream's metadata.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{UInt32Type, UInt64Type};
use arrow_array::{ArrayRef, Float32Array, RecordBatch, UInt32Array, UInt64Array};
use arrow_ipc::reader::StreamReader;
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{DataType, Metadata, Schema, SchemaRef};

use super::parquet::{Kept, field, write_whole};
use super::samples::{self, Label};
use super::sound::sound_length;
use super::{Signal, StorageError};
use crate::input::regular;

/// A part is closed when it holds this many rows, if its point has not ended before.
pub(super) const MOST_ROWS: u64 = 100_000;

/// Rows that are written to the stream together at the latest.
const ROWS_PER_BATCH: usize = 4096;

const ENDING: &str = "open.arrows";

fn path(folder: &Path, number: u32) -> PathBuf {
    folder.join(format!("samples-{number:06}.{ENDING}"))
}

/// Numbers and files of the parts that are open, or were when the program was killed.
#[must_use]
pub fn open_parts(folder: &Path) -> Vec<(u32, PathBuf)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let numbered = entries.filter_map(|path| {
        let name = path.file_name()?.to_str()?;
        let number = name.strip_prefix("samples-")?.strip_suffix(ENDING)?.strip_suffix('.')?.parse().ok()?;
        Some((number, path))
    });
    let mut parts: Vec<(u32, PathBuf)> = numbered.collect();
    parts.sort();
    parts
}

/// The part that is being written.
pub(super) struct OpenPart {
    pub(super) number: u32,
    pub(super) label: Arc<Label>,
    pub(super) rows: u64,
    pub(super) lost_rows: u64,
    pub(super) path: PathBuf,
    writer: StreamWriter<BufWriter<File>>,
    schema: SchemaRef,
    written: Vec<RecordBatch>,
    is_on_disk: bool,
    ticks: Vec<u64>,
    gaps: Vec<u32>,
    signals: Vec<Vec<f32>>,
}

impl OpenPart {
    pub(super) fn create(
        folder: &Path,
        number: u32,
        label: Arc<Label>,
        signals: &[Signal],
        tick_hz: f64,
    ) -> Result<Self, StorageError> {
        let path = path(folder, number);
        let schema = stream_schema(&label, signals, tick_hz);
        let file = File::create(&path).map_err(|e| StorageError::new("create", &path, e))?;
        let mut writer = StreamWriter::try_new(BufWriter::new(file), &schema).map_err(|e| failed(&path, &e))?;
        writer.flush().map_err(|e| failed(&path, &e))?;
        let signals = vec![Vec::new(); signals.len()];
        let (ticks, gaps, written) = (Vec::new(), Vec::new(), Vec::new());
        let (rows, lost_rows, is_on_disk) = (0, 0, true);
        Ok(Self { number, label, rows, lost_rows, path, writer, schema, written, is_on_disk, ticks, gaps, signals })
    }

    /// Adds a row; `values` holds all signals.
    pub(super) fn push(&mut self, tick: u64, gap_ticks: u32, values: &[f32]) -> Result<(), StorageError> {
        self.ticks.push(tick);
        self.gaps.push(gap_ticks);
        for (column, value) in self.signals.iter_mut().zip(values) {
            column.push(*value);
        }
        self.rows += 1;
        if self.ticks.len() >= ROWS_PER_BATCH { self.write() } else { Ok(()) }
    }

    /// Hands what has been gathered to the system: it survives the program from here on.
    pub(super) fn write(&mut self) -> Result<(), StorageError> {
        if self.ticks.is_empty() {
            return Ok(());
        }
        let mut columns: Vec<ArrayRef> = vec![
            Arc::new(UInt64Array::from(std::mem::take(&mut self.ticks))),
            Arc::new(UInt32Array::from(std::mem::take(&mut self.gaps))),
        ];
        columns.extend(self.signals.iter_mut().map(|s| Arc::new(Float32Array::from(std::mem::take(s))) as ArrayRef));
        let batch = RecordBatch::try_new(self.schema.clone(), columns).map_err(|e| failed(&self.path, &e))?;
        self.written.push(batch.clone());
        self.is_on_disk = false;
        self.writer.write(&batch).and_then(|()| self.writer.flush()).map_err(|e| failed(&self.path, &e))
    }

    /// Brings what has been gathered to the disk itself: it survives the machine from here on.
    pub(super) fn sync(&mut self) -> Result<(), StorageError> {
        self.write()?;
        if !self.is_on_disk {
            self.writer.get_ref().get_ref().sync_data().map_err(|e| failed(&self.path, &e))?;
            self.is_on_disk = true;
        }
        Ok(())
    }

    /// Writes all its rows as a closed part; the stream stays until the journal knows of it.
    pub(super) fn seal(&mut self, folder: &Path, signals: &[Signal], tick_hz: f64) -> Result<(), StorageError> {
        self.write()?;
        seal(folder, self.number, &self.label, signals, tick_hz, &self.written)
    }
}

fn failed(path: &Path, error: &dyn std::fmt::Display) -> StorageError {
    StorageError::new("write", path, error)
}

fn seal(
    folder: &Path,
    number: u32,
    label: &Label,
    signals: &[Signal],
    tick_hz: f64,
    batches: &[RecordBatch],
) -> Result<(), StorageError> {
    make_folder_of_parts(folder)?;
    let schema = samples::schema(signals);
    let whole = batches.iter().map(|batch| complete(&schema, label, tick_hz, batch));
    write_whole(&folder.join(samples::part_name(number)), &schema, whole, Kept::ByTheSystem)
}

/// In the run folder that there is: one that was removed is not made again.
fn make_folder_of_parts(folder: &Path) -> Result<(), StorageError> {
    let parts = folder.join(samples::PARTS);
    match fs::create_dir(&parts) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => {
            Err(StorageError::new("create", &parts, error))
        }
        _ => Ok(()),
    }
}

/// A batch of the stream with all columns that the samples have.
fn complete(schema: &SchemaRef, label: &Label, tick_hz: f64, batch: &RecordBatch) -> Result<RecordBatch, String> {
    let ticks = batch.column(0).as_primitive::<UInt64Type>();
    samples::rows(schema, label, tick_hz, ticks, batch.column(1).clone(), &batch.columns()[2..])
}

fn stream_schema(label: &Label, signals: &[Signal], tick_hz: f64) -> SchemaRef {
    let mut fields = vec![field("tick", DataType::UInt64, "tick"), field("gap_before_ticks", DataType::UInt32, "tick")];
    fields.extend(signals.iter().map(|s| field(&s.name, DataType::Float32, &s.unit)));
    let words = [
        ("set_up", label.set_up.clone()),
        ("experiment", label.experiment.clone()),
        ("segment", label.segment.to_string()),
        ("point_index", label.point_index.to_string()),
        ("point_frequency_hz", label.frequency_hz.to_string()),
        ("tick_hz", tick_hz.to_string()),
    ];
    let metadata: HashMap<String, String> = words.map(|(key, value)| (key.to_string(), value)).into();
    Arc::new(Schema::new_with_metadata(fields, metadata))
}

/// What can be read of a part that was open when the program ended.
#[derive(Clone, Debug)]
pub struct Salvaged {
    /// Its rows with all columns.
    pub batches: Vec<RecordBatch>,
    /// How many.
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
    let mut salvaged = Salvaged { batches: Vec::new(), rows: 0, gap_ticks: 0 };
    let Ok(reader) = StreamReader::try_new(&bytes[..sound_length(&bytes)], None) else { return Ok(salvaged) };
    let stream = reader.schema();
    let Some((label, tick_hz)) = read_label(stream.metadata()) else { return Ok(salvaged) };
    let unit = |f: &arrow_schema::Field| f.metadata().get("unit").cloned().unwrap_or_default();
    let signals: Vec<Signal> =
        stream.fields().iter().skip(2).map(|f| Signal { name: f.name().clone(), unit: unit(f) }).collect();
    let schema = samples::schema(&signals);
    for batch in reader.map_while(Result::ok) {
        salvaged.gap_ticks +=
            batch.column(1).as_primitive::<UInt32Type>().values().iter().map(|g| u64::from(*g)).sum::<u64>();
        let Ok(batch) = complete(&schema, &label, tick_hz, &batch) else { break };
        salvaged.rows += batch.num_rows() as u64;
        salvaged.batches.push(batch);
    }
    Ok(salvaged)
}

/// What the head of an open part says.
#[derive(Clone, Debug, PartialEq)]
pub enum Stream {
    /// Whose rows it holds.
    Of(Label),
    /// The file is empty: the program ended before it wrote anything.
    Empty,
    /// There is something, and none of it is a stream of samples.
    Unreadable,
}

/// Reads the head of an open part.
#[must_use]
pub fn read_stream(path: &Path) -> Stream {
    let Ok(bytes) = regular::read(path) else { return Stream::Unreadable };
    if bytes.is_empty() {
        return Stream::Empty;
    }
    let reader = StreamReader::try_new(&bytes[..sound_length(&bytes)], None).ok();
    let label = reader.and_then(|reader| read_label(reader.schema().metadata()));
    label.map_or(Stream::Unreadable, |(label, _)| Stream::Of(label))
}

fn read_label(metadata: &Metadata) -> Option<(Label, f64)> {
    let get = |key: &str| metadata.get(key);
    let label = Label {
        set_up: get("set_up")?.clone(),
        experiment: get("experiment")?.clone(),
        segment: get("segment")?.parse().ok()?,
        point_index: get("point_index")?.parse().ok()?,
        frequency_hz: get("point_frequency_hz")?.parse().ok()?,
    };
    Some((label, get("tick_hz")?.parse().ok()?))
}

/// Writes what was salvaged as the closed part of this number.
///
/// # Errors
/// When it cannot be written.
pub(super) fn seal_salvaged(folder: &Path, number: u32, salvaged: &Salvaged) -> Result<(), StorageError> {
    let Some(first) = salvaged.batches.first() else { return Ok(()) };
    make_folder_of_parts(folder)?;
    let batches = salvaged.batches.iter().cloned().map(Ok);
    write_whole(&folder.join(samples::part_name(number)), &first.schema(), batches, Kept::OnTheDisk)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A part of 10 batches of 4 rows, and what is in its file.
    fn part(folder: &Path) -> (PathBuf, Vec<u8>) {
        let signals = [Signal { name: "x_m".into(), unit: "m".into() }];
        let (set_up, experiment) = ("a".to_string(), "e".to_string());
        let label = Label { set_up, experiment, segment: 0, point_index: 1, frequency_hz: 2.45 };
        let mut part = OpenPart::create(folder, 7, Arc::new(label), &signals, 1000.0).unwrap();
        for n in 0..40 {
            part.push(n, 0, &[n as f32]).unwrap();
            if n % 4 == 3 {
                part.write().unwrap();
            }
        }
        (part.path.clone(), std::fs::read(&part.path).unwrap())
    }

    fn ticks(salvaged: &Salvaged) -> Vec<u64> {
        let ticks = |b: &RecordBatch| b.column_by_name("tick").unwrap().as_primitive::<UInt64Type>().values().to_vec();
        salvaged.batches.iter().flat_map(ticks).collect()
    }

    #[test]
    fn a_part_cut_off_anywhere_is_read_up_to_its_last_whole_batch() {
        let folder = tempfile::tempdir().unwrap();
        let (path, bytes) = part(folder.path());
        let mut before = 0;
        for length in 0..=bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let salvaged = salvage(&path).unwrap();
            assert_eq!(ticks(&salvaged), (0..salvaged.rows).collect::<Vec<_>>(), "cut at {length}");
            assert!(salvaged.rows >= before && salvaged.rows.is_multiple_of(4), "cut at {length}");
            before = salvaged.rows;
        }
        assert_eq!(before, 40);
    }

    #[test]
    fn a_part_whose_end_is_nonsense_is_read_up_to_there() {
        let folder = tempfile::tempdir().unwrap();
        let (path, bytes) = part(folder.path());
        let mut random = fastrand::Rng::with_seed(9);
        for _ in 0..1000 {
            let from = random.usize(..bytes.len());
            let mut damaged = bytes.clone();
            // A machine that lost its supply leaves zeros, or what was there before.
            let zeros = random.bool();
            damaged[from..].iter_mut().for_each(|b| *b = if zeros { 0 } else { random.u8(..) });
            std::fs::write(&path, &damaged).unwrap();
            let salvaged = salvage(&path).unwrap();
            let sound = ticks(&salvaged).iter().enumerate().take_while(|(n, tick)| *n as u64 == **tick).count();
            // The last batch may have been hit in its values alone: nothing can tell.
            assert!(sound + 4 >= ticks(&salvaged).len(), "from {from}");
        }
    }
}
