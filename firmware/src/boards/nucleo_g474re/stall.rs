//! Notices a control tick that does not come, and writes down where the program was before the watchdog bites.
//!
//! TIM7 interrupts everything else 200 times a second, so a loop in the tick itself does not hide from it.

use core::sync::atomic::{AtomicU32, Ordering};

use damprig_protocol::CrashCause;
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::{Peri, pac, peripherals, rcc};

use super::clock::CORE_HZ;
use crate::{callers, crash, tick};

/// Looks per second.
const LOOKS_HZ: u32 = 200;

/// Count of the timer, Hz.
const COUNT_HZ: u32 = 10_000;

/// Looks in a row without a tick: 30 ms to 35 ms after the last one, of the watchdog's 47 at the least.
const MOST_LOOKS: u32 = 6;

static TICK_BEFORE: AtomicU32 = AtomicU32::new(0);
static WITHOUT: AtomicU32 = AtomicU32::new(0);

/// Begins to look. To be called when the ticks have begun.
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
    } else if WITHOUT.fetch_add(1, Ordering::Relaxed) + 1 == MOST_LOOKS {
        // The first of the calls is the exception's own mark; those after it are who called what was interrupted.
        crash::note(CrashCause::ControlStalled, callers::of_here());
    }
}
