//! The transmit task: encodes what waits and sends it, replies and events first. The line paces it.

use damprig_device::outbox::Outbox;
use damprig_protocol::frame::{self, LONGEST};

use crate::boards::Transmitter;
use crate::tasks::queues::Queues;

/// Owns the line's sending side.
pub async fn run(mut line: impl Transmitter) -> ! {
    let mut outbox = Outbox::default();
    let mut frame = [0; LONGEST];
    loop {
        line.ready().await;
        match outbox.next(&mut Queues) {
            Some(message) => {
                // Every message fits a frame: a test encodes the longest.
                let length = frame::encode(&message, &mut frame).unwrap_or(0);
                line.send(&frame[..length]).await;
            }
            None => Queues.filled().await,
        }
    }
}
