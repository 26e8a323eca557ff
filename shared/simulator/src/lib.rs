//! The simulator: a simulated rig and a board around it, for the virtual rig and the emulated boards.
//!
//! * [`plant`] is the simulated rig: structure, dampers, shaker, sensors, friction-damper drive, and faults injected into them,
//! * [`messages`] are what a host may ask of the simulator,
//! * [`board`] is the board that the control loop drives: its ticks pass under the host's tick credit,
//! * [`line_pace`] lets a simulated board send no faster than a real line,
//! * [`device`] is the whole device in this process: control loop, queues and link.
//!
//! The control loop and everything that it decides are `damprig-device`'s and `damprig-core`'s. A real board's image contains nothing
//! of this crate.

#![no_std]
#![forbid(unsafe_code)]

pub mod board;
pub mod device;
pub mod line_pace;
pub mod messages;
pub mod plant;
