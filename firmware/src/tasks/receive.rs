//! From the line to control: bytes to requests, and requests to orders, which takes longer than a tick has.

use core::sync::atomic::Ordering;

use damprig_device::intake::Intake;
use damprig_protocol::ask::ToDevice;
use embassy_stm32::usart::RingBufferedUartRx;

use crate::tasks::lanes::{BAD_FRAMES, Order, OrdersIn, REQUESTS_DROPPED, counted};

/// Owns the line's receiving side.
#[embassy_executor::task]
pub async fn run(mut receiver: RingBufferedUartRx<'static>, mut orders: OrdersIn) -> ! {
    let mut intake = Intake::default();
    let mut bytes = [0; 64];
    loop {
        // A framing or overrun error costs bytes: the checksum of the frame they belonged to shows it.
        let Ok(length) = receiver.read(&mut bytes).await else { continue };
        for &byte in &bytes[..length] {
            // A real board's clock is its own: grants are passed over.
            let Some(ToDevice::Request(request)) = intake.push(byte) else { continue };
            if let Some(place) = orders.try_send() {
                *place = Order::prepare(request);
                orders.send_done();
            } else {
                REQUESTS_DROPPED.store(counted(&REQUESTS_DROPPED).saturating_add(1), Ordering::Relaxed);
            }
        }
        BAD_FRAMES.store(intake.bad_frames(), Ordering::Relaxed);
    }
}
