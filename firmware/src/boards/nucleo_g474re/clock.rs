//! Clock set-up: 170 MHz from the 24 MHz crystal, or from the internal oscillator if the crystal does not start. The
//! core reaches 170 MHz in boost mode, which is set before the PLL is selected, and in two steps.

use damprig_protocol::ClockSource;
use embassy_stm32::pac::flash::vals::Latency;
use embassy_stm32::pac::rcc::vals::Hpre;
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, Peri, pac, peripherals, rcc};

/// Frequency of the core's, the buses' and the converters' clock, Hz.
pub const CORE_HZ: u32 = 170_000_000;

/// Iterations of a loop at 16 MHz in which the crystal must start: about 50 ms, ten times the start-up time of its
/// data sheet.
const PATIENCE: u32 = 200_000;

/// The clocks of the start: the internal oscillator of 16 MHz. The RTC is off: according to the errata sheet the LSI may run 50 %
/// too fast while it clocks the RTC. The watchdog's time-out would become shorter.
pub fn at_start() -> Config {
    let mut config = Config::default();
    config.rcc.ls = rcc::LsConfig { rtc: rcc::RtcClockSource::DISABLE, lsi: false, lse: None };
    config
}

/// Selects boost mode, starts the crystal and the PLL. Call once, at 16 MHz. The library's own start would wait for the crystal
/// forever, and [`embassy_stm32::init`] would end boost mode, because it resets the power control.
pub fn start(rcc: &mut Peri<'_, peripherals::RCC>) -> ClockSource {
    boost();
    let (clocks, source) = choose();
    rcc::reinit(clocks, rcc);
    source
}

fn choose() -> (rcc::Config, ClockSource) {
    pac::RCC.cr().modify(|control| control.set_hseon(true));
    let starts = (0..PATIENCE).any(|_| pac::RCC.cr().read().hserdy());
    let mut clocks = at_start().rcc;
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
    (clocks, if starts { ClockSource::Crystal } else { ClockSource::InternalOscillator })
}

/// Boost mode of range 1: without it SYSCLK may not exceed 150 MHz, whatever the AHB prescaler (RM0440, section 6.1.5). The
/// library's option `boost` alone has no effect: its register definition (stm32-metapac 21) has R1MODE, bit 8, at bit 0 (RM0440,
/// section 6.4.21).
fn boost() {
    pac::PWR.cr5().write_value(pac::pwr::regs::Cr5(0));
}

/// Raises the clock of core and buses from 85 MHz to [`CORE_HZ`], at least 1 µs after the switch to the PLL (RM0440,
/// section 7.2.7): a larger step would lower the core's supply voltage. Call after the drivers have been set up. The
/// library still assumes 85 MHz, so this function sets the DAC's interface.
pub fn speed_up() {
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
