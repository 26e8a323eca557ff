//! Errors when a run folder is written or read.

use std::path::{Path, PathBuf};

/// A file or folder that cannot be written.
#[derive(Clone, Debug, thiserror::Error)]
#[error("cannot {action} {}: {message}", path.display())]
pub struct StorageError {
    action: &'static str,
    path: PathBuf,
    message: String,
}

impl StorageError {
    /// `action` is a verb: "write", "create".
    pub fn new(action: &'static str, path: &Path, message: impl std::fmt::Display) -> Self {
        Self { action, path: path.to_path_buf(), message: message.to_string() }
    }
}

/// A run, or a file of it, that cannot be read. The text names the file and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ReadError(pub String);
