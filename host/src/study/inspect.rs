//! How far the workers of a study are, and whether its files are right.

use std::time::SystemTime;

use super::data_set::{DataSet, PARTS, part_number};
use super::lease::{self, Lease};
use crate::run_folder::{ReadError, StorageError};

/// Parts that the pace is taken from: the latest.
const PACE_PARTS: usize = 64;

/// How far a study is.
#[derive(Clone, Debug)]
pub struct Status {
    /// Parts that are there.
    pub done: u64,
    /// Parts that are not, rising.
    pub missing: Vec<u64>,
    /// Leases of missing parts.
    pub leases: Vec<(u64, Lease)>,
    /// Estimated time until the last part, s, and the number of parts whose pace it is taken from; `None` before two parts of
    /// different times.
    pub left_s: Option<(f64, usize)>,
}

/// How far a study is. Its parts are listed, not read.
///
/// # Errors
/// When parts or leases cannot be listed or read.
pub fn status(data_set: &DataSet) -> Result<Status, StorageError> {
    let parts = data_set.parts()?;
    let missing: Vec<u64> = (0..data_set.manifest().parts()).filter(|part| !parts.contains_key(part)).collect();
    let mut leases = Vec::new();
    for (part, term) in lease::terms(data_set.store())? {
        if parts.contains_key(&part) {
            continue;
        }
        if let Some(lease) = lease::read(data_set.store(), part, term)? {
            leases.push((part, lease));
        }
    }
    let left_s = left_s(parts.into_values().collect(), missing.len());
    let done = data_set.manifest().parts() - missing.len() as u64;
    Ok(Status { done, missing, leases, left_s })
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
pub struct Verdict {
    /// Parts that are right.
    pub good: u64,
    /// Parts that are not there, rising.
    pub missing: Vec<u64>,
    /// Each wrong file, what is wrong, and what to do.
    pub wrong: Vec<String>,
}

/// Reads every part: whether it is a whole file of this study with its rows in order. `seen` gets each part's number.
///
/// # Errors
/// When the parts cannot be listed.
pub fn verify(data_set: &DataSet, mut seen: impl FnMut(u64)) -> Result<Verdict, StorageError> {
    let mut verdict = Verdict { good: 0, missing: Vec::new(), wrong: Vec::new() };
    for part in 0..data_set.manifest().parts() {
        match data_set.part(part) {
            Ok(Some(_)) => verdict.good += 1,
            Ok(None) => verdict.missing.push(part),
            Err(ReadError(what)) => verdict.wrong.push(what),
        }
        seen(part);
    }
    for entry in data_set.store().list(PARTS)? {
        if part_number(&entry.name).is_none_or(|part| part >= data_set.manifest().parts()) {
            let path = data_set.store().address(&format!("{PARTS}/{}", entry.name));
            verdict.wrong.push(format!("{}: is no part of this study\n  remove it", path.display()));
        }
    }
    Ok(verdict)
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
