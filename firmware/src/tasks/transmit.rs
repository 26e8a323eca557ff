//! The transmit task: encodes and sends queued messages, replies and events first, at the rate of the line.

use damprig_device::outbox::Outbox;
use damprig_protocol::frame::{self, LONGEST};

use crate::boards::Transmitter;
use crate::tasks::queues::Queues;

/// Runs the transmit task. Owns the sending side of the line.
pub async fn run(mut line: impl Transmitter) -> ! {
    let mut outbox = Outbox::default();
    let mut frame = [0; LONGEST];
    loop {
        line.ready().await;
        match outbox.next(&mut Queues) {
            Some(message) => {
                // Cannot fail: a test encodes the longest message.
                let length = frame::encode(&message, &mut frame).unwrap_or(0);
                line.send(&frame[..length]).await;
            }
            None => Queues.filled().await,
        }
    }
}
