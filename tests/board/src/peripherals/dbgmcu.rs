//! The debug support registers (RM0440, section 47).

use crate::register::{Access, bit, only, unknown};

const IDCODE: u32 = 0x00;
const CR: u32 = 0x04;
const APB1FZR1: u32 = 0x08;

/// The registers; only a power-on resets them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dbgmcu {
    cr: u32,
    apb1fzr1: u32,
}

impl Dbgmcu {
    /// DBG_IWDG_STOP: the watchdog stops while the core is halted.
    #[must_use]
    pub fn freezes_watchdog(&self) -> bool {
        bit(self.apb1fzr1, 12)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32) -> Access<u32> {
        Ok(match offset {
            // A category 3 device, revision X.
            IDCODE => 0x2003_6469,
            CR => self.cr,
            APB1FZR1 => self.apb1fzr1,
            _ => return unknown("DBGMCU", offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled.
    pub fn write(&mut self, offset: u32, value: u32) -> Access<()> {
        match offset {
            CR => {
                only("DBGMCU_CR", value, 7)?;
                self.cr = value;
            }
            APB1FZR1 => {
                only("DBGMCU_APB1FZR1", value, 0x1c3f)?;
                self.apb1fzr1 = value;
            }
            _ => return unknown("DBGMCU", offset),
        }
        Ok(())
    }
}
