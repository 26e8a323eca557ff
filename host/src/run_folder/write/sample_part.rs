//! Writes the open part of the samples: an Arrow stream that can be read up to wherever it ends.
//!
//! It holds the rows of one point, or the first hundred thousand of them. When its point is over it becomes a Parquet file;
//! after a kill [`read::open_part`](crate::run_folder::read::open_part) reads it up to its last whole batch.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::{ArrayRef, Float32Array, RecordBatch, UInt32Array, UInt64Array};
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{Metadata, SchemaRef};

use super::parquet_file::{Durability, write_whole};
use crate::failure::Failure;
use crate::run_folder::own_files;
use crate::run_folder::read::open_part::Salvaged;
use crate::run_folder::schema::samples::{self, PointLabel, SampleColumn, open_part_name, part_name, stream_schema};
use crate::run_folder::schema::stream_sums::{RunningSum, sums_path};

/// A part is closed at this many rows, if its point has not ended before.
pub(super) const MAX_ROWS: u64 = 100_000;

/// Rows that are written to the stream together at the latest.
const ROWS_PER_BATCH: usize = 4096;

/// The stream's file, with the checksum of what has been written to it.
struct SummedFile {
    file: BufWriter<File>,
    sum: RunningSum,
}

impl Write for SummedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.sum.push(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// The part that is being written.
pub(crate) struct OpenPart {
    pub(super) number: u32,
    pub(super) label: Arc<PointLabel>,
    pub(super) rows: u64,
    pub(super) lost_rows: u64,
    pub(super) path: PathBuf,
    writer: StreamWriter<SummedFile>,
    sums: File,
    schema: SchemaRef,
    written: Vec<RecordBatch>,
    is_on_disk: bool,
    /// Its name is on the disk.
    is_named: bool,
    ticks: Vec<u64>,
    gaps: Vec<u32>,
    signals: Vec<Vec<f32>>,
}

impl OpenPart {
    pub(crate) fn create(
        folder: &Path,
        number: u32,
        label: Arc<PointLabel>,
        signals: &[SampleColumn],
        tick_hz: f64,
    ) -> Result<Self, Failure> {
        let path = folder.join(open_part_name(number));
        let schema = stream_schema(&label, signals, tick_hz);
        let file = own_files::create(&path).map_err(|e| Failure::cannot("create", &path, e))?;
        let mut sums =
            own_files::create(&sums_path(&path)).map_err(|e| Failure::cannot("create", &sums_path(&path), e))?;
        let file = SummedFile { file: BufWriter::new(file), sum: RunningSum::default() };
        let mut writer = StreamWriter::try_new(file, &schema).map_err(|e| failed(&path, &e))?;
        writer.flush().map_err(|e| failed(&path, &e))?;
        note_sum(&mut sums, &writer, &path)?;
        let signals = vec![Vec::new(); signals.len()];
        let (ticks, gaps, written) = (Vec::new(), Vec::new(), Vec::new());
        let (rows, lost_rows, is_on_disk, is_named) = (0, 0, true, false);
        Ok(Self {
            number,
            label,
            rows,
            lost_rows,
            path,
            writer,
            sums,
            schema,
            written,
            is_on_disk,
            is_named,
            ticks,
            gaps,
            signals,
        })
    }

    /// Adds a row; `values` holds all signals.
    pub(crate) fn push(&mut self, tick: u64, gap_ticks: u32, values: &[f32]) -> Result<(), Failure> {
        self.ticks.push(tick);
        self.gaps.push(gap_ticks);
        for (column, value) in self.signals.iter_mut().zip(values) {
            column.push(*value);
        }
        self.rows += 1;
        if self.ticks.len() >= ROWS_PER_BATCH { self.write() } else { Ok(()) }
    }

    /// Writes the gathered rows to the file: they survive the program from here on.
    pub(super) fn write(&mut self) -> Result<(), Failure> {
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
        self.writer.write(&batch).and_then(|()| self.writer.flush()).map_err(|e| failed(&self.path, &e))?;
        note_sum(&mut self.sums, &self.writer, &self.path)
    }

    /// Syncs the gathered rows to the disk: they survive a power cut from here on.
    pub(super) fn sync(&mut self) -> Result<(), Failure> {
        self.write()?;
        if !self.is_on_disk {
            self.writer.get_ref().file.get_ref().sync_data().map_err(|e| failed(&self.path, &e))?;
            self.sums.sync_data().map_err(|e| failed(&sums_path(&self.path), &e))?;
            self.is_on_disk = true;
        }
        if !self.is_named {
            let folder = self.path.parent().unwrap_or(Path::new(""));
            own_files::sync_folder(folder).map_err(|e| failed(&self.path, &e))?;
            self.is_named = true;
        }
        Ok(())
    }

    /// Writes all its rows as a closed part; the stream stays until the journal lists the part.
    pub(crate) fn seal(
        &mut self,
        folder: &Path,
        signals: &[SampleColumn],
        about: &Metadata,
        tick_hz: f64,
    ) -> Result<(), Failure> {
        self.write()?;
        create_folder_of_parts(folder)?;
        let schema = samples::schema(signals, about);
        let whole = self.written.iter().map(|batch| samples::complete(&schema, &self.label, tick_hz, batch));
        write_whole(&folder.join(part_name(self.number)), &schema, whole, Durability::Program)
    }
}

/// Adds the line for what has been written to the stream.
fn note_sum(sums: &mut File, stream: &StreamWriter<SummedFile>, path: &Path) -> Result<(), Failure> {
    sums.write_all(stream.get_ref().sum.line().as_bytes()).map_err(|e| failed(&sums_path(path), &e))
}

fn failed(path: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::cannot("write", path, error)
}

/// Does not create the run folder: it may have been removed.
fn create_folder_of_parts(folder: &Path) -> Result<(), Failure> {
    let parts = folder.join(samples::PARTS);
    match fs::create_dir(&parts) {
        Ok(()) => Ok(()),
        // Not through a link: it would lead out of the folder.
        Err(_) if fs::symlink_metadata(&parts).is_ok_and(|there| there.is_dir()) => Ok(()),
        Err(error) => Err(Failure::cannot("create", &parts, error)),
    }
}

/// Writes salvaged rows as the closed part of this number.
///
/// # Errors
/// When it cannot be written.
pub(super) fn seal_salvaged(
    folder: &Path,
    number: u32,
    salvaged: &Salvaged,
    schema: &SchemaRef,
) -> Result<(), Failure> {
    if salvaged.batches.is_empty() {
        return Ok(());
    }
    create_folder_of_parts(folder)?;
    let batches = salvaged.batches.iter().cloned().map(Ok);
    write_whole(&folder.join(part_name(number)), schema, batches, Durability::Disk)
}

#[cfg(test)]
mod tests {
    use arrow_array::cast::AsArray;
    use arrow_array::types::UInt64Type;

    use super::*;
    use crate::run_folder::read::open_part::salvage;
    use crate::run_folder::schema::segment_id::SegmentId;

    /// A part of 10 batches of 4 rows, and its file's bytes.
    fn part(folder: &Path) -> (PathBuf, Vec<u8>) {
        let signals = [SampleColumn { name: "x_m".into(), unit: "m".into() }];
        let id = SegmentId { set_up: "a".into(), experiment: "e".into(), segment: 0 };
        let label = PointLabel { id, point_index: 1, frequency_hz: 2.45 };
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
    fn a_part_with_a_damaged_end_is_read_up_to_the_damage() {
        let folder = tempfile::tempdir().unwrap();
        let (path, bytes) = part(folder.path());
        let mut random = fastrand::Rng::with_seed(9);
        for _ in 0..1000 {
            let from = random.usize(..bytes.len());
            let mut damaged = bytes.clone();
            // A machine that lost power leaves zeros, or the disk's earlier content.
            let zeros = random.bool();
            damaged[from..].iter_mut().for_each(|b| *b = if zeros { 0 } else { random.u8(..) });
            std::fs::write(&path, &damaged).unwrap();
            let salvaged = salvage(&path).unwrap();
            let sound = ticks(&salvaged).iter().enumerate().take_while(|(n, tick)| *n as u64 == **tick).count();
            assert_eq!(ticks(&salvaged).len(), sound, "from {from}");
        }
    }
}
