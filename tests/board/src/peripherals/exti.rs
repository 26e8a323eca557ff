//! Extended interrupt controller (RM0440, section 16): lines 0 to 31, interrupts on rising edges.

use crate::register::{Access, bit, only, unknown};

const IMR1: u32 = 0x00;
const RTSR1: u32 = 0x08;
const PR1: u32 = 0x14;

/// The modelled lines: the voltage detector's.
const LINES: u32 = 1 << 16;

/// IMR1 after a reset: the direct lines are unmasked.
const IMR1_AT_RESET: u32 = 0x1f84_0000;

/// The registers.
#[derive(Clone, Copy, Debug)]
pub struct Exti {
    imr1: u32,
    rtsr1: u32,
    pr1: u32,
}

impl Default for Exti {
    fn default() -> Self {
        Self { imr1: IMR1_AT_RESET, rtsr1: 0, pr1: 0 }
    }
}

impl Exti {
    /// Signals a rising edge at the input of a line.
    pub fn rises(&mut self, line: u32) {
        self.pr1 |= self.rtsr1 & 1 << line;
    }

    /// Whether a line requests its interrupt.
    #[must_use]
    pub fn interrupt(&self, line: u32) -> bool {
        bit(self.pr1 & self.imr1, line)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32) -> Access<u32> {
        Ok(match offset {
            IMR1 => self.imr1,
            RTSR1 => self.rtsr1,
            PR1 => self.pr1,
            _ => return unknown("EXTI", offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a line is not modelled.
    pub fn write(&mut self, offset: u32, value: u32) -> Access<()> {
        match offset {
            IMR1 => {
                only("EXTI_IMR1", value, IMR1_AT_RESET | LINES)?;
                self.imr1 = value;
            }
            RTSR1 => {
                only("EXTI_RTSR1", value, LINES)?;
                self.rtsr1 = value;
            }
            PR1 => {
                only("EXTI_PR1", value, LINES)?;
                self.pr1 &= !value;
            }
            _ => return unknown("EXTI", offset),
        }
        Ok(())
    }
}
