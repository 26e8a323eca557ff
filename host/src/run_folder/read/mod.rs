//! Opens, lists and verifies run folders. Nothing here writes, moves or deletes a file.

mod arrow_salvage;
pub mod campaign_copy;
pub mod cut_results;
pub mod folder;
pub mod open_part;
pub mod parquet_file;
pub mod sample_files;
pub mod unfinished_tables;
pub mod untracked_files;
pub mod verify;

pub use folder::RunFolder;
