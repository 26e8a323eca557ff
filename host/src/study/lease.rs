//! Leases: which worker computes which part of a study at the moment.
//!
//! A lease is a file `leases/PART.TERM`. Its holder writes it again while it computes. When it has not done so for the time that
//! the file states, any worker may create the file of the next term, and only one can. So a worker that was killed loses its
//! part after a while. A worker that was only slow finds the next term, or the part itself, when it renews.
//!
//! Leases save computing, nothing else depends on them: a part computed twice has the same bytes, and the first one stays.

use std::collections::BTreeMap;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::data_set::{DataSet, LEASES, part_name};
use super::store::Store;
use crate::run_folder::StorageError;

/// A worker: a process of some machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Worker {
    /// Name of the machine.
    pub host: String,
    /// Number of the process there.
    pub process: u32,
    /// Tells processes of the same number apart.
    pub key: u64,
}

impl Worker {
    /// This process.
    #[must_use]
    pub fn this() -> Self {
        let named =
            ["/proc/sys/kernel/hostname", "/etc/hostname"].iter().find_map(|path| std::fs::read_to_string(path).ok());
        let host = named.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
        let host = if host.trim().is_empty() { "unknown".into() } else { host.trim().into() };
        Self { host, process: std::process::id(), key: getrandom::u64().unwrap_or_else(|_| fastrand::u64(..)) }
    }
}

/// Content of a lease.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lease {
    /// Who holds it.
    pub worker: Worker,
    /// When it was taken, s since 1970.
    pub taken_s: f64,
    /// When its holder last wrote it, s since 1970.
    pub renewed_s: f64,
    /// Time after that at which it expires, s.
    pub length_s: f64,
}

impl Lease {
    /// Whether another worker may take the part.
    #[must_use]
    pub fn is_expired(&self, now_s: f64) -> bool {
        // So is one that a wrong clock has written far ahead.
        (now_s - self.renewed_s).abs() > self.length_s
    }
}

/// Time by this machine's clock, s since 1970.
#[must_use]
pub fn now_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}

/// The latest term of each part that has a lease.
///
/// # Errors
/// When they cannot be listed.
pub fn terms(store: &Store) -> Result<BTreeMap<u64, u64>, StorageError> {
    let mut latest = BTreeMap::new();
    for entry in store.list(LEASES)? {
        let numbers: Option<(u64, u64)> =
            entry.name.split_once('.').and_then(|(part, term)| Some((part.parse().ok()?, term.parse().ok()?)));
        if let Some((part, term)) = numbers {
            let known = latest.entry(part).or_insert(term);
            *known = term.max(*known);
        }
    }
    Ok(latest)
}

/// Reads a lease; `None` if it has been given back, or is damaged.
///
/// # Errors
/// When it cannot be read.
pub fn read(store: &Store, part: u64, term: u64) -> Result<Option<Lease>, StorageError> {
    let bytes = store.get(&lease_name(part, term))?;
    Ok(bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()))
}

/// A part that this worker holds.
#[derive(Debug)]
pub struct Claim<'a> {
    data_set: &'a DataSet,
    part: u64,
    term: u64,
    lease: Lease,
}

impl<'a> Claim<'a> {
    /// Takes a part that nobody holds, or whose lease has expired. `latest` is its latest term, if it has one. `None` if another
    /// worker holds it, was faster, or has finished it.
    ///
    /// # Errors
    /// When the store cannot be read or written.
    pub fn take(
        data_set: &'a DataSet,
        part: u64,
        latest: Option<u64>,
        worker: &Worker,
        length: Duration,
    ) -> Result<Option<Self>, StorageError> {
        let store = data_set.store();
        if let Some(term) = latest
            && read(store, part, term)?.is_some_and(|lease| !lease.is_expired(now_s()))
        {
            return Ok(None);
        }
        let term = latest.map_or(0, |term| term + 1);
        let now_s = now_s();
        let lease = Lease { worker: worker.clone(), taken_s: now_s, renewed_s: now_s, length_s: length.as_secs_f64() };
        // An object store may answer a repeated request after its own first one: then the file there is this worker's.
        let is_taken = store.put_new(&lease_name(part, term), &lease.bytes())?
            || read(store, part, term)?.is_some_and(|there| there == lease);
        if !is_taken {
            return Ok(None);
        }
        let claim = Self { data_set, part, term, lease };
        if data_set.has_part(part)? {
            claim.give_back()?;
            return Ok(None);
        }
        Ok(Some(claim))
    }

    /// The part.
    #[must_use]
    pub fn part(&self) -> u64 {
        self.part
    }

    /// Writes the lease again; answers whether the part is still to be computed by this worker.
    ///
    /// # Errors
    /// When the store cannot be read or written.
    pub fn renew(&self) -> Result<bool, StorageError> {
        let store = self.data_set.store();
        if store.has(&lease_name(self.part, self.term + 1))? || self.data_set.has_part(self.part)? {
            return Ok(false);
        }
        let lease = Lease { renewed_s: now_s(), ..self.lease.clone() };
        store.replace(&lease_name(self.part, self.term), &lease.bytes())?;
        Ok(true)
    }

    /// Removes the lease and those of earlier terms.
    ///
    /// # Errors
    /// When the store cannot be written.
    pub fn give_back(&self) -> Result<(), StorageError> {
        (0..=self.term).try_for_each(|term| self.data_set.store().remove(&lease_name(self.part, term)))
    }
}

impl Lease {
    fn bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }
}

fn lease_name(part: u64, term: u64) -> String {
    let part = part_name(part);
    format!("{LEASES}/{}.{term:04}", part.trim_end_matches(".parquet"))
}
