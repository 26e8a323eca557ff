//! How far the workers of a study are, and whether its files are right.

use std::time::SystemTime;

use super::Study;
use super::data_set::{DataSet, PARTS, TABLE, part_number};
use super::sums::{SUMS, Sums};
use crate::failure::Failure;

/// Parts that the pace is taken from: the latest.
const PACE_PARTS: usize = 64;

/// The parts of a study.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StudyParts {
    /// Parts that are right.
    pub good: u64,
    /// Those of them that have no digest: an older version has written them, and a changed result in them is not noticed.
    pub without_digest: u64,
    /// Parts that are not there, rising.
    pub missing: Vec<u64>,
    /// Each wrong part, what is wrong, and what to do.
    pub wrong: Vec<String>,
}

/// Reads every part. `seen` gets each part's number.
fn look(study: &Study, data_set: &DataSet, mut seen: impl FnMut(u64)) -> Result<StudyParts, Failure> {
    let mut parts = StudyParts::default();
    for part in 0..data_set.manifest().parts() {
        match data_set.part(study, part) {
            Ok(Some(there)) => {
                parts.good += 1;
                parts.without_digest += u64::from(!there.has_digest);
            }
            Ok(None) => parts.missing.push(part),
            Err(error) => parts.wrong.push(error.to_string()),
        }
        seen(part);
    }
    Ok(parts)
}

/// How far a study is.
#[derive(Clone, Debug)]
pub struct Status {
    /// Its parts.
    pub parts: StudyParts,
    /// Estimated time until the last part, s, and the number of parts whose pace it is taken from; `None` before two parts of
    /// different times.
    pub left_s: Option<(f64, usize)>,
}

/// How far a study is. Its parts are read: a wrong one is not done.
///
/// # Errors
/// When parts cannot be listed or read.
pub fn status(study: &Study, data_set: &DataSet) -> Result<Status, Failure> {
    let there = data_set.parts()?;
    let parts = look(study, data_set, |_| ())?;
    let left_s = left_s(there.into_values().collect(), parts.missing.len());
    Ok(Status { parts, left_s })
}

/// Time for the missing parts at the pace of the latest ones.
fn left_s(mut written: Vec<SystemTime>, missing: usize) -> Option<(f64, usize)> {
    written.sort();
    let latest = &written[written.len().saturating_sub(PACE_PARTS)..];
    let [first, .., last] = latest else { return None };
    let span_s = last.duration_since(*first).ok()?.as_secs_f64();
    // A store may keep whole seconds.
    (span_s > 0.0).then(|| (span_s / (latest.len() - 1) as f64 * missing as f64, latest.len()))
}

/// What a look at all files found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inspection {
    /// The parts.
    pub parts: StudyParts,
    /// Table, figures and page that are right; `None` before the parts are joined, or for files of an older version.
    pub results: Option<u64>,
    /// There is a table.
    pub has_table: bool,
    /// Each wrong file that is no part, what is wrong, and what to do.
    pub wrong: Vec<String>,
}

impl Inspection {
    /// Number of files that are wrong or missing.
    #[must_use]
    pub fn wrong_files(&self) -> usize {
        self.parts.wrong.len() + self.parts.missing.len() + self.wrong.len()
    }
}

/// Reads every file: whether each part is there, whole, as it was written and has the points of this study, and whether table, figures
/// and page are as they were written, and the table is this study's. `seen` gets each part's number.
///
/// # Errors
/// When files cannot be listed or read.
pub fn verify(study: &Study, data_set: &DataSet, seen: impl FnMut(u64)) -> Result<Inspection, Failure> {
    let store = data_set.store();
    let (parts, mut wrong) = (look(study, data_set, seen)?, Vec::new());
    for entry in store.list(PARTS)? {
        if part_number(&entry.name).is_none_or(|part| part >= data_set.manifest().parts()) {
            let path = store.path(&format!("{PARTS}/{}", entry.name));
            wrong.push(format!("{}: is no part of this study\n  remove it", path.display()));
        }
    }
    let again = |what: &String| format!("{what}\n  `damprig study merge` writes it again");
    let (table, shown) = (data_set.table_has_digest()?, store.path(TABLE).display().to_string());
    let results = match Sums::read(store)? {
        Ok(None) => {
            // An older version wrote neither.
            if matches!(table, Some(Ok(true))) {
                wrong.push(again(&format!("{}: missing", store.path(SUMS).display())));
            }
            None
        }
        Ok(Some(sums)) => {
            let (good, changed) = sums.check(store)?;
            wrong.extend(changed.iter().map(again));
            Some(good)
        }
        Err(failure) => {
            wrong.push(again(&failure.to_string()));
            None
        }
    };
    // One that the digests name is named once.
    if let Some(Err(Failure::Storage(what))) = &table
        && !wrong.iter().any(|named| named.starts_with(&shown))
    {
        wrong.push(again(what));
    }
    Ok(Inspection { parts, results, has_table: table.is_some(), wrong })
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, UNIX_EPOCH};

    use super::*;

    #[test]
    fn the_time_left_is_that_of_the_missing_parts_at_the_pace_of_the_latest() {
        let written =
            |seconds: &[u64]| seconds.iter().map(|s| UNIX_EPOCH + Duration::from_secs(*s)).collect::<Vec<_>>();
        assert_eq!(left_s(written(&[30, 10, 20]), 7), Some((70.0, 3)));
        assert_eq!([left_s(written(&[10]), 7), left_s(written(&[10, 10]), 7)], [None, None]);
        // A pause before the latest parts does not count.
        let after_a_pause: Vec<u64> = [0].into_iter().chain(1_000_000..1_000_064).collect();
        assert_eq!(left_s(written(&after_a_pause), 5), Some((5.0, 64)));
    }
}
