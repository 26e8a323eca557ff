//! Files that other files name: each is read and parsed once, however many cases name it.

use std::any::Any;
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sha2::{Digest, Sha256};

use super::regular;

/// SHA-256 of a file.
pub type FileDigest = [u8; 32];

/// How a file was read: its path, and the options of its reader.
type Reading = (PathBuf, String);

/// The files that were read so far.
#[derive(Debug, Default)]
pub struct Files {
    digests: Mutex<BTreeMap<PathBuf, FileDigest>>,
    parsed: Mutex<HashMap<Reading, Arc<dyn Any + Send + Sync>>>,
}

fn lock<T>(value: &Mutex<T>) -> MutexGuard<'_, T> {
    // A map is valid even if a thread panicked while it held the lock.
    value.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Files {
    /// What `parse` made of a file when it was first read with these `options`; a failure is not kept. A file that changes later is not
    /// read again.
    ///
    /// # Errors
    /// That of `parse`, which gets the file's bytes or why it cannot be read.
    pub fn parsed<T: Clone + Send + Sync + 'static, E>(
        &self,
        path: &Path,
        options: &str,
        parse: impl FnOnce(io::Result<Vec<u8>>) -> Result<T, E>,
    ) -> Result<T, E> {
        let reading = (path.to_path_buf(), options.to_string());
        if let Some(known) = lock(&self.parsed).get(&reading).and_then(|known| known.downcast_ref::<T>()) {
            return Ok(known.clone());
        }
        let bytes = regular::read_input(path);
        let digest = bytes.as_ref().ok().map(|bytes| Sha256::digest(bytes).into());
        let value = parse(bytes)?;
        if let Some(digest) = digest {
            lock(&self.digests).insert(path.to_path_buf(), digest);
            lock(&self.parsed).insert(reading, Arc::new(value.clone()));
        }
        Ok(value)
    }

    /// The files by their paths.
    #[must_use]
    pub fn digests(&self) -> BTreeMap<PathBuf, FileDigest> {
        lock(&self.digests).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_once_for_each_way_of_reading_it_and_a_failure_is_tried_again() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("record.csv");
        let (files, reads) = (Files::default(), Mutex::new(0));
        let read = |options: &str| {
            files.parsed(&path, options, |bytes| {
                *lock(&reads) += 1;
                bytes.map(|bytes| bytes.len())
            })
        };
        assert!(read("").is_err() && files.digests().is_empty());
        std::fs::write(&path, "12345").unwrap();
        assert_eq!([read("").unwrap(), read("").unwrap(), read("other").unwrap()], [5, 5, 5]);
        std::fs::write(&path, "123").unwrap();
        assert_eq!((read("").unwrap(), *lock(&reads)), (5, 3));
        let expected: FileDigest = Sha256::digest(b"12345").into();
        assert_eq!(files.digests().into_values().collect::<Vec<_>>(), [expected]);
    }
}
