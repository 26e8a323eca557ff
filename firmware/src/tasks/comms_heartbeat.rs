//! Heartbeat of the communication tasks: control signals this task in every step, and the task answers when its
//! executor runs. Control stops feeding the watchdog when no answer has come for a while.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

static SIGNALLED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
static ANSWERED: AtomicBool = AtomicBool::new(false);

/// Number of steps without an answer after which the communication counts as stalled. Encoding and sending the
/// longest message takes a few steps.
const MAX_STEPS: u32 = 500;

/// Answers each signal.
pub async fn run() -> ! {
    loop {
        SIGNALLED.wait().await;
        ANSWERED.store(true, Ordering::Relaxed);
    }
}

/// State of the communication.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heartbeat {
    /// The task answers.
    Alive,
    /// The task has just stopped answering.
    Stalls,
    /// The task stopped answering earlier.
    Stalled,
}

/// Control's side of the heartbeat.
#[derive(Default)]
pub struct HeartbeatWatch {
    steps_without: u32,
}

impl HeartbeatWatch {
    /// Signals the task; call once per step. Returns whether it has answered recently.
    pub fn check(&mut self) -> Heartbeat {
        SIGNALLED.signal(());
        if ANSWERED.swap(false, Ordering::Relaxed) {
            self.steps_without = 0;
        } else {
            self.steps_without = self.steps_without.saturating_add(1);
        }
        match self.steps_without {
            ..MAX_STEPS => Heartbeat::Alive,
            MAX_STEPS => Heartbeat::Stalls,
            _ => Heartbeat::Stalled,
        }
    }
}
