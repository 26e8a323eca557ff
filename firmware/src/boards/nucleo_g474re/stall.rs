//! Detects a missing control tick and records the call stack before the watchdog resets the board.
//!
//! The interrupt of TIM7 has the highest priority and runs 200 times per second, so it also detects a loop in the
//! tick itself.

use core::sync::atomic::{AtomicU32, Ordering};

use damprig_protocol::CrashCause;
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::{Peri, pac, peripherals, rcc};

use super::clock::CORE_HZ;
use crate::{callers, crash, tick};

/// Checks per second.
const LOOKS_HZ: u32 = 200;

/// Counting rate of the timer, Hz.
const COUNT_HZ: u32 = 10_000;

/// Number of consecutive checks without a tick: 30 ms to 35 ms after the last tick. The watchdog expires after 47 ms
/// at the earliest.
const MAX_LOOKS: u32 = 6;

static TICK_BEFORE: AtomicU32 = AtomicU32::new(0);
static WITHOUT: AtomicU32 = AtomicU32::new(0);

/// Starts the checks. Call when the ticks have started.
pub fn watch(_timer: Peri<'static, peripherals::TIM7>) {
    rcc::enable_and_reset::<peripherals::TIM7>();
    let timer = pac::TIM7;
    timer.psc().write_value((CORE_HZ / COUNT_HZ - 1) as u16);
    timer.arr().modify(|end| end.set_arr((COUNT_HZ / LOOKS_HZ - 1) as u16));
    timer.dier().modify(|interrupts| interrupts.set_uie(true));
    timer.cr1().modify(|control| control.set_cen(true));
    interrupt::TIM7_DAC.set_priority(Priority::P0);
    // SAFETY: the handler below is ready, and no critical section relies on this mask.
    unsafe { interrupt::TIM7_DAC.enable() };
}

#[embassy_stm32::interrupt]
unsafe fn TIM7_DAC() {
    pac::TIM7.sr().write(|flags| flags.set_uif(false));
    let noted = tick::now();
    if TICK_BEFORE.swap(noted, Ordering::Relaxed) != noted {
        WITHOUT.store(0, Ordering::Relaxed);
    } else if WITHOUT.fetch_add(1, Ordering::Relaxed) + 1 == MAX_LOOKS {
        // The first call is the exception's own return mark; the following ones are the callers of the interrupted
        // code.
        crash::note(CrashCause::ControlStalled, callers::of_here());
    }
}
