//! The rig's tick as last stored by control, for log time stamps and crash records. It is the `tick` of the samples,
//! so that a log line can be matched with them. It restarts with each experiment and stops when control does.

use core::sync::atomic::{AtomicU32, Ordering};

/// Only control writes it; access to a word is atomic.
static TICK: AtomicU32 = AtomicU32::new(0);

// A tick is a millisecond.
defmt::timestamp!("{=u32:tms}", now());

/// Stores the next tick.
pub fn note(tick: u32) {
    TICK.store(tick, Ordering::Relaxed);
}

/// The tick that was stored last.
pub fn now() -> u32 {
    TICK.load(Ordering::Relaxed)
}
