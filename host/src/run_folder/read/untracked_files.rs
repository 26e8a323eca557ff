//! Finds files of a run folder that the journal does not list.
//!
//! A journal that was emptied, cut or replaced lists fewer files than the folder has. Resuming from it would repeat
//! measurements and overwrite their files. Therefore only files that the journal lists are joined, rewritten or
//! removed. An open part beside the closed part of its number shows that the program was killed before the journal
//! had the closed one. Both belong to the run if the closed part has the rows of the open one.

use std::collections::BTreeSet;
use std::path::Path;

use arrow_array::RecordBatch;

use super::open_part::{label_of, salvage};
use super::parquet_file::read;
use super::sample_files::{closed_parts, open_parts};
use crate::failure::Failure;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::results::RESULTS;
use crate::run_folder::schema::samples::{JOINED, PARTS, PointLabel};
use crate::run_folder::schema::transients::TRANSIENTS;
use crate::table::values::{numbers, texts, values};

/// Data of a run that its journal does not list, as `file: description`. `is_complete`: every point is taken, so the samples may have been joined when the
/// program was killed.
#[must_use]
pub fn untracked(folder: &Path, journal: &JournalState, is_complete: bool) -> Vec<String> {
    let mut found = Vec::new();
    let streams = open_parts(folder);
    for (number, path) in closed_parts(folder) {
        if journal.is_sealed(number) {
            continue;
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match streams.iter().find(|(n, _)| *n == number) {
            None => found.push(format!("{}/{name}: a part of the samples", PARTS)),
            Some((_, stream)) if !is_made_of(&path, stream) => {
                let stream = stream.file_name().unwrap_or_default().to_string_lossy();
                found.push(format!("{}/{name}: a part of the samples, and not of those in {stream}", PARTS));
            }
            Some(_) => {}
        }
    }
    for (_, path) in &streams {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let label = label_of(path).filter(|label| journal.segments.iter().all(|start| start.id != label.id));
        found.extend(label.map(|PointLabel { id, .. }| {
            let (set_up, experiment, segment) = (id.set_up, id.experiment, id.segment);
            format!("{name}: samples of set-up {set_up:?}, {experiment:?}, segment {segment}, which was never started")
        }));
    }
    if folder.join(JOINED).exists() && journal.joined.is_none() && !is_complete {
        found.push(format!("{JOINED}: samples of a complete run"));
    }
    for name in [RESULTS, TRANSIENTS] {
        found.extend(results(folder, name, journal));
    }
    found
}

/// Whether a closed part may have been made from a stream: the rows that both have are equal. Either may have more
/// rows, if the other lost some when the machine stopped.
fn is_made_of(part: &Path, stream: &Path) -> bool {
    let Ok(salvaged) = salvage(stream) else { return true };
    // A part that cannot be read is written again from the stream.
    let Some(own) = rows(part) else { return true };
    let theirs: Option<Vec<TextRows>> = salvaged.batches.iter().map(rows_of).collect();
    own.iter().zip(&theirs.unwrap_or_default().concat()).all(|(a, b)| a == b)
}

/// Rows as text; equal text of a number means equal bits.
type TextRows = Vec<String>;

fn rows(part: &Path) -> Option<TextRows> {
    let batches: Option<Vec<TextRows>> = read(part).ok()?.map(|batch| rows_of(&batch.ok()?)).collect();
    Some(batches?.concat())
}

fn rows_of(batch: &RecordBatch) -> Option<TextRows> {
    let columns: Option<Vec<_>> = batch.columns().iter().map(|column| values(column.as_ref())).collect();
    let columns = columns?;
    Some((0..batch.num_rows()).map(|n| columns.iter().map(|c| format!("{:?} ", c[n])).collect()).collect())
}

/// Rows of a table of results without their line in the journal.
fn results(folder: &Path, name: &str, journal: &JournalState) -> Option<String> {
    let path = folder.join(name);
    if !path.exists() {
        return None;
    }
    let rows = journal.rows().iter().chain(journal.superseded());
    let rows = rows.map(|r| (r.set_up.as_str(), r.experiment.as_str(), r.segment, r.point_index));
    let transients = journal.transients().iter();
    let transients = transients.map(|r| (r.set_up.as_str(), r.experiment.as_str(), r.segment, r.point_index));
    let withdrawn = journal.withdrawn().iter();
    let withdrawn = withdrawn.map(|w| (w.id.set_up.as_str(), w.id.experiment.as_str(), w.id.segment, w.point_index));
    let listed: BTreeSet<_> = rows.chain(transients).chain(withdrawn).collect();
    let keys = read(&path).and_then(|batches| batches.map(|batch| keys(&batch?)).collect::<Result<Vec<_>, _>>());
    match keys.map(|keys| keys.concat()) {
        Ok(keys) => {
            let untracked =
                keys.iter().filter(|(s, e, n, p)| !listed.contains(&(s.as_str(), e.as_str(), *n, *p))).count();
            (untracked > 0).then(|| format!("{name}: {untracked} of its {} points", keys.len()))
        }
        // It is made from the journal, if that has anything.
        Err(_) if !listed.is_empty() => None,
        Err(error) => Some(error.to_string()),
    }
}

type ResultKey = (String, String, u32, u32);

/// The points that a batch of results holds.
fn keys(batch: &RecordBatch) -> Result<Vec<ResultKey>, Failure> {
    let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
    let (segments, points) = (numbers(batch, "segment")?, numbers(batch, "point_index")?);
    let rows = set_ups.into_iter().zip(experiments).zip(segments.into_iter().zip(points));
    Ok(rows
        .map(|((set_up, experiment), (segment, point))| (set_up, experiment, segment as u32, point as u32))
        .collect())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::run_folder::journal::{JournalEntry, SegmentStart};
    use crate::run_folder::schema::samples::SampleColumn;
    use crate::run_folder::schema::segment_id::SegmentId;
    use crate::run_folder::write::sample_part::OpenPart;

    fn id() -> SegmentId {
        SegmentId { set_up: "a".into(), experiment: "e".into(), segment: 0 }
    }

    /// Writes a stream of rows and the closed part made from it; the stream stays.
    fn seal(folder: &Path, first: f32) {
        let signals = [SampleColumn { name: "x_m".into(), unit: "m".into() }];
        let label = PointLabel { id: id(), point_index: 0, frequency_hz: 2.5 };
        let mut part = OpenPart::create(folder, 3, Arc::new(label), &signals, 1000.0).unwrap();
        (0..20_u16).for_each(|n| part.push(n.into(), 0, &[first + f32::from(n)]).unwrap());
        part.seal(folder, &signals, &arrow_schema::Metadata::new(), 1000.0).unwrap();
    }

    #[test]
    fn a_part_beside_an_open_part_of_its_number_is_tracked_only_if_it_has_its_rows() {
        let folder = tempfile::tempdir().unwrap();
        let start = SegmentStart { id: id(), points: 1, ..SegmentStart::default() };
        let journal = JournalState::of(&[JournalEntry::Segment(start)]);
        let found = || untracked(folder.path(), &journal, false);
        seal(folder.path(), f32::NAN);
        assert!(found().is_empty(), "a kill came before the journal had the part");
        let part = folder.path().join("samples.parts/000003.parquet");
        let own = std::fs::read(&part).unwrap();
        std::fs::write(&part, &own[..own.len() / 2]).unwrap();
        assert!(found().is_empty(), "a damaged part is written again");
        // A part of another run, beside the stream of this one.
        seal(folder.path(), 1.0);
        let stranger = std::fs::read(&part).unwrap();
        seal(folder.path(), 2.0);
        std::fs::write(&part, stranger).unwrap();
        let found = found();
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("000003.parquet") && found[0].contains("samples-000003.open.arrows"), "{found:?}");
    }
}
