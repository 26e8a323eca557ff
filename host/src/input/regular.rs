//! Opens regular files only: reading a pipe or a device could block or never end. A path of a shipped example is read from
//! [`super::shipped`].

use std::fs::{self, File, FileType};
use std::io::{self, Read};
use std::path::Path;

use super::shipped;

/// Size limit of an input file, bytes: a record of millions of samples, or an image with debug information, is smaller.
pub const MAX_BYTES: u64 = 256 << 20;

/// Opens a file to read it.
///
/// # Errors
/// When it cannot be opened, or is not a regular file.
pub fn open(path: &Path) -> io::Result<File> {
    let kind = fs::metadata(path)?.file_type();
    if !kind.is_file() {
        return Err(io::Error::other(format!("this is {}, not a regular file", name(kind))));
    }
    File::open(path)
}

/// Reads a file whole.
///
/// # Errors
/// As [`open`]; when it cannot be read.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    if let Some(text) = shipped::text(path) {
        return Ok(text.into());
    }
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads an input file.
///
/// # Errors
/// As [`read`]; when it holds more than [`MAX_BYTES`].
pub fn read_input(path: &Path) -> io::Result<Vec<u8>> {
    if let Some(text) = shipped::text(path) {
        return Ok(text.into());
    }
    let mut bytes = Vec::new();
    // Also limits a file that grows meanwhile.
    open(path)?.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_BYTES {
        let message = format!("it holds more than the {} MiB that are read; is it the right file?", MAX_BYTES >> 20);
        return Err(io::Error::other(message));
    }
    Ok(bytes)
}

fn name(kind: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    if kind.is_dir() { "a folder" } else { "something else" }
}
