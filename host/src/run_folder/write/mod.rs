//! Records into a run folder.
//!
//! The [`recorder`] separates the link from the disk; its thread runs the [`writer`], which writes the journal, the open
//! part of the samples ([`sample_part`]) and the tables. A run that ends early or is killed leaves all but the last quarter
//! of a second readable.

pub mod output_folder;
pub mod parquet_file;
pub mod recorder;
pub mod sample_join;
pub mod sample_part;
pub mod writer;

pub use output_folder::OutputFolder;
pub use recorder::Recorder;
pub use writer::RunWriter;
