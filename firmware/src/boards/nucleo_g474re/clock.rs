//! The clock: the board's 24 MHz crystal, or the internal oscillator if that does not start; both make 170 MHz.

use damprig_protocol::ClockSource;
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
    clocks.boost = true;
    clocks.mux.adc12sel = rcc::mux::Adcsel::SYS;
    (clocks, if starts { ClockSource::Crystal } else { ClockSource::InternalOscillator })
}

/// From now on a crystal that stops raises the non-maskable interrupt.
pub fn watch(source: ClockSource) {
    if source == ClockSource::Crystal {
        pac::RCC.cr().modify(|control| control.set_csson(true));
    }
}
