//! SHA-256 of a run folder's files: recorded in the manifest when a run ends, compared by `damprig runs verify`.

use std::fs;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::file_name::FileName;
use crate::failure::Failure;
use crate::input::regular;

/// A file as it was when the run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileRecord {
    /// Its name.
    pub name: FileName,
    /// Size, bytes.
    pub bytes: u64,
    /// SHA-256 in lower-case hexadecimal.
    pub sha256: String,
}

impl FileRecord {
    /// Compares the file in `folder` with this record; the difference in words, if there is one.
    #[must_use]
    pub fn difference(&self, folder: &Path) -> Option<String> {
        match of_file(folder, &self.name) {
            Ok(now) if now == *self => None,
            Ok(now) if now.bytes != self.bytes => {
                Some(format!("{}: {} bytes, and {} when it was recorded", self.name, now.bytes, self.bytes))
            }
            Ok(_) => Some(format!("{}: changed since it was recorded (SHA-256 differs)", self.name)),
            Err(error) => Some(format!("{}: cannot read it: {error}", self.name)),
        }
    }
}

/// The file `name` of a run folder, as it is now.
///
/// # Errors
/// When it cannot be read.
pub fn of_file(folder: &Path, name: &FileName) -> io::Result<FileRecord> {
    let mut file = regular::open(&folder.join(name))?;
    let mut hash = Sha256::new();
    let bytes = io::copy(&mut file, &mut HashWriter(&mut hash))?;
    Ok(FileRecord { name: name.clone(), bytes, sha256: hex(hash) })
}

/// SHA-256 of a file's content in lower-case hexadecimal.
///
/// # Errors
/// When it cannot be read.
pub fn of_path(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut regular::open(path)?, &mut HashWriter(&mut hash))?;
    Ok(hex(hash))
}

/// SHA-256 of bytes in lower-case hexadecimal.
#[must_use]
pub fn of_bytes(bytes: &[u8]) -> String {
    hex(Sha256::new_with_prefix(bytes))
}

fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

/// Digests what is written to it.
pub(super) struct HashWriter<'a>(pub(super) &'a mut Sha256);

impl io::Write for HashWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// All files of a run folder by name, except the manifest, which holds this list, and files that are being written. Links,
/// pipes and the like are left out, and files whose names a journal cannot hold.
///
/// # Errors
/// When one cannot be read.
pub fn of_folder(folder: &Path) -> Result<Vec<FileRecord>, Failure> {
    let mut names = Vec::new();
    list(folder, "", &mut names).map_err(|e| Failure::cannot("list", folder, e))?;
    names.sort_by(|a, b| a.as_bytes().cmp(b.as_bytes()));
    let one = |name: &FileName| of_file(folder, name).map_err(|e| Failure::cannot("read", &folder.join(name), e));
    names.iter().map(one).collect()
}

fn list(folder: &Path, prefix: &str, names: &mut Vec<FileName>) -> io::Result<()> {
    for entry in fs::read_dir(folder.join(prefix))? {
        let entry = entry?;
        let Some(name) = entry.file_name().to_str().map(|name| format!("{prefix}{name}")) else { continue };
        let kind = entry.file_type()?;
        if kind.is_dir() {
            list(folder, &format!("{name}/"), names)?;
        } else if name != "manifest.json" && !name.ends_with(".tmp") && kind.is_file() {
            names.extend(FileName::new(&name));
        }
    }
    Ok(())
}
