//! The folder with the files of a study, as several workers need it: a file appears whole under its name, and only one of several
//! writers can create a name.

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use bytes::Bytes;

use crate::failure::Failure;
use crate::input::regular;
use crate::run_folder::checksum;
use crate::storage::whole_file::{WholeFile, is_unfinished};

/// Age from which an unfinished file belongs to a killed writer.
const ABANDONED: Duration = Duration::from_secs(3_600);

/// A folder for files with names such as `parts/00000001.parquet`.
#[derive(Clone, Debug)]
pub struct Store(PathBuf);

/// A file in a store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredFile {
    /// Its name under the listed folder.
    pub name: String,
    /// When it was written, by the store's clock.
    pub modified: SystemTime,
}

impl Store {
    /// The store at a path of this machine or of a file server. Nothing is created.
    ///
    /// # Errors
    /// A URL.
    pub fn at(folder: &Path) -> Result<Self, Failure> {
        match folder.to_str().filter(|text| text.contains("://")) {
            Some(url) => Err(Failure::Input(format!(
                "{url}: results are written to a folder\n  give a folder, and copy it with the tools of the object store"
            ))),
            None => Ok(Self(folder.to_path_buf())),
        }
    }

    /// Path of a file, or of the store itself for an empty name.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        if name.is_empty() { self.0.clone() } else { self.0.join(name) }
    }

    /// Content of a file, `None` if it is not there.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn get(&self, name: &str) -> Result<Option<Bytes>, Failure> {
        if_there(regular::read(&self.path(name)).map(Bytes::from)).map_err(|error| self.failed("read", name, error))
    }

    /// SHA-256 of a file in lower-case hexadecimal, `None` if it is not there.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn sha256(&self, name: &str) -> Result<Option<String>, Failure> {
        if_there(checksum::of_path(&self.path(name))).map_err(|error| self.failed("read", name, error))
    }

    /// Whether a file is there.
    ///
    /// # Errors
    /// When that cannot be found out.
    pub fn has(&self, name: &str) -> Result<bool, Failure> {
        self.path(name).try_exists().map_err(|error| self.failed("find", name, error))
    }

    /// Creates a file, whole; answers whether it did. An existing one stays as it is: of several writers one succeeds.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn put_new(&self, name: &str, bytes: &[u8]) -> Result<bool, Failure> {
        written(&self.path(name), bytes)
            .and_then(WholeFile::name_new)
            .map_err(|error| self.failed("write", name, error))
    }

    /// Writes a file, whole, in place of an earlier one.
    ///
    /// # Errors
    /// When it cannot be written; the earlier one stays.
    pub fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        let file = written(&self.path(name), bytes);
        file.and_then(WholeFile::replace).map_err(|error| self.failed("write", name, error))
    }

    /// Removes a file; one that is not there is removed already.
    ///
    /// # Errors
    /// When it cannot be removed.
    pub fn remove(&self, name: &str) -> Result<(), Failure> {
        if_there(fs::remove_file(self.path(name))).map(drop).map_err(|error| self.failed("remove", name, error))
    }

    /// Files and folders directly in a folder of the store, by name; none if it is not there. Unfinished files are left out.
    ///
    /// # Errors
    /// When it cannot be listed.
    pub fn list(&self, under: &str) -> Result<Vec<StoredFile>, Failure> {
        let mut entries = listed(&self.path(under)).map_err(|error| self.failed("list", under, error))?;
        entries.retain(|entry| !is_unfinished(&entry.name));
        entries.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(entries)
    }

    /// A file to write something large to.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn large_file(&self, name: &str) -> Result<WholeFile, Failure> {
        unfinished(&self.path(name)).map_err(|error| self.failed("write", name, error))
    }

    /// Removes what killed writers left in a folder of the store more than an hour ago.
    pub fn remove_abandoned(&self, under: &str) {
        let folder = self.path(under);
        for entry in listed(&folder).unwrap_or_default() {
            let is_old = entry.modified.elapsed().is_ok_and(|age| age > ABANDONED);
            if is_unfinished(&entry.name) && is_old {
                let _ = fs::remove_file(folder.join(entry.name));
            }
        }
    }

    fn failed(&self, action: &'static str, name: &str, error: io::Error) -> Failure {
        Failure::cannot(action, &self.path(name), error)
    }
}

fn if_there<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// A file under construction; the store's folders are made as they are needed.
fn unfinished(path: &Path) -> io::Result<WholeFile> {
    fs::create_dir_all(path.parent().unwrap_or(Path::new("")))?;
    WholeFile::create(path)
}

fn written(path: &Path, bytes: &[u8]) -> io::Result<WholeFile> {
    let mut file = unfinished(path)?;
    file.write_all(bytes)?;
    Ok(file)
}

fn listed(folder: &Path) -> io::Result<Vec<StoredFile>> {
    let Some(entries) = if_there(fs::read_dir(folder))? else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for entry in entries {
        let entry = entry?;
        // A file may vanish while the folder is listed.
        let Some(metadata) = if_there(entry.metadata())? else { continue };
        found.push(StoredFile {
            name: entry.file_name().to_string_lossy().into_owned(),
            modified: metadata.modified()?,
        });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_sixteen_writers_one_creates_a_file_and_nothing_is_left_over() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::at(folder.path()).unwrap();
        let contents: Vec<Vec<u8>> = (0..16u8).map(|n| vec![n; 10_000]).collect();
        let created: Vec<bool> = std::thread::scope(|scope| {
            let writers: Vec<_> =
                contents.iter().map(|bytes| scope.spawn(|| store.put_new("parts/a", bytes).unwrap())).collect();
            writers.into_iter().map(|writer| writer.join().unwrap()).collect()
        });
        let winner = created.iter().position(|created| *created).unwrap();
        assert_eq!(created.iter().filter(|created| **created).count(), 1);
        assert_eq!(store.get("parts/a").unwrap().unwrap(), contents[winner]);
        assert_eq!(fs::read_dir(folder.path().join("parts")).unwrap().count(), 1);
    }

    #[test]
    fn a_place_that_does_not_exist_is_empty_and_is_not_made_by_reading() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::at(&folder.path().join("new")).unwrap();
        assert!(
            store.list("parts").unwrap().is_empty() && store.get("a").unwrap().is_none() && !store.has("a").unwrap()
        );
        store.remove("a").unwrap();
        assert!(!folder.path().join("new").exists());
    }

    #[test]
    fn an_error_names_the_file_and_what_was_done() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::at(folder.path()).unwrap();
        fs::create_dir(folder.path().join("a")).unwrap();
        let told = store.get("a").unwrap_err().to_string();
        assert!(told.contains("cannot read") && told.contains("/a:") && told.contains("a folder"), "{told}");
        assert!(store.put_new("a", b"1").is_err());
    }
}
