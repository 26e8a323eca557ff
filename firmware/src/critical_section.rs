//! Critical sections of the whole image: interrupts masked, and how long the longest of them took.
//!
//! The queues between the tasks and the drivers of the peripherals use them. What they mask, the control tick waits for.

use core::sync::atomic::{AtomicU32, Ordering, compiler_fence};

use cortex_m::peripheral::DWT;
use cortex_m::register::primask;
use critical_section::RawRestoreState;

/// Count of cycles at the outermost section's beginning; nothing else runs meanwhile.
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

/// Whether this is the outermost section.
fn begin() -> bool {
    let was_on = primask::read().is_active();
    cortex_m::interrupt::disable();
    compiler_fence(Ordering::SeqCst);
    if was_on {
        BEGUN.store(DWT::cycle_count(), Ordering::Relaxed);
    }
    was_on
}

/// The outermost section is over.
fn end() {
    let took = DWT::cycle_count().wrapping_sub(BEGUN.load(Ordering::Relaxed));
    if took > LONGEST.load(Ordering::Relaxed) {
        LONGEST.store(took, Ordering::Relaxed);
    }
    compiler_fence(Ordering::SeqCst);
    // SAFETY: they were on when the section began.
    unsafe { cortex_m::interrupt::enable() };
}

/// The longest section since [`forget`], cycles of the core; 0 where its counter is off.
#[cfg(feature = "board-nucleo-g474re")]
pub fn longest_cycles() -> u32 {
    LONGEST.load(Ordering::Relaxed)
}

/// Counts anew: what the start needs says nothing about the tick.
#[cfg(feature = "board-nucleo-g474re")]
pub fn forget() {
    LONGEST.store(0, Ordering::Relaxed);
}
