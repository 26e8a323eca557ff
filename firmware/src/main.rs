//! The damprig controller image: wiring only. Pins are the boards', decisions the shared crates'.

#![no_std]
#![no_main]
// The image that only counts leaves the line alone.
#![cfg_attr(feature = "count-instructions", allow(dead_code))]

mod board;
#[cfg(any(feature = "board-nucleo-g474re", feature = "count-instructions"))]
mod callers;
#[cfg(feature = "board-nucleo-g474re")]
mod crash;
#[cfg(not(feature = "board-mps2-an385"))]
mod identity;
mod masked;
mod tasks;
#[cfg(not(feature = "board-mps2-an385"))]
mod tick;

#[cfg(not(feature = "board-mps2-an385"))]
use defmt_rtt as _;
#[cfg(not(feature = "board-mps2-an385"))]
use embassy_executor::Spawner;

#[cfg(feature = "board-mps2-an385")]
#[cortex_m_rt::entry]
fn main() -> ! {
    tasks::fixed_point::run(&board::mps2_an385::init())
}

#[cfg(all(feature = "board-mps2-an386", not(feature = "count-instructions")))]
#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = board::mps2_an386::init();
    spawner.spawn(tasks::granted::run(board.line, tasks::granted::device()).expect("the task is spawned once"));
}

#[cfg(feature = "count-instructions")]
#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let board = board::mps2_an386::init();
    tasks::count::run(&board.instructions, tasks::granted::device());
}

#[cfg(feature = "board-nucleo-g474re")]
mod wiring {
    use embassy_executor::InterruptExecutor;
    use embassy_stm32::interrupt::{self, InterruptExt, Priority};

    use super::*;

    /// Runs the control tick above the thread executor, on an interrupt that the board has no other use for.
    static CONTROL: InterruptExecutor = InterruptExecutor::new();

    #[embassy_stm32::interrupt]
    unsafe fn UART5() {
        // SAFETY: this is the interrupt that `CONTROL` was started on.
        unsafe { CONTROL.on_interrupt() }
    }

    #[embassy_executor::main]
    async fn main(spawner: Spawner) {
        let board = board::nucleo_g474re::init();
        let (orders_in, orders_out) = tasks::lanes::orders();
        interrupt::UART5.set_priority(Priority::P6);
        let control = CONTROL.start(interrupt::UART5);
        control.spawn(
            tasks::control::run(board.bench, board.birth, board.kept, orders_out).expect("the task is spawned once"),
        );
        spawner.spawn(tasks::alive::run().expect("the task is spawned once"));
        spawner.spawn(tasks::receive::run(board.receiver, orders_in).expect("the task is spawned once"));
        spawner.spawn(tasks::transmit::run(board.transmitter, board.led).expect("the task is spawned once"));
        if let Some(keeper) = board.keeper {
            spawner.spawn(tasks::settings::run(keeper).expect("the task is spawned once"));
        }
        defmt::info!("damprig {} on {}", env!("CARGO_PKG_VERSION"), board::nucleo_g474re::NAME);
    }
}
