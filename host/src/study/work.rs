//! Computes a share of a study as one of several workers, on any number of machines. A worker joins nothing.

use std::ops::Range;
use std::str::FromStr;
use std::time::Instant;

use super::data_set::DataSet;
use super::file::Study;
use super::run::{StudyEnding, compute};
use crate::failure::Failure;

/// A share of the parts: those that leave the remainder `index` when divided by `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u64,
    count: u64,
}

impl Shard {
    /// Whether a part belongs to it.
    #[must_use]
    pub fn has(&self, part: u64) -> bool {
        part % self.count == self.index
    }
}

impl FromStr for Shard {
    type Err = String;

    /// From `i/n`; i counts from 1.
    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<(u64, u64)> =
            text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
        match numbers {
            Some((0, _)) => Err("i counts from 1: for an index from 0 write $((index + 1))/n".into()),
            Some((i, n)) if i <= n => Ok(Self { index: i - 1, count: n }),
            _ => Err("write i/n: the i-th of n shares, i from 1 to n, for example 3/8".into()),
        }
    }
}

/// A part that a worker has written, or that another worker had written meanwhile.
#[derive(Clone, Debug, PartialEq)]
pub struct Done {
    /// The part.
    pub part: u64,
    /// Its rows.
    pub rows: Range<u64>,
    /// Time it took, s.
    pub took_s: f64,
}

/// Computes the missing parts of a share. `seen` sees each when it is done; `go_on` is asked whether to go on.
///
/// # Errors
/// A case that the axes make and that is refused; parts that cannot be listed or written.
pub fn shard(
    study: &Study,
    data_set: &DataSet,
    shard: Shard,
    seen: impl Fn(Done),
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<StudyEnding, Failure> {
    let missing = data_set.missing()?;
    for part in missing.into_iter().filter(|part| shard.has(*part)) {
        // Another worker of this share may have been faster.
        if data_set.has_part(part)? {
            continue;
        }
        let (start, rows) = (Instant::now(), data_set.manifest().rows_of(part));
        let Some(values) = compute(study, rows.clone(), &|_| go_on())? else { return Ok(StudyEnding::Stopped) };
        data_set.write_part(study, part, &values)?;
        seen(Done { part, rows, took_s: start.elapsed().as_secs_f64() });
    }
    Ok(StudyEnding::Complete)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_count_from_one_and_each_part_is_in_one_of_them() {
        let shards: Vec<Shard> = (1..=3).map(|i| format!("{i}/3").parse().unwrap()).collect();
        for part in 0..20 {
            let having: Vec<usize> = (0..3).filter(|n| shards[*n].has(part)).collect();
            assert_eq!(having, [part as usize % 3]);
        }
        for (wrong, words) in
            [("0/3", "counts from 1"), ("4/3", "1 to n"), ("3", "i/n"), ("1/0", "1 to n"), ("-1/2", "i/n")]
        {
            let told = wrong.parse::<Shard>().unwrap_err();
            assert!(told.contains(words), "{wrong}: {told}");
        }
    }
}
