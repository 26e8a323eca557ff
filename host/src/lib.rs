//! The host side of the rig: campaigns, links, recording, figures, and the `damprig` command's parts.
//!
//! What decides how the rig moves lives in `damprig-core`, the byte formats in `damprig-protocol`.

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

/// Name and version, as files and reports carry it.
pub const VERSION_LINE: &str = concat!("damprig ", env!("CARGO_PKG_VERSION"));
