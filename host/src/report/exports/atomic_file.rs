//! A new file that appears under its name only when it is whole: a full disk or a kill leaves no half of it that could be
//! taken for the whole, and an earlier file is never replaced.

use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

use super::Exported;
use crate::run_folder::ReadError;

fn failed(out: &Path, why: &dyn std::fmt::Display) -> ReadError {
    ReadError(format!("cannot write {}: {why}", out.display()))
}

/// Lets an exporter fill a file beside `out`, then gives it its name.
///
/// # Errors
/// As [`write_new`]; when nothing could be read.
pub(super) fn write_whole(
    out: &Path,
    write: impl FnOnce(&mut NamedTempFile) -> Result<Exported, ReadError>,
) -> Result<Exported, ReadError> {
    write_new(out, |file| {
        let exported = write(file)?;
        if exported.rows == 0 && !exported.missing.is_empty() {
            return Err(ReadError(format!("nothing was exported: {}", exported.missing.join("\n"))));
        }
        Ok(exported)
    })
}

/// Lets `write` fill a file beside `out`, then gives it its name.
///
/// # Errors
/// When `out` exists or its folder cannot be written; what `write` gives.
pub(crate) fn write_new<T>(
    out: &Path,
    write: impl FnOnce(&mut NamedTempFile) -> Result<T, ReadError>,
) -> Result<T, ReadError> {
    if out.symlink_metadata().is_ok() {
        return Err(failed(out, &"it exists; move it away or give another name"));
    }
    let folder = match out.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    };
    if !folder.is_dir() {
        return Err(failed(out, &format!("there is no folder {}; make it or give another place", folder.display())));
    }
    let mut builder = Builder::new();
    builder.prefix(".damprig-").suffix(".tmp");
    // As any new file; temporary ones are private otherwise.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut beside = builder.tempfile_in(&folder).map_err(|e| failed(out, &e))?;
    let written = write(&mut beside)?;
    beside.as_file().sync_data().map_err(|e| failed(out, &e))?;
    beside.persist_noclobber(out).map_err(|e| failed(out, &e.error))?;
    Ok(written)
}

/// The failure of a write to `out`, in the user's words: the temporary name is none of theirs.
pub(crate) fn to_failure(out: &Path) -> impl Fn(&dyn std::fmt::Display) -> ReadError {
    move |why| failed(out, why)
}
