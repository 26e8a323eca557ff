//! Watches the board's supply: below 2.9 V it opens the relay, switches the motor off and starts anew, before the converters
//! and the output buffer lose their reference and long before the processor stops.

use damprig_protocol::{CALLS_TOLD, CrashCause};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::pac;

use crate::crash;

/// PLS: threshold for a falling supply, 2.9 V nominal (DS12288, table 19).
const THRESHOLD: u8 = 6;

/// Line of the voltage detector in the extended interrupt controller (RM0440, table 100).
const LINE: usize = 16;

/// Begins to watch, once the supply is above the threshold. Every output is still off.
pub fn watch() {
    pac::PWR.cr2().modify(|detector| {
        detector.set_pls(THRESHOLD);
        detector.set_pvde(true);
    });
    while pac::PWR.sr2().read().pvdo() {}
    pac::EXTI.rtsr(0).modify(|lines| lines.set_line(LINE, true));
    pac::EXTI.imr(0).modify(|lines| lines.set_line(LINE, true));
    interrupt::PVD_PVM.set_priority(Priority::P0);
    // SAFETY: the handler below is ready, and no critical section relies on this mask.
    unsafe { interrupt::PVD_PVM.enable() };
}

#[embassy_stm32::interrupt]
unsafe fn PVD_PVM() {
    // Open the relay and switch the motor's driver off, whatever the tick has set.
    pac::GPIOC.bsrr().write(|pins| pins.set_br(7, true));
    pac::GPIOB.bsrr().write(|pins| pins.set_bs(10, true));
    crash::end(CrashCause::SupplyLow, [0; CALLS_TOLD])
}
