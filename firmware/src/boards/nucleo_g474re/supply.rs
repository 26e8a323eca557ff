//! The board's supply. Below 2.9 V the relay opens, the motor is switched off and the board restarts, before the converters and
//! the output buffer lose their reference. At the start the supply is measured, because it is the reference of every analogue
//! input and of the drive.

use cortex_m::asm;
use damprig_protocol::{CALLS_TOLD, CrashCause};
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::{pac, peripherals};

use super::clock::CORE_HZ;
use crate::crash;

/// PLS: threshold for a falling supply, 2.9 V nominal (DS12288, table 19).
const THRESHOLD: u8 = 6;

/// Line of the voltage detector in the extended interrupt controller (RM0440, table 100).
const LINE: usize = 16;

/// The code of the internal reference, measured in production at [`FACTORY_SUPPLY_V`] (DS12288, section 3.18.2).
const VREFINT_CAL: *const u16 = 0x1fff_75aa as *const u16;

/// Supply at the factory measurement, V.
const FACTORY_SUPPLY_V: f32 = 3.0;

/// Start-up time of the reference's buffer: 12 µs (DS12288, table 18), in cycles.
const REFERENCE_STARTS: u32 = 12 * (CORE_HZ / 1_000_000);

/// Conversions that the converter adds up to one result.
const ADDED_UP: f32 = 16.0;

/// Measures the supply, V, with a converter that is not sampling yet. The error is below 0.7 %: 0.33 % of the factory
/// measurement, 0.2 % of the converter, 0.15 % of 30 °C.
pub fn measure(mut adc: Adc<'static, peripherals::ADC1>) -> f32 {
    let mut reference = adc.enable_vrefint();
    asm::delay(REFERENCE_STARTS);
    // At least 4 µs; this is 5.8 µs.
    let sum = adc.blocking_read(&mut reference, SampleTime::CYCLES247_5);
    pac::ADC12_COMMON.ccr().modify(|common| common.set_vrefen(false));
    // SAFETY: a constant of the chip that can be read at any time.
    let factory = unsafe { VREFINT_CAL.read_volatile() };
    FACTORY_SUPPLY_V * f32::from(factory) * ADDED_UP / f32::from(sum)
}

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
