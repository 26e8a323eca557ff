//! System control block (Armv7-M, section B3.2), except the exception priorities, which are in the interrupt
//! controller.

use super::nvic::{NMI, Nvic, PEND_SV, SYS_TICK};
use crate::register::{Access, bit, field, only, refuse, unknown};

const CPUID: u32 = 0xd00;
const ICSR: u32 = 0xd04;
const VTOR: u32 = 0xd08;
const AIRCR: u32 = 0xd0c;
const SCR: u32 = 0xd10;
const CCR: u32 = 0xd14;
const SHPR1: u32 = 0xd18;
const SHPR3: u32 = 0xd20;
const SHCSR: u32 = 0xd24;
const CFSR: u32 = 0xd28;
const HFSR: u32 = 0xd2c;
const CPACR: u32 = 0xd88;

/// The registers.
#[derive(Clone, Copy, Debug)]
pub struct Scb {
    vtor: u32,
    scr: u32,
    ccr: u32,
    cpacr: u32,
    /// Whether SYSRESETREQ was set.
    pub reset_requested: bool,
}

impl Default for Scb {
    fn default() -> Self {
        Self { vtor: 0, scr: 0, ccr: 0x200, cpacr: 0, reset_requested: false }
    }
}

impl Scb {
    /// Address of the vector table.
    #[must_use]
    pub fn vtor(&self) -> u32 {
        self.vtor
    }

    /// Whether the program has switched the floating-point unit on.
    #[must_use]
    pub fn has_fpu(&self) -> bool {
        field(self.cpacr, 20, 4) == 0xf
    }

    /// Reads a register, `offset` from 0xE000E000.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32, nvic: &Nvic) -> Access<u32> {
        Ok(match offset {
            CPUID => 0x410f_c241,
            ICSR => {
                let pending = nvic.first_pending().unwrap_or(0);
                let system = u32::from(nvic.system_pending());
                let to_base = u32::from(nvic.depth() <= 1);
                u32::from(nvic.current())
                    | to_base << 11
                    | u32::from(pending) << 12
                    | (system >> SYS_TICK & 1) << 26
                    | (system >> PEND_SV & 1) << 28
                    | (system >> NMI & 1) << 31
            }
            VTOR => self.vtor,
            AIRCR => 0xfa05_0000,
            SCR => self.scr,
            CCR => self.ccr,
            SHPR1..=SHPR3 => nvic.system_priorities((offset - SHPR1) as usize / 4),
            SHCSR | CFSR | HFSR => 0,
            CPACR => self.cpacr,
            _ => return unknown("SCB", offset),
        })
    }

    /// Writes a register, `offset` from 0xE000E000.
    ///
    /// # Errors
    /// The register or a bit is not modelled.
    pub fn write(&mut self, offset: u32, value: u32, nvic: &mut Nvic) -> Access<()> {
        match offset {
            ICSR => {
                only("SCB_ICSR", value, 0x9e00_0000)?;
                for (n, exception, pends) in [
                    (31, NMI, true),
                    (28, PEND_SV, true),
                    (27, PEND_SV, false),
                    (26, SYS_TICK, true),
                    (25, SYS_TICK, false),
                ] {
                    match (bit(value, n), pends) {
                        (true, true) => nvic.pend_system(exception),
                        (true, false) => nvic.unpend_system(exception),
                        _ => {}
                    }
                }
            }
            VTOR => self.vtor = value & 0x3fff_ff80,
            AIRCR => {
                if value >> 16 != 0x05fa {
                    return refuse!("SCB_AIRCR: {value:#010x} has not the key 0x05fa");
                }
                only("SCB_AIRCR", value & 0xffff, 1 << 2)?;
                self.reset_requested |= bit(value, 2);
            }
            SCR => {
                only("SCB_SCR", value, 1 << 4)?;
                self.scr = value;
            }
            CCR => {
                only("SCB_CCR", value, 0x200)?;
                self.ccr = value;
            }
            SHPR1..=SHPR3 => nvic.set_system_priorities((offset - SHPR1) as usize / 4, value),
            CPACR => {
                only("SCB_CPACR", value, 0x00f0_0000)?;
                self.cpacr = value;
            }
            _ => return unknown("SCB", offset),
        }
        Ok(())
    }
}
