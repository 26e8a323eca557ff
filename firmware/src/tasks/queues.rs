//! Bounded queues between the tasks, and counters of dropped items. Control never waits for space.

use core::sync::atomic::{AtomicU32, Ordering};

use damprig_device::queues::{Losses, Outgoing, Requests, StreamItem, Waiting};
use damprig_device::{REPLIES_WAITING, REQUESTS_WAITING, ROWS_WAITING};
use damprig_protocol::{FromDevice, NumberedRequest, Request};
use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::zerocopy_channel;
use static_cell::StaticCell;

/// Receive task's end of the request queue. Requests are large, so they are written and served in place.
pub type RequestsIn = zerocopy_channel::Sender<'static, CriticalSectionRawMutex, NumberedRequest>;

/// Control's end of the request queue.
pub struct RequestsOut(zerocopy_channel::Receiver<'static, CriticalSectionRawMutex, NumberedRequest>);

/// Makes the request queue. Call once.
pub fn requests() -> (RequestsIn, RequestsOut) {
    // Initialised at run time: a constant would occupy its full size in flash.
    static PLACES: StaticCell<[NumberedRequest; REQUESTS_WAITING]> = StaticCell::new();
    let places = PLACES.init_with(|| {
        [const { NumberedRequest { seq: 0, at_tick: None, request: Request::Identify } }; REQUESTS_WAITING]
    });
    static QUEUE: StaticCell<zerocopy_channel::Channel<'static, CriticalSectionRawMutex, NumberedRequest>> =
        StaticCell::new();
    let (sender, receiver) = QUEUE.init(zerocopy_channel::Channel::new(places)).split();
    (sender, RequestsOut(receiver))
}

impl Requests for RequestsOut {
    fn front(&mut self) -> Option<&NumberedRequest> {
        self.0.try_receive().map(|request| &*request)
    }

    fn drop_front(&mut self) {
        self.0.receive_done();
    }

    fn losses(&self) -> Losses {
        Losses { bad_frames: counted(&BAD_FRAMES), requests_dropped: counted(&REQUESTS_DROPPED) }
    }
}

/// Frames that were too long, did not decode or failed their checksum. Only the receive task writes it.
pub static BAD_FRAMES: AtomicU32 = AtomicU32::new(0);

/// Requests dropped because the queue was full. Only the receive task writes it.
pub static REQUESTS_DROPPED: AtomicU32 = AtomicU32::new(0);

/// Reads a counter that another task writes.
pub fn counted(counter: &AtomicU32) -> u32 {
    counter.load(Ordering::Relaxed)
}

/// Replies and events to be sent.
static MESSAGES: Channel<CriticalSectionRawMutex, FromDevice, REPLIES_WAITING> = Channel::new();

/// Telemetry to be sent.
static STREAM: Channel<CriticalSectionRawMutex, StreamItem, ROWS_WAITING> = Channel::new();

/// Both ends of the outgoing queues.
pub struct Queues;

impl Outgoing for Queues {
    fn message(&mut self, message: FromDevice) -> Result<usize, ()> {
        MESSAGES.try_send(message).map_err(|_| ())?;
        Ok(MESSAGES.len())
    }

    fn stream(&mut self, item: StreamItem) -> Result<usize, ()> {
        STREAM.try_send(item).map_err(|_| ())?;
        Ok(STREAM.len())
    }

    fn clear_stream(&mut self) {
        STREAM.clear();
    }
}

impl Waiting for Queues {
    fn pop_message(&mut self) -> Option<FromDevice> {
        MESSAGES.try_receive().ok()
    }

    fn pop_stream(&mut self) -> Option<StreamItem> {
        STREAM.try_receive().ok()
    }
}

impl Queues {
    /// Waits until a message is queued.
    pub async fn filled(&self) {
        select(MESSAGES.ready_to_receive(), STREAM.ready_to_receive()).await;
    }

    /// Queues an item once there is space.
    #[cfg(feature = "board-mps2-an386")]
    pub async fn stream_when_free(&self, item: StreamItem) {
        STREAM.send(item).await;
    }
}
