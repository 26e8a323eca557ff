//! Finds results without the end of their samples: a machine that lost power may have kept the journal and not the samples.

use std::collections::BTreeMap;
use std::path::Path;

use super::sample_files::{read_samples, sample_files};
use crate::failure::Failure;
use crate::run_folder::journal::Withdrawn;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::segment_id::SegmentId;
use crate::table::values::{numbers, texts};

/// The last tick of each segment's samples.
pub type LastTicks = BTreeMap<(String, String, u32), u64>;

/// The results of a run that are without the end of their samples, if these end at `last`.
#[must_use]
pub fn cut_results(journal: &JournalState, last: &LastTicks) -> Vec<Withdrawn> {
    let Some(every) = journal.begun.last().map(|begin| u64::from(begin.every_ticks)).filter(|every| *every > 0) else {
        return Vec::new();
    };
    let rows = journal.rows().iter();
    let rows = rows.map(|r| (&r.set_up, &r.experiment, r.segment, r.point_index, r.start_tick..r.end_tick));
    let transients = journal.transients().iter();
    let transients = transients.map(|r| (&r.set_up, &r.experiment, r.segment, r.point_index, r.start_tick..r.end_tick));
    let cut = rows.chain(transients).filter_map(|(set_up, experiment, segment, point_index, ticks)| {
        let id = SegmentId { set_up: set_up.clone(), experiment: experiment.clone(), segment };
        let end = last.get(&(id.set_up.clone(), id.experiment.clone(), segment)).map_or(0, |last| last + 1);
        // The rows are at whole multiples of their spacing.
        let lost_rows = ticks.end.div_ceil(every).saturating_sub(end.max(ticks.start).div_ceil(every));
        (lost_rows > 0).then_some(Withdrawn { id, point_index, lost_rows })
    });
    cut.collect()
}

/// The results of a run that was killed without the end of their samples, by the files of its folder. None where samples are damaged,
/// which is found otherwise.
#[must_use]
pub fn cut_off(folder: &Path, journal: &JournalState) -> Vec<Withdrawn> {
    let is_open = |id: &SegmentId| journal.end_of(id).is_none();
    if journal.joined.is_some() || !journal.segments.iter().any(|start| is_open(&start.id)) {
        return Vec::new();
    }
    if journal.sealed.iter().any(|sealed| !folder.join(&sealed.file.name).is_file()) {
        return Vec::new();
    }
    let Ok(last) = last_ticks(folder) else { return Vec::new() };
    // The device had ended the others: rows that had not arrived by then were lost on the way.
    cut_results(journal, &last).into_iter().filter(|cut| is_open(&cut.id)).collect()
}

fn last_ticks(folder: &Path) -> Result<LastTicks, Failure> {
    let mut last = LastTicks::new();
    for file in sample_files(folder) {
        for batch in read_samples(&file)? {
            let batch = batch?;
            let (set_ups, experiments) = (texts(&batch, "set_up")?, texts(&batch, "experiment")?);
            let (segments, ticks) = (numbers(&batch, "segment")?, numbers(&batch, "tick")?);
            // The rows of a batch are of one point.
            let first = set_ups.into_iter().zip(experiments).zip(segments).next();
            let highest = ticks.into_iter().fold(0.0, f64::max) as u64;
            if let Some(((set_up, experiment), segment)) = first {
                let known = last.entry((set_up, experiment, segment as u32)).or_default();
                *known = highest.max(*known);
            }
        }
    }
    Ok(last)
}
