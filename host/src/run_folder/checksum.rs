//! SHA-256 of a run folder's files: recorded in the manifest when a run ends, compared by `damprig runs verify`.

use std::fs;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::error::StorageError;
use crate::input::regular;

/// A file as it was when the run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileRecord {
    /// Path relative to the run folder, with `/`.
    pub name: String,
    /// Size, bytes.
    pub bytes: u64,
    /// SHA-256 in lower-case hexadecimal.
    pub sha256: String,
}

/// The file `name` of a run folder, as it is now.
///
/// # Errors
/// When it cannot be read.
pub fn of_file(folder: &Path, name: &str) -> io::Result<FileRecord> {
    let mut file = regular::open(&folder.join(name))?;
    let mut hash = Sha256::new();
    let bytes = io::copy(&mut file, &mut HashWriter(&mut hash))?;
    let sha256 = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    Ok(FileRecord { name: name.to_string(), bytes, sha256 })
}

struct HashWriter<'a>(&'a mut Sha256);

impl io::Write for HashWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// All files of a run folder by name, except the manifest, which holds this list, and files that are being written. Links
/// to folders, pipes and the like are left out.
///
/// # Errors
/// When one cannot be read.
pub fn of_folder(folder: &Path) -> Result<Vec<FileRecord>, StorageError> {
    let mut names = Vec::new();
    list(folder, "", &mut names).map_err(|e| StorageError::new("list", folder, e))?;
    names.sort();
    let one = |name: &String| of_file(folder, name).map_err(|e| StorageError::new("read", &folder.join(name), e));
    names.iter().map(one).collect()
}

fn list(folder: &Path, prefix: &str, names: &mut Vec<String>) -> io::Result<()> {
    for entry in fs::read_dir(folder.join(prefix))? {
        let entry = entry?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.file_type()?.is_dir() {
            list(folder, &format!("{name}/"), names)?;
        } else if name != "manifest.json" && !name.ends_with(".tmp") && entry.path().is_file() {
            names.push(name);
        }
    }
    Ok(())
}
