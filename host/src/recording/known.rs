//! What stands in a run folder and is not what the journal speaks of.
//!
//! A journal that was emptied, cut or replaced knows less than the folder holds; going on from it would measure again
//! what is there and write over it. So nothing but what the journal knows is joined, rewritten or removed. A stream that
//! still goes on beside a part is the mark of a kill before the journal had the part: both are the run's own.

use std::collections::BTreeSet;
use std::path::Path;

use arrow_array::StringArray;
use arrow_array::cast::AsArray;
use arrow_array::types::UInt32Type;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::part::{Stream, open_parts, read_stream};
use super::samples::{self, JOINED, Label};
use super::taken::Taken;
use super::transients::TRANSIENTS;

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
        let is_known = taken.sealed.iter().any(|s| s.part == number) || streams.iter().any(|(n, _)| *n == number);
        if !is_known {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            found.data.push(format!("{}/{name}: a part of the samples", samples::PARTS));
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
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
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
