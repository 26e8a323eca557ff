//! The queues between the control loop and the link: requests in; replies, events and telemetry rows out.
//!
//! The control loop never waits for room: a full queue rejects, and the controller counts what was lost.

use damprig_core::rig::{MOTION_SIGNALS, SIGNALS, Signals};
use damprig_protocol::{FromDevice, MAX_SIGNALS, NumberedRequest};
use heapless::{Deque, Vec};

use crate::{REPLIES_WAITING, ROWS_WAITING};

/// Messages that the receiving side has lost since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Frames that were too long, did not decode or failed their checksum.
    pub bad_frames: u32,
    /// Requests dropped because their queue was full.
    pub requests_dropped: u32,
}

/// The queue of received requests. They are large and are served in place.
pub trait Requests {
    /// The oldest request.
    fn front(&mut self) -> Option<&NumberedRequest>;

    /// Removes the oldest request.
    fn drop_front(&mut self);

    /// Messages lost by the receiving side.
    fn losses(&self) -> Losses;
}

/// The control loop's end of the outgoing queues.
pub trait Outgoing {
    /// Queues a reply or an event; returns the length of the queue.
    ///
    /// # Errors
    /// The queue is full.
    #[allow(clippy::result_unit_err)] // The only failure is "full", and the caller counts it.
    fn message(&mut self, message: FromDevice) -> Result<usize, ()>;

    /// Queues a row of telemetry or a mark between rows; returns the length of the queue.
    ///
    /// # Errors
    /// The queue is full.
    #[allow(clippy::result_unit_err)]
    fn stream(&mut self, item: StreamItem) -> Result<usize, ()>;

    /// Drops the queued rows; called when an experiment has started.
    fn clear_stream(&mut self) {}
}

/// The link's end of the outgoing queues.
pub trait Waiting {
    /// Removes and returns the oldest reply or event.
    fn pop_message(&mut self) -> Option<FromDevice>;

    /// Removes and returns the oldest row or mark.
    fn pop_stream(&mut self) -> Option<StreamItem>;
}

/// An item of the telemetry queue.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub enum StreamItem {
    /// A row of telemetry.
    Row(Row),
    /// An experiment has started: ticks count from 0, and earlier rows belong to another experiment.
    Started,
    /// A granted clock has stopped before this tick. Everything before it has been queued.
    ClockStands {
        /// The first tick that has not run.
        tick: u32,
    },
}

/// One row of telemetry.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Tick of the row.
    pub tick: u32,
    /// Ticks between rows.
    pub every_ticks: u16,
    /// The signals to send.
    pub chosen: Chosen,
    /// All signals.
    pub values: Signals,
    /// No row follows soon: send it without waiting for a full batch.
    pub last: bool,
}

/// The selected signals, as indices in the signal table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chosen {
    places: [u8; MAX_SIGNALS],
    width: u8,
}

impl Default for Chosen {
    /// The motion signals.
    fn default() -> Self {
        Self { width: MOTION_SIGNALS as u8, places: core::array::from_fn(|n| n as u8) }
    }
}

impl Chosen {
    /// Selects these signals, in the row's order.
    #[must_use]
    pub fn new(signals: &Vec<u8, MAX_SIGNALS>) -> Self {
        let place = |n| signals.get(n).copied().unwrap_or_default();
        Self { width: signals.len() as u8, places: core::array::from_fn(place) }
    }

    /// Indices of the selected signals.
    #[must_use]
    pub fn places(&self) -> &[u8] {
        &self.places[..usize::from(self.width).min(MAX_SIGNALS)]
    }
}

/// Both outgoing queues, for a board whose control loop and link run in one thread.
#[derive(Debug, Default)]
pub struct LocalQueues {
    messages: Deque<FromDevice, REPLIES_WAITING>,
    stream: Deque<StreamItem, ROWS_WAITING>,
}

impl Outgoing for LocalQueues {
    fn message(&mut self, message: FromDevice) -> Result<usize, ()> {
        self.messages.push_back(message).map_err(|_| ())?;
        Ok(self.messages.len())
    }

    fn stream(&mut self, item: StreamItem) -> Result<usize, ()> {
        self.stream.push_back(item).map_err(|_| ())?;
        Ok(self.stream.len())
    }

    fn clear_stream(&mut self) {
        self.stream.clear();
    }
}

impl Waiting for LocalQueues {
    fn pop_message(&mut self) -> Option<FromDevice> {
        self.messages.pop_front()
    }

    fn pop_stream(&mut self) -> Option<StreamItem> {
        self.stream.pop_front()
    }
}

const _: () = assert!(SIGNALS.len() <= u8::MAX as usize);
