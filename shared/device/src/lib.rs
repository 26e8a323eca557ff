//! The device side of the link, around the core's `Rig`: control loop, controller, queues, uploads, settings, crash record.
//!
//! * [`board`] has the trait that every board implements,
//! * [`control_loop`] is the loop's body: one tick, then one request,
//! * [`controller`] owns the rig: it serves requests and queues replies, events and telemetry rows,
//! * [`queues`] are between the control loop and the link,
//! * [`message_reader`] reads requests from received bytes, [`outbox`] builds the messages to send, replies first,
//! * [`upload_buffer`] holds the record that a host uploads,
//! * [`settings_store`] keeps the settings in flash as [`settings_record`]s, [`crash`] the crash record.
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
pub mod settings_record;
pub mod settings_store;
pub mod upload_buffer;

/// Maximum number of telemetry rows in the queue.
///
/// The longest replies and events take 26 ms to send (eight frames of 300 bytes). Rows of every tick must fit the
/// queue meanwhile.
pub const ROWS_WAITING: usize = 32;

/// Maximum number of replies and events in the queue: a reply, and the events of a tick with impacts on both walls
/// and the end of an experiment.
pub const REPLIES_WAITING: usize = 8;

/// Maximum number of requests that wait for their tick.
pub const REQUESTS_WAITING: usize = 2;
