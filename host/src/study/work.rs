//! Computes parts of a study as one of several workers, on any number of machines. A worker joins nothing.

use std::ops::Range;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use super::data_set::DataSet;
use super::failure::StudyFailure;
use super::file::Study;
use super::lease::{self, Claim, Worker};
use super::run::{Ending, compute};
use crate::run_folder::StorageError;

/// Renewals of a lease in its length: two may fail.
const RENEWALS: u32 = 3;

/// Longest wait between two looks for a part whose lease has expired.
const LONGEST_WAIT: Duration = Duration::from_secs(5);

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

/// What a worker does.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Has written a part, or found that another worker had.
    Done {
        /// The part.
        part: u64,
        /// Its rows.
        rows: Range<u64>,
        /// Time it took, s.
        took_s: f64,
    },
    /// Another worker has taken its part over, or finished it.
    Lost {
        /// The part.
        part: u64,
    },
    /// A lease could not be renewed; it is tried again.
    NotRenewed {
        /// The part.
        part: u64,
        /// Why.
        why: String,
    },
    /// Other workers hold all parts that are missing.
    Waiting {
        /// Number of these parts.
        parts: u64,
    },
}

/// Whom a worker tells what it does, and who tells it to stop.
pub trait Foreman: Sync {
    /// Sees a step.
    fn sees(&self, step: Step);
    /// Whether the worker is to go on.
    fn goes_on(&self) -> bool;
}

/// Computes the missing parts of a share.
///
/// # Errors
/// A case that the axes make and that is refused; parts that cannot be listed or written.
pub fn shard(study: &Study, data_set: &DataSet, shard: Shard, foreman: &dyn Foreman) -> Result<Ending, StudyFailure> {
    let missing = data_set.missing()?;
    for part in missing.into_iter().filter(|part| shard.has(*part)) {
        // Another worker of this share may have been faster.
        if data_set.has_part(part)? {
            continue;
        }
        if !compute_part(study, data_set, part, foreman, &|| foreman.goes_on())? {
            return Ok(Ending::Stopped);
        }
    }
    Ok(Ending::Complete)
}

/// Takes one missing part after the other until all are there. Waits for parts of other workers, because these may be killed.
///
/// # Errors
/// A case that the axes make and that is refused; parts or leases that cannot be listed or written.
pub fn claim(
    study: &Study,
    data_set: &DataSet,
    length: Duration,
    foreman: &dyn Foreman,
) -> Result<Ending, StudyFailure> {
    let worker = Worker::this();
    let mut is_waiting = false;
    loop {
        if !foreman.goes_on() {
            return Ok(Ending::Stopped);
        }
        let missing = data_set.missing()?;
        if missing.is_empty() {
            return Ok(Ending::Complete);
        }
        let Some(claim) = next(data_set, &missing, &worker, length)? else {
            if !is_waiting {
                foreman.sees(Step::Waiting { parts: missing.len() as u64 });
            }
            is_waiting = true;
            thread::sleep(LONGEST_WAIT.min(length / RENEWALS));
            continue;
        };
        is_waiting = false;
        let outcome = compute_claimed(study, &claim, data_set, length, foreman);
        // A lease that cannot be given back expires.
        let _ = claim.give_back();
        outcome?;
    }
}

/// The first part that can be taken, from a random one on: workers that start together do not all try the same.
fn next<'a>(
    data_set: &'a DataSet,
    missing: &[u64],
    worker: &Worker,
    length: Duration,
) -> Result<Option<Claim<'a>>, StorageError> {
    let terms = lease::terms(data_set.store())?;
    let from = fastrand::usize(..missing.len());
    for &part in missing[from..].iter().chain(&missing[..from]) {
        let claim = Claim::take(data_set, part, terms.get(&part).copied(), worker, length)?;
        if claim.is_some() {
            return Ok(claim);
        }
    }
    Ok(None)
}

/// Computes a part while its lease is renewed.
fn compute_claimed(
    study: &Study,
    claim: &Claim,
    data_set: &DataSet,
    length: Duration,
    foreman: &dyn Foreman,
) -> Result<(), StudyFailure> {
    let is_lost = AtomicBool::new(false);
    thread::scope(|scope| {
        let (done, end) = mpsc::channel::<()>();
        let is_lost = &is_lost;
        scope.spawn(move || {
            // The channel closes when the part is done.
            while end.recv_timeout(length / RENEWALS) == Err(RecvTimeoutError::Timeout) {
                match claim.renew() {
                    Ok(true) => {}
                    Ok(false) => {
                        is_lost.store(true, Ordering::Relaxed);
                        return;
                    }
                    Err(error) => foreman.sees(Step::NotRenewed { part: claim.part(), why: error.to_string() }),
                }
            }
        });
        let go_on = || foreman.goes_on() && !is_lost.load(Ordering::Relaxed);
        let outcome = compute_part(study, data_set, claim.part(), foreman, &go_on);
        drop(done);
        outcome
    })?;
    if is_lost.into_inner() {
        foreman.sees(Step::Lost { part: claim.part() });
    }
    Ok(())
}

/// Computes and writes a part; `false` if `go_on` said no.
fn compute_part(
    study: &Study,
    data_set: &DataSet,
    part: u64,
    foreman: &dyn Foreman,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<bool, StudyFailure> {
    let (start, rows) = (Instant::now(), data_set.manifest().rows_of(part));
    let Some(values) = compute(study, rows.clone(), &|_| go_on())? else { return Ok(false) };
    data_set.write_part(study, part, &values)?;
    foreman.sees(Step::Done { part, rows, took_s: start.elapsed().as_secs_f64() });
    Ok(true)
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
