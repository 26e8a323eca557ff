//! Power control (RM0440, section 6), used parts only: write access to the backup domain, the voltage detector, the
//! boost mode of range 1, the pull-downs of USB power delivery.

use crate::register::{Access, bit, field, only, unknown};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const CR3: u32 = 0x08;
const SR2: u32 = 0x14;
const CR5: u32 = 0x80;

/// The registers.
#[derive(Clone, Copy, Debug)]
pub struct Pwr {
    cr1: u32,
    cr2: u32,
    cr3: u32,
    cr5: u32,
    supply_v: f64,
    is_browned_out: bool,
}

/// Thresholds of the brown-out reset for a falling and a rising supply, V, by BOR_LEV (DS12288, table 19: typical).
const BROWN_OUT_V: [(f64, f64); 5] = [(1.64, 1.66), (2.0, 2.1), (2.2, 2.31), (2.52, 2.61), (2.8, 2.9)];

/// Thresholds of the voltage detector for a falling supply, V (DS12288, table 19: typical).
const PVD_V: [f64; 7] = [1.94, 2.10, 2.30, 2.51, 2.65, 2.79, 2.86];

impl Pwr {
    /// The state after a power-on with this supply and brown-out level.
    #[must_use]
    pub fn new(supply_v: f64, brown_out_level: usize) -> Self {
        let is_browned_out = supply_v < BROWN_OUT_V[brown_out_level].1;
        Self { cr1: 0x200, cr2: 0, cr3: 0x8000, cr5: 0x100, supply_v, is_browned_out }
    }

    /// Resets the registers; the supply voltage stays.
    pub fn reset(&mut self) {
        *self = Self { is_browned_out: self.is_browned_out, ..Self::new(self.supply_v, 0) };
    }

    /// The chip is held in reset because its supply is low.
    #[must_use]
    pub fn is_browned_out(&self) -> bool {
        self.is_browned_out
    }

    /// PVDO: the detector is on and the supply is below its threshold.
    fn is_low(&self) -> bool {
        let threshold = PVD_V.get(field(self.cr2, 1, 3) as usize);
        bit(self.cr2, 0) && threshold.is_some_and(|threshold| self.supply_v < *threshold)
    }

    /// Changes the supply voltage. Returns whether PVDO rises.
    pub fn set_supply(&mut self, volts: f64, brown_out_level: usize) -> bool {
        let before = self.is_low();
        self.supply_v = volts;
        let (falling_v, rising_v) = BROWN_OUT_V[brown_out_level];
        self.is_browned_out = volts < if self.is_browned_out { rising_v } else { falling_v };
        self.is_low() && !before
    }

    /// DBP: the backup domain is writable.
    #[must_use]
    pub fn backup_writable(&self) -> bool {
        bit(self.cr1, 8)
    }

    /// R1MODE = 0: the core may run above 150 MHz.
    #[must_use]
    pub fn is_boosted(&self) -> bool {
        !bit(self.cr5, 8)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32) -> Access<u32> {
        match offset {
            CR1 => Ok(self.cr1),
            CR2 => Ok(self.cr2),
            SR2 => Ok(u32::from(self.is_low()) << 11),
            CR3 => Ok(self.cr3),
            CR5 => Ok(self.cr5),
            _ => unknown("PWR", offset),
        }
    }

    /// Writes a register. Returns whether PVDO rises.
    ///
    /// # Errors
    /// The register or a bit is not modelled.
    pub fn write(&mut self, offset: u32, value: u32) -> Access<bool> {
        let before = self.is_low();
        match offset {
            CR2 => {
                // PVDE, PLS.
                only("PWR_CR2", value, 0xf)?;
                self.cr2 = value;
            }
            CR1 => {
                only("PWR_CR1", value, 0x300)?;
                self.cr1 = value;
            }
            CR3 => {
                // EIWUL, UCPD1_DBDIS.
                only("PWR_CR3", value, 0xc000)?;
                self.cr3 = value;
            }
            CR5 => {
                only("PWR_CR5", value, 0x100)?;
                self.cr5 = value;
            }
            _ => return unknown("PWR", offset),
        }
        Ok(self.is_low() && !before)
    }
}
