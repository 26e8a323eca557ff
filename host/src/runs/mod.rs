//! Run folders as they are read back: found, listed, verified. Nothing here writes, moves or deletes a file.
//!
//! Who writes them is [`crate::recording`]; other formats are [`crate::report::exports`]'s. The files and their
//! columns are described in `host/RUN_FOLDER.md`.

pub mod columns;
pub mod folder;
pub mod manifest;
pub mod verify;

pub use folder::{ReadError, RunFolder};
