//! The run folder: what was run, what came of it, and whether it is whole.
//!
//! ```text
//! runs/20261121-041624-hybrid-k3x9/
//!   campaign.toml     the campaign as run
//!   manifest.json     versions, device, units, counters, complete or why not
//!   results.parquet   one row per set-up and frequency; rewritten whole after each point
//!   samples.parquet   telemetry; while the run lasts: one file per point in samples.parts/
//!   figure.svg|png
//! ```
//! A run that ends badly, or is killed, leaves all of it up to the last point, readable. The tables are in
//! [`parquet`], the rows in [`row`], the manifest in [`manifest`].

pub mod checksum;
pub mod folder;
pub mod manifest;
pub mod parquet;
pub mod row;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use folder::RunFolder;
pub use parquet::Point;
pub use row::ResultRow;

/// A recorded quantity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Signal {
    /// Name of its column.
    pub name: String,
    /// Its unit.
    pub unit: String,
}

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
