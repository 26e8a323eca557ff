//! A file that a person asked for: it replaces an existing one only if that is asked for too.

use std::path::{Path, PathBuf};

use super::whole_file::WholeFile;
use crate::failure::Failure;

/// A file to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutFile {
    /// Its path.
    pub path: PathBuf,
    /// An existing file is replaced (`--force`).
    pub force: bool,
}

/// What to do about a file that exists.
pub const EXISTS: &str = "it exists; move it away, give another name, or replace it with --force";

fn failed(out: &Path, why: &dyn std::fmt::Display) -> Failure {
    Failure::Storage(format!("cannot write {}: {why}", out.display()))
}

/// Lets `write` fill a file, which then gets its name.
///
/// # Errors
/// When `out` exists or its folder cannot be written; the error of `write`.
pub fn write_new<T>(out: &OutFile, write: impl FnOnce(&mut WholeFile) -> Result<T, Failure>) -> Result<T, Failure> {
    let OutFile { path: out, force } = out;
    if !force && out.symlink_metadata().is_ok() {
        return Err(failed(out, &EXISTS));
    }
    let mut file = WholeFile::create(out).map_err(|e| failed(out, &e))?;
    let written = write(&mut file)?;
    let is_named = if *force { file.replace().map(|()| true) } else { file.name_new() };
    if is_named.map_err(|e| failed(out, &e))? { Ok(written) } else { Err(failed(out, &EXISTS)) }
}

/// Makes errors that name `out` instead of the temporary file.
pub fn to_failure(out: &Path) -> impl Fn(&dyn std::fmt::Display) -> Failure {
    move |why| failed(out, why)
}
