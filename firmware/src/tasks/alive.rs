//! The communication's sign of life: control asks every tick, this task answers as soon as the line's executor runs.
//! Without an answer for a while control stops feeding the watchdog.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

static ASKED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
static ANSWERED: AtomicBool = AtomicBool::new(false);

/// Ticks that the line's tasks may be away: encoding and sending the longest message takes a few.
const MOST_TICKS: u32 = 500;

/// Answers.
#[embassy_executor::task]
pub async fn run() -> ! {
    loop {
        ASKED.wait().await;
        ANSWERED.store(true, Ordering::Relaxed);
    }
}

/// Control's side.
#[derive(Default)]
pub struct Watch {
    away_ticks: u32,
}

impl Watch {
    /// Once a tick: whether the communication has answered lately.
    pub fn is_alive(&mut self) -> bool {
        ASKED.signal(());
        if ANSWERED.swap(false, Ordering::Relaxed) {
            self.away_ticks = 0;
        } else {
            self.away_ticks = self.away_ticks.saturating_add(1);
        }
        self.away_ticks < MOST_TICKS
    }

    /// It has just been found dead.
    pub fn has_just_died(&self) -> bool {
        self.away_ticks == MOST_TICKS
    }
}
