//! The device side of the link: what a board does between its pins and its serial line, around the core's `Rig`.
//!
//! * [`board`] is what the control loop needs of a board,
//! * [`control_loop`] is the loop's body: one tick, then one request,
//! * [`controller`] owns the rig: it serves requests and queues replies, events and telemetry rows,
//! * [`queues`] lie between the control loop and the link,
//! * [`message_reader`] reads requests from received bytes, [`outbox`] makes messages of what waits, replies first,
//! * [`upload_buffer`] holds the record that a host uploads,
//! * [`settings_store`] keeps the settings in flash, [`crash`] the record of what ended the firmware.
//!
//! Decisions about the experiment belong to `damprig-core`, byte formats to `damprig-protocol`, pins to the firmware, simulated
//! plants to `damprig-simulator`.

#![no_std]
#![forbid(unsafe_code)]

pub mod board;
pub mod control_loop;
pub mod controller;
pub mod crash;
pub mod message_reader;
pub mod outbox;
pub mod queues;
pub mod settings_store;
pub mod upload_buffer;

/// Most telemetry rows that wait for the line.
///
/// While the longest replies and events go out (eight frames of 300 bytes, 26 ms), rows of every tick wait.
pub const ROWS_WAITING: usize = 32;

/// Most replies and events that wait for the line: a reply, and the events of a tick with impacts on both walls and the end of
/// an experiment.
pub const REPLIES_WAITING: usize = 8;

/// Most requests that wait for their tick.
pub const REQUESTS_WAITING: usize = 2;
