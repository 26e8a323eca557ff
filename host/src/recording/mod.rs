//! The run folder: what was run, what came of it, and whether it is whole. `host/RUN_FOLDER.md` describes its files.
//!
//! ```text
//! runs/20261121-041624-hybrid-k3x9/
//!   campaign.toml     the campaign as run
//!   manifest.json     versions, device, units, counters, complete or why not
//!   journal.jsonl     what happened, a line each: what a run is taken up again from
//!   results.parquet   one row per set-up and frequency; made of the journal
//!   transients.parquet  one row per record, pulse and free vibration; made of the journal
//!   samples.parquet   telemetry; until the run is complete: a file per point in samples.parts/, the last
//!                     one as samples-NNNNNN.open.arrows
//!   figure.svg|png
//!   report.html       all of it on a page for people; made by [`crate::report::page`]
//! ```
//! A run that ends badly, or is killed, leaves all of it up to the last quarter of a second, readable. The
//! [`recorder`] keeps the disk away from the link, the [`writer`] is its thread's work: the [`journal`], the open
//! [`part`], the [`samples`]. What a journal adds up to is [`taken`]'s, what it
//! does not know [`known`]'s, whole tables are [`parquet`]'s.

pub mod acting;
pub mod checksum;
pub mod clock;
pub mod controller;
pub mod folder;
pub mod impacts;
pub mod journal;
pub mod known;
pub mod manifest;
mod number;
pub mod parquet;
pub mod part;
pub mod recorder;
pub mod row;
pub mod samples;
mod sound;
pub mod taken;
pub mod transients;
pub mod writer;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

pub use folder::RunFolder;
pub use row::ResultRow;

/// The recorder of a run folder.
pub type Recorder = recorder::Recorder<writer::Writer>;

/// A recorded quantity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
