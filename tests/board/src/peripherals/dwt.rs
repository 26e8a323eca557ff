//! Cycle counter of the core, and the trace enable that it depends on (Armv7-M, sections C1.6 and C1.8).

use crate::register::{Access, bit, only, rule, unknown};
use crate::time::{At, Time};

const CTRL: u32 = 0x00;
const CYCCNT: u32 = 0x04;

const TRCENA: u32 = 1 << 24;

/// The cycle counter.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dwt {
    demcr: u32,
    is_counting: bool,
    /// The count at `since`.
    count: u32,
    since: Time,
}

impl Dwt {
    fn current(&self, at: &At) -> u32 {
        if !self.is_counting {
            return self.count;
        }
        self.count.wrapping_add((at.now.since(self.since).0 / at.clocks.hclk.0) as u32)
    }

    /// Stores the present count; call with the old clock before the clock changes.
    pub fn keep(&mut self, at: &At) {
        (self.count, self.since) = (self.current(at), at.now);
    }

    /// DEMCR.
    #[must_use]
    pub fn demcr(&self) -> u32 {
        self.demcr
    }

    /// Writes DEMCR.
    ///
    /// # Errors
    /// A bit is not modelled.
    pub fn set_demcr(&mut self, value: u32) -> Access<()> {
        only("DEMCR", value, TRCENA)?;
        self.demcr = value;
        Ok(())
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32, at: &At) -> Access<u32> {
        match offset {
            CTRL => Ok(0x4000_0000 | u32::from(self.is_counting)),
            CYCCNT => Ok(self.current(at)),
            _ => unknown("DWT", offset),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled, or the trace unit is off.
    pub fn write(&mut self, offset: u32, value: u32, at: &At) -> Access<()> {
        rule(self.demcr & TRCENA != 0, "DWT is written while DEMCR.TRCENA is 0")?;
        self.keep(at);
        match offset {
            CTRL => {
                only("DWT_CTRL", value & 0x0fff_ffff, 1)?;
                self.is_counting = bit(value, 0);
            }
            CYCCNT => self.count = value,
            _ => return unknown("DWT", offset),
        }
        Ok(())
    }
}
