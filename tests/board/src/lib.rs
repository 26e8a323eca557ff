//! The controller's own image, unmodified, on an emulated NUCLEO-G474RE whose pins are wired to a simulated rig.
//!
//! [`board`] drives the core, [`chip`] is the STM32G474 around it, [`peripherals`] its register files, [`plant`] the rig. Time
//! is the device's own ([`time`]): it follows from the instructions executed and the events between them, so that a run
//! repeats itself exactly as long as the same bytes come at the same times.
//!
//! Whatever the program does that is not modelled (an unknown register, an access with the clock off, a broken write rule,
//! a misaligned access) ends the run with the instruction's place in the source. What the emulation says nothing about:
//! wait states and caches, analogue levels, errata, what a relay really does.

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
