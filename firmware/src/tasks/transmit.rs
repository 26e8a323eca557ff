//! From control to the line: replies and events first, telemetry in what remains.
//!
//! The line paces this task: it waits until the transmitter has room.

use damprig_device::outbox::Batch;
use damprig_protocol::FromDevice;
use damprig_protocol::frame::{self, LONGEST};
use embassy_futures::select::{Either, select};
use embassy_stm32::gpio::Output;
use embassy_stm32::mode::Async;
use embassy_stm32::usart::UartTx;
use embedded_io_async::Write;

use crate::tasks::lanes::{ROWS, URGENT};

/// Owns the line's sending side, and the LED, which changes with every message.
#[embassy_executor::task]
pub async fn run(mut transmitter: UartTx<'static, Async>, mut led: Output<'static>) -> ! {
    let mut batch = Batch::default();
    let mut frame = [0; LONGEST];
    loop {
        let message = next(&mut batch).await;
        // Every message fits a frame: the longest is a test's claim.
        let length = frame::encode(&message, &mut frame).unwrap_or(0);
        led.toggle();
        if transmitter.write_all(&frame[..length]).await.is_err() {
            defmt::warn!("the line took no bytes");
        }
    }
}

async fn next(batch: &mut Batch) -> FromDevice {
    loop {
        if let Ok(saying) = URGENT.try_receive() {
            return saying.into();
        }
        if let Some(telemetry) = batch.pop() {
            return FromDevice::Telemetry(telemetry);
        }
        // `select` asks in this order.
        match select(URGENT.receive(), ROWS.receive()).await {
            Either::First(saying) => return saying.into(),
            Either::Second(row) => {
                if row.tick == 0 {
                    // What is left of the old count of ticks.
                    *batch = Batch::default();
                }
                batch.push(&row);
            }
        }
    }
}
