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
}

/// Thresholds of the voltage detector for a falling supply, V (DS12288, table 19: typical).
const PVD_V: [f64; 7] = [1.94, 2.10, 2.30, 2.51, 2.65, 2.79, 2.86];

impl Default for Pwr {
    fn default() -> Self {
        Self { cr1: 0x200, cr2: 0, cr3: 0x8000, cr5: 0x100, supply_v: 3.3 }
    }
}

impl Pwr {
    /// Resets the registers; the supply voltage stays.
    pub fn reset(&mut self) {
        *self = Self { supply_v: self.supply_v, ..Self::default() };
    }

    /// PVDO: the detector is on and the supply is below its threshold.
    fn is_low(&self) -> bool {
        let threshold = PVD_V.get(field(self.cr2, 1, 3) as usize);
        bit(self.cr2, 0) && threshold.is_some_and(|threshold| self.supply_v < *threshold)
    }

    /// Changes the supply voltage. Returns whether PVDO rises.
    pub fn set_supply(&mut self, volts: f64) -> bool {
        let before = self.is_low();
        self.supply_v = volts;
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
