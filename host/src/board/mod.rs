//! The controller board at a debug probe: its image's file, the probe, and writing the one through the other.
//!
//! Nothing here talks to a running rig; that is [`crate::client::session`]'s. Only with the feature `probe`.

pub mod image;
pub mod probe;

/// The controller's chip, as the probe's library calls it.
pub const CHIP: &str = "STM32G474RETx";

/// The controller board, as its firmware calls it.
pub const BOARD: &str = "nucleo-g474re";
