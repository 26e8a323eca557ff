//! A run folder's own files: the names that damprig uses, and writing them. Links among them are refused: reading or writing
//! through one would leave the folder. A link to the whole folder is allowed.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::error::StorageError;

/// First part, up to the first `.` or `-`, of the names that damprig uses at the top of a run folder.
const OWN: [&str; 11] = [
    "campaign",
    "figure",
    "impacts",
    "journal",
    "manifest",
    "motions",
    "records",
    "report",
    "results",
    "samples",
    "transients",
];

/// Folders that hold only files of the run.
const OWN_FOLDERS: [&str; 2] = ["samples.parts", "records"];

const HELP: &str =
    "this is a link, and a run folder holds its own files; replace it by the file or folder that it leads to";

/// Refuses links under the names that damprig uses. Other names are never opened.
///
/// # Errors
/// Names the first link.
pub fn refuse_links(folder: &Path) -> Result<(), StorageError> {
    let links = |folder: &Path, is_own: &dyn Fn(&OsStr) -> bool| {
        // What cannot be listed is reported by the reader that needs it.
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let mut links = entries.filter(|e| is_own(&e.file_name()) && e.file_type().is_ok_and(|kind| kind.is_symlink()));
        links.next().map_or(Ok(()), |link| Err(StorageError::new("use", &link.path(), HELP)))
    };
    let stem = |name: &OsStr| name.to_string_lossy().split(['.', '-']).next().map(str::to_string);
    links(folder, &|name| stem(name).is_some_and(|stem| OWN.contains(&stem.as_str())))?;
    OWN_FOLDERS.iter().try_for_each(|inside| links(&folder.join(inside), &|_| true))
}

/// Creates a file in place of an earlier one of a program that was killed. An earlier link is refused, and an earlier file with
/// a second name (a hard link) keeps its content.
///
/// # Errors
/// A link, or a file that cannot be removed or created.
pub fn create(path: &Path) -> io::Result<File> {
    match fs::symlink_metadata(path) {
        Ok(earlier) if earlier.is_symlink() => return Err(io::Error::other(HELP)),
        Ok(_) => fs::remove_file(path)?,
        Err(_) => {}
    }
    OpenOptions::new().write(true).create_new(true).open(path)
}

/// The name under which a file is written before it is whole.
#[must_use]
pub fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_os_string();
    name.push(".tmp");
    name.into()
}

/// Writes a file beside its name and renames it: the file is there whole or not at all; an earlier one is replaced.
///
/// # Errors
/// When it cannot be written; the earlier file stays.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), StorageError> {
    let beside = beside(path);
    let written = create(&beside).and_then(|mut file| file.write_all(bytes)).and_then(|()| fs::rename(&beside, path));
    written.map_err(|e| {
        remove_left(&beside);
        StorageError::new("write", path, e)
    })
}

/// Removes the rest of a file that could not be written; a link stays.
pub fn remove_left(path: &Path) {
    if fs::symlink_metadata(path).is_ok_and(|left| left.is_file()) {
        let _ = fs::remove_file(path);
    }
}
