//! STM32G474 without its core: address map, clock checks, and the connections between peripherals.
//!
//! - Update events of a timer start the converters' sequences, and DMA moves the results to memory. Both are computed
//!   on demand: when a register of either is read, or when a half transfer must raise an interrupt.
//! - Outputs of the chip (drive, relay, motor) act on the [`Plant`] at once and are recorded in a trace.
//! - Every access to something that is not modelled fails with [`Refused`].

use damprig_core::io::{Invalid, Sensor};
use damprig_simulator::plant::{InjectedFault, PlantConfig};

use crate::peripherals::adc::{self, Adc};
use crate::peripherals::dac::Dac;
use crate::peripherals::dbgmcu::Dbgmcu;
use crate::peripherals::dma::{CHANNELS, Dma, Dmamux};
use crate::peripherals::dwt::Dwt;
use crate::peripherals::exti::Exti;
use crate::peripherals::flash::{BANK_BYTES, Bank2, Cut, Flash, OPTR_DELIVERED};
use crate::peripherals::gpio::{Gpio, Mode};
use crate::peripherals::iwdg::Iwdg;
use crate::peripherals::lpuart::Lpuart;
use crate::peripherals::nvic::{NMI, Nvic};
use crate::peripherals::pwr::Pwr;
use crate::peripherals::rcc::{Gate, Rcc, ResetCause};
use crate::peripherals::scb::Scb;
use crate::peripherals::tim::{Kind, Tim};
use crate::plant::{Plant, REFERENCE_V, Relay};
use crate::register::{Access, Refused, ensure, refuse, rule};
use crate::time::{At, Time, UNITS_PER_US};

/// First address of the flash.
pub const FLASH_BASE: u32 = 0x0800_0000;
/// Size of both banks.
pub const FLASH_BYTES: u32 = 2 * BANK_BYTES;
/// First address of the second bank.
pub const BANK2_BASE: u32 = FLASH_BASE + BANK_BYTES;
/// First address of the RAM: SRAM1 and SRAM2, contiguous. The alias of the CCM behind it is not used.
pub const RAM_BASE: u32 = 0x2000_0000;
/// Size of the RAM.
pub const RAM_BYTES: u32 = 96 * 1_024;

/// Start of the CCM, which DMA does not reach at this address.
pub const CCM_BASE: u32 = 0x1000_0000;

/// Size of the CCM.
pub const CCM_BYTES: u32 = 32 * 1_024;

/// Request numbers of the multiplexer (RM0440, table 91).
const REQUEST_OF_ADC: [u32; 2] = [5, 36];
const REQUEST_OF_LPUART1_RX: u32 = 34;
const REQUEST_OF_LPUART1_TX: u32 = 35;

/// Interrupt numbers (RM0440, table 97).
const PVD_PVM: usize = 1;
const DMA1_CHANNEL1: usize = 11;
const DMA1_CHANNEL8: usize = 96;
const ADC1_2: usize = 18;
const TIM1_UP_TIM16: usize = 25;
const TIM3: usize = 29;
const TIM4: usize = 30;
const TIM7_DAC: usize = 55;
const LPUART1: usize = 91;

/// External interrupt line of the voltage detector.
const EXTI_PVD: u32 = 16;

/// The rig's pins (firmware/README.md): port and number.
const PIN_RELAY: (usize, u8) = (2, 7);
const PIN_STEP: (usize, u8) = (1, 4);
const PIN_DIRECTION: (usize, u8) = (1, 5);
const PIN_MOTOR_OFF: (usize, u8) = (1, 10);
const PIN_LIMIT: (usize, u8) = (0, 8);
const PIN_EMERGENCY_STOP: (usize, u8) = (0, 9);
const PIN_DRIVE: (usize, u8) = (0, 4);
const PIN_TX: (usize, u8) = (0, 2);
const PIN_RX: (usize, u8) = (0, 3);

/// Converter (from 0), channel, pin and sensor of each analogue input.
const INPUTS: [(usize, u8, (usize, u8), Sensor); 5] = [
    (0, 1, (0, 0), Sensor::X),
    (0, 2, (0, 1), Sensor::Z),
    (0, 6, (2, 0), Sensor::SpringForce),
    (1, 7, (2, 1), Sensor::WallLow),
    (1, 8, (2, 2), Sensor::WallHigh),
];

/// The chip's peripherals by bus address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Block {
    Tim3,
    Tim4,
    Tim7,
    Tim16,
    Iwdg,
    Pwr,
    Lpuart1,
    Syscfg,
    Dma1,
    Dmamux,
    Rcc,
    Flash,
    Gpio(usize),
    Adc(usize),
    Adc12Common,
    Dac1,
    Dwt,
    Nvic,
    Scs,
    Dbgmcu,
    Exti,
}

/// Name, first address, length, clock.
const MAP: [(&str, u32, u32, Block, Option<Gate>); 28] = [
    ("EXTI", 0x4001_0400, 0x400, Block::Exti, None),
    ("DMA1", 0x4002_0000, 0x400, Block::Dma1, Some(Gate::Ahb1(0))),
    ("LPUART1", 0x4000_8000, 0x400, Block::Lpuart1, Some(Gate::Apb1High(0))),
    ("ADC1", 0x5000_0000, 0x100, Block::Adc(0), Some(Gate::Ahb2(13))),
    ("ADC2", 0x5000_0100, 0x100, Block::Adc(1), Some(Gate::Ahb2(13))),
    ("ADC12_COMMON", 0x5000_0300, 0x100, Block::Adc12Common, Some(Gate::Ahb2(13))),
    ("DAC1", 0x5000_0800, 0x400, Block::Dac1, Some(Gate::Ahb2(16))),
    ("GPIOA", 0x4800_0000, 0x400, Block::Gpio(0), Some(Gate::Ahb2(0))),
    ("GPIOB", 0x4800_0400, 0x400, Block::Gpio(1), Some(Gate::Ahb2(1))),
    ("GPIOC", 0x4800_0800, 0x400, Block::Gpio(2), Some(Gate::Ahb2(2))),
    ("GPIOD", 0x4800_0c00, 0x400, Block::Gpio(3), Some(Gate::Ahb2(3))),
    ("GPIOE", 0x4800_1000, 0x400, Block::Gpio(4), Some(Gate::Ahb2(4))),
    ("GPIOF", 0x4800_1400, 0x400, Block::Gpio(5), Some(Gate::Ahb2(5))),
    ("GPIOG", 0x4800_1800, 0x400, Block::Gpio(6), Some(Gate::Ahb2(6))),
    ("TIM16", 0x4001_4400, 0x400, Block::Tim16, Some(Gate::Apb2(17))),
    ("TIM7", 0x4000_1400, 0x400, Block::Tim7, Some(Gate::Apb1(5))),
    ("IWDG", 0x4000_3000, 0x400, Block::Iwdg, None),
    ("TIM3", 0x4000_0400, 0x400, Block::Tim3, Some(Gate::Apb1(1))),
    ("TIM4", 0x4000_0800, 0x400, Block::Tim4, Some(Gate::Apb1(2))),
    ("DWT", 0xe000_1000, 0x1000, Block::Dwt, None),
    ("NVIC", 0xe000_e100, 0x400, Block::Nvic, None),
    ("SCS", 0xe000_e000, 0x1000, Block::Scs, None),
    ("RCC", 0x4002_1000, 0x400, Block::Rcc, None),
    ("FLASH", 0x4002_2000, 0x400, Block::Flash, Some(Gate::Ahb1(8))),
    ("PWR", 0x4000_7000, 0x400, Block::Pwr, Some(Gate::Apb1(28))),
    ("DMAMUX", 0x4002_0800, 0x400, Block::Dmamux, Some(Gate::Ahb1(2))),
    ("SYSCFG", 0x4001_0000, 0x30, Block::Syscfg, Some(Gate::Apb2(0))),
    ("DBGMCU", 0xe004_2000, 0x400, Block::Dbgmcu, None),
];

/// The register of the system control space that this file handles.
const DEMCR: u32 = 0xdfc;

/// A change of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The drive's code changed; `None` while the converter is off.
    Drive(Option<u16>),
    /// The relay's coil was switched.
    Relay(bool),
    /// The motor's driver was switched off or on.
    MotorOff(bool),
    /// The motor's direction changed: whether towards the structure.
    Direction(bool),
    /// The motor's step output changed.
    Step(bool),
    /// The chip was reset.
    Reset,
    /// A note from a test.
    Mark(&'static str),
}

/// Configuration of a run besides its image.
#[derive(Clone, Debug)]
pub struct Config {
    /// The simulated rig.
    pub plant: PlantConfig,
    /// The relay between output and amplifier.
    pub relay: Relay,
    /// Whether the board's crystal oscillates.
    pub has_crystal: bool,
    /// The internal low-speed oscillator's frequency, Hz.
    pub lsi_hz: u64,
    /// Contents of the second bank of the flash at power-on, for example from an earlier run.
    pub bank2: Bank2,
    /// The flash operation at which the supply fails, counted from 0.
    pub cut: Option<(u64, Cut)>,
    /// FLASH_OPTR.
    pub option_bytes: u32,
    /// The supply at power-on, V.
    pub supply_v: f64,
}

impl Config {
    /// A board in its delivery state, wired to this rig.
    #[must_use]
    pub fn new(plant: PlantConfig) -> Self {
        Self {
            plant,
            relay: Relay::default(),
            has_crystal: true,
            lsi_hz: 32_000,
            bank2: Bank2::default(),
            cut: None,
            option_bytes: OPTR_DELIVERED,
            supply_v: REFERENCE_V,
        }
    }
}

/// The chip and the rig that its pins are wired to.
#[derive(Debug)]
pub struct Chip {
    /// The present device time.
    pub now: Time,
    rcc: Rcc,
    pwr: Pwr,
    flash: Flash,
    ports: [Gpio; 7],
    adcs: [Adc; 2],
    adc_common: adc::Common,
    dma1: Dma,
    dmamux: Dmamux,
    tim3: Tim,
    tim4: Tim,
    tim7: Tim,
    tim16: Tim,
    dac1: Dac,
    lpuart1: Lpuart,
    iwdg: Iwdg,
    dbgmcu: Dbgmcu,
    dwt: Dwt,
    exti: Exti,
    /// The interrupt controller.
    pub nvic: Nvic,
    scb: Scb,
    /// The clocks' periods and the present time, passed with each access.
    at: At,
    plant: Plant,
    outputs: Outputs,
    /// Every change of an output, in order.
    trace: Vec<(Time, Output)>,
    /// Half words that DMA has written and that the caller must copy to memory: address and bytes, in order.
    pub memory: Vec<(u32, Vec<u8>)>,
    /// Failure found outside an access.
    pub failure: Option<Refused>,
    /// End of the core's wait for the flash.
    pub stalled_until: Time,
    /// The channel that is about to read memory.
    source_wanted: Option<usize>,
    /// Data of the DMA channel that feeds the serial line.
    source: Vec<u8>,
    /// Rules of the reference manual that the program broke and that the chip tolerates, with their first time.
    deviations: Vec<(Time, &'static str)>,
    /// Time at which HCLK rose above 80 MHz with the AHB's prescaler at 2.
    half_speed_since: Option<Time>,
    stop_line_is_shorted: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Outputs {
    drive: Option<u16>,
    relay: bool,
    motor_off: bool,
    direction: bool,
    step: bool,
}

impl Chip {
    /// A chip that has just been powered on.
    ///
    /// # Errors
    /// Names a value of the rig that is not physical.
    pub fn new(config: &Config) -> Result<Self, Invalid> {
        let mut rcc = Rcc::new(ResetCause::Power);
        rcc.has_crystal = config.has_crystal;
        rcc.lsi_hz = config.lsi_hz;
        let clocks = rcc.clocks();
        let mut plant = Plant::new(&config.plant, config.relay)?;
        plant.set_supply(Time(0), config.supply_v);
        let mut flash = Flash::new(config.bank2.clone(), config.option_bytes);
        flash.cut = config.cut;
        let tim = |name, kind| Tim::new(name, kind, clocks.timers1);
        let mut chip = Self {
            now: Time(0),
            rcc,
            pwr: Pwr::new(config.supply_v, flash.brown_out_level()),
            flash,
            ports: ['A', 'B', 'C', 'D', 'E', 'F', 'G'].map(Gpio::new),
            adcs: [Adc::new("ADC1"), Adc::new("ADC2")],
            adc_common: adc::Common::default(),
            dma1: Dma::default(),
            dmamux: Dmamux::default(),
            tim3: tim("TIM3", Kind::General),
            tim4: tim("TIM4", Kind::General),
            tim7: tim("TIM7", Kind::Basic),
            tim16: tim("TIM16", Kind::OneChannel),
            dac1: Dac::default(),
            lpuart1: Lpuart::new(),
            iwdg: Iwdg::default(),
            dbgmcu: Dbgmcu::default(),
            dwt: Dwt::default(),
            exti: Exti::default(),
            nvic: Nvic::default(),
            scb: Scb::default(),
            at: At { now: Time(0), clocks },
            plant,
            outputs: Outputs { drive: None, relay: false, motor_off: true, direction: false, step: true },
            trace: Vec::new(),
            memory: Vec::new(),
            failure: None,
            stalled_until: Time(0),
            source_wanted: None,
            source: Vec::new(),
            deviations: Vec::new(),
            half_speed_since: None,
            stop_line_is_shorted: false,
        };
        chip.apply_inputs();
        Ok(chip)
    }

    /// Resets the chip while the supply stays on.
    pub fn reset(&mut self, cause: ResetCause) {
        self.at.now = self.now;
        self.sync_converters();
        self.rcc.system_reset(cause);
        self.pwr.reset();
        self.exti = Exti::default();
        self.flash.reset();
        self.ports.iter_mut().for_each(Gpio::reset);
        self.adcs.iter_mut().for_each(Adc::reset);
        self.adc_common = adc::Common::default();
        self.dma1 = Dma::default();
        self.dmamux = Dmamux::default();
        for tim in [&mut self.tim3, &mut self.tim4, &mut self.tim7, &mut self.tim16] {
            tim.reset();
        }
        self.dac1 = Dac::default();
        self.lpuart1.reset();
        self.iwdg = Iwdg::default();
        self.nvic = Nvic::default();
        self.scb = Scb::default();
        self.trace.push((self.now, Output::Reset));
        self.follow_clocks();
        self.apply_inputs();
        self.apply_outputs();
    }

    /// The reset that the chip requests, if any.
    #[must_use]
    pub fn wants_reset(&self) -> Option<ResetCause> {
        if self.scb.reset_requested {
            return Some(ResetCause::Software);
        }
        (self.iwdg.expires() <= self.now).then_some(ResetCause::Watchdog)
    }

    /// The period of the core's clock.
    #[must_use]
    pub fn cycle(&self) -> Time {
        self.at.clocks.hclk
    }

    /// Address of the vector table; the flash is mapped at 0 too.
    #[must_use]
    pub fn vectors(&self) -> u32 {
        if self.scb.vtor() < FLASH_BYTES { FLASH_BASE + self.scb.vtor() } else { self.scb.vtor() }
    }

    /// Whether the program has switched the floating-point unit on.
    #[must_use]
    pub fn has_fpu(&self) -> bool {
        self.scb.has_fpu()
    }

    /// The simulated rig.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Every change of an output so far.
    #[must_use]
    pub fn trace(&self) -> &[(Time, Output)] {
        &self.trace
    }

    /// Adds a note to the trace of outputs.
    pub fn mark(&mut self, what: &'static str) {
        self.trace.push((self.now, Output::Mark(what)));
    }

    /// Rules of the reference manual that the program broke and that the chip tolerates, with their first time.
    #[must_use]
    pub fn deviations(&self) -> &[(Time, &'static str)] {
        &self.deviations
    }

    /// The second bank of the flash.
    #[must_use]
    pub fn bank2(&self) -> &Bank2 {
        &self.flash.bank2
    }

    /// Whether the supply has failed during a flash operation.
    #[must_use]
    pub fn has_no_supply(&self) -> bool {
        self.flash.is_cut
    }

    /// Number of programmed double words and erased pages.
    #[must_use]
    pub fn flash_operations(&self) -> u64 {
        self.flash.operations
    }

    /// Number of bytes that the UART lost.
    #[must_use]
    pub fn bytes_lost(&self) -> u64 {
        self.lpuart1.lost
    }

    /// Queues bytes from the host on the line.
    pub fn host_sends(&mut self, bytes: &[u8]) {
        self.at.now = self.now;
        self.lpuart1.host_sends(bytes, &self.at);
    }

    /// Bytes sent by the board since the last call.
    pub fn take_sent(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.lpuart1.sent)
    }

    /// Whether a halt by a debugger stops the watchdog.
    #[must_use]
    pub fn freezes_watchdog(&self) -> bool {
        self.dbgmcu.freezes_watchdog()
    }

    /// Postpones the watchdog by the time during which it was frozen.
    pub fn postpone_watchdog(&mut self, time: Time) {
        self.iwdg.postpone(time);
    }

    /// Stops the crystal. The clock security system, which must be on, switches to the internal oscillator and raises
    /// the non-maskable interrupt.
    pub fn stop_crystal(&mut self) {
        self.sync_converters();
        self.rcc.stop_crystal();
        self.follow_clocks();
        self.nvic.pend_system(NMI);
    }

    /// Reports an access to a flash double word with an error that the ECC cannot correct.
    pub fn damage_flash(&mut self, in_bank2: bool) {
        self.flash.find_damage(in_bank2);
        self.nvic.pend_system(NMI);
    }

    /// Makes bits of a byte of the second bank, at this offset, read as 0 from now on, without an error.
    pub fn stick_flash(&mut self, offset: u32, bits: u8) {
        self.flash.stuck = Some((offset, bits));
    }

    /// Changes the supply voltage, which is also the analogue reference. Below the brown-out level of the option bytes the
    /// chip is held in reset.
    pub fn set_supply(&mut self, volts: f64) {
        self.at.now = self.now;
        self.sync_converters();
        self.plant.set_supply(self.now, volts);
        if self.pwr.set_supply(volts, self.flash.brown_out_level()) {
            self.exti.rises(EXTI_PVD);
        }
        self.set_lines();
    }

    /// Whether the supply is too low for the chip to run.
    #[must_use]
    pub fn is_browned_out(&self) -> bool {
        self.pwr.is_browned_out()
    }

    /// Injects a fault into the rig, or ends it.
    pub fn inject(&mut self, fault: &InjectedFault) {
        self.at.now = self.now;
        self.sync_converters();
        self.plant.inject(self.now, fault);
        self.apply_inputs();
    }

    /// A hand holds the structure at this displacement, m, or releases it.
    pub fn hold(&mut self, at_m: Option<f64>) {
        self.plant.hold(self.now, at_m);
    }

    /// Applies the switches to their pins: closed means low, open means tripped.
    fn apply_inputs(&mut self) {
        let (port, pin) = PIN_LIMIT;
        self.ports[port].connect(pin, (!self.plant.at_limit()).then_some(false));
        let (port, pin) = PIN_EMERGENCY_STOP;
        let is_closed = !self.plant.is_stopped() || self.stop_line_is_shorted;
        self.ports[port].connect(pin, is_closed.then_some(false));
    }

    /// Shorts the line of the emergency stop's contact 2 to ground: the controller no longer sees it open.
    pub fn short_stop_line(&mut self) {
        self.stop_line_is_shorted = true;
        self.apply_inputs();
    }

    /// Applies the chip's outputs to the rig.
    fn apply_outputs(&mut self) {
        let output = |ports: &[Gpio; 7], (port, pin): (usize, u8)| ports[port].output(pin);
        let is_driven = self.ports[PIN_DRIVE.0].mode(PIN_DRIVE.1) == Mode::Analog;
        let step = match self.ports[PIN_STEP.0].mode(PIN_STEP.1) {
            Mode::Alternate(1) => self.tim16.output1(self.now),
            Mode::Output => output(&self.ports, PIN_STEP) == Some(true),
            // After a reset this pin is NJTRST with its pull-up.
            _ => self.ports[PIN_STEP.0].pulled_up(PIN_STEP.1),
        };
        let new = Outputs {
            drive: self.dac1.output().filter(|_| is_driven),
            // External pull-down.
            relay: output(&self.ports, PIN_RELAY) == Some(true),
            // External pull-up.
            motor_off: output(&self.ports, PIN_MOTOR_OFF) != Some(false),
            direction: output(&self.ports, PIN_DIRECTION) == Some(true),
            step,
        };
        let old = std::mem::replace(&mut self.outputs, new);
        if new == old {
            return;
        }
        let now = self.now;
        if new.drive != old.drive {
            let volts = new.drive.map_or(0.0, |code| f64::from(code) / 4_095.0 * self.plant.supply_v());
            self.plant.set_output(now, volts, new.drive.is_some() && self.dac1.is_buffered());
            self.trace.push((now, Output::Drive(new.drive)));
        }
        if new.relay != old.relay {
            self.plant.set_coil(now, new.relay);
            self.trace.push((now, Output::Relay(new.relay)));
        }
        if new.motor_off != old.motor_off {
            self.trace.push((now, Output::MotorOff(new.motor_off)));
        }
        if new.direction != old.direction {
            self.trace.push((now, Output::Direction(new.direction)));
        }
        if new.step != old.step {
            self.trace.push((now, Output::Step(new.step)));
            if new.step {
                self.plant.step_motor(now, new.direction, !new.motor_off);
                self.apply_inputs();
            }
        }
    }

    /// Time of the next spontaneous event that the core is notified of or that changes an output.
    #[must_use]
    pub fn next_event(&self) -> Time {
        let timers = [&self.tim3, &self.tim4, &self.tim7, &self.tim16].map(|tim| tim.next_event(self.now));
        let converters = [0, 1].map(|n| self.next_transfer_interrupt(n));
        timers
            .into_iter()
            .chain(converters)
            .chain([self.lpuart1.next_event(), self.iwdg.expires()])
            .min()
            .unwrap_or(Time::NEVER)
    }

    /// Time at which a converter's DMA channel next raises its half-transfer or transfer-complete interrupt.
    fn next_transfer_interrupt(&self, n: usize) -> Time {
        let adc = &self.adcs[n];
        let channel = self.dmamux.channel_of(REQUEST_OF_ADC[n]).filter(|&channel| channel < CHANNELS);
        let (Some(channel), Some(timer)) = (channel, self.trigger_of(n)) else { return Time::NEVER };
        match self.dma1.transfers_to_interrupt(channel) {
            Some(transfers) if adc.requests_dma() => {
                adc.nth_result(transfers, |after| timer.trigger_after(after), timer.trigger_period())
            }
            _ => Time::NEVER,
        }
    }

    /// The timer that starts a converter's sequences.
    fn trigger_of(&self, n: usize) -> Option<&Tim> {
        // EXTSEL (RM0440, table 166).
        match self.adcs[n].trigger()? {
            4 => Some(&self.tim3),
            12 => Some(&self.tim4),
            _ => None,
        }
    }

    /// Processes everything due up to now.
    pub fn settle(&mut self) {
        self.at.now = self.now;
        if self.next_transfer_interrupt(0).min(self.next_transfer_interrupt(1)) <= self.now {
            self.sync_converters();
        }
        for tim in [&mut self.tim3, &mut self.tim4, &mut self.tim7, &mut self.tim16] {
            tim.sync(self.now);
        }
        self.sync_line();
        self.apply_outputs();
        self.set_lines();
    }

    /// The channel of a request, if it is ready for a transfer.
    fn ready_channel(&self, request: u32) -> Option<usize> {
        self.dmamux.channel_of(request).filter(|&channel| channel < CHANNELS && self.dma1.is_ready(channel))
    }

    /// Processes the serial line up to now, including its DMA transfers.
    fn sync_line(&mut self) {
        self.lpuart1.sync(&self.at);
        while let Some(byte) = self.lpuart1.give_dma() {
            match self.ready_channel(REQUEST_OF_LPUART1_RX) {
                Some(channel) => {
                    let (address, _) = self.dma1.transfer(channel);
                    self.memory.push((address, vec![byte]));
                }
                None => self.lpuart1.keep(byte),
            }
        }
        while self.lpuart1.wants_dma()
            && self.source_wanted.is_none()
            && let Some(channel) = self.ready_channel(REQUEST_OF_LPUART1_TX)
        {
            let (address, _) = self.dma1.transfer(channel);
            let byte = self.source[(address - self.dma1.memory(channel).0) as usize];
            if let Err(refused) = self.lpuart1.send(byte, &self.at) {
                self.failure = Some(refused);
            }
        }
    }

    /// The memory range that a channel is about to read: first address and bytes.
    #[must_use]
    pub fn source_wanted(&self) -> Option<(u32, u32)> {
        self.source_wanted.map(|channel| self.dma1.memory(channel))
    }

    /// Supplies the contents of that range. The program does not change it while it is read.
    pub fn give_source(&mut self, bytes: Vec<u8>) {
        self.source = bytes;
        self.source_wanted = None;
        self.sync_line();
    }

    /// Computes the converters' results up to now and queues their transfers to memory.
    fn sync_converters(&mut self) {
        self.plant.advance(self.now);
        for n in 0..2 {
            self.sync_converter(n);
        }
    }

    fn sync_converter(&mut self, n: usize) {
        let timer = match self.adcs[n].trigger() {
            Some(4) => Some(&self.tim3),
            Some(12) => Some(&self.tim4),
            Some(_) => return,
            None => None,
        };
        let channel = self.dmamux.channel_of(REQUEST_OF_ADC[n]).filter(|&channel| channel < CHANNELS);
        let data_register = 0x5000_0000 + 0x100 * n as u32 + adc::DR;
        loop {
            let plant = &mut self.plant;
            let converted = self.adcs[n].convert(
                self.now,
                |after| timer?.trigger_after(after),
                |channel, time| match input(n, channel) {
                    Some((_, sensor)) => plant.code(sensor, time),
                    None => adc::reference_code(plant.supply_v()),
                },
            );
            let Some(converted) = converted else { return };
            if !self.adcs[n].requests_dma() {
                continue;
            }
            let Some(channel) = channel.filter(|&channel| self.dma1.is_ready(channel)) else {
                self.adcs[n].overrun();
                continue;
            };
            if self.dma1.peripheral_address(channel) != data_register {
                self.failure = Some(Refused(format!("DMA1 channel {} does not read ADC{}_DR", channel + 1, n + 1)));
                return;
            }
            let (address, bytes) = self.dma1.transfer(channel);
            self.adcs[n].taken();
            let ram = RAM_BASE..RAM_BASE + RAM_BYTES;
            if !ram.contains(&address) || !ram.contains(&(address + bytes - 1)) {
                self.failure = Some(Refused(format!("DMA1 channel {} writes to {address:#010x}", channel + 1)));
                return;
            }
            let data = &converted.data.to_le_bytes()[..bytes as usize];
            match self.memory.last_mut() {
                Some((start, run)) if *start + run.len() as u32 == address => run.extend_from_slice(data),
                _ => self.memory.push((address, data.to_vec())),
            }
        }
    }

    /// Updates the levels of the interrupt lines.
    fn set_lines(&mut self) {
        for n in 0..CHANNELS {
            let interrupt = if n == 7 { DMA1_CHANNEL8 } else { DMA1_CHANNEL1 + n };
            self.nvic.set_line(interrupt, self.dma1.interrupt(n));
        }
        for (interrupt, level) in [
            (ADC1_2, self.adcs.iter().any(Adc::interrupt)),
            (TIM1_UP_TIM16, self.tim16.interrupt()),
            (TIM3, self.tim3.interrupt()),
            (TIM4, self.tim4.interrupt()),
            (TIM7_DAC, self.tim7.interrupt()),
            (LPUART1, self.lpuart1.interrupt()),
            (PVD_PVM, self.exti.interrupt(EXTI_PVD)),
        ] {
            self.nvic.set_line(interrupt, level);
        }
    }

    /// Applies changed clock periods.
    fn follow_clocks(&mut self) {
        let new = self.rcc.clocks();
        if new == self.at.clocks {
            return;
        }
        self.dwt.keep(&self.at);
        self.at.clocks = new;
        self.tim3.set_clock(new.timers1, self.now);
        self.tim4.set_clock(new.timers1, self.now);
        self.tim7.set_clock(new.timers1, self.now);
        self.tim16.set_clock(new.timers2, self.now);
    }

    /// Checks that the voltage range permits the system clock, and the wait states the core's. The AHB prescaler does not divide
    /// SYSCLK: the range limits SYSCLK itself (RM0440, section 6.1.5).
    fn check_speed(&mut self, before: Time) -> Access<()> {
        let megahertz_of = |period: Time| UNITS_PER_US as f64 / period.0 as f64;
        let megahertz = megahertz_of(self.at.clocks.hclk);
        if megahertz_of(self.at.clocks.sysclk) > 150.0 && !self.pwr.is_boosted() {
            self.deviate("SYSCLK is above 150 MHz while PWR_CR5.R1MODE (bit 8) is 1: not in range 1's boost mode");
        }
        // RM0440, table 29.
        let step = if self.pwr.is_boosted() || megahertz > 150.0 { 34.0 } else { 30.0 };
        let needed = ((megahertz / step).ceil() as u32).saturating_sub(1);
        let latency = self.flash.latency();
        ensure!(latency >= needed, "FLASH_ACR: {latency} wait states at {megahertz} MHz, {needed} are needed");
        if before.0 > self.at.clocks.hclk.0 && megahertz > 80.0 {
            let is_half = self.rcc.divides_ahb_by_two();
            let was_half = self.half_speed_since.is_some_and(|since| self.now - since >= Time::from_us(1));
            self.half_speed_since = is_half.then_some(self.now);
            if !is_half && !was_half {
                self.deviate(
                    "RCC_CFGR: HCLK rises above 80 MHz at once, without 1 µs at half of it (RM0440, section 7.2.7)",
                );
            }
        }
        Ok(())
    }

    fn deviate(&mut self, rule: &'static str) {
        if !self.deviations.iter().any(|(_, known)| *known == rule) {
            self.deviations.push((self.now, rule));
        }
    }

    fn find(&self, address: u32) -> Access<(&'static str, Block, u32)> {
        let Some((name, base, _, block, gate)) =
            MAP.iter().find(|(_, base, length, ..)| (*base..*base + *length).contains(&address))
        else {
            return refuse!("nothing is modelled at {address:#010x}");
        };
        if let Some(gate) = gate {
            ensure!(self.rcc.is_enabled(*gate), "{name} is accessed while its clock is off");
            ensure!(!self.rcc.is_held(*gate), "{name} is accessed while it is held in reset");
        }
        Ok((name, *block, address - base))
    }

    /// Reads `bytes` bytes.
    ///
    /// # Errors
    /// The address is not modelled, or the access breaks a rule.
    pub fn read(&mut self, address: u32, bytes: u32) -> Access<u32> {
        ensure!(address.is_multiple_of(bytes), "a misaligned read of {bytes} bytes at {address:#010x}");
        self.at.now = self.now;
        if (BANK2_BASE..FLASH_BASE + FLASH_BYTES).contains(&address) {
            // The bus waits for an erase or programming operation in the same bank.
            self.stalled_until = self.flash.busy_until();
            if self.flash.is_damaged(address - BANK2_BASE) {
                self.nvic.pend_system(NMI);
            }
            return Ok(self.flash.read_bank2(address - BANK2_BASE, bytes));
        }
        if address == adc::VREFINT_CAL && bytes == 2 {
            return Ok(adc::factory_code().into());
        }
        let (name, block, offset) = self.find(address)?;
        let word = offset & !3;
        let takes_parts = match block {
            Block::Lpuart1 | Block::Nvic => true,
            Block::Adc(_) => bytes >= 2 && word == adc::DR,
            Block::Tim3 | Block::Tim4 | Block::Tim7 | Block::Tim16 | Block::Gpio(_) => bytes >= 2,
            _ => false,
        };
        ensure!(bytes == 4 || takes_parts, "{name} is read by {bytes} bytes at offset {offset:#05x}");
        let at = self.at;
        let value = match block {
            Block::Rcc => self.rcc.read(word, &at),
            Block::Pwr => self.pwr.read(word),
            Block::Flash => self.flash.read(word, &at),
            Block::Gpio(port) => self.ports[port].read(word),
            Block::Adc(n) => {
                self.sync_converters();
                self.adcs[n].read(word, &at)
            }
            Block::Adc12Common => self.adc_common.read(word),
            Block::Dma1 => {
                self.sync_converters();
                self.sync_line();
                self.dma1.read(word)
            }
            Block::Dmamux => self.dmamux.read(word),
            Block::Tim3 => self.tim3.read(word, at.now),
            Block::Tim4 => self.tim4.read(word, at.now),
            Block::Tim7 => self.tim7.read(word, at.now),
            Block::Tim16 => self.tim16.read(word, at.now),
            Block::Dac1 => self.dac1.read(word),
            Block::Lpuart1 => self.lpuart1.read(word, &at),
            Block::Iwdg => self.iwdg.read(word, &at),
            Block::Dbgmcu => self.dbgmcu.read(word),
            Block::Exti => self.exti.read(word),
            Block::Dwt => self.dwt.read(word, &at),
            Block::Nvic => self.nvic.read(word),
            Block::Scs if word == DEMCR => Ok(self.dwt.demcr()),
            Block::Scs => self.scb.read(word, &self.nvic),
            // MEMRMP: main flash at 0, FB_MODE 0: bank 1 comes first.
            Block::Syscfg if word == 0 => Ok(0),
            Block::Syscfg => crate::register::unknown("SYSCFG", word),
        }?;
        self.set_lines();
        let value = value >> (8 * (offset & 3));
        Ok(if bytes == 4 { value } else { value & ((1 << (8 * bytes)) - 1) })
    }

    /// Writes `bytes` bytes.
    ///
    /// # Errors
    /// The address is not modelled, or the access breaks a rule.
    pub fn write(&mut self, address: u32, bytes: u32, value: u32) -> Access<()> {
        ensure!(address.is_multiple_of(bytes), "a misaligned write of {bytes} bytes at {address:#010x}");
        self.at.now = self.now;
        if (BANK2_BASE..FLASH_BASE + FLASH_BYTES).contains(&address) {
            return self.flash.program(address - BANK2_BASE, bytes, value, &self.at);
        }
        let (name, block, offset) = self.find(address)?;
        let takes_parts = match block {
            // The data registers; the priorities.
            Block::Lpuart1 => matches!(offset, 0x24 | 0x28),
            Block::Nvic => offset >= 0x300,
            // Registers of 16 bits.
            Block::Tim3 | Block::Tim4 | Block::Tim7 | Block::Tim16 => bytes == 2 && offset.is_multiple_of(4),
            Block::Iwdg | Block::Dac1 => bytes == 2 && offset.is_multiple_of(4),
            _ => false,
        };
        ensure!(bytes == 4 || takes_parts, "{name} is written by {bytes} bytes at offset {offset:#05x}");
        let at = self.at;
        match block {
            Block::Rcc => {
                self.rcc.backup_writable = self.pwr.backup_writable();
                let before = at.clocks.hclk;
                self.rcc.write(offset, value, &at)?;
                if let Some(deviation) = self.rcc.deviation.take() {
                    self.deviate(deviation);
                }
                self.follow_clocks();
                self.check_speed(before)?;
                self.release_resets();
            }
            Block::Pwr => {
                if self.pwr.write(offset, value)? {
                    self.exti.rises(EXTI_PVD);
                }
                self.check_speed(at.clocks.hclk)?;
            }
            Block::Exti => self.exti.write(offset, value)?,
            Block::Flash => {
                self.flash.write(offset, value, &at)?;
                self.check_speed(at.clocks.hclk)?;
            }
            Block::Gpio(port) => self.ports[port].write(offset, value)?,
            Block::Adc(n) => {
                self.sync_converters();
                let was_started = self.adcs[n].is_started();
                self.adcs[n].write(offset, value, &at, &self.adc_common)?;
                if self.adcs[n].is_started() && !was_started {
                    self.check_inputs(n)?;
                }
            }
            Block::Adc12Common => {
                let one_is_on = self.adcs.iter().any(Adc::is_on);
                self.adc_common.write(offset, value, one_is_on, at.now)?;
            }
            Block::Dma1 => {
                self.sync_converters();
                self.sync_line();
                let was_on: [bool; CHANNELS] = std::array::from_fn(|n| self.dma1.is_enabled(n));
                self.dma1.write(offset, value)?;
                let begins = |n: &usize| self.dma1.is_enabled(*n) && !was_on[*n] && self.dma1.reads_memory(*n);
                self.source_wanted = (0..CHANNELS).find(begins);
            }
            Block::Dmamux => {
                self.sync_converters();
                self.dmamux.write(offset, value)?;
            }
            Block::Tim3 | Block::Tim4 => {
                self.sync_converters();
                let tim = if block == Block::Tim3 { &mut self.tim3 } else { &mut self.tim4 };
                tim.write(offset, value, at.now)?;
                for n in 0..2 {
                    self.check_trigger(n)?;
                }
            }
            Block::Tim7 => self.tim7.write(offset, value, at.now)?,
            Block::Tim16 => self.tim16.write(offset, value, at.now)?,
            Block::Dac1 => self.dac1.write(offset, value, &at)?,
            Block::Lpuart1 => {
                self.lpuart1.write(offset, value, &at)?;
                if offset == 0x28 {
                    for (port, pin) in [PIN_TX, PIN_RX] {
                        let is_wired = self.ports[port].mode(pin) == Mode::Alternate(12);
                        rule(is_wired, "LPUART1 sends while PA2 or PA3 is not its pin (AF12)")?;
                    }
                }
            }
            Block::Iwdg => {
                if self.iwdg.write(offset, value, &at)? {
                    self.rcc.start_lsi(at.now);
                }
            }
            Block::Dbgmcu => self.dbgmcu.write(offset, value)?,
            Block::Dwt => self.dwt.write(offset, value, &at)?,
            Block::Nvic => self.nvic.write(offset, bytes, value)?,
            Block::Scs if offset == DEMCR => self.dwt.set_demcr(value)?,
            // STIR.
            Block::Scs if offset == 0xf00 => {
                self.nvic.write(0x100 + value / 32 * 4, 4, 1 << (value % 32))?;
            }
            Block::Scs => self.scb.write(offset, value, &mut self.nvic)?,
            Block::Syscfg => return crate::register::unknown("SYSCFG", offset),
        }
        self.apply_outputs();
        self.set_lines();
        Ok(())
    }

    /// Resets the peripherals whose reset has just been released.
    fn release_resets(&mut self) {
        if self.rcc.released.is_empty() {
            return;
        }
        for (_, _, _, block, gate) in MAP {
            if !gate.is_some_and(|gate| self.rcc.was_released(gate)) {
                continue;
            }
            match block {
                Block::Tim3 => self.tim3.reset(),
                Block::Tim4 => self.tim4.reset(),
                Block::Tim7 => self.tim7.reset(),
                Block::Tim16 => self.tim16.reset(),
                Block::Lpuart1 => self.lpuart1.reset(),
                Block::Gpio(port) => self.ports[port].reset(),
                Block::Adc(n) => self.adcs[n].reset(),
                Block::Adc12Common => self.adc_common = adc::Common::default(),
                Block::Dac1 => self.dac1 = Dac::default(),
                Block::Dma1 => self.dma1 = Dma::default(),
                Block::Dmamux => self.dmamux = Dmamux::default(),
                Block::Pwr => self.pwr.reset(),
                Block::Flash => self.flash.reset(),
                _ => {}
            }
        }
        self.rcc.released.clear();
    }

    /// Checks that each channel of a started converter is on an analogue pin of the rig, and that it has a trigger.
    fn check_inputs(&self, n: usize) -> Access<()> {
        for channel in self.adcs[n].channels() {
            if (n, channel) == (0, adc::REFERENCE_CHANNEL) {
                let has_reference = self.adc_common.has_reference(self.now);
                ensure!(
                    has_reference,
                    "ADC1 IN18: the internal reference has not been on for 12 µs (ADC12_CCR.VREFEN)"
                );
                ensure!(
                    self.adcs[n].samples_reference(channel),
                    "ADC1 IN18: the reference is sampled for 4 µs or more"
                );
                continue;
            }
            let Some(((port, pin), _)) = input(n, channel) else {
                return refuse!("ADC{} IN{channel} is not wired", n + 1);
            };
            let is_analog = self.ports[port].mode(pin) == Mode::Analog;
            ensure!(is_analog, "ADC{} IN{channel}: its pin is not analogue", n + 1);
        }
        let is_modelled = self.adcs[n].trigger().is_none() || self.trigger_of(n).is_some();
        ensure!(is_modelled, "ADC{}: its trigger is not modelled", n + 1);
        self.check_trigger(n)
    }

    /// Checks that a sequence ends before the next begins.
    fn check_trigger(&self, n: usize) -> Access<()> {
        let Some(timer) = self.trigger_of(n).filter(|timer| timer.trigger_after(self.now).is_some()) else {
            return Ok(());
        };
        let fits = !self.adcs[n].is_started() || self.adcs[n].sequence_length() < timer.trigger_period();
        ensure!(fits, "ADC{}: a sequence takes longer than its trigger's period", n + 1);
        Ok(())
    }
}

/// The pin and the sensor of a converter's channel.
fn input(n: usize, channel: u8) -> Option<((usize, u8), Sensor)> {
    INPUTS.iter().find(|(adc, number, ..)| (*adc, *number) == (n, channel)).map(|(.., pin, sensor)| (*pin, *sensor))
}
