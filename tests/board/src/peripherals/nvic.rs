//! Nested vectored interrupt controller with the system exceptions (Armv7-M, sections B1.5 and B3.4): selects the next
//! exception. Priorities have four bits, all of them for preemption (PRIGROUP = 0).

use crate::register::{Access, refuse, unknown};

/// Number of interrupts of the STM32G474.
pub const INTERRUPTS: usize = 102;

/// Number of exceptions before the first interrupt.
pub const FIRST_INTERRUPT: u16 = 16;

/// The non-maskable interrupt.
pub const NMI: u16 = 2;
/// HardFault.
pub const HARD_FAULT: u16 = 3;
/// PendSV.
pub const PEND_SV: u16 = 14;
/// SysTick.
pub const SYS_TICK: u16 = 15;

const ISER: u32 = 0x000;
const ICER: u32 = 0x080;
const ISPR: u32 = 0x100;
const ICPR: u32 = 0x180;
const IABR: u32 = 0x200;
const IPR: u32 = 0x300;

/// Priority of code outside any exception: lower than every exception.
const THREAD: i16 = 256;

/// The core's mask registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Masks {
    /// PRIMASK.
    pub primask: bool,
    /// FAULTMASK.
    pub faultmask: bool,
    /// BASEPRI.
    pub basepri: u8,
}

/// The interrupt controller.
#[derive(Clone, Debug)]
pub struct Nvic {
    enabled: [u32; 4],
    pending: [u32; 4],
    /// The levels of the interrupt lines.
    lines: [u32; 4],
    priorities: [u8; INTERRUPTS],
    /// SHPR1 to SHPR3: exceptions 4 to 15.
    system_priorities: [u8; 12],
    /// Pending system exceptions.
    system_pending: u16,
    /// Active exceptions, outermost first.
    active: Vec<u16>,
}

impl Default for Nvic {
    fn default() -> Self {
        Self {
            enabled: [0; 4],
            pending: [0; 4],
            lines: [0; 4],
            priorities: [0; INTERRUPTS],
            system_priorities: [0; 12],
            system_pending: 0,
            active: Vec::new(),
        }
    }
}

impl Nvic {
    /// Sets the level of an interrupt's line: a rising edge makes it pending.
    pub fn set_line(&mut self, interrupt: usize, level: bool) {
        let (word, mask) = (interrupt / 32, 1 << (interrupt % 32));
        if level && self.lines[word] & mask == 0 {
            self.pending[word] |= mask;
        }
        self.lines[word] = if level { self.lines[word] | mask } else { self.lines[word] & !mask };
    }

    /// Makes a system exception pending.
    pub fn pend_system(&mut self, exception: u16) {
        self.system_pending |= 1 << exception;
    }

    /// Clears the pending state of a system exception.
    pub fn unpend_system(&mut self, exception: u16) {
        self.system_pending &= !(1 << exception);
    }

    /// Pending system exceptions.
    #[must_use]
    pub fn system_pending(&self) -> u16 {
        self.system_pending
    }

    fn priority(&self, exception: u16) -> i16 {
        match exception {
            1 => -3,
            NMI => -2,
            HARD_FAULT => -1,
            4..FIRST_INTERRUPT => self.system_priorities[usize::from(exception) - 4].into(),
            _ => self.priorities[usize::from(exception - FIRST_INTERRUPT)].into(),
        }
    }

    /// The active exception; 0 for none.
    #[must_use]
    pub fn current(&self) -> u16 {
        self.active.last().copied().unwrap_or(0)
    }

    /// Nesting depth of exceptions.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.active.len()
    }

    /// The pending and enabled exception of highest priority; the lowest number among equal priorities.
    #[must_use]
    pub fn first_pending(&self) -> Option<u16> {
        let system = (1..FIRST_INTERRUPT).filter(|n| self.system_pending >> n & 1 == 1);
        let words = (0..4).flat_map(|word| {
            let mut bits = self.pending[word] & self.enabled[word];
            std::iter::from_fn(move || {
                let n = bits.trailing_zeros();
                (n < 32).then(|| {
                    bits &= bits - 1;
                    FIRST_INTERRUPT + 32 * word as u16 + n as u16
                })
            })
        });
        system.chain(words).min_by_key(|&exception| (self.priority(exception), exception))
    }

    /// Whether any exception is pending and enabled, masked or not.
    #[must_use]
    pub fn has_pending(&self) -> bool {
        self.system_pending != 0 || self.pending.iter().zip(&self.enabled).any(|(p, e)| p & e != 0)
    }

    /// The exception that preempts the running code, if any.
    #[must_use]
    pub fn to_take(&self, masks: &Masks) -> Option<u16> {
        let exception = self.first_pending()?;
        let mut running = self.active.iter().map(|&active| self.priority(active)).min().unwrap_or(THREAD);
        if masks.basepri != 0 {
            running = running.min(masks.basepri.into());
        }
        if masks.primask {
            running = running.min(0);
        }
        if masks.faultmask {
            running = running.min(-1);
        }
        (self.priority(exception) < running).then_some(exception)
    }

    /// Enters an exception.
    pub fn enter(&mut self, exception: u16) {
        if let Some(interrupt) = exception.checked_sub(FIRST_INTERRUPT) {
            self.pending[usize::from(interrupt) / 32] &= !(1 << (interrupt % 32));
        } else {
            self.unpend_system(exception);
        }
        self.active.push(exception);
    }

    /// Returns from the innermost exception; a line that is still high makes its interrupt pending again.
    pub fn leave(&mut self) -> Option<u16> {
        let exception = self.active.pop()?;
        if let Some(interrupt) = exception.checked_sub(FIRST_INTERRUPT) {
            let (word, mask) = (usize::from(interrupt) / 32, 1 << (interrupt % 32));
            self.pending[word] |= self.lines[word] & mask;
        }
        Some(exception)
    }

    /// SHPR1 to SHPR3.
    #[must_use]
    pub fn system_priorities(&self, register: usize) -> u32 {
        u32::from_le_bytes(std::array::from_fn(|n| self.system_priorities[4 * register + n]))
    }

    /// Writes SHPR1 to SHPR3: the upper four bits of each priority.
    pub fn set_system_priorities(&mut self, register: usize, value: u32) {
        for (n, priority) in value.to_le_bytes().into_iter().enumerate() {
            self.system_priorities[4 * register + n] = priority & 0xf0;
        }
    }

    /// Reads a register of the controller, `offset` from 0xE000E100, as a whole word.
    ///
    /// # Errors
    /// The register does not exist.
    pub fn read(&self, offset: u32) -> Access<u32> {
        let word = (offset % 0x80 / 4) as usize;
        if (IPR..IPR + INTERRUPTS as u32).contains(&offset) {
            let first = (offset - IPR) as usize;
            let byte = |n: usize| self.priorities.get(first + n).copied().unwrap_or(0);
            return Ok(u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]));
        }
        if word >= 4 {
            return unknown("NVIC", offset);
        }
        match offset & !0x7f {
            ISER | ICER => Ok(self.enabled[word]),
            ISPR | ICPR => Ok(self.pending[word]),
            IABR => Ok(self.active.iter().fold(0, |bits, exception| match exception.checked_sub(FIRST_INTERRUPT) {
                Some(n) if usize::from(n / 32) == word => bits | 1 << (n % 32),
                _ => bits,
            })),
            _ => unknown("NVIC", offset),
        }
    }

    /// Writes a register of the controller; priorities by byte or by word.
    ///
    /// # Errors
    /// The register does not exist, or the chip has no such interrupt.
    pub fn write(&mut self, offset: u32, bytes: u32, value: u32) -> Access<()> {
        if offset >= IPR {
            for n in 0..bytes {
                let Some(priority) = self.priorities.get_mut((offset - IPR + n) as usize) else {
                    return refuse!("NVIC_IPR: there is no interrupt {}", offset - IPR + n);
                };
                *priority = (value >> (8 * n)) as u8 & 0xf0;
            }
            return Ok(());
        }
        let word = (offset % 0x80 / 4) as usize;
        if bytes != 4 || word >= 4 {
            return unknown("NVIC", offset);
        }
        let past = 32 * word as u32 + 31u32.saturating_sub(value.leading_zeros());
        if value != 0 && past as usize >= INTERRUPTS {
            return refuse!("NVIC: there is no interrupt {past}");
        }
        match offset & !0x7f {
            ISER => self.enabled[word] |= value,
            ICER => self.enabled[word] &= !value,
            ISPR => self.pending[word] |= value,
            // An interrupt whose line is high stays pending.
            ICPR => self.pending[word] &= !value | self.lines[word],
            _ => return unknown("NVIC", offset),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Masks = Masks { primask: false, faultmask: false, basepri: 0 };

    /// Interrupts 3 (priority 0x60), 40 (0x80) and 41 (0x80) enabled.
    fn nvic() -> Nvic {
        let mut nvic = Nvic::default();
        nvic.write(ISER, 4, 1 << 3).unwrap();
        nvic.write(ISER + 4, 4, 3 << 8).unwrap();
        for (interrupt, priority) in [(3, 0x60), (40, 0x8f), (41, 0x80)] {
            nvic.write(IPR + interrupt, 1, priority).unwrap();
        }
        nvic
    }

    #[test]
    fn a_higher_priority_preempts_and_an_equal_one_waits() {
        let mut nvic = nvic();
        nvic.set_line(41, true);
        nvic.set_line(40, true);
        assert_eq!(nvic.to_take(&NONE), Some(56));
        nvic.enter(56);
        assert_eq!(nvic.to_take(&NONE), None);
        nvic.set_line(3, true);
        assert_eq!(nvic.to_take(&NONE), Some(19));
        nvic.enter(19);
        nvic.set_line(3, false);
        assert_eq!(nvic.leave(), Some(19));
        nvic.set_line(40, false);
        nvic.leave();
        assert_eq!(nvic.to_take(&NONE), Some(57));
    }

    #[test]
    fn masks_block_exceptions_of_equal_or_lower_priority() {
        let mut nvic = nvic();
        nvic.set_line(3, true);
        assert_eq!(nvic.to_take(&Masks { primask: true, ..NONE }), None);
        assert_eq!(nvic.to_take(&Masks { basepri: 0x60, ..NONE }), None);
        assert_eq!(nvic.to_take(&Masks { basepri: 0x70, ..NONE }), Some(19));
        nvic.pend_system(NMI);
        assert_eq!(nvic.to_take(&Masks { primask: true, faultmask: true, basepri: 0 }), Some(NMI));
    }

    #[test]
    fn a_line_that_stays_high_makes_its_interrupt_pending_again() {
        let mut nvic = nvic();
        nvic.set_line(3, true);
        nvic.enter(19);
        assert_eq!(nvic.to_take(&NONE), None);
        nvic.leave();
        assert_eq!(nvic.to_take(&NONE), Some(19));
        nvic.write(ICPR, 4, 1 << 3).unwrap();
        assert_eq!(nvic.to_take(&NONE), Some(19));
        nvic.set_line(3, false);
        nvic.write(ICPR, 4, 1 << 3).unwrap();
        assert_eq!(nvic.to_take(&NONE), None);
    }
}
