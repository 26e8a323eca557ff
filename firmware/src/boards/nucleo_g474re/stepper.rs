//! Step, direction and enable outputs of the friction damper's motor. TIM16 generates the steps of a tick without the
//! core: a number of pulses, evenly spaced over the tick.

use damprig_core::io::Motor;
use embassy_stm32::gpio::{AfType, Flex, Level, Output, OutputType, Speed};
use embassy_stm32::pac::timer::vals::Ocm;
use embassy_stm32::{Peri, pac, peripherals, rcc};

use super::clock::CORE_HZ;

/// Counting rate of the timer, Hz.
const COUNT_HZ: u32 = 1_000_000;

/// Length of a pulse, counts. Drivers require 1 µs to 2.5 µs.
const PULSE: u16 = 5;

/// Part of a tick for the pulses, counts: the last pulse ends 100 µs before the next tick. The start of a tick varies
/// by about 10 µs.
const TICK: u16 = 900;

/// The motor's driver.
pub struct Stepper {
    _step: Flex<'static>,
    direction: Output<'static>,
    /// Low switches the driver on. Without power or program a pull-up switches the motor off.
    off: Output<'static>,
}

impl Stepper {
    /// Sets the outputs up; the motor is off.
    pub fn new(
        step: Peri<'static, peripherals::PB4>,
        direction: Peri<'static, peripherals::PB5>,
        off: Peri<'static, peripherals::PB10>,
        _timer: Peri<'static, peripherals::TIM16>,
    ) -> Self {
        rcc::enable_and_reset::<peripherals::TIM16>();
        let timer = pac::TIM16;
        timer.psc().write_value((CORE_HZ / COUNT_HZ - 1) as u16);
        timer.cr1().modify(|control| control.set_opm(true));
        // The output is low at rest: the counter is at 0, below the compare value.
        timer.ccr(0).write(|compare| compare.set_ccr(u16::MAX));
        // Low up to the compare value, then high to the end of the period.
        timer.ccmr_output(0).modify(|mode| mode.set_ocm(0, Ocm::PWM_MODE2));
        timer.ccer().modify(|enable| enable.set_cce(0, true));
        timer.bdtr().modify(|output| output.set_moe(true));
        let mut step = Flex::new(step);
        // TIM16_CH1 on PB4 (DS12288, table 13).
        step.set_as_af_unchecked(1, AfType::output(OutputType::PushPull, Speed::Low));
        Self {
            _step: step,
            direction: Output::new(direction, Level::Low, Speed::Low),
            off: Output::new(off, Level::High, Speed::Low),
        }
    }

    /// Makes the steps of this tick. A disabled motor is switched off, and any pulse in progress ends.
    pub fn go(&mut self, motor: Motor) {
        if !motor.enabled {
            self.off.set_high();
            pac::TIM16.cr1().modify(|control| control.set_cen(false));
            // Reset the counter to 0, where the output is low.
            pac::TIM16.egr().write(|event| event.set_ug(true));
            return;
        }
        self.off.set_low();
        let steps = motor.steps.unsigned_abs();
        if steps == 0 {
            return;
        }
        // The direction is set at least 50 µs before the first pulse.
        self.direction.set_level(if motor.steps > 0 { Level::High } else { Level::Low });
        let timer = pac::TIM16;
        let period = TICK / u16::from(steps);
        timer.arr().write(|reload| reload.set_arr(period - 1));
        timer.ccr(0).write(|compare| compare.set_ccr(period - PULSE));
        timer.rcr().write(|repetitions| repetitions.set_rep(steps - 1));
        // Load the preloaded values.
        timer.egr().write(|event| event.set_ug(true));
        timer.cr1().modify(|control| control.set_cen(true));
    }
}
