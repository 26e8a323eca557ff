//! The boards: pins and peripherals only. Decisions are the shared crates', wiring is `main.rs`'s.
//!
//! The traits are what the tasks need of a board; each board file implements them for its parts.

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

    /// A board in the control task.
    pub trait TaskBoard: Board {
        /// Starts the ticks.
        fn start(&mut self);

        /// Waits until the next step of the control loop is due; `last` is what the last one did.
        async fn wait(&mut self, last: Step, rig: &Rig);

        /// A step has ended; `next_tick` comes next.
        fn end_step(&mut self, next_tick: u32);

        /// The control loop and the communication run.
        fn feed_watchdog(&mut self);

        /// The communication's tasks have just been found not to run.
        fn communication_stalled(&mut self);
    }

    /// The receiving side of the line.
    pub trait Receiver: embedded_io_async::Read {
        /// The host has granted ticks up to this one. A board with a clock of its own ignores it.
        fn granted(&mut self, _until_tick: u32) {}

        /// A request waits for the control loop.
        fn request_queued(&mut self) {}
    }

    /// The sending side of the line.
    pub trait Transmitter {
        /// Waits until a frame may start.
        async fn ready(&mut self);

        /// Sends a frame.
        async fn send(&mut self, frame: &[u8]);
    }
}

#[cfg(not(feature = "board-mps2-an385"))]
pub use tasked::{Receiver, TaskBoard, Transmitter};
