//! Writes a file atomically: it gets its name only when complete, and replaces an existing file only if that is asked for. A
//! full disk or a kill leaves no partial file under the name.

use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

use super::ExportSummary;
use crate::run_folder::ReadError;

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

fn failed(out: &Path, why: &dyn std::fmt::Display) -> ReadError {
    ReadError(format!("cannot write {}: {why}", out.display()))
}

/// Writes an export as [`write_new`] does.
///
/// # Errors
/// As [`write_new`], and when nothing could be read.
pub(super) fn write_export(
    out: &OutFile,
    write: impl FnOnce(&mut NamedTempFile) -> Result<ExportSummary, ReadError>,
) -> Result<ExportSummary, ReadError> {
    write_new(out, |file| {
        let exported = write(file)?;
        if exported.rows == 0 && !exported.missing.is_empty() {
            return Err(ReadError(format!("nothing was exported: {}", exported.missing.join("\n"))));
        }
        Ok(exported)
    })
}

/// Lets `write` fill a temporary file in the folder of `out`, then renames it to `out`.
///
/// # Errors
/// When `out` exists or its folder cannot be written; the error of `write`.
pub fn write_new<T>(
    out: &OutFile,
    write: impl FnOnce(&mut NamedTempFile) -> Result<T, ReadError>,
) -> Result<T, ReadError> {
    let OutFile { path: out, force } = out;
    if !force && out.symlink_metadata().is_ok() {
        return Err(failed(out, &EXISTS));
    }
    let folder = match out.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    };
    if !folder.is_dir() {
        return Err(failed(out, &format!("there is no folder {}; create it or give another path", folder.display())));
    }
    let mut builder = Builder::new();
    builder.prefix(".damprig-").suffix(".tmp");
    // Temporary files are private by default.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut beside = builder.tempfile_in(&folder).map_err(|e| failed(out, &e))?;
    let written = write(&mut beside)?;
    beside.as_file().sync_data().map_err(|e| failed(out, &e))?;
    let named = if *force { beside.persist(out) } else { beside.persist_noclobber(out) };
    named.map_err(|e| failed(out, &e.error))?;
    Ok(written)
}

/// Makes errors that name `out` instead of the temporary file.
pub fn to_failure(out: &Path) -> impl Fn(&dyn std::fmt::Display) -> ReadError {
    move |why| failed(out, why)
}
