//! The rig's tick, as control has noted it last: the log's time stamps, and where a crash was. It is the `tick` of the
//! samples, so that a line of the log finds its place among them; it begins anew with each start of an experiment, and stands
//! still when control does.

use core::sync::atomic::{AtomicU32, Ordering};

/// Control alone writes it; a word is written and read at once.
static TICK: AtomicU32 = AtomicU32::new(0);

// A tick is a millisecond.
defmt::timestamp!("{=u32:tms}", now());

/// The tick that comes next.
pub fn note(tick: u32) {
    TICK.store(tick, Ordering::Relaxed);
}

/// As noted last.
pub fn now() -> u32 {
    TICK.load(Ordering::Relaxed)
}
