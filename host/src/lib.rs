//! Host library and the `damprig` command: campaigns, link to the rig, run folders, simulation, reports.
//!
//! Decisions about the rig's motion belong to `damprig-core`, byte formats to `damprig-protocol`. docs/ARCHITECTURE.md has the
//! layers of the modules.

pub mod board;
pub mod calibrate;
pub mod campaign;
pub mod cli;
pub mod client;
pub mod compare;
pub mod continuation;
pub mod failure;
pub mod file_keys;
pub mod host_time;
pub mod identify;
pub mod input;
pub mod manual;
pub mod monitor;
pub mod motion_record;
pub mod optimise;
pub mod prediction;
pub mod quantity;
pub mod recorded_run;
pub mod report;
pub mod run_folder;
pub mod runner;
pub mod settings;
pub mod setup;
pub mod signal_file;
pub mod simulation;
pub mod spectrum;
pub mod storage;
pub mod structure;
pub mod study;
pub mod table;

/// Name and version, as files and reports carry it.
pub const VERSION_LINE: &str = concat!("damprig ", env!("CARGO_PKG_VERSION"));

/// Digest of the sources of the library and of the crates of this workspace that it is built on: equal ones compute the same results, on
/// whatever machine they were built.
pub const BUILD: &str = env!("DAMPRIG_BUILD");
