//! Runs a study on this machine: part after part, the rows of each on all cores.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use arrow_array::Float64Array;
use rayon::prelude::*;

use super::data_set::DataSet;
use super::evaluate::{UNRESOLVED, columns, cycles_per_row, main_column, rows, spread_rows, trial_s};
use super::file::Study;
use super::part::Part;
use crate::failure::Failure;

/// Where a study is.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyProgress {
    /// Rows of the table.
    pub rows: u64,
    /// Rows that are done, those of an earlier run among them.
    pub done: u64,
    /// The best row so far and its value of the objective.
    pub best: Option<(u64, f64)>,
    /// Rows with an instant of too many events.
    pub unresolved: u64,
    /// Parts without a digest: an older version has written them.
    pub without_digest: u64,
}

/// How a study ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StudyEnding {
    /// All parts are there.
    Complete,
    /// It was stopped; the parts so far are kept.
    Stopped,
}

/// Estimated computing time of a whole study on one core, s, from the beginnings of some simulations spread over it.
///
/// # Errors
/// The refusal of a case that the axes make.
pub fn estimate_s(study: &Study) -> Result<f64, Failure> {
    let seconds = spread_rows(study.rows()).map(|row| trial_s(study, row)).collect::<Result<Vec<f64>, Failure>>()?;
    Ok(seconds.iter().sum::<f64>() * study.rows() as f64 / seconds.len() as f64)
}

/// Simulated cycles of a whole study, about.
#[must_use]
pub fn cycles(study: &Study) -> f64 {
    cycles_per_row(study) * study.rows() as f64
}

/// Runs every part that is not there yet. `report` sees the progress after each part and within it; it answers whether to go on.
///
/// # Errors
/// A case that the axes make and that is refused, a part that is not of this study, a part that cannot be written.
pub fn run(
    study: &Study,
    data_set: &DataSet,
    report: &(dyn Fn(&StudyProgress) -> bool + Sync),
) -> Result<(StudyEnding, StudyProgress), Failure> {
    let manifest = data_set.manifest();
    let mut progress = StudyProgress::none(manifest.rows);
    let objective = place_of(study, &main_column(study, study.objective));
    let unresolved = place_of(study, UNRESOLVED);
    let mut missing = Vec::new();
    for part in 0..manifest.parts() {
        match data_set.part(study, part)? {
            Some(there) => progress.meet_part(study, manifest.rows_of(part).start, &there),
            None => missing.push(part),
        }
    }
    for part in missing {
        if !report(&progress) {
            return Ok((StudyEnding::Stopped, progress));
        }
        let numbers = manifest.rows_of(part);
        let within = |computed: u64| report(&StudyProgress { done: progress.done + computed, ..progress.clone() });
        let Some(rows) = compute(study, numbers.clone(), &within)? else { return Ok((StudyEnding::Stopped, progress)) };
        data_set.write_part(study, part, &rows)?;
        for (number, values) in numbers.zip(&rows) {
            progress.meet(study, number, values[objective]);
            progress.unresolved += u64::from(values[unresolved] > 0.0);
        }
        progress.done += rows.len() as u64;
    }
    report(&progress);
    Ok((StudyEnding::Complete, progress))
}

/// Computes rows of the table on all cores. `go_on` is asked before each row and within it, and told how many are computed; `None` if it
/// says no.
///
/// # Errors
/// A case that the axes make and that is refused.
pub fn compute(
    study: &Study,
    numbers: Range<u64>,
    go_on: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Option<Vec<Vec<f64>>>, Failure> {
    let computed = AtomicU64::new(0);
    let go_on = || go_on(computed.load(Ordering::Relaxed));
    let row = |row: u64| {
        if !go_on() {
            return Ok(None);
        }
        let values = Failure::unless_interrupted(rows(study, row..row + 1, &go_on));
        computed.fetch_add(1, Ordering::Relaxed);
        values
    };
    let rows: Option<Vec<_>> = numbers.into_par_iter().map(row).collect::<Result<_, Failure>>()?;
    Ok(rows.map(|rows| rows.concat()))
}

impl StudyProgress {
    /// Before the first part.
    #[must_use]
    pub fn none(rows: u64) -> Self {
        Self { rows, done: 0, best: None, unresolved: 0, without_digest: 0 }
    }

    /// Counts the rows of a part that is there.
    pub fn meet_part(&mut self, study: &Study, first: u64, Part { batch, has_digest }: &Part) {
        self.without_digest += u64::from(!has_digest);
        let values_of = |name: &str| batch.column_by_name(name)?.as_any().downcast_ref::<Float64Array>();
        for (row, value) in (first..).zip(values_of(&main_column(study, study.objective)).into_iter().flatten()) {
            self.meet(study, row, value.unwrap_or(f64::NAN));
        }
        let unresolved = values_of(UNRESOLVED).into_iter().flatten();
        self.unresolved += unresolved.filter(|count| count.is_some_and(|count| count > 0.0)).count() as u64;
        self.done += batch.num_rows() as u64;
    }

    /// Counts a row's value of the objective.
    pub fn meet(&mut self, study: &Study, row: u64, value: f64) {
        let is_best = self.best.is_none_or(|(_, best)| study.is_better(value, best));
        if is_best && !value.is_nan() {
            self.best = Some((row, value));
        }
    }
}

/// Place of a column among the computed ones.
#[must_use]
pub fn place_of(study: &Study, name: &str) -> usize {
    columns(study).iter().position(|column| column.name == name).unwrap_or(0)
}
