//! Reset and clock control (RM0440, section 7): oscillators with start-up times, the PLL, prescalers, clock enables
//! ([`crate::chip`] checks them before every access), peripheral resets, reset flags.

use crate::register::{Access, bit, field, only, refuse, rule, unchanged, unknown};
use crate::time::{At, Clocks, Time};

const CR: u32 = 0x00;
const ICSCR: u32 = 0x04;
const CFGR: u32 = 0x08;
const PLLCFGR: u32 = 0x0c;
const CIER: u32 = 0x18;
const CIFR: u32 = 0x1c;
const CICR: u32 = 0x20;
const AHB1RSTR: u32 = 0x28;
const APB2RSTR: u32 = 0x40;
const AHB1ENR: u32 = 0x48;
const APB2ENR: u32 = 0x60;
const AHB1SMENR: u32 = 0x68;
const APB2SMENR: u32 = 0x80;
const CCIPR: u32 = 0x88;
const BDCR: u32 = 0x90;
const CSR: u32 = 0x94;
const CRRCR: u32 = 0x98;
const CCIPR2: u32 = 0x9c;

const CIFR_CSSF: u32 = 1 << 8;

const CR_HSION: u32 = 1 << 8;
const CR_HSIRDY: u32 = 1 << 10;
const CR_HSEON: u32 = 1 << 16;
const CR_HSERDY: u32 = 1 << 17;
const CR_HSEBYP: u32 = 1 << 18;
const CR_CSSON: u32 = 1 << 19;
const CR_PLLON: u32 = 1 << 24;
const CR_PLLRDY: u32 = 1 << 25;

const CSR_LSION: u32 = 1 << 0;
const CSR_LSIRDY: u32 = 1 << 1;
const CSR_RMVF: u32 = 1 << 23;
const CSR_FLAGS: u32 = 0xff << 24;

const BDCR_LSEON: u32 = 1 << 0;
const BDCR_RTCSEL: u32 = 3 << 8;
const BDCR_BDRST: u32 = 1 << 16;

const SW_HSI: u32 = 1;
const SW_HSE: u32 = 2;
const SW_PLL: u32 = 3;

const HSI: Time = Time(255);
const HSE: Time = Time(170);

/// Typical start-up times (DS12288, section 5.3).
const HSI_STARTS: Time = Time::from_us(1);
const HSE_STARTS: Time = Time::from_ms(2);
const PLL_LOCKS: Time = Time::from_us(40);
const LSI_STARTS: Time = Time::from_us(130);
const HSI48_STARTS: Time = Time::from_us(6);

/// Cause of the last reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// The supply was switched on, or fell below the brown-out level.
    Power,
    /// The NRST pin.
    Pin,
    /// SYSRESETREQ.
    Software,
    /// The independent watchdog.
    Watchdog,
}

impl ResetCause {
    /// The flags of this cause in CSR; every reset also drives the NRST pin.
    fn flags(self) -> u32 {
        const PINRSTF: u32 = 1 << 26;
        PINRSTF
            | match self {
                Self::Power => 1 << 27,
                Self::Pin => 0,
                Self::Software => 1 << 28,
                Self::Watchdog => 1 << 29,
            }
    }
}

/// Register and bit of a peripheral's clock enable; its reset has the same position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gate {
    /// AHB1ENR, AHB1RSTR.
    Ahb1(u32),
    /// AHB2ENR, AHB2RSTR.
    Ahb2(u32),
    /// APB1ENR1, APB1RSTR1.
    Apb1(u32),
    /// APB1ENR2, APB1RSTR2.
    Apb1High(u32),
    /// APB2ENR, APB2RSTR.
    Apb2(u32),
}

impl Gate {
    /// Index among the six registers of a kind, AHB1 first (a gap precedes those of APB), and the bit.
    fn place(self) -> (usize, u32) {
        match self {
            Self::Ahb1(n) => (0, n),
            Self::Ahb2(n) => (1, n),
            Self::Apb1(n) => (4, n),
            Self::Apb1High(n) => (5, n),
            Self::Apb2(n) => (6, n),
        }
    }
}

/// The six enable, reset or sleep-enable registers: AHB1, AHB2, AHB3, a gap, APB1 (1), APB1 (2), APB2.
type Row = [u32; 7];

const ENABLED_AT_RESET: Row = [0x100, 0, 0, 0, 0x400, 0, 0];

/// The RCC registers and the state of the oscillators.
#[derive(Clone, Debug)]
pub struct Rcc {
    cr: u32,
    cfgr: u32,
    pllcfgr: u32,
    cier: u32,
    cifr: u32,
    enabled: Row,
    reset: Row,
    ccipr: u32,
    bdcr: u32,
    csr: u32,
    hsi48_on: bool,
    hsi_ready: Time,
    hse_ready: Time,
    pll_ready: Time,
    lsi_ready: Time,
    hsi48_ready: Time,
    /// Whether the board's crystal oscillates when switched on.
    pub has_crystal: bool,
    /// Frequency of the internal low-speed oscillator, Hz: 32 kHz, 29.5 kHz to 34 kHz over all conditions.
    pub lsi_hz: u64,
    /// PWR_CR1.DBP: whether BDCR is writable.
    pub backup_writable: bool,
    /// The gates whose reset has just been released.
    pub released: Vec<(usize, u32)>,
    /// A rule that the last write broke and that the chip tolerates.
    pub deviation: Option<&'static str>,
}

impl Rcc {
    /// The state after a reset.
    #[must_use]
    pub fn new(cause: ResetCause) -> Self {
        Self {
            cr: 0x0000_0100,
            cfgr: SW_HSI << 2 | SW_HSI,
            pllcfgr: 0x0000_1000,
            cier: 0,
            cifr: 0,
            enabled: ENABLED_AT_RESET,
            reset: Row::default(),
            ccipr: 0,
            bdcr: 0,
            csr: cause.flags(),
            hsi48_on: false,
            hsi_ready: Time(0),
            hse_ready: Time::NEVER,
            pll_ready: Time::NEVER,
            lsi_ready: Time::NEVER,
            hsi48_ready: Time::NEVER,
            has_crystal: true,
            lsi_hz: 32_000,
            backup_writable: false,
            released: Vec::new(),
            deviation: None,
        }
    }

    /// A system reset. It keeps the backup domain, the reset flags that the program has not cleared, and everything
    /// outside the chip.
    pub fn system_reset(&mut self, cause: ResetCause) {
        let kept = self.clone();
        *self = Self::new(cause);
        if cause != ResetCause::Power {
            self.bdcr = kept.bdcr;
            self.csr |= kept.csr & CSR_FLAGS;
        }
        self.has_crystal = kept.has_crystal;
        self.lsi_hz = kept.lsi_hz;
    }

    /// HPRE: the AHB runs at half of SYSCLK.
    #[must_use]
    pub fn divides_ahb_by_two(&self) -> bool {
        field(self.cfgr, 4, 4) == 0b1000
    }

    /// Whether a peripheral's clock runs.
    #[must_use]
    pub fn is_enabled(&self, gate: Gate) -> bool {
        let (row, n) = gate.place();
        bit(self.enabled[row], n)
    }

    /// Whether a peripheral is held in reset.
    #[must_use]
    pub fn is_held(&self, gate: Gate) -> bool {
        let (row, n) = gate.place();
        bit(self.reset[row], n)
    }

    /// Whether the reset of `gate` is among those just released.
    #[must_use]
    pub fn was_released(&self, gate: Gate) -> bool {
        self.released.contains(&gate.place())
    }

    /// Starts the internal low-speed oscillator; the watchdog does this by hardware.
    pub fn start_lsi(&mut self, now: Time) {
        if self.lsi_ready == Time::NEVER {
            self.lsi_ready = now + LSI_STARTS;
        }
    }

    /// Stops the crystal. The CSS switches off the HSE and the PLL that uses it, and switches the system clock to the
    /// HSI.
    ///
    /// # Panics
    /// The CSS is off: a core without a clock is not modelled.
    pub fn stop_crystal(&mut self) {
        assert!(self.cr & CR_CSSON != 0, "the crystal stops while the clock security system is off");
        self.has_crystal = false;
        self.hse_ready = Time::NEVER;
        if self.is_pll_source(3) {
            self.cr &= !CR_PLLON;
            self.cfgr = self.cfgr & !0xf | SW_HSI << 2 | SW_HSI;
        }
        self.cr = self.cr & !(CR_HSEON | CR_CSSON) | CR_HSION;
        self.cifr |= CIFR_CSSF;
    }

    /// The periods of the clocks.
    #[must_use]
    pub fn clocks(&self) -> Clocks {
        let sysclk = self.sysclk();
        let hclk = sysclk * ahb_divider(field(self.cfgr, 4, 4));
        let pclk = |prescaler: u32| hclk * apb_divider(prescaler);
        // The timer clock is twice a divided APB clock.
        let timers = |prescaler: u32| hclk * (apb_divider(prescaler) / 2).max(1);
        let (ppre1, ppre2) = (field(self.cfgr, 8, 3), field(self.cfgr, 11, 3));
        Clocks {
            sysclk,
            hclk,
            pclk1: pclk(ppre1),
            pclk2: pclk(ppre2),
            timers1: timers(ppre1),
            timers2: timers(ppre2),
            adc12: (field(self.ccipr, 28, 2) == 2).then_some(sysclk),
            lpuart1: if field(self.ccipr, 10, 2) == 1 { sysclk } else { pclk(ppre1) },
            lsi: Time(crate::time::UNITS_PER_US * 1_000_000 / self.lsi_hz),
        }
    }

    fn sysclk(&self) -> Time {
        match field(self.cfgr, 0, 2) {
            SW_HSE => HSE,
            SW_PLL => self.pll_period().unwrap_or(HSI),
            _ => HSI,
        }
    }

    /// The period of PLLRCLK, if it is a whole number of units.
    fn pll_period(&self) -> Option<Time> {
        let source = match field(self.pllcfgr, 0, 2) {
            2 => HSI,
            3 => HSE,
            _ => return None,
        };
        let m = u64::from(field(self.pllcfgr, 4, 4)) + 1;
        let n = u64::from(field(self.pllcfgr, 8, 7));
        let r = 2 * (u64::from(field(self.pllcfgr, 25, 2)) + 1);
        let units = source.0 * m * r;
        (n >= 8 && units.is_multiple_of(n)).then(|| Time(units / n))
    }

    fn is_pll_source(&self, source: u32) -> bool {
        self.cr & CR_PLLON != 0 && field(self.pllcfgr, 0, 2) == source
    }

    fn current_cr(&self, now: Time) -> u32 {
        let ready = |on: u32, at: Time, flag: u32| if self.cr & on != 0 && now >= at { flag } else { 0 };
        self.cr
            | ready(CR_HSION, self.hsi_ready, CR_HSIRDY)
            | ready(CR_HSEON, self.hse_ready, CR_HSERDY)
            | ready(CR_PLLON, self.pll_ready, CR_PLLRDY)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&mut self, offset: u32, at: &At) -> Access<u32> {
        Ok(match offset {
            CR => self.current_cr(at.now),
            CFGR => self.cfgr,
            PLLCFGR => self.pllcfgr,
            CIER => self.cier,
            CIFR => self.cifr,
            AHB1RSTR..=APB2RSTR => self.reset[(offset - AHB1RSTR) as usize / 4],
            AHB1ENR..=APB2ENR => self.enabled[(offset - AHB1ENR) as usize / 4],
            CCIPR => self.ccipr,
            BDCR => self.bdcr,
            CSR => {
                let ready = self.csr & CSR_LSION != 0 && at.now >= self.lsi_ready;
                self.csr | if ready { CSR_LSIRDY } else { 0 }
            }
            CRRCR => u32::from(self.hsi48_on) | u32::from(self.hsi48_on && at.now >= self.hsi48_ready) << 1,
            CCIPR2 => 0,
            ICSCR | CICR | AHB1SMENR..=APB2SMENR => return unknown("RCC", offset),
            _ => return unknown("RCC", offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled, or a rule of the reference manual is broken.
    pub fn write(&mut self, offset: u32, value: u32, at: &At) -> Access<()> {
        match offset {
            CR => self.write_cr(value, at.now)?,
            CFGR => self.write_cfgr(value, at.now)?,
            PLLCFGR => {
                only("RCC_PLLCFGR", value, 0xff73_7ff3)?;
                let is_on = self.cr & CR_PLLON != 0;
                rule(!is_on || value == self.pllcfgr, "RCC_PLLCFGR is written while the PLL is on")?;
                self.pllcfgr = value;
            }
            CIER => {
                only("RCC_CIER", value, 0)?;
                self.cier = value;
            }
            CICR => {
                only("RCC_CICR", value, 1 << 8)?;
                self.cifr &= !value;
            }
            AHB1RSTR..=APB2RSTR => {
                let row = (offset - AHB1RSTR) as usize / 4;
                let released = self.reset[row] & !value;
                self.reset[row] = value;
                self.released.extend((0..32).filter(|&n| bit(released, n)).map(|n| (row, n)));
            }
            AHB1ENR..=APB2ENR => self.enabled[(offset - AHB1ENR) as usize / 4] = value,
            CCIPR => {
                // LPUART1SEL = PCLK1 or SYSCLK, ADC12SEL = SYSCLK: the only modelled selections.
                only("RCC_CCIPR", value, 2 << 28 | 1 << 10)?;
                self.ccipr = value;
            }
            CCIPR2 => only("RCC_CCIPR2", value, 0)?,
            BDCR => self.write_bdcr(value)?,
            CSR => {
                only("RCC_CSR", value, CSR_LSION | CSR_LSIRDY | CSR_RMVF | CSR_FLAGS)?;
                if value & CSR_RMVF != 0 {
                    self.csr &= !CSR_FLAGS;
                }
                self.csr = self.csr & CSR_FLAGS | value & CSR_LSION;
                if value & CSR_LSION != 0 {
                    self.start_lsi(at.now);
                }
            }
            CRRCR => {
                only("RCC_CRRCR", value & 0x7f, 3)?;
                let on = bit(value, 0);
                if on && !self.hsi48_on {
                    self.hsi48_ready = at.now + HSI48_STARTS;
                }
                self.hsi48_on = on;
            }
            _ => return unknown("RCC", offset),
        }
        Ok(())
    }

    fn write_cr(&mut self, value: u32, now: Time) -> Access<()> {
        let switches = CR_HSION | CR_HSEON | CR_HSEBYP | CR_CSSON | CR_PLLON;
        only("RCC_CR", value, switches | CR_HSIRDY | CR_HSERDY | CR_PLLRDY)?;
        let sw = field(self.cfgr, 0, 2);
        let runs_on = |source| sw == source || sw == SW_PLL && self.is_pll_source(source + 1);
        rule(value & CR_PLLON != 0 || sw != SW_PLL, "RCC_CR: PLLON is cleared while the PLL is the system clock")?;
        rule(value & CR_HSEON != 0 || !runs_on(SW_HSE), "RCC_CR: HSEON is cleared while the system runs on the HSE")?;
        rule(value & CR_HSION != 0 || !runs_on(SW_HSI), "RCC_CR: HSION is cleared while the system runs on the HSI")?;
        if self.cr & CR_HSEON != 0 {
            unchanged("RCC_CR", self.cr, value, CR_HSEBYP, "which may only be written while the HSE is off")?;
        }
        let ready = self.current_cr(now);
        rule(
            value & CR_CSSON == 0 || ready & CR_HSERDY != 0,
            "RCC_CR: CSSON is set before the HSE is ready: it would not be enabled",
        )?;
        let rises = value & !self.cr;
        if rises & CR_HSION != 0 {
            self.hsi_ready = now + HSI_STARTS;
        }
        if rises & CR_HSEON != 0 {
            self.hse_ready = if self.has_crystal { now + HSE_STARTS } else { Time::NEVER };
        }
        if rises & CR_PLLON != 0 {
            rule(
                self.pll_period().is_some(),
                "RCC_CR: the PLL is switched on without a source or with a period not modelled",
            )?;
            let source_ready = match field(self.pllcfgr, 0, 2) {
                2 => ready & CR_HSIRDY != 0,
                _ => ready & CR_HSERDY != 0,
            };
            rule(source_ready, "RCC_CR: the PLL is switched on before its source is ready")?;
            self.pll_ready = now + PLL_LOCKS;
        }
        self.cr = value & switches;
        Ok(())
    }

    fn write_cfgr(&mut self, value: u32, now: Time) -> Access<()> {
        only("RCC_CFGR", value, 0x3fff)?;
        let sw = field(value, 0, 2);
        let ready = match sw {
            SW_HSI => CR_HSIRDY,
            SW_HSE => CR_HSERDY,
            SW_PLL => CR_PLLRDY,
            _ => return refuse!("RCC_CFGR: SW = 0 is reserved"),
        };
        rule(self.current_cr(now) & ready != 0, "RCC_CFGR: SW selects a clock that is not ready")?;
        rule(sw != SW_PLL || bit(self.pllcfgr, 24), "RCC_CFGR: SW selects the PLL, but PLLREN is not set")?;
        self.cfgr = value & !0xc | sw << 2;
        Ok(())
    }

    fn write_bdcr(&mut self, value: u32) -> Access<()> {
        rule(self.backup_writable, "RCC_BDCR is written while PWR_CR1.DBP is 0")?;
        only("RCC_BDCR", value, 0x0001_8300)?;
        if value & BDCR_BDRST != 0 {
            self.bdcr = BDCR_BDRST;
            return Ok(());
        }
        // Once selected, the RTC's clock stays until the backup domain is reset.
        let selected = self.bdcr & BDCR_RTCSEL;
        let value = if selected == 0 || selected == value & BDCR_RTCSEL {
            value
        } else {
            self.deviation =
                Some("RCC_BDCR: RTCSEL is changed without a reset of the backup domain; the chip ignores it");
            value & !BDCR_RTCSEL | selected
        };
        debug_assert_eq!(value & BDCR_LSEON, 0);
        self.bdcr = value;
        Ok(())
    }
}

fn ahb_divider(hpre: u32) -> u64 {
    [1, 2, 4, 8, 16, 64, 128, 256, 512][hpre.saturating_sub(7) as usize]
}

fn apb_divider(ppre: u32) -> u64 {
    [1, 2, 4, 8, 16][ppre.saturating_sub(3) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(us: u64, rcc: &Rcc) -> At {
        At { now: Time::from_us(us), clocks: rcc.clocks() }
    }

    #[test]
    fn the_pll_makes_170_mhz_from_either_oscillator() {
        for (source, m) in [(3, 6), (2, 4)] {
            let mut rcc = Rcc::new(ResetCause::Power);
            let now = at(0, &rcc);
            rcc.write(PLLCFGR, 1 << 24 | 85 << 8 | (m - 1) << 4 | source, &now).unwrap();
            assert_eq!(rcc.pll_period(), Some(Time(24)));
        }
    }

    #[test]
    fn a_clock_that_is_not_ready_cannot_be_selected() {
        let mut rcc = Rcc::new(ResetCause::Power);
        let now = at(0, &rcc);
        rcc.write(CR, CR_HSION | CR_HSEON, &now).unwrap();
        assert!(rcc.write(CFGR, SW_HSE, &at(1_999, &rcc)).is_err());
        rcc.write(CFGR, SW_HSE, &at(2_000, &rcc)).unwrap();
        assert_eq!(rcc.clocks().hclk, HSE);
    }

    #[test]
    fn reset_flags_accumulate_until_they_are_cleared() {
        let mut rcc = Rcc::new(ResetCause::Power);
        rcc.system_reset(ResetCause::Watchdog);
        let now = at(0, &rcc);
        assert_eq!(rcc.read(CSR, &now).unwrap() >> 24, 0x2c);
        rcc.write(CSR, CSR_RMVF, &now).unwrap();
        assert_eq!(rcc.read(CSR, &now).unwrap() >> 24, 0);
        rcc.system_reset(ResetCause::Software);
        assert_eq!(rcc.read(CSR, &now).unwrap() >> 24, 0x14);
    }
}
