//! Opens, lists and verifies run folders. Nothing here writes, moves or deletes a file.

mod arrow_salvage;
pub mod columns;
pub mod folder;
pub mod open_part;
pub mod parquet_file;
pub mod sample_files;
pub mod untracked_files;
pub mod verify;

pub use folder::RunFolder;
