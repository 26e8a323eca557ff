//! A run folder's own files: the names that damprig uses, and writing them. Links among them are refused: reading or writing
//! through one would leave the folder. A link to the whole folder is allowed.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::failure::Failure;

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
pub fn refuse_links(folder: &Path) -> Result<(), Failure> {
    let links = |folder: &Path, is_own: &dyn Fn(&OsStr) -> bool| {
        // What cannot be listed is reported by the reader that needs it.
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let mut links = entries.filter(|e| is_own(&e.file_name()) && e.file_type().is_ok_and(|kind| kind.is_symlink()));
        links.next().map_or(Ok(()), |link| Err(Failure::cannot("use", &link.path(), HELP)))
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

/// Syncs the names of a folder to the disk: files that were created, renamed or removed in it are so after a power cut.
///
/// # Errors
/// When the disk fails.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    // Other systems open no folders.
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

/// Gives a file that is whole and synced its own name, for good.
///
/// # Errors
/// When it cannot be renamed, or the disk fails.
pub fn name_for_good(beside: &Path, path: &Path) -> io::Result<()> {
    fs::rename(beside, path)?;
    sync_folder(path.parent().unwrap_or(Path::new("")))
}

/// Writes a file beside its name, syncs it to the disk and renames it: the file is there whole or not at all, after a power cut too; an
/// earlier one is replaced.
///
/// # Errors
/// When it cannot be written; the earlier file stays.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let beside = beside(path);
    let write = |mut file: File| file.write_all(bytes).and_then(|()| file.sync_data());
    let written = create(&beside).and_then(write).and_then(|()| name_for_good(&beside, path));
    written.map_err(|e| {
        remove_left(&beside);
        Failure::cannot("write", path, e)
    })
}

/// Removes a file, if it is there.
///
/// # Errors
/// When it cannot be removed.
pub fn remove(path: &Path) -> Result<(), Failure> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(Failure::cannot("remove", path, error)),
        _ => Ok(()),
    }
}

/// Removes the rest of a file that could not be written; a link stays.
pub fn remove_left(path: &Path) {
    if fs::symlink_metadata(path).is_ok_and(|left| left.is_file()) {
        let _ = fs::remove_file(path);
    }
}
