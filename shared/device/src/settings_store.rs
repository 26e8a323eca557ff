//! Stores the rig's settings in flash. A power loss at any instant leaves either the old or the new settings.
//!
//! Each of two pages holds one record ([`crate::settings_record`]). A save erases the page that does *not* hold the
//! newest record and writes there. An interrupted erase or write therefore leaves the other page untouched, and the
//! checksum shows which record is valid (random bytes pass with a probability of 2⁻³²). A read of a word with an
//! uncorrectable error must return some bytes instead of faulting.
//!
//! The crate `sequential-storage` is not used: after an erase that was interrupted bit by bit it found neither the
//! old nor the new settings.
//!
//! A page endures 10 000 erase cycles (data sheet), both pages together 20 000 saves. [`crate::controller`] decides
//! when settings may be saved.

use core::ops::Range;
use damprig_core::settings::{Settings, Source};
use damprig_protocol::StoredPart;
use embedded_storage::nor_flash::NorFlash;

use crate::settings_record::{Bytes, RECORD_BYTES, SettingsRecord, encode};

/// The settings could not be saved. Settings saved before are still stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotSaved;

/// The bytes of both pages, for a host that asks for them ([`damprig_protocol::Request::StoredSettings`]).
#[derive(Clone, Debug)]
pub struct Records([Bytes; 2]);

impl Records {
    /// Zeros, which are no valid record.
    pub const UNREAD: Self = Self([[0; RECORD_BYTES]; 2]);

    /// Erased pages: no settings were ever saved.
    pub const ERASED: Self = Self([[0xff; RECORD_BYTES]; 2]);

    /// Writes these settings to the first page, as a board that has saved them once; `None` leaves the pages as they are.
    pub fn hold(&mut self, settings: &Settings) -> Option<()> {
        self.0[0] = encode(0, settings)?;
        Some(())
    }

    /// The bytes of a page from `from` on, as many as fit a reply.
    #[must_use]
    pub fn part(&self, page: u8, from: u16) -> StoredPart {
        let Some(record) = self.0.get(usize::from(page)) else { return StoredPart::NONE };
        let rest = record.get(usize::from(from)..).unwrap_or_default();
        StoredPart {
            length: RECORD_BYTES as u16,
            bytes: rest.iter().copied().take(damprig_protocol::STORED_TOLD).collect(),
        }
    }
}

/// Chooses the settings that act from the records of the pages: those that were saved last, or the defaults.
#[must_use]
pub fn choose(records: &[SettingsRecord]) -> (Settings, Source) {
    let mut newest: Option<(u32, &Settings, bool)> = None;
    for record in records {
        if let SettingsRecord::Settings { number, settings, is_migrated } = record
            && newest.is_none_or(|(newest, ..)| newest < *number)
        {
            newest = Some((*number, settings, *is_migrated));
        }
    }
    let is_damaged = records.iter().any(|record| matches!(record, SettingsRecord::Damaged));
    let other = records
        .iter()
        .filter(|record| matches!(record, SettingsRecord::Other { .. }))
        .filter_map(SettingsRecord::number)
        .max();
    match newest {
        // Nobody can tell whether the damaged record was the newer one.
        Some((number, settings, _)) if is_damaged || other.is_some_and(|other| other > number) => {
            (*settings, Source::Older)
        }
        Some((_, settings, true)) => (*settings, Source::Migrated),
        Some((_, settings, false)) => (*settings, Source::Stored),
        None if other.is_some() => (Settings::default(), Source::OtherLayout),
        None if is_damaged => (Settings::default(), Source::Damaged),
        None => (Settings::default(), Source::Default),
    }
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
        let fits = page as usize >= RECORD_BYTES && RECORD_BYTES.is_multiple_of(F::WRITE_SIZE);
        let is_whole = range.start.is_multiple_of(page) && range.end.checked_sub(range.start) == page.checked_mul(2);
        (fits && is_whole).then(|| Self { flash, pages: [range.start, range.start + page] })
    }

    /// Reads the settings that were saved last, or the defaults, and their source.
    pub fn load(&mut self) -> (Settings, Source) {
        let [first, second] = self.pages;
        choose(&[self.read(first), self.read(second)])
    }

    /// Copies the bytes of a page. A page that cannot be read is copied as zeros, which are no valid record.
    pub fn copy(&mut self, records: &mut Records) {
        for (place, page) in records.0.iter_mut().zip(self.pages) {
            if self.flash.read(page, place).is_err() {
                *place = [0; RECORD_BYTES];
            }
        }
    }

    /// Saves the settings and verifies them by reading back. A damaged record in the other page is then erased: from now
    /// on these settings are the last.
    ///
    /// # Errors
    /// The flash did not accept the record.
    pub fn save(&mut self, settings: &Settings) -> Result<(), NotSaved> {
        let (mut numbers, mut is_damaged) = ([None; 2], [false; 2]);
        for (place, page) in self.pages.into_iter().enumerate() {
            let record = self.read(page);
            (numbers[place], is_damaged[place]) = (record.number(), record == SettingsRecord::Damaged);
        }
        let [first, second] = numbers;
        // `None`, a page without a record, is less than any number.
        let place = usize::from(first > second);
        let (page, other) = (self.pages[place], self.pages[1 - place]);
        let number = first.max(second).map_or(0, |newest| newest.saturating_add(1));
        let record = encode(number, settings).ok_or(NotSaved)?;
        self.flash.erase(page, page + F::ERASE_SIZE as u32).map_err(|_| NotSaved)?;
        self.flash.write(page, &record).map_err(|_| NotSaved)?;
        // What the next start reads decides; the padding after the checksum does not count.
        let saved = SettingsRecord::Settings { number, settings: *settings, is_migrated: false };
        if self.read(page) != saved {
            return Err(NotSaved);
        }
        if is_damaged[1 - place] {
            self.flash.erase(other, other + F::ERASE_SIZE as u32).map_err(|_| NotSaved)?;
        }
        Ok(())
    }

    fn read(&mut self, page: u32) -> SettingsRecord {
        let mut bytes = [0; RECORD_BYTES];
        match self.flash.read(page, &mut bytes) {
            Ok(()) => SettingsRecord::read(&bytes),
            Err(_) => SettingsRecord::Damaged,
        }
    }
}
