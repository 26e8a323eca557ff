//! The receive task: reads requests from the line and queues them for control.

use core::sync::atomic::Ordering;

use damprig_device::message_reader::MessageReader;
use damprig_protocol::ToDevice;

use crate::boards::Receiver;
use crate::tasks::let_others_run;
use crate::tasks::log::HEARD;
use crate::tasks::queues::{BAD_FRAMES, REQUESTS_DROPPED, RequestsIn, counted};

/// Runs the receive task. Owns the receiving side of the line.
pub async fn run(mut receiver: impl Receiver, mut requests: RequestsIn) -> ! {
    let mut reader = MessageReader::default();
    let mut bytes = [0; 64];
    loop {
        // A framing or overrun error loses bytes; the frame's checksum detects this.
        let Ok(length) = receiver.read(&mut bytes).await else { continue };
        for &byte in &bytes[..length] {
            let message = reader.push(byte);
            BAD_FRAMES.store(reader.bad_frames(), Ordering::Relaxed);
            if message.is_some() {
                HEARD.store(true, Ordering::Relaxed);
            }
            match message {
                None => {}
                Some(ToDevice::Grant { until_tick }) => receiver.granted(until_tick),
                Some(ToDevice::Request(request)) => {
                    if let Some(place) = requests.try_send() {
                        *place = request;
                        requests.send_done();
                    } else {
                        REQUESTS_DROPPED.store(counted(&REQUESTS_DROPPED).saturating_add(1), Ordering::Relaxed);
                    }
                    receiver.request_queued();
                    // A stopped clock serves the request before the following bytes are read.
                    let_others_run().await;
                }
            }
        }
    }
}
