//! Flash interface and second flash bank (RM0440, section 3, dual-bank mode): keys, page erase and double-word
//! programming with the data sheet's times, status flags, wait states. The first bank contains the program and is
//! read-only.

use std::collections::BTreeSet;

use crate::register::{Access, bit, field, only, refuse, rule, unknown};
use crate::time::{At, Time, UNITS_PER_US};

const ACR: u32 = 0x00;
const KEYR: u32 = 0x08;
const SR: u32 = 0x10;
const CR: u32 = 0x14;
const ECCR: u32 = 0x18;
const OPTR: u32 = 0x20;

const SR_EOP: u32 = 1 << 0;
const SR_FLAGS: u32 = 0xc3fb;
const SR_BSY: u32 = 1 << 16;

const ECCR_BK: u32 = 1 << 21;
const ECCR_ECCD: u32 = 1 << 31;

const CR_PG: u32 = 1 << 0;
const CR_PER: u32 = 1 << 1;
const CR_BKER: u32 = 1 << 11;
const CR_STRT: u32 = 1 << 16;
const CR_LOCK: u32 = 1 << 31;

const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Option register in the delivery state: two banks, no protection, BOR_LEV 0 (RM0440, section 3.4.1).
pub const OPTR_DELIVERED: u32 = 0xffef_f8aa;

/// Size of a page in dual-bank mode, bytes.
pub const PAGE_BYTES: u32 = 2_048;

/// Size of a bank, bytes.
pub const BANK_BYTES: u32 = 256 * 1_024;

/// Maximum times for programming 64 bits and for erasing a page (DS12288, table 53).
const PROGRAMMING: Time = Time(83_350 * UNITS_PER_US / 1_000);
const ERASING: Time = Time(24_500 * UNITS_PER_US);

/// Contents of the second bank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bank2 {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Offsets of double words with errors that the ECC cannot correct.
    pub damaged: BTreeSet<u32>,
}

impl Default for Bank2 {
    /// Erased.
    fn default() -> Self {
        Self { bytes: vec![0xff; BANK_BYTES as usize], damaged: BTreeSet::new() }
    }
}

/// Progress of the operation during which the supply failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// The operation had not begun.
    Before,
    /// A page is half erased, or a double word is damaged.
    Half,
    /// The operation was complete.
    After,
}

/// The registers and the second bank.
#[derive(Clone, Debug)]
pub struct Flash {
    acr: u32,
    sr: u32,
    cr: u32,
    eccr: u32,
    optr: u32,
    /// Number of keys given so far; `None` after a wrong key, until a reset.
    keys: Option<usize>,
    busy_until: Time,
    /// The second bank.
    pub bank2: Bank2,
    /// A byte of the second bank, as an offset, and the bits of it that always read as 0, without an error.
    pub stuck: Option<(u32, u8)>,
    /// The operation at which the supply fails, counted from 0.
    pub cut: Option<(u64, Cut)>,
    /// Whether the supply has failed.
    pub is_cut: bool,
    /// The first word of the double word being written.
    first: Option<(u32, u32)>,
    /// Number of completed operations: programmed double words and erased pages.
    pub operations: u64,
}

impl Flash {
    /// The state after a power-on, with this second bank and these option bytes.
    #[must_use]
    pub fn new(bank2: Bank2, optr: u32) -> Self {
        Self {
            acr: 0x0004_0600,
            sr: 0,
            cr: CR_LOCK,
            eccr: 0,
            optr,
            keys: Some(0),
            busy_until: Time(0),
            bank2,
            stuck: None,
            cut: None,
            is_cut: false,
            first: None,
            operations: 0,
        }
    }

    /// Resets the registers; the contents stay.
    pub fn reset(&mut self) {
        let (operations, stuck, cut, is_cut) = (self.operations, self.stuck, self.cut, self.is_cut);
        *self = Self { operations, stuck, cut, is_cut, ..Self::new(std::mem::take(&mut self.bank2), self.optr) };
    }

    /// BOR_LEV: the brown-out level, 0 to 4.
    #[must_use]
    pub fn brown_out_level(&self) -> usize {
        field(self.optr, 8, 3).min(4) as usize
    }

    /// Wait states, LATENCY.
    #[must_use]
    pub fn latency(&self) -> u32 {
        field(self.acr, 0, 4)
    }

    /// End of the wait of a read of the second bank.
    #[must_use]
    pub fn busy_until(&self) -> Time {
        self.busy_until
    }

    fn is_busy(&self, now: Time) -> bool {
        now < self.busy_until
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32, at: &At) -> Access<u32> {
        Ok(match offset {
            ACR => self.acr,
            SR => self.sr | if self.is_busy(at.now) { SR_BSY } else { 0 },
            CR => self.cr,
            ECCR => self.eccr,
            OPTR => self.optr,
            _ => return unknown("FLASH", offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The register or a bit is not modelled, or a rule of the reference manual is broken.
    pub fn write(&mut self, offset: u32, value: u32, at: &At) -> Access<()> {
        match offset {
            ACR => {
                // LATENCY, PRFTEN, ICEN, DCEN, ICRST, DCRST, DBG_SWEN.
                only("FLASH_ACR", value, 0x0004_1f0f)?;
                rule(
                    value & 0x1000 == 0 || self.acr & 0x400 == 0,
                    "FLASH_ACR: DCRST is set while the data cache is on",
                )?;
                rule(value & 0x0800 == 0 || self.acr & 0x200 == 0, "FLASH_ACR: ICRST is set while the cache is on")?;
                self.acr = value;
            }
            KEYR => {
                let Some(given) = self.keys else {
                    return refuse!("FLASH_KEYR: the flash is locked until the next reset");
                };
                rule(self.cr & CR_LOCK != 0, "FLASH_KEYR is written while the flash is unlocked")?;
                if value != KEYS[given] {
                    self.keys = None;
                    return refuse!("FLASH_KEYR: {value:#010x} is not key {}", given + 1);
                }
                self.keys = Some(given + 1);
                if given == 1 {
                    (self.keys, self.cr) = (Some(0), self.cr & !CR_LOCK);
                }
            }
            SR => {
                only("FLASH_SR", value & !SR_BSY, SR_FLAGS)?;
                self.sr &= !value;
            }
            CR => self.write_cr(value, at)?,
            // Writing 1 clears ECCD.
            ECCR => self.eccr &= !(value & ECCR_ECCD),
            _ => return unknown("FLASH", offset),
        }
        Ok(())
    }

    fn write_cr(&mut self, value: u32, at: &At) -> Access<()> {
        rule(self.cr & CR_LOCK == 0 || value == self.cr, "FLASH_CR is written while it is locked")?;
        rule(!self.is_busy(at.now), "FLASH_CR is written while BSY is set")?;
        only("FLASH_CR", value, CR_PG | CR_PER | 0x3f8 | CR_BKER | CR_STRT | CR_LOCK)?;
        rule(value & CR_PG == 0 || value & CR_PER == 0, "FLASH_CR: PG and PER are set together")?;
        rule(self.first.is_none(), "FLASH_CR is written in the middle of a double word")?;
        self.cr = value & !CR_STRT;
        if value & CR_STRT != 0 {
            rule(value & CR_PER != 0, "FLASH_CR: STRT is set without PER: only page erase is modelled")?;
            rule(self.sr & SR_FLAGS & !SR_EOP == 0, "FLASH_CR: STRT is set while SR has error flags")?;
            rule(value & CR_BKER != 0, "FLASH_CR: a page of the first bank is erased, where the program lies")?;
            rule(!bit(self.acr, 10), "a page is erased while the data cache is on: it would keep what was there")?;
            let start = field(value, 3, 7) * PAGE_BYTES;
            let erased = match self.next_operation() {
                None | Some(Cut::After) => PAGE_BYTES,
                Some(Cut::Half) => PAGE_BYTES / 2,
                Some(Cut::Before) => 0,
            };
            self.bank2.bytes[start as usize..(start + erased) as usize].fill(0xff);
            self.bank2.damaged.retain(|place| !(start..start + erased).contains(place));
            self.busy_until = at.now + ERASING;
        }
        Ok(())
    }

    /// Reports a double-bit error in a double word that was accessed.
    pub fn find_damage(&mut self, in_bank2: bool) {
        self.eccr = ECCR_ECCD | if in_bank2 { ECCR_BK } else { 0 };
    }

    /// Reads `bytes` bytes of the second bank, `offset` from its start. Sets ECCR if the double word is damaged.
    pub fn read_bank2(&mut self, offset: u32, bytes: u32) -> u32 {
        if self.is_damaged(offset) {
            self.find_damage(true);
        }
        let byte = |at: u32| match self.stuck {
            Some((stuck, bits)) if stuck == at => self.bank2.bytes[at as usize] & !bits,
            _ => self.bank2.bytes[at as usize],
        };
        (0..bytes).fold(0, |value, n| value | u32::from(byte(offset + n)) << (8 * n))
    }

    /// Whether the double word at `offset` has an uncorrectable error.
    #[must_use]
    pub fn is_damaged(&self, offset: u32) -> bool {
        self.bank2.damaged.contains(&(offset & !7))
    }

    /// Counts an operation. Returns its progress if the supply fails during it.
    fn next_operation(&mut self) -> Option<Cut> {
        let cut = self.cut.filter(|(operation, _)| *operation == self.operations);
        self.operations += 1;
        self.is_cut |= cut.is_some();
        cut.map(|(_, cut)| cut)
    }

    /// Programs a word of the second bank. The second word of a double word starts the programming of both.
    ///
    /// # Errors
    /// Programming is not possible now, or the words are not an erased, aligned double word in order.
    pub fn program(&mut self, offset: u32, bytes: u32, value: u32, at: &At) -> Access<()> {
        rule(self.cr & (CR_PG | CR_LOCK) == CR_PG, "the flash is written to while PG is not set")?;
        rule(!self.is_busy(at.now), "the flash is written to while BSY is set")?;
        rule(self.sr & SR_FLAGS & !SR_EOP == 0, "the flash is written to while SR has error flags")?;
        rule(!bit(self.acr, 10), "the flash is written to while the data cache is on (ES0430, 2.2.2)")?;
        rule(bytes == 4, "SIZERR: the flash is written to by other than words")?;
        let Some((start, low)) = self.first.take() else {
            rule(offset.is_multiple_of(8), "PGAERR: a double word begins between two")?;
            self.first = Some((offset, value));
            return Ok(());
        };
        rule(offset == start + 4, "PGSERR: the second word does not follow the first")?;
        let place = start as usize..start as usize + 8;
        let double = u64::from(value) << 32 | u64::from(low);
        let is_erased = self.bank2.bytes[place.clone()].iter().all(|&byte| byte == 0xff);
        rule(is_erased || double == 0, "PROGERR: a double word is programmed that is not erased")?;
        self.busy_until = at.now + PROGRAMMING;
        match self.next_operation() {
            Some(Cut::Before) => return Ok(()),
            Some(Cut::Half) => {
                self.bank2.damaged.insert(start);
            }
            None | Some(Cut::After) => {}
        }
        self.bank2.bytes[place].copy_from_slice(&double.to_le_bytes());
        Ok(())
    }
}
