//! The rig's settings in flash: the last ones that were saved, whenever the supply goes.
//!
//! Two pages hold a record each: the settings in postcard with their layout's hash, a number that counts the savings, and a
//! CRC-32 over all of it. A saving erases the page that does *not* hold the newest record and writes there; so whatever an
//! interrupted erasing or programming leaves in that page, the other is untouched, and the checksum tells which to believe
//! (one in 2³² of any bytes would pass). A record of another layout is not read as if it were ours. What the flash's error
//! correction cannot mend must come back as any bytes. `sequential-storage` read neither settings after an erasing that was
//! cut short bit by bit.
//!
//! A page bears 10 000 erasings (data sheet), both together 20 000 savings. When settings may be saved is
//! [`crate::controller`]'s decision.

use core::ops::Range;
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use damprig_core::settings::{Prepared, Settings, Source};
use embedded_storage::nor_flash::NorFlash;
use postcard_schema::key::Key;

/// The layout of [`Settings`], names included.
const LAYOUT: [u8; 8] = Key::for_path::<Settings>("settings").to_bytes();

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// A record, padded to whole words of the flash, bytes: 44 numbers of four, the head, the checksum, and some to grow.
const RECORD: usize = 256;

/// Layout, number, and length of the settings; of any layout's record.
const HEAD: usize = 8 + 4 + 4;

type Bytes = [u8; RECORD];

/// The settings could not be saved; what was saved before is still there, if anything was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotSaved;

/// What a page holds.
enum Slot {
    Blank,
    Damaged,
    /// A sound record of another layout, of this number.
    Other(u32),
    /// Settings of ours.
    Ours(u32, Settings),
}

impl Slot {
    fn read(record: &Bytes) -> Self {
        if record.iter().all(|byte| *byte == 0xff) {
            return Self::Blank;
        }
        Self::sound(record).unwrap_or(Self::Damaged)
    }

    /// `None` for a record whose checksum is wrong, or whose settings are.
    fn sound(record: &Bytes) -> Option<Self> {
        let (number, length) = (word(record, 8)?, word(record, 12)? as usize);
        let end = HEAD.checked_add(length)?;
        if CRC.checksum(record.get(..end)?) != word(record, end)? {
            return None;
        }
        let Some(body) = record.strip_prefix(&LAYOUT).and_then(|rest| rest.get(HEAD - LAYOUT.len()..)) else {
            return Some(Self::Other(number));
        };
        let settings = postcard::from_bytes(body).ok()?;
        Prepared::new(&settings).ok()?;
        Some(Self::Ours(number, settings))
    }

    fn number(&self) -> Option<u32> {
        match self {
            Self::Other(number) | Self::Ours(number, _) => Some(*number),
            Self::Blank | Self::Damaged => None,
        }
    }
}

fn word(bytes: &Bytes, at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

/// The record of `settings`, and erased bytes after it.
fn record(number: u32, settings: &Settings) -> Option<Bytes> {
    let mut record = [0xff; RECORD];
    let length = postcard::to_slice(settings, record.get_mut(HEAD..RECORD - 4)?).ok()?.len();
    record.get_mut(..8)?.copy_from_slice(&LAYOUT);
    record.get_mut(8..12)?.copy_from_slice(&number.to_le_bytes());
    record.get_mut(12..HEAD)?.copy_from_slice(&(length as u32).to_le_bytes());
    let end = HEAD + length;
    let checksum = CRC.checksum(record.get(..end)?);
    record.get_mut(end..end + 4)?.copy_from_slice(&checksum.to_le_bytes());
    Some(record)
}

/// Settings in two pages of a flash.
pub struct SettingsStore<F> {
    flash: F,
    pages: [u32; 2],
}

impl<F: NorFlash> SettingsStore<F> {
    /// In `range`, bytes from the flash's start. `None` unless these are two whole pages that a record fits into.
    pub fn new(flash: F, range: Range<u32>) -> Option<Self> {
        let page = F::ERASE_SIZE as u32;
        let fits = page as usize >= RECORD && RECORD.is_multiple_of(F::WRITE_SIZE);
        let is_whole = range.start.is_multiple_of(page) && range.end.checked_sub(range.start) == page.checked_mul(2);
        (fits && is_whole).then(|| Self { flash, pages: [range.start, range.start + page] })
    }

    /// What was saved last, else the settings as delivered; and which of the two.
    pub fn load(&mut self) -> (Settings, Source) {
        let mut newest: Option<(u32, Settings)> = None;
        let (mut is_other, mut is_damaged) = (false, false);
        for page in self.pages {
            match self.read(page) {
                Slot::Blank => {}
                Slot::Damaged => is_damaged = true,
                Slot::Other(_) => is_other = true,
                Slot::Ours(number, settings) => {
                    if newest.as_ref().is_none_or(|(newest, _)| *newest < number) {
                        newest = Some((number, settings));
                    }
                }
            }
        }
        match newest {
            Some((_, settings)) => (settings, Source::Stored),
            None if is_damaged && !is_other => (Settings::default(), Source::Damaged),
            None => (Settings::default(), Source::Default),
        }
    }

    /// Saves, and reads back.
    ///
    /// # Errors
    /// The flash did not take them.
    pub fn save(&mut self, settings: &Settings) -> Result<(), NotSaved> {
        let mut numbers = [None; 2];
        for (number, page) in numbers.iter_mut().zip(self.pages) {
            *number = self.read(page).number();
        }
        let [first, second] = numbers;
        // Nothing is older than any number.
        let page = self.pages[usize::from(first > second)];
        let number = first.max(second).map_or(0, |newest| newest.saturating_add(1));
        let record = record(number, settings).ok_or(NotSaved)?;
        self.flash.erase(page, page + F::ERASE_SIZE as u32).map_err(|_| NotSaved)?;
        self.flash.write(page, &record).map_err(|_| NotSaved)?;
        let mut written = [0; RECORD];
        self.flash.read(page, &mut written).map_err(|_| NotSaved)?;
        if written == record { Ok(()) } else { Err(NotSaved) }
    }

    fn read(&mut self, page: u32) -> Slot {
        let mut record = [0; RECORD];
        match self.flash.read(page, &mut record) {
            Ok(()) => Slot::read(&record),
            Err(_) => Slot::Damaged,
        }
    }
}
