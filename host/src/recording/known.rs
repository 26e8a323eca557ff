//! What stands in a run folder and is not what the journal speaks of.
//!
//! A journal that was emptied, cut or replaced knows less than the folder holds; going on from it would measure again
//! what is there and write over it. So nothing but what the journal knows is joined, rewritten or removed. A stream that
//! still stands beside a part is the mark of a kill before the journal had the part: both are the run's own, if the part
//! is made of the stream.

use std::collections::BTreeSet;
use std::path::Path;

use arrow_array::cast::AsArray;
use arrow_array::types::UInt32Type;
use arrow_array::{RecordBatch, StringArray};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::part::{Stream, open_parts, read_stream, salvage};
use super::samples::{self, JOINED, Label};
use super::taken::Taken;
use super::transients::TRANSIENTS;
use crate::input::regular;
use crate::runs::columns::values;

/// What a journal does not know.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unknown {
    /// Data of a run that the journal has no word of, as `file: what it is`.
    pub data: Vec<String>,
    /// Streams of samples without a single readable word; they are left as they are.
    pub unreadable: Vec<String>,
}

/// Compares a folder with its journal; `is_complete`: it has every point, so that the samples may have been joined when
/// the program was killed. Nothing is written.
#[must_use]
pub fn unknown(folder: &Path, taken: &Taken, is_complete: bool) -> Unknown {
    let mut found = Unknown::default();
    let streams = open_parts(folder);
    for (number, path) in samples::parts(folder) {
        if taken.sealed.iter().any(|s| s.part == number) {
            continue;
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match streams.iter().find(|(n, _)| *n == number) {
            None => found.data.push(format!("{}/{name}: a part of the samples", samples::PARTS)),
            Some((_, stream)) if !is_made_of(&path, stream) => {
                let stream = stream.file_name().unwrap_or_default().to_string_lossy();
                found
                    .data
                    .push(format!("{}/{name}: a part of the samples, and not of those in {stream}", samples::PARTS));
            }
            Some(_) => {}
        }
    }
    for (_, path) in &streams {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match read_stream(path) {
            Stream::Of(label) if !is_begun(taken, &label) => found.data.push(format!(
                "{name}: samples of set-up {:?}, {:?}, segment {}, which was never begun",
                label.set_up, label.experiment, label.segment
            )),
            Stream::Unreadable => found.unreadable.push(name.into_owned()),
            Stream::Of(_) | Stream::Empty => {}
        }
    }
    if folder.join(JOINED).exists() && taken.joined.is_none() && !is_complete {
        found.data.push(format!("{JOINED}: samples of a complete run"));
    }
    for name in ["results.parquet", TRANSIENTS] {
        found.data.extend(results(folder, name, taken));
    }
    found
}

/// Whether a part may have been made of a stream: their rows are the same, as far as both of them go. What one of them has
/// more was lost to the other when the machine stopped.
fn is_made_of(part: &Path, stream: &Path) -> bool {
    let Ok(salvaged) = salvage(stream) else { return true };
    // A part that cannot be read is made anew of the stream.
    let Some(own) = rows(part) else { return true };
    let theirs: Option<Vec<Rows>> = salvaged.batches.iter().map(rows_of).collect();
    own.iter().zip(&theirs.unwrap_or_default().concat()).all(|(a, b)| a == b)
}

/// Rows as text: of a number, equal text is equal bits.
type Rows = Vec<String>;

fn rows(part: &Path) -> Option<Rows> {
    let reader = ParquetRecordBatchReaderBuilder::try_new(regular::open(part).ok()?).ok()?.build().ok()?;
    let batches: Option<Vec<Rows>> = reader.map(|batch| rows_of(&batch.ok()?)).collect();
    Some(batches?.concat())
}

fn rows_of(batch: &RecordBatch) -> Option<Rows> {
    let columns: Option<Vec<_>> = batch.columns().iter().map(|column| values(column.as_ref())).collect();
    let columns = columns?;
    Some((0..batch.num_rows()).map(|n| columns.iter().map(|c| format!("{:?} ", c[n])).collect()).collect())
}

/// Whether the journal has the start of the device that a label names.
#[must_use]
fn is_begun(taken: &Taken, label: &Label) -> bool {
    let is = |s: &super::journal::Segment| {
        s.set_up == label.set_up && s.experiment == label.experiment && s.segment == label.segment
    };
    taken.segments.iter().any(is)
}

/// Rows of a table of results without their line in the journal.
fn results(folder: &Path, name: &str, taken: &Taken) -> Option<String> {
    let path = folder.join(name);
    if !path.exists() {
        return None;
    }
    let known: BTreeSet<_> = taken
        .rows()
        .iter()
        .chain(taken.superseded())
        .map(|r| (r.set_up.as_str(), r.experiment.as_str(), r.segment, r.point_index))
        .chain(taken.transients().iter().map(|r| (r.set_up.as_str(), r.experiment.as_str(), r.segment, r.point_index)))
        .collect();
    match keys(&path) {
        Ok(keys) => {
            let strange = keys.iter().filter(|(s, e, n, p)| !known.contains(&(s.as_str(), e.as_str(), *n, *p))).count();
            (strange > 0).then(|| format!("{name}: {strange} of its {} points", keys.len()))
        }
        // It follows from the journal, if that has anything.
        Err(_) if !known.is_empty() => None,
        Err(error) => Some(format!("{name}: {error}")),
    }
}

type Key = (String, String, u32, u32);

/// Which points a results file holds.
fn keys(path: &Path) -> Result<Vec<Key>, String> {
    let file = regular::open(path).map_err(|e| e.to_string())?;
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).and_then(ParquetRecordBatchReaderBuilder::build);
    let mut keys = Vec::new();
    for batch in reader.map_err(|e| e.to_string())? {
        let batch = batch.map_err(|e| e.to_string())?;
        let text = |name: &str| -> Option<&StringArray> { batch.column_by_name(name)?.as_string_opt() };
        let number = |name: &str| batch.column_by_name(name)?.as_primitive_opt::<UInt32Type>();
        let columns = (text("set_up"), text("experiment"), number("segment"), number("point_index"));
        let (Some(set_ups), Some(experiments), Some(segments), Some(points)) = columns else {
            return Err("it lacks the columns that name a point".into());
        };
        keys.extend((0..points.len()).map(|n| {
            (set_ups.value(n).to_string(), experiments.value(n).to_string(), segments.value(n), points.value(n))
        }));
    }
    Ok(keys)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::Signal;
    use super::super::journal::{Entry, Segment};
    use super::super::part::OpenPart;
    use super::*;

    /// Writes a stream of rows and the closed part that is made of it; the stream stays.
    fn seal(folder: &Path, first: f32) {
        let signals = [Signal { name: "x_m".into(), unit: "m".into() }];
        let (set_up, experiment) = ("a".to_string(), "e".to_string());
        let label = Label { set_up, experiment, segment: 0, point_index: 0, frequency_hz: 2.5 };
        let mut part = OpenPart::create(folder, 3, Arc::new(label), &signals, 1000.0).unwrap();
        (0..20_u16).for_each(|n| part.push(n.into(), 0, &[first + f32::from(n)]).unwrap());
        part.seal(folder, &signals, 1000.0).unwrap();
    }

    #[test]
    fn a_part_beside_a_stream_of_its_number_is_the_runs_own_only_if_it_is_made_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let (set_up, experiment, at) = ("a".to_string(), "e".to_string(), String::new());
        let start = Segment { set_up, experiment, segment: 0, first_index: 0, points: 1, anew: false, at };
        let taken = Taken::of(&[Entry::Segment(start)]);
        let found = || unknown(folder.path(), &taken, false).data;
        seal(folder.path(), f32::NAN);
        assert!(found().is_empty(), "a kill came before the journal had the part");
        let part = folder.path().join("samples.parts/000003.parquet");
        let own = std::fs::read(&part).unwrap();
        std::fs::write(&part, &own[..own.len() / 2]).unwrap();
        assert!(found().is_empty(), "a damaged part is made anew");
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
