//! Stores the rig's settings in flash. A power loss at any instant leaves either the old or the new settings.
//!
//! Each of two pages holds one record: the settings in postcard, the hash of their layout, a sequence number, and a
//! CRC-32 over all of these. A save erases the page that does *not* hold the newest record and writes there. An
//! interrupted erase or write therefore leaves the other page untouched, and the checksum shows which record is valid
//! (random bytes pass with a probability of 2⁻³²). A record of another layout is not read. A read of a word with an
//! uncorrectable error must return some bytes instead of faulting.
//!
//! The crate `sequential-storage` is not used: after an erase that was interrupted bit by bit it found neither the
//! old nor the new settings.
//!
//! A page endures 10 000 erase cycles (data sheet), both pages together 20 000 saves. [`crate::controller`] decides
//! when settings may be saved.

use core::ops::Range;
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use damprig_core::settings::{Prepared, Settings, Source};
use embedded_storage::nor_flash::NorFlash;
use postcard_schema::key::Key;

/// Hash of the layout of [`Settings`], names included.
const LAYOUT: [u8; 8] = Key::for_path::<Settings>("settings").to_bytes();

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Size of a record, bytes, a multiple of the flash's word: 66 numbers of four bytes, header, checksum, and a
/// reserve.
const RECORD: usize = 320;

/// Size of the header, bytes, the same in every layout: layout hash, sequence number, length of the settings.
const HEAD: usize = 8 + 4 + 4;

type Bytes = [u8; RECORD];

/// The settings could not be saved. Settings saved before are still stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotSaved;

/// Content of a page.
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
enum Slot {
    Blank,
    Damaged,
    /// A valid record of another layout, with its sequence number.
    Other(u32),
    /// Settings of this layout, with their sequence number.
    Ours(u32, Settings),
}

impl Slot {
    fn read(record: &Bytes) -> Self {
        if record.iter().all(|byte| *byte == 0xff) {
            return Self::Blank;
        }
        Self::sound(record).unwrap_or(Self::Damaged)
    }

    /// Returns `None` for a record with a wrong checksum or invalid settings.
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

/// Encodes `settings` as a record, padded with erased bytes.
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

/// Stores settings in two pages of a flash.
pub struct SettingsStore<F> {
    flash: F,
    pages: [u32; 2],
}

impl<F: NorFlash> SettingsStore<F> {
    /// Uses the pages in `range`, bytes from the start of the flash. `None` unless these are exactly two pages that
    /// each hold a record.
    pub fn new(flash: F, range: Range<u32>) -> Option<Self> {
        let page = F::ERASE_SIZE as u32;
        let fits = page as usize >= RECORD && RECORD.is_multiple_of(F::WRITE_SIZE);
        let is_whole = range.start.is_multiple_of(page) && range.end.checked_sub(range.start) == page.checked_mul(2);
        (fits && is_whole).then(|| Self { flash, pages: [range.start, range.start + page] })
    }

    /// Reads the settings that were saved last, or the defaults, and their source.
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

    /// Saves the settings and verifies them by reading back.
    ///
    /// # Errors
    /// The flash did not accept the record.
    pub fn save(&mut self, settings: &Settings) -> Result<(), NotSaved> {
        let mut numbers = [None; 2];
        for (number, page) in numbers.iter_mut().zip(self.pages) {
            *number = self.read(page).number();
        }
        let [first, second] = numbers;
        // `None`, a page without a record, is less than any number.
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
