//! The files of a run folder are plain files: a pipe or a device in the place of one would be waited for, or read, for
//! ever.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Opens a file to read it.
///
/// # Errors
/// When it cannot be opened, or is none.
pub fn open(path: &Path) -> io::Result<File> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("this is no plain file"));
    }
    File::open(path)
}

/// Reads a file whole.
///
/// # Errors
/// As [`open`]; when it cannot be read.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}
