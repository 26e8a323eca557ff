//! The damprig controller image: wiring only. Pins are the boards', decisions the shared crates'.
#![no_std]
#![no_main]

mod board;

use defmt_rtt as _;

#[cfg(feature = "board-mps2-an386")]
#[embassy_executor::main]
async fn main(_spawner: embassy_executor::Spawner) {
    let mut board = board::mps2_an386::init();
    loop { let b = board.line.read().await; board.line.write(&[b]); }
}
