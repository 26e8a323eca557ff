//! Flashes the controller board: reads and checks the firmware image, selects the debug probe, writes through it.
//!
//! Only with the feature `probe`. Communication with a running rig is in [`crate::client::session`].

pub mod image;
pub mod probe;

/// The controller's chip, as probe-rs names it.
pub const CHIP: &str = "STM32G474RETx";

/// The controller board, as its firmware names it.
pub const BOARD: &str = "nucleo-g474re";
