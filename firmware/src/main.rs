//! The damprig controller image: wiring of the tasks only. Pins are in `boards`, decisions in the shared crates.

#![no_std]
#![no_main]
// The image that only counts instructions runs no tasks.
#![cfg_attr(feature = "count-instructions", allow(dead_code))]

mod boards;
#[cfg(any(feature = "board-nucleo-g474re", feature = "count-instructions"))]
mod callers;
#[cfg(feature = "board-nucleo-g474re")]
mod crash;
mod critical_section;
#[cfg(not(feature = "board-mps2-an385"))]
mod identity;
mod tasks;
#[cfg(not(feature = "board-mps2-an385"))]
mod tick;

#[cfg(feature = "board-mps2-an386")]
use boards::mps2_an386 as board;
#[cfg(feature = "board-nucleo-g474re")]
use boards::nucleo_g474re as board;
#[cfg(not(feature = "board-mps2-an385"))]
use defmt_rtt as _;

#[cfg(feature = "board-mps2-an385")]
#[cortex_m_rt::entry]
fn main() -> ! {
    tasks::fixed_point::run(&boards::mps2_an385::init())
}

#[cfg(feature = "count-instructions")]
#[embassy_executor::main]
async fn main(_spawner: embassy_executor::Spawner) {
    tasks::count::run(&board::init().instructions);
}

/// Instances of the tasks in `tasks` for the parts of a board.
#[cfg(all(not(feature = "board-mps2-an385"), not(feature = "count-instructions")))]
mod wiring {
    use damprig_core::settings::{Settings, Source};
    use damprig_device::controller::BootInfo;
    use damprig_device::settings_store::SettingsStore;
    use embassy_executor::Spawner;

    use crate::board;
    use crate::tasks::queues::{RequestsIn, RequestsOut};
    use crate::tasks::{comms_heartbeat, control, log, queues, receive, settings, transmit};

    #[embassy_executor::task]
    async fn run_control(
        board: board::ControlBoard,
        boot: BootInfo,
        stored: &'static (Settings, Source),
        requests: RequestsOut,
    ) -> ! {
        control::run(board, board::NAME, boot, stored, requests).await
    }

    #[embassy_executor::task]
    async fn run_heartbeat() -> ! {
        comms_heartbeat::run().await
    }

    #[embassy_executor::task]
    async fn run_log() -> ! {
        log::run().await
    }

    #[embassy_executor::task]
    async fn run_receive(receiver: board::LineReceiver, requests: RequestsIn) -> ! {
        receive::run(receiver, requests).await
    }

    #[embassy_executor::task]
    async fn run_transmit(transmitter: board::LineTransmitter) -> ! {
        transmit::run(transmitter).await
    }

    #[embassy_executor::task]
    async fn run_settings(store: SettingsStore<board::SettingsFlash>) -> ! {
        settings::run(store).await
    }

    #[embassy_executor::main]
    async fn main(spawner: Spawner) {
        let board::Parts { board, boot, receiver, transmitter, store, stored } = board::init();
        let (requests_in, requests_out) = queues::requests();
        let once = "the task is spawned once";
        board::spawn_control(&spawner, run_control(board, boot, stored, requests_out).expect(once));
        spawner.spawn(run_heartbeat().expect(once));
        spawner.spawn(run_log().expect(once));
        spawner.spawn(run_receive(receiver, requests_in).expect(once));
        spawner.spawn(run_transmit(transmitter).expect(once));
        if let Some(store) = store {
            spawner.spawn(run_settings(store).expect(once));
        }
        defmt::info!("damprig {} on {}", env!("CARGO_PKG_VERSION"), board::NAME);
    }
}
