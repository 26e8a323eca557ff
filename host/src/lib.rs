//! The host side of the rig: campaigns, links, run folders, simulation, figures, and the `damprig` command.
//!
//! Every decision about how the rig moves is in `damprig-core`, the byte formats are in `damprig-protocol`.

#[cfg(feature = "probe")]
pub mod board;
pub mod campaign;
pub mod cli;
pub mod client;
pub mod input;
pub mod motion_record;
pub mod prediction;
pub mod report;
pub mod run_folder;
pub mod runner;
pub mod settings;
pub mod setup;
pub mod simulation;

/// Name and version, as files and reports carry it.
pub const VERSION_LINE: &str = concat!("damprig ", env!("CARGO_PKG_VERSION"));
