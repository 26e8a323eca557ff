//! Finds gaps in the samples: rows after a gap, and rows missing at the end of a segment.

use std::path::Path;

use arrow_array::RecordBatch;

use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::run_folder::read::parquet_file;
use crate::run_folder::read::sample_files::{is_open_part, read_samples, sample_files};
use crate::run_folder::schema::journal_state::JournalState;
use crate::table::values::{numbers, texts};

/// Most gaps listed; further ones are counted.
const MAX_LISTED: usize = 40;

/// A gap in the samples.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SampleGap {
    pub(super) set_up: String,
    pub(super) experiment: String,
    pub(super) segment: u64,
    /// Device time of the first row after the gap, s; `None` if the rest of the segment is missing.
    pub(super) until_s: Option<f64>,
    pub(super) rows: u64,
}

/// All gaps of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SampleGaps {
    /// The first gaps, in the order of the samples.
    pub(super) list: Vec<SampleGap>,
    /// Number of gaps.
    pub(super) count: usize,
    /// Files that could not be read.
    pub(super) unreadable: Vec<String>,
}

impl SampleGaps {
    fn add(&mut self, gap: SampleGap) {
        self.count += 1;
        if self.list.len() < MAX_LISTED {
            self.list.push(gap);
        }
    }
}

/// Searches the samples if the journal counts missing rows, or if there is no journal.
pub(super) fn find(run: &RunFolder, taken: &JournalState) -> SampleGaps {
    let mut gaps = SampleGaps::default();
    let every_ticks = run.manifest().every_ticks().unwrap_or(1).max(1);
    let is_whole = !taken.begun.is_empty() && taken.sealed.iter().all(|s| s.lost_rows == 0);
    for file in sample_files(run.path()) {
        // Missing rows of a file that was still open have not been counted.
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
        gaps.add(SampleGap { set_up, experiment, segment, until_s: None, rows: end.lost_rows });
    }
    gaps
}

const COLUMNS: [&str; 5] = ["set_up", "experiment", "segment", "gap_before_ticks", "t_s"];

/// Reads only the columns that describe gaps, since the signals may be large.
fn batches(file: &Path, mut take: impl FnMut(&RecordBatch) -> Result<(), Failure>) -> Result<(), Failure> {
    if is_open_part(file) {
        return read_samples(file)?.try_for_each(|batch| take(&batch?));
    }
    parquet_file::read_columns(file, &COLUMNS)?.try_for_each(|batch| take(&batch?))
}

fn gather(batch: &RecordBatch, every_ticks: u64, gaps: &mut SampleGaps) -> Result<(), Failure> {
    let lost = numbers(batch, "gap_before_ticks")?;
    if lost.iter().all(|ticks| *ticks == 0.0) {
        return Ok(());
    }
    let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
    let (segments, t_s) = (numbers(batch, "segment")?, numbers(batch, "t_s")?);
    for (n, ticks) in lost.iter().enumerate().filter(|(_, ticks)| **ticks > 0.0) {
        gaps.add(SampleGap {
            set_up: set_ups[n].clone(),
            experiment: experiments[n].clone(),
            segment: segments[n] as u64,
            until_s: Some(t_s[n]),
            rows: *ticks as u64 / every_ticks,
        });
    }
    Ok(())
}
