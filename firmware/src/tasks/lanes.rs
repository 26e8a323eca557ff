//! What lies between the tasks: bounded queues that control never waits at, and the counts of what found no room.

use core::sync::atomic::{AtomicU32, Ordering};

use damprig_core::rig::Signals;
use damprig_device::lanes::{Lanes, Row, Saying};
use damprig_device::orders::{self, Work};
use damprig_device::{REPLIES_WAITING, REQUESTS_WAITING, ROWS_WAITING};
use damprig_protocol::ask::PassedOver;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::zerocopy_channel;
use static_cell::StaticCell;

/// A request made ready. A real structure is no plant to set.
pub type Order = orders::Order<PassedOver>;

/// The ends of the queue of orders on their way from the line to control. Orders are large: they are made and served where
/// they lie.
pub type OrdersIn = zerocopy_channel::Sender<'static, CriticalSectionRawMutex, Order>;

/// Control's end.
pub type OrdersOut = zerocopy_channel::Receiver<'static, CriticalSectionRawMutex, Order>;

/// Makes the queue of orders. To be called once.
pub fn orders() -> (OrdersIn, OrdersOut) {
    // Filled here: as a constant it would lie in flash as a whole.
    static PLACES: StaticCell<[Order; REQUESTS_WAITING]> = StaticCell::new();
    let places =
        PLACES.init_with(|| [const { Order { seq: 0, at_tick: None, work: Work::Identify } }; REQUESTS_WAITING]);
    static QUEUE: StaticCell<zerocopy_channel::Channel<'static, CriticalSectionRawMutex, Order>> = StaticCell::new();
    QUEUE.init(zerocopy_channel::Channel::new(places)).split()
}

/// Replies and events on their way to the line.
pub static URGENT: Channel<CriticalSectionRawMutex, Saying, REPLIES_WAITING> = Channel::new();

/// Telemetry rows on their way to the line.
pub static ROWS: Channel<CriticalSectionRawMutex, Row, ROWS_WAITING> = Channel::new();

/// Frames that were none; written by the receiver alone.
pub static BAD_FRAMES: AtomicU32 = AtomicU32::new(0);

/// Requests that found no room; written by the receiver alone.
pub static REQUESTS_DROPPED: AtomicU32 = AtomicU32::new(0);

/// Reads a counter that another task writes.
pub fn counted(counter: &AtomicU32) -> u32 {
    counter.load(Ordering::Relaxed)
}

/// Control's way out.
pub struct Outgoing;

impl Lanes for Outgoing {
    fn urgent(&mut self, saying: Saying) -> Result<usize, ()> {
        URGENT.try_send(saying).map_err(|_| ())?;
        Ok(URGENT.len())
    }

    fn row(&mut self, row: Row<&Signals>) -> Result<usize, ()> {
        ROWS.try_send(row.copied()).map_err(|_| ())?;
        Ok(ROWS.len())
    }
}
