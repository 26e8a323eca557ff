//! The boards: pins and peripherals only. Decisions are in the shared crates, the wiring of the tasks is in
//! `main.rs`.
//!
//! The traits are what the tasks need of a board; each board file implements them.

#[cfg(any(feature = "count-instructions", feature = "board-mps2-an385"))]
pub mod instructions;
#[cfg(feature = "board-mps2-an385")]
pub mod mps2_an385;
#[cfg(feature = "board-mps2-an386")]
pub mod mps2_an386;
#[cfg(feature = "board-nucleo-g474re")]
pub mod nucleo_g474re;

#[cfg(not(feature = "board-mps2-an385"))]
mod tasked {
    use damprig_core::rig::Rig;
    use damprig_device::board::Board;
    use damprig_device::control_loop::Step;

    /// A board, as the control task uses it.
    pub trait TaskBoard: Board {
        /// Starts the ticks.
        fn start(&mut self);

        /// Waits until the next step of the control loop is due; `last` is the result of the previous step.
        async fn wait(&mut self, last: Step, rig: &Rig);

        /// Called at the end of a step; `next_tick` is the next tick.
        fn end_step(&mut self, next_tick: u32);

        /// Feeds the watchdog. Called while control loop and communication run.
        fn feed_watchdog(&mut self);

        /// Called when the communication tasks have stopped running.
        fn communication_stalled(&mut self);
    }

    /// The receiving side of the serial line.
    pub trait Receiver: embedded_io_async::Read {
        /// Called when the host has granted ticks up to this one. A board with its own clock ignores it.
        fn granted(&mut self, _until_tick: u32) {}

        /// Called when a request has been queued for the control loop.
        fn request_queued(&mut self) {}
    }

    /// The sending side of the serial line.
    pub trait Transmitter {
        /// Waits until a frame may start.
        async fn ready(&mut self);

        /// Sends a frame.
        async fn send(&mut self, frame: &[u8]);
    }
}

#[cfg(not(feature = "board-mps2-an385"))]
pub use tasked::{Receiver, TaskBoard, Transmitter};
