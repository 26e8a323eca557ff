//! DAC1, channel 1 (RM0440, section 22), without a trigger: a write to its holding register changes the output at once.

use crate::register::{Access, field, only, rule, unknown};
use crate::time::{At, UNITS_PER_US};

const CR: u32 = 0x00;
const DHR12R1: u32 = 0x08;
const DOR1: u32 = 0x2c;
const SR: u32 = 0x34;
const MCR: u32 = 0x3c;
const STMODR: u32 = 0x60;

const EN1: u32 = 1 << 0;

/// The converter.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dac {
    cr: u32,
    dhr1: u32,
    mcr: u32,
    stmodr: u32,
}

impl Dac {
    /// The code at the output; `None` while the channel is off.
    #[must_use]
    pub fn output(&self) -> Option<u16> {
        (self.cr & EN1 != 0).then_some(self.dhr1 as u16)
    }

    /// Whether the output buffer is on; it limits the output to 0.2 V from the rails.
    #[must_use]
    pub fn is_buffered(&self) -> bool {
        matches!(field(self.mcr, 0, 3), 0 | 1)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32) -> Access<u32> {
        Ok(match offset {
            CR => self.cr,
            DHR12R1 => self.dhr1,
            DOR1 => self.output().unwrap_or(0).into(),
            MCR => self.mcr,
            STMODR => self.stmodr,
            SR => return unknown("DAC", offset),
            _ => return unknown("DAC", offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled, or the mode is changed while the channel is on.
    pub fn write(&mut self, offset: u32, value: u32, at: &At) -> Access<()> {
        match offset {
            CR => {
                only("DAC_CR", value, EN1)?;
                if value & EN1 != 0 {
                    self.check_interface(at)?;
                }
                self.cr = value;
            }
            DHR12R1 => {
                only("DAC_DHR12R1", value, 0xfff)?;
                self.check_interface(at)?;
                self.dhr1 = value;
            }
            MCR => {
                only("DAC_MCR", value, 0xc007)?;
                let same_mode = value & 7 == self.mcr & 7;
                rule(self.cr & EN1 == 0 || same_mode, "DAC_MCR.MODE1 is written while the channel is enabled")?;
                self.mcr = value;
            }
            STMODR => {
                only("DAC_STMODR", value, 0)?;
                self.stmodr = value;
            }
            _ => return unknown("DAC", offset),
        }
        Ok(())
    }

    /// HFSEL: 0 up to 80 MHz, 1 to 160 MHz, 2 above.
    fn check_interface(&self, at: &At) -> Access<()> {
        let megahertz = UNITS_PER_US as f64 / at.clocks.hclk.0 as f64;
        let needed = u32::from(megahertz > 80.0) + u32::from(megahertz > 160.0);
        rule(field(self.mcr, 14, 2) >= needed, "DAC_MCR: HFSEL is too low for the AHB clock")
    }
}
