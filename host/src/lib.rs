//! Host library and the `damprig` command: campaigns, link to the rig, recording, simulation, reports.
//!
//! Decisions about the rig's motion belong to `damprig-core`, byte formats to `damprig-protocol`. docs/ARCHITECTURE.md has the
//! layers of the modules.

#[cfg(feature = "probe")]
pub mod board;
pub mod campaign;
pub mod cli;
pub mod devices;
pub mod input;
pub mod link;
pub mod prediction;
pub mod recording;
pub mod report;
pub mod run;
pub mod runs;
pub mod session;
pub mod settings;
pub mod setup;
pub mod simulation;
mod upload;

/// Name and version in files and reports.
pub const VERSION_LINE: &str = concat!("damprig ", env!("CARGO_PKG_VERSION"));
