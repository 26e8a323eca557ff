//! Flashes the controller board: reads and checks the firmware image and writes it, through the drive that the board's ST-LINK shows or
//! (with the feature `probe`) through its debug probe.
//!
//! Communication with a running rig is in [`crate::client::session`].

pub mod drive;
pub mod hex;
pub mod image;
#[cfg(feature = "probe")]
pub mod probe;

/// The controller's chip, as probe-rs names it.
pub const CHIP: &str = "STM32G474RETx";

/// The controller board, as its firmware names it.
pub const BOARD: &str = "nucleo-g474re";
