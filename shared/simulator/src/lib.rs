//! The simulator: a simulated rig and a board around it, for the virtual rig and the emulated boards.
//!
//! * [`plant`] is the simulated rig: structure, dampers, shaker, sensors, friction-spring drive, and faults injected
//!   into them,
//! * [`messages`] are the host's messages to the simulator,
//! * [`board`] is the board that the control loop drives: its ticks pass under the host's tick credit,
//! * [`line_pace`] limits a simulated board to the rate of a serial line,
//! * [`device`] is the whole device in this process: control loop, queues and link.
//!
//! The control loop and all decisions are in `damprig-device` and `damprig-core`. A real board's image contains
//! nothing of this crate.

#![no_std]
#![forbid(unsafe_code)]

pub mod board;
pub mod device;
pub mod line_pace;
pub mod messages;
pub mod plant;
