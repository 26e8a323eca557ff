//! The clock: the board's 24 MHz crystal, or the internal oscillator if that does not start; both make 170 MHz, in boost mode and in two steps.

use damprig_protocol::ClockSource;
use embassy_stm32::pac::flash::vals::Latency;
use embassy_stm32::pac::rcc::vals::Hpre;
use embassy_stm32::time::Hertz;
use embassy_stm32::{pac, rcc};

/// The core's, the buses' and the converters' clock, Hz.
pub const CORE_HZ: u32 = 170_000_000;

/// Turns of a loop at 16 MHz in which a crystal starts or never does: some 50 ms, ten times its data sheet's.
const PATIENCE: u32 = 200_000;

/// Starts the crystal and says what the clock is to be. The library would wait for the crystal for ever.
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
    // Half speed for the start: see `speed_up`. What the converters and the line run on is not divided.
    clocks.ahb_pre = rcc::AHBPrescaler::DIV2;
    clocks.boost = true;
    clocks.mux.adc12sel = rcc::mux::Adcsel::SYS;
    clocks.mux.lpuart1sel = rcc::mux::Uartsel::SYS;
    // No RTC: an errata sheet of this family lists an LSI that runs 50 % fast while it clocks the RTC, and the watchdog's
    // time would shrink with it.
    clocks.ls = rcc::LsConfig { rtc: rcc::RtcClockSource::DISABLE, lsi: false, lse: None };
    (clocks, if starts { ClockSource::Crystal } else { ClockSource::InternalOscillator })
}

/// Brings the core and the buses from 85 MHz to [`CORE_HZ`], at least 1 µs after the clock was switched to the PLL (RM0440,
/// section 7.2.7): a larger step would pull the core's supply down. To be called when the drivers have been set up: the
/// library goes on to believe in 85 MHz, which is why the DAC's interface is told here.
pub fn speed_up() {
    // Range 1's boost mode, without which 150 MHz are the limit: R1MODE is bit 8 (RM0440, section 6.4.21). The library's
    // register file (stm32-metapac 21) has it at bit 0, so `boost` alone does not reach it.
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

/// From now on a crystal that stops raises the non-maskable interrupt.
pub fn watch(source: ClockSource) {
    if source == ClockSource::Crystal {
        pac::RCC.cr().modify(|control| control.set_csson(true));
    }
}
