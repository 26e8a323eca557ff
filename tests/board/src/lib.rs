//! Runs the unmodified controller image on an emulated NUCLEO-G474RE whose pins are wired to a simulated rig.
//!
//! [`board`] drives the core, [`chip`] is the STM32G474 around it, [`peripherals`] contains its register models,
//! [`plant`] is the rig. [`time`] is device time: it follows from the executed instructions and the events between
//! them. A run is exactly repeatable if the same bytes arrive at the same device times.
//!
//! Anything that is not modelled or not allowed (an unknown register, an access with the clock off, a broken write
//! rule, a misaligned access) ends the run and reports the source location of the instruction. The emulation does not
//! cover wait states and caches, analogue levels, errata, or the behaviour of a real relay.

pub mod board;
pub mod chip;
pub mod image;
pub mod link;
pub mod peripherals;
pub mod plant;
pub mod register;
pub mod time;

pub use board::{Board, Failure};
pub use chip::{Chip, Config, Output};
pub use image::Image;
pub use time::Time;
