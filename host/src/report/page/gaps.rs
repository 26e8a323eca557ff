//! Where samples are missing: the rows of the samples that stand after a gap, and what never came at the end of a start.

use std::path::Path;

use arrow_array::RecordBatch;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::input::regular;
use crate::run_folder::read::columns::{numbers, texts};
use crate::run_folder::read::sample_files::{is_open_part, read_samples, sample_files};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::{ReadError, RunFolder};

/// Gaps that are listed; the rest is counted.
const MOST_LISTED: usize = 40;

/// A place where rows are missing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Gap {
    pub(super) set_up: String,
    pub(super) experiment: String,
    pub(super) segment: u64,
    /// Device time of the first row after it, s; none when the rest of the start is missing.
    pub(super) until_s: Option<f64>,
    pub(super) rows: u64,
}

/// All of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Gaps {
    /// The first ones, in the order of the samples.
    pub(super) list: Vec<Gap>,
    /// How many there are.
    pub(super) count: usize,
    /// Files that could not be looked through.
    pub(super) unreadable: Vec<String>,
}

impl Gaps {
    fn add(&mut self, gap: Gap) {
        self.count += 1;
        if self.list.len() < MOST_LISTED {
            self.list.push(gap);
        }
    }
}

/// Looks the samples through, if the journal says that any are missing, or there is none to say so.
pub(super) fn find(run: &RunFolder, taken: &JournalState) -> Gaps {
    let mut gaps = Gaps::default();
    let every_ticks = run.manifest().every_ticks().unwrap_or(1).max(1);
    let is_whole = !taken.begun.is_empty() && taken.sealed.iter().all(|s| s.lost_rows == 0);
    for file in sample_files(run.path()) {
        // Of a part that was open nobody has counted anything.
        if is_whole && !is_open_part(&file) {
            continue;
        }
        if let Err(error) = batches(&file, |batch| gather(batch, every_ticks, &mut gaps)) {
            gaps.unreadable.push(error.to_string());
        }
    }
    for end in taken.finished.iter().filter(|f| f.lost_rows > 0) {
        let (set_up, experiment) = (end.id.set_up.clone(), end.id.experiment.clone());
        let segment = u64::from(end.id.segment);
        gaps.add(Gap { set_up, experiment, segment, until_s: None, rows: end.lost_rows });
    }
    gaps
}

const COLUMNS: [&str; 5] = ["set_up", "experiment", "segment", "gap_before_ticks", "t_s"];

/// Only the columns that tell of gaps: the signals of a night need not be read for them.
fn batches(file: &Path, mut take: impl FnMut(&RecordBatch) -> Result<(), ReadError>) -> Result<(), ReadError> {
    if is_open_part(file) {
        return read_samples(file)?.try_for_each(|batch| take(&batch?));
    }
    let failed = |e: &dyn std::fmt::Display| ReadError(format!("{}: {e}", file.display()));
    let open = regular::open(file).map_err(|e| failed(&e))?;
    let builder = ParquetRecordBatchReaderBuilder::try_new(open).map_err(|e| failed(&e))?;
    let mask = ProjectionMask::columns(builder.parquet_schema(), COLUMNS);
    let reader = builder.with_projection(mask).build().map_err(|e| failed(&e))?;
    reader.into_iter().try_for_each(|batch| take(&batch.map_err(|e| failed(&e))?))
}

fn gather(batch: &RecordBatch, every_ticks: u64, gaps: &mut Gaps) -> Result<(), ReadError> {
    let lost = numbers(batch, "gap_before_ticks")?;
    if lost.iter().all(|ticks| *ticks == 0.0) {
        return Ok(());
    }
    let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
    let (segments, t_s) = (numbers(batch, "segment")?, numbers(batch, "t_s")?);
    for (n, ticks) in lost.iter().enumerate().filter(|(_, ticks)| **ticks > 0.0) {
        gaps.add(Gap {
            set_up: set_ups[n].clone(),
            experiment: experiments[n].clone(),
            segment: segments[n] as u64,
            until_s: Some(t_s[n]),
            rows: *ticks as u64 / every_ticks,
        });
    }
    Ok(())
}
