//! Power control (RM0440, section 6), as far as it is used: write access to the backup domain, range 1's boost mode,
//! the pull-downs of USB power delivery.

use crate::register::{Access, bit, only, unknown};

const CR1: u32 = 0x00;
const CR3: u32 = 0x08;
const CR5: u32 = 0x80;

/// The registers.
#[derive(Clone, Copy, Debug)]
pub struct Pwr {
    cr1: u32,
    cr3: u32,
    cr5: u32,
}

impl Default for Pwr {
    fn default() -> Self {
        Self { cr1: 0x200, cr3: 0x8000, cr5: 0x100 }
    }
}

impl Pwr {
    /// DBP: the backup domain can be written.
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
    /// It is not modelled.
    pub fn read(&self, offset: u32) -> Access<u32> {
        match offset {
            CR1 => Ok(self.cr1),
            CR3 => Ok(self.cr3),
            CR5 => Ok(self.cr5),
            _ => unknown("PWR", offset),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled.
    pub fn write(&mut self, offset: u32, value: u32) -> Access<()> {
        match offset {
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
        Ok(())
    }
}
