//! SHA-256 of a study's table, figures and page, in a file that `sha256sum -c` checks too.

use std::collections::BTreeMap;

use super::store::Store;
use crate::failure::Failure;
use crate::run_folder::checksum;

/// Name of the file.
pub const SUMS: &str = "SHA256SUMS";

/// Names of files and their digests.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sums(BTreeMap<String, String>);

impl Sums {
    /// With the content of a file that was written.
    pub fn add(&mut self, name: &str, bytes: &[u8]) {
        self.0.insert(name.into(), checksum::of_bytes(bytes));
    }

    /// With a file as it is in the store.
    ///
    /// # Errors
    /// When it is missing or cannot be read.
    pub fn of_stored(mut self, store: &Store, name: &str) -> Result<Self, Failure> {
        let digest = store.sha256(name)?;
        let missing = || Failure::cannot("read", &store.path(name), "it was removed as soon as it was written");
        self.0.insert(name.into(), digest.ok_or_else(missing)?);
        Ok(self)
    }

    /// Writes the file, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, store: &Store) -> Result<(), Failure> {
        let text: String = self.0.iter().map(|(name, digest)| format!("{digest}  {name}\n")).collect();
        store.replace(SUMS, text.as_bytes())
    }

    /// Removes the file, before any of the others is written again.
    ///
    /// # Errors
    /// When it cannot be removed.
    pub fn remove(store: &Store) -> Result<(), Failure> {
        store.remove(SUMS)
    }

    /// Reads the file; `None` before the parts are joined, or for files of an older version.
    ///
    /// # Errors
    /// When it cannot be read, or is damaged.
    pub fn read(store: &Store) -> Result<Result<Option<Self>, Failure>, Failure> {
        let Some(bytes) = store.get(SUMS)? else { return Ok(Ok(None)) };
        let line = |line: &str| {
            let (digest, name) =
                line.split_once("  ").filter(|(digest, name)| digest.len() == 64 && !name.is_empty())?;
            Some((name.to_string(), digest.to_string()))
        };
        let text = std::str::from_utf8(&bytes).ok().and_then(|text| text.strip_suffix('\n'));
        let sums = text.and_then(|text| text.split('\n').map(line).collect::<Option<BTreeMap<_, _>>>());
        let damaged = || Failure::Storage(format!("{}: a damaged line", store.path(SUMS).display()));
        Ok(sums.map(|sums| Some(Self(sums))).ok_or_else(damaged))
    }

    /// Whether a file is there as it was written.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn has(&self, store: &Store, name: &str) -> Result<bool, Failure> {
        let digest = self.0.get(name);
        Ok(digest.is_some() && store.sha256(name)?.as_ref() == digest)
    }

    /// The files that are missing or have changed, and what to do; and the number of the others.
    ///
    /// # Errors
    /// When one cannot be read.
    pub fn check(&self, store: &Store) -> Result<(u64, Vec<String>), Failure> {
        let (mut good, mut wrong) = (0, Vec::new());
        for (name, digest) in &self.0 {
            let shown = store.path(name);
            match store.sha256(name)? {
                Some(there) if there == *digest => good += 1,
                Some(_) => wrong.push(format!("{}: changed since it was written (SHA-256 differs)", shown.display())),
                None => wrong.push(format!("{}: missing", shown.display())),
            }
        }
        Ok((good, wrong))
    }
}
