//! The run folder: what a run records, how it is written, and how it is read back. `docs/RUN_FOLDER.md` describes its files.
//!
//! [`schema`] has the records and columns, [`journal`] the append-only log, [`read`] opens, lists and verifies run folders,
//! [`mod@write`] records into one. Nothing in [`read`] writes, moves or deletes a file.

pub mod checksum;
pub mod file_name;
pub mod journal;
pub mod own_files;
pub mod read;
pub mod schema;
pub mod sealed_parquet;
pub mod write;

pub use read::RunFolder;
pub use schema::results::ResultRow;
