//! What a board does between its pins and its line: the device side of the protocol around the core's `Rig`.
//!
//! Each part is owned by one task on a real board and called in turn on a simulated one:
//!
//! * [`intake`] turns received bytes into requests and counts what is none,
//! * [`orders`] checks what a request carries and makes what it asks for, where there is time for it,
//! * [`control`] owns the rig: one order at most per tick, one tick, replies, events and telemetry rows out,
//! * [`store`] keeps the record that a host uploads, and lends it to the tick,
//! * [`outbox`] turns those into frames, replies first, at the pace of the line,
//! * [`settings`] keeps the rig's settings in flash,
//! * [`crash`] is what is left of a run of the firmware that ended,
//! * [`simulated`] is a whole board without pins: the three parts around a simulated plant, under the host's tick
//!   credit. The virtual rig and the emulated board are both exactly this.
//!
//! Decisions about the experiment live in `damprig-core`, byte formats in `damprig-protocol`, pins in the firmware.

#![no_std]
#![forbid(unsafe_code)]

pub mod control;
pub mod crash;
pub mod intake;
pub mod lanes;
pub mod orders;
pub mod outbox;
pub mod settings;
pub mod simulated;
pub mod store;

/// Telemetry rows waiting for the line, at most.
///
/// While the longest replies and events go out (eight frames of 300 bytes, 26 ms), rows of every tick wait.
pub const ROWS_WAITING: usize = 32;

/// Replies and events waiting for the line, at most: a reply, and what a tick with impacts on both walls and the end of an
/// experiment tells.
pub const REPLIES_WAITING: usize = 8;

/// Requests waiting for their tick, at most.
pub const REQUESTS_WAITING: usize = 2;
