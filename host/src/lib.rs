//! The host side of the rig: campaigns, links, recording, figures, and the `damprig` command's parts.
//!
//! What decides how the rig moves lives in `damprig-core`, the byte formats in `damprig-protocol`.

pub mod campaign;
pub mod input;

/// The controller's tick rate, Hz.
pub const TICK_RATE_HZ: f64 = 1000.0;
