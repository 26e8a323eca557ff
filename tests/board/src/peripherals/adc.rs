//! ADC1 and ADC2 with their common registers (RM0440, section 21): regular sequences of single-ended channels, started by
//! a timer or by software, with hardware oversampling, calibration, the switch-on order, the internal reference, and the
//! write rules of the registers.

use crate::register::{Access, bit, field, only, refuse, rule, unchanged, unknown};
use crate::time::{At, Time};

const ISR: u32 = 0x00;
const IER: u32 = 0x04;
const CR: u32 = 0x08;
const CFGR: u32 = 0x0c;
const CFGR2: u32 = 0x10;
const SMPR1: u32 = 0x14;
const SMPR2: u32 = 0x18;
const SQR1: u32 = 0x30;
const SQR4: u32 = 0x3c;
/// The data register.
pub const DR: u32 = 0x40;
const DIFSEL: u32 = 0xb0;
const CALFACT: u32 = 0xb4;

const COMMON_CSR: u32 = 0x00;
const COMMON_CCR: u32 = 0x08;

const ISR_ADRDY: u32 = 1 << 0;
const ISR_EOC: u32 = 1 << 2;
const ISR_EOS: u32 = 1 << 3;
const ISR_OVR: u32 = 1 << 4;

const CR_ADEN: u32 = 1 << 0;
const CR_ADDIS: u32 = 1 << 1;
const CR_ADSTART: u32 = 1 << 2;
const CR_ADSTP: u32 = 1 << 4;
const CR_ADVREGEN: u32 = 1 << 28;
const CR_DEEPPWD: u32 = 1 << 29;
const CR_ADCALDIF: u32 = 1 << 30;
const CR_ADCAL: u32 = 1 << 31;

const CCR_PRESC: u32 = 0xf << 18;
const CCR_VREFEN: u32 = 1 << 22;

/// ADC1's channel of the internal reference.
pub const REFERENCE_CHANNEL: u8 = 18;

/// Address of VREFINT_CAL: the reference's code, measured in production at a supply of 3.0 V (DS12288, section 3.18.2).
pub const VREFINT_CAL: u32 = 0x1fff_75aa;

/// Voltage of the internal reference, V, and of the supply at its factory measurement.
const VREFINT_V: f64 = 1.212;
const FACTORY_SUPPLY_V: f64 = 3.0;

/// Start-up time of the reference's buffer, and its shortest sampling time (DS12288, table 18).
const REFERENCE_STARTS: Time = Time::from_us(12);
const REFERENCE_SAMPLING: Time = Time::from_us(4);

/// Code of the internal reference at this supply, V.
#[must_use]
pub fn reference_code(supply_v: f64) -> u16 {
    (VREFINT_V / supply_v * 4_095.0).round() as u16
}

/// Contents of [`VREFINT_CAL`].
#[must_use]
pub fn factory_code() -> u16 {
    reference_code(FACTORY_SUPPLY_V)
}

const CFGR_DMAEN: u32 = 1 << 0;
const CFGR_RESET: u32 = 1 << 31;

/// Start-up time of the voltage regulator (DS12288, table 66).
const REGULATOR_STARTS: Time = Time::from_us(20);

/// Duration of a calibration, cycles of the converter's clock.
const CALIBRATION_CYCLES: u64 = 116;

/// From ADEN to ADRDY, cycles: one conversion at the shortest sampling time.
const READY_CYCLES: u64 = 15;

/// From a trigger to the start of sampling, cycles.
const LATENCY_CYCLES: u64 = 2;

/// Shortest clock period of a single active converter, units: 60 MHz.
const FASTEST: Time = Time(68);

/// A completed conversion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Converted {
    /// Time of completion.
    pub at: Time,
    /// Contents of the data register after it.
    pub data: u32,
}

/// One converter.
#[derive(Clone, Debug)]
pub struct Adc {
    name: &'static str,
    isr: u32,
    ier: u32,
    cr: u32,
    cfgr: u32,
    cfgr2: u32,
    smpr: [u32; 2],
    sqr: [u32; 4],
    dr: u32,
    difsel: u32,
    calibrated: [bool; 2],
    regulator_ready: Time,
    calibration_ends: Time,
    ready: Time,
    /// Time of the last processed trigger.
    last_trigger: Time,
    /// The running sequence: start of its sampling, and number of completed channels.
    sequence: Option<(Time, u32)>,
    /// Period of the converter's clock while it runs.
    cycle: Time,
}

/// Registers common to both converters.
#[derive(Clone, Copy, Debug, Default)]
pub struct Common {
    ccr: u32,
    /// Time at which the internal reference was connected.
    reference_since: Time,
}

impl Common {
    /// Period of the converters' clock.
    #[must_use]
    pub fn cycle(&self, at: &At) -> Option<Time> {
        let presc = field(self.ccr, 18, 4) as usize;
        Some(at.clocks.adc12? * *[1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256].get(presc)?)
    }

    /// Whether the internal reference is connected and has started.
    #[must_use]
    pub fn has_reference(&self, now: Time) -> bool {
        self.ccr & CCR_VREFEN != 0 && now >= self.reference_since + REFERENCE_STARTS
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32) -> Access<u32> {
        match offset {
            COMMON_CCR => Ok(self.ccr),
            COMMON_CSR => unknown("ADC12_COMMON", offset),
            _ => unknown("ADC12_COMMON", offset),
        }
    }

    /// Writes a register; `one_is_on` is set while either converter is enabled.
    ///
    /// # Errors
    /// The register or a bit is not modelled, or the prescaler is changed while a converter is on.
    pub fn write(&mut self, offset: u32, value: u32, one_is_on: bool, now: Time) -> Access<()> {
        match offset {
            COMMON_CCR => {
                only("ADC12_CCR", value, CCR_PRESC | CCR_VREFEN)?;
                let is_same = (value ^ self.ccr) & CCR_PRESC == 0;
                rule(is_same || !one_is_on, "ADC12_CCR: PRESC is written while a converter is enabled")?;
                if value & !self.ccr & CCR_VREFEN != 0 {
                    self.reference_since = now;
                }
                self.ccr = value;
                Ok(())
            }
            _ => unknown("ADC12_COMMON", offset),
        }
    }
}

impl Adc {
    /// The state after a reset.
    #[must_use]
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            isr: 0,
            ier: 0,
            cr: CR_DEEPPWD,
            cfgr: CFGR_RESET,
            cfgr2: 0,
            smpr: [0; 2],
            sqr: [0; 4],
            dr: 0,
            difsel: 0,
            calibrated: [false; 2],
            regulator_ready: Time::NEVER,
            calibration_ends: Time(0),
            ready: Time::NEVER,
            last_trigger: Time(0),
            sequence: None,
            cycle: Time(0),
        }
    }

    /// The state after a reset.
    pub fn reset(&mut self) {
        *self = Self::new(self.name);
    }

    /// ADEN: the converter is enabled.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.cr & CR_ADEN != 0
    }

    /// ADSTART: triggers start sequences.
    #[must_use]
    pub fn is_started(&self) -> bool {
        self.cr & CR_ADSTART != 0
    }

    /// EXTSEL: the event that starts a sequence; `None` if software starts it.
    #[must_use]
    pub fn trigger(&self) -> Option<u32> {
        (field(self.cfgr, 10, 2) != 0).then_some(field(self.cfgr, 5, 5))
    }

    /// Whether the sampling time of a channel is long enough for the internal reference.
    #[must_use]
    pub fn samples_reference(&self, channel: u8) -> bool {
        self.halves(self.sampling(channel)) >= REFERENCE_SAMPLING
    }

    /// The channels of the sequence, in order.
    #[must_use]
    pub fn channels(&self) -> Vec<u8> {
        (0..self.length()).map(|rank| self.channel(rank)).collect()
    }

    fn length(&self) -> u32 {
        field(self.sqr[0], 0, 4) + 1
    }

    fn channel(&self, rank: u32) -> u8 {
        // SQR1 contains the length and four channels, the other registers five channels each.
        let (register, place) = if rank < 4 { (0, rank + 1) } else { ((rank - 4) / 5 + 1, (rank - 4) % 5) };
        field(self.sqr[register as usize], 6 * place, 5) as u8
    }

    /// Sampling time of a channel, half cycles.
    fn sampling(&self, channel: u8) -> u64 {
        let smp = field(self.smpr[usize::from(channel / 10)], 3 * u32::from(channel % 10), 3);
        [5, 13, 25, 49, 95, 185, 495, 1281][smp as usize]
    }

    /// Duration of a conversion, half cycles: sampling plus 12.5 cycles.
    fn conversion(&self, channel: u8) -> u64 {
        self.sampling(channel) + 25
    }

    /// Number of conversions added to one result.
    fn oversampling(&self) -> u64 {
        if bit(self.cfgr2, 0) { 2 << field(self.cfgr2, 2, 3) } else { 1 }
    }

    fn halves(&self, count: u64) -> Time {
        Time(self.cycle.0 * count / 2)
    }

    /// Time from the start of a sequence to the result of `rank`.
    fn until(&self, rank: u32) -> Time {
        let halves = (0..=rank).map(|rank| self.conversion(self.channel(rank))).sum::<u64>();
        self.halves(halves * self.oversampling())
    }

    /// Time from the start of a sequence to its end.
    #[must_use]
    pub fn sequence_length(&self) -> Time {
        self.until(self.length() - 1)
    }

    /// Time of the `n`th result from now (from 1); `trigger` returns the first trigger after a time, `period` is the
    /// time between triggers.
    #[must_use]
    pub fn nth_result(&self, n: u32, trigger: impl Fn(Time) -> Option<Time>, period: Time) -> Time {
        if !self.is_started() || n == 0 {
            return Time::NEVER;
        }
        let length = self.length();
        let mut n = n - 1;
        if let Some((start, done)) = self.sequence {
            if n < length - done {
                return start + self.until(done + n);
            }
            n -= length - done;
        }
        let Some(first) = trigger(self.last_trigger) else { return Time::NEVER };
        first + self.latency() + period * u64::from(n / length) + self.until(n % length)
    }

    fn latency(&self) -> Time {
        self.cycle * LATENCY_CYCLES
    }

    /// The next result completed by `now`, if any; `sample` returns the 12-bit code of a channel at a time.
    pub fn convert(
        &mut self,
        now: Time,
        trigger: impl Fn(Time) -> Option<Time>,
        mut sample: impl FnMut(u8, Time) -> u16,
    ) -> Option<Converted> {
        if !self.is_started() {
            return None;
        }
        let (start, rank) = match self.sequence {
            Some(sequence) => sequence,
            None => {
                let at = trigger(self.last_trigger).filter(|&at| at <= now)?;
                self.last_trigger = at;
                self.sequence = Some((at + self.latency(), 0));
                (at + self.latency(), 0)
            }
        };
        let at = start + self.until(rank);
        if at > now {
            return None;
        }
        let channel = self.channel(rank);
        let (sampling, conversion, count) = (self.sampling(channel), self.conversion(channel), self.oversampling());
        let begun = at - self.halves(conversion * count);
        // The input is held at the end of the sampling time.
        let sum: u32 =
            (0..count).map(|n| u32::from(sample(channel, begun + self.halves(conversion * n + sampling)))).sum();
        let data = if count > 1 { sum >> field(self.cfgr2, 5, 4) & 0xffff } else { sum };
        let is_last = rank + 1 == self.length();
        self.sequence = (!is_last).then_some((start, rank + 1));
        self.dr = data;
        self.isr |= ISR_EOC | if is_last { ISR_EOS } else { 0 };
        if is_last && self.trigger().is_none() {
            self.cr &= !CR_ADSTART;
        }
        Some(Converted { at, data })
    }

    /// Whether results go to a DMA channel and no overrun has occurred.
    #[must_use]
    pub fn requests_dma(&self) -> bool {
        self.cfgr & CFGR_DMAEN != 0 && self.isr & ISR_OVR == 0
    }

    /// Marks the result as read.
    pub fn taken(&mut self) {
        self.isr &= !ISR_EOC;
    }

    /// Marks an overrun: the result was not read before the next one.
    pub fn overrun(&mut self) {
        self.isr |= ISR_OVR;
    }

    /// Whether an interrupt is requested.
    #[must_use]
    pub fn interrupt(&self) -> bool {
        self.isr & self.ier != 0
    }

    fn current_cr(&self, now: Time) -> u32 {
        if now < self.calibration_ends { self.cr | CR_ADCAL } else { self.cr }
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&mut self, offset: u32, at: &At) -> Access<u32> {
        Ok(match offset {
            ISR => self.isr | if self.is_on() && at.now >= self.ready { ISR_ADRDY } else { 0 },
            IER => self.ier,
            CR => self.current_cr(at.now),
            CFGR => self.cfgr,
            CFGR2 => self.cfgr2,
            SMPR1 | SMPR2 => self.smpr[(offset - SMPR1) as usize / 4],
            SQR1..=SQR4 => self.sqr[(offset - SQR1) as usize / 4],
            DR => {
                self.taken();
                self.dr
            }
            DIFSEL => self.difsel,
            CALFACT => return unknown(self.name, offset),
            _ => return unknown(self.name, offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled, or a rule of the reference manual is broken.
    pub fn write(&mut self, offset: u32, value: u32, at: &At, common: &Common) -> Access<()> {
        let while_started = |register: &str, before: u32, protected: u32| {
            if self.is_started() {
                unchanged(register, before, value, protected, "which may only be written while ADSTART = 0")
            } else {
                Ok(())
            }
        };
        match offset {
            ISR => self.isr &= !(value & !ISR_ADRDY),
            IER => {
                only("ADC_IER", value, 0x1f)?;
                self.ier = value;
            }
            CR => self.write_cr(value, at, common)?,
            CFGR => {
                // DMAEN, DMACFG, EXTSEL, EXTEN, OVRMOD, JQDIS.
                only("ADC_CFGR", value, 0x8000_1fe3)?;
                while_started("ADC_CFGR", self.cfgr, u32::MAX)?;
                self.cfgr = value;
            }
            CFGR2 => {
                // ROVSE, OVSR, OVSS, ROVSM; TROVS (a trigger for each conversion) is not modelled.
                only("ADC_CFGR2", value, 0x05fd)?;
                while_started("ADC_CFGR2", self.cfgr2, u32::MAX)?;
                self.cfgr2 = value;
            }
            SMPR1 | SMPR2 => {
                let n = (offset - SMPR1) as usize / 4;
                only("ADC_SMPR", value, 0x3fff_ffff)?;
                while_started("ADC_SMPR", self.smpr[n], u32::MAX)?;
                self.smpr[n] = value;
            }
            SQR1..=SQR4 => {
                let n = (offset - SQR1) as usize / 4;
                while_started("ADC_SQR", self.sqr[n], u32::MAX)?;
                self.sqr[n] = value;
            }
            DIFSEL => {
                if self.is_on() {
                    unchanged("ADC_DIFSEL", self.difsel, value, u32::MAX, "which may only be written while ADEN = 0")?;
                }
                only("ADC_DIFSEL", value, 0)?;
                self.difsel = value;
            }
            _ => return unknown(self.name, offset),
        }
        Ok(())
    }

    fn write_cr(&mut self, value: u32, at: &At, common: &Common) -> Access<()> {
        let commands = CR_ADEN | CR_ADDIS | CR_ADSTART | CR_ADSTP | CR_ADCAL;
        only("ADC_CR", value, commands | CR_ADVREGEN | CR_DEEPPWD | CR_ADCALDIF)?;
        let before = self.current_cr(at.now);
        // Writing 1 gives a command; writing 0 has no effect.
        let given = value & commands & !before;
        let settings = CR_ADVREGEN | CR_DEEPPWD | CR_ADCALDIF;
        if before & commands != 0 {
            unchanged("ADC_CR", before, value, settings, "which may only be written while the converter is off")?;
        }
        if value & !before & CR_ADVREGEN != 0 {
            rule(value & CR_DEEPPWD == 0, "ADC_CR: ADVREGEN is set in deep power-down")?;
            self.regulator_ready = at.now + REGULATOR_STARTS;
        }
        self.cr = self.cr & commands & !CR_ADCAL | value & settings;
        let has_regulator = self.cr & CR_ADVREGEN != 0 && at.now >= self.regulator_ready;
        if given & (CR_ADCAL | CR_ADEN) != 0 {
            rule(given.count_ones() == 1, "ADC_CR: two commands at once")?;
            rule(before & commands == 0, "ADC_CR: ADCAL or ADEN is set while another command is under way")?;
            rule(has_regulator, "ADC_CR: ADCAL or ADEN is set before the voltage regulator is ready")?;
            let Some(cycle) = common.cycle(at) else { return refuse!("{}: no clock is selected", self.name) };
            rule(cycle >= FASTEST, "the converter's clock is faster than 60 MHz")?;
            self.cycle = cycle;
        }
        if given & CR_ADCAL != 0 {
            self.calibration_ends = at.now + self.cycle * CALIBRATION_CYCLES;
            self.calibrated[usize::from(value & CR_ADCALDIF != 0)] = true;
        }
        if given & CR_ADEN != 0 {
            rule(
                at.now >= self.calibration_ends + self.cycle * 4,
                "ADC_CR: ADEN is set less than four cycles after the calibration",
            )?;
            self.ready = at.now + self.cycle * READY_CYCLES;
            self.cr |= CR_ADEN;
        }
        if given & CR_ADSTART != 0 {
            rule(self.is_on() && at.now >= self.ready, "ADC_CR: ADSTART is set before the converter is ready")?;
            rule(self.cr & CR_ADDIS == 0, "ADC_CR: ADSTART is set together with ADDIS")?;
            rule(self.calibrated[0], "ADC_CR: ADSTART is set without a calibration")?;
            rule(field(self.cfgr, 10, 2) <= 1, "ADC_CR: only software and rising triggers are modelled")?;
            self.cr |= CR_ADSTART;
            self.last_trigger = at.now;
            self.sequence = self.trigger().is_none().then(|| (at.now + self.latency(), 0));
        }
        if given & CR_ADSTP != 0 {
            rule(self.is_started(), "ADC_CR: ADSTP is set while ADSTART = 0")?;
            // Takes effect at once; the chip takes a few cycles.
            self.cr &= !CR_ADSTART;
            self.sequence = None;
        }
        if given & CR_ADDIS != 0 {
            rule(self.is_on() && !self.is_started(), "ADC_CR: ADDIS is set while ADEN = 0 or ADSTART = 1")?;
            self.cr &= !CR_ADEN;
        }
        Ok(())
    }
}
