//! Clock set-up: 170 MHz from the 24 MHz crystal, or from the internal oscillator if the crystal does not start. The
//! core reaches 170 MHz in boost mode and in two steps.

use damprig_protocol::ClockSource;
use embassy_stm32::pac::flash::vals::Latency;
use embassy_stm32::pac::rcc::vals::Hpre;
use embassy_stm32::time::Hertz;
use embassy_stm32::{pac, rcc};

/// Frequency of the core's, the buses' and the converters' clock, Hz.
pub const CORE_HZ: u32 = 170_000_000;

/// Iterations of a loop at 16 MHz in which the crystal must start: about 50 ms, ten times the start-up time of its
/// data sheet.
const PATIENCE: u32 = 200_000;

/// Starts the crystal and selects the clocks. The library's own start would wait for the crystal forever.
pub fn choose() -> (rcc::Config, ClockSource) {
    pac::RCC.cr().modify(|control| control.set_hseon(true));
    let starts = (0..PATIENCE).any(|_| pac::RCC.cr().read().hserdy());
    let mut clocks = rcc::Config::new();
    let (source, prediv) = if starts {
        clocks.hse = Some(rcc::Hse { freq: Hertz::mhz(24), mode: rcc::HseMode::Oscillator });
        (rcc::PllSource::HSE, rcc::PllPreDiv::DIV6)
    } else {
        pac::RCC.cr().modify(|control| control.set_hseon(false));
        (rcc::PllSource::HSI, rcc::PllPreDiv::DIV4)
    };
    // 24 MHz / 6 or 16 MHz / 4, times 85, over 2.
    clocks.pll = Some(rcc::Pll {
        source,
        prediv,
        mul: rcc::PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(rcc::PllRDiv::DIV2),
    });
    clocks.sys = rcc::Sysclk::PLL1_R;
    // The core starts at half speed: see `speed_up`. The clocks of the converters and of the serial line are not
    // divided.
    clocks.ahb_pre = rcc::AHBPrescaler::DIV2;
    clocks.boost = true;
    clocks.mux.adc12sel = rcc::mux::Adcsel::SYS;
    clocks.mux.lpuart1sel = rcc::mux::Uartsel::SYS;
    // The RTC is off: according to an errata sheet of this family the LSI may run 50 % too fast while it clocks the
    // RTC. The watchdog's time-out would become shorter.
    clocks.ls = rcc::LsConfig { rtc: rcc::RtcClockSource::DISABLE, lsi: false, lse: None };
    (clocks, if starts { ClockSource::Crystal } else { ClockSource::InternalOscillator })
}

/// Raises the clock of core and buses from 85 MHz to [`CORE_HZ`], at least 1 µs after the switch to the PLL (RM0440,
/// section 7.2.7): a larger step would lower the core's supply voltage. Call after the drivers have been set up. The
/// library still assumes 85 MHz, so this function sets the DAC's interface.
pub fn speed_up() {
    // Boost mode of range 1; without it the limit is 150 MHz. R1MODE is bit 8 (RM0440, section 6.4.21). The library's
    // register definition (stm32-metapac 21) has it at bit 0, so the option `boost` alone has no effect.
    pac::PWR.cr5().write_value(pac::pwr::regs::Cr5(0));
    cortex_m::asm::delay(CORE_HZ / 2_000_000 + 1);
    pac::FLASH.acr().modify(|access| {
        access.set_latency(Latency::WS4);
        access.set_prften(true);
    });
    while pac::FLASH.acr().read().latency() != Latency::WS4 {}
    // The AHB runs above 160 MHz.
    pac::DAC1.mcr().modify(|mode| mode.set_hfsel(2));
    pac::RCC.cfgr().modify(|clocks| clocks.set_hpre(Hpre::DIV1));
}

/// Enables the clock security system: from now on a stopped crystal raises the non-maskable interrupt.
pub fn watch(source: ClockSource) {
    if source == ClockSource::Crystal {
        pac::RCC.cr().modify(|control| control.set_csson(true));
    }
}
