//! The heartbeat of the communication: control signals this task in every step, and the task answers as soon as its executor runs.
//! Control stops feeding the watchdog when no answer has come for a while.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

static SIGNALLED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
static ANSWERED: AtomicBool = AtomicBool::new(false);

/// Steps without an answer after which the communication counts as stalled: encoding and sending the longest message takes a few.
const MOST_STEPS: u32 = 500;

/// Answers.
pub async fn run() -> ! {
    loop {
        SIGNALLED.wait().await;
        ANSWERED.store(true, Ordering::Relaxed);
    }
}

/// State of the communication.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heartbeat {
    /// It answers.
    Alive,
    /// It has just stopped answering.
    Stalls,
    /// It stopped answering earlier.
    Stalled,
}

/// Control's side.
#[derive(Default)]
pub struct Watch {
    steps_without: u32,
}

impl Watch {
    /// Asks for an answer, once a step; returns whether one has come lately.
    pub fn check(&mut self) -> Heartbeat {
        SIGNALLED.signal(());
        if ANSWERED.swap(false, Ordering::Relaxed) {
            self.steps_without = 0;
        } else {
            self.steps_without = self.steps_without.saturating_add(1);
        }
        match self.steps_without {
            ..MOST_STEPS => Heartbeat::Alive,
            MOST_STEPS => Heartbeat::Stalls,
            _ => Heartbeat::Stalled,
        }
    }
}
