//! Critical sections of the image: mask interrupts and measure the longest time for which they are masked.
//!
//! The queues between the tasks and the peripheral drivers use them. A critical section delays the control tick.

use core::sync::atomic::{AtomicU32, Ordering, compiler_fence};

use cortex_m::peripheral::DWT;
use cortex_m::register::primask;
use critical_section::RawRestoreState;

/// Cycle count at the start of the outermost section.
static BEGUN: AtomicU32 = AtomicU32::new(0);
static LONGEST: AtomicU32 = AtomicU32::new(0);

struct Masked;
critical_section::set_impl!(Masked);

// SAFETY: with interrupts masked nothing else runs on the only core, until the outermost section restores them.
unsafe impl critical_section::Impl for Masked {
    unsafe fn acquire() -> RawRestoreState {
        begin()
    }

    unsafe fn release(was_on: RawRestoreState) {
        if was_on {
            end();
        }
    }
}

/// Enters a section; returns whether it is the outermost one.
fn begin() -> bool {
    let was_on = primask::read().is_active();
    cortex_m::interrupt::disable();
    compiler_fence(Ordering::SeqCst);
    if was_on {
        BEGUN.store(DWT::cycle_count(), Ordering::Relaxed);
    }
    was_on
}

/// Ends the outermost section.
fn end() {
    let took = DWT::cycle_count().wrapping_sub(BEGUN.load(Ordering::Relaxed));
    if took > LONGEST.load(Ordering::Relaxed) {
        LONGEST.store(took, Ordering::Relaxed);
    }
    compiler_fence(Ordering::SeqCst);
    // SAFETY: interrupts were on when the section began.
    unsafe { cortex_m::interrupt::enable() };
}

/// Longest section since [`forget`], core cycles; 0 while the cycle counter is off.
#[cfg(feature = "board-nucleo-g474re")]
pub fn longest_cycles() -> u32 {
    LONGEST.load(Ordering::Relaxed)
}

/// Restarts the measurement, to exclude the sections of the start-up.
#[cfg(feature = "board-nucleo-g474re")]
pub fn forget() {
    LONGEST.store(0, Ordering::Relaxed);
}
