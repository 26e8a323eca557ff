//! The record in which settings are stored: bytes, checksum, layouts, and the migration of the last layout.
//!
//! | bytes | contents |
//! |---|---|
//! | 8 | hash of the layout of the settings |
//! | 4 | sequence number, little endian: of two records the one with the larger number is newer |
//! | 4 | length of the settings, bytes, little endian |
//! | length | the settings in postcard |
//! | 4 | CRC-32 of all the bytes before it, little endian |
//!
//! Erased bytes (0xff) follow. This frame is the same in every layout and never changes, so that any later firmware or
//! host finds the sequence number and the layout of any record.
//!
//! A change of [`Settings`] changes the layout. Then the type of before moves into `last`, with the conversion, and the
//! bytes of a record of it into the tests (`shared/device/tests/integration/layouts.rs`).

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use damprig_core::settings::{Prepared, Settings};
use postcard_schema::key::Key;

/// Hash of the layout of [`Settings`], names included.
pub const LAYOUT: [u8; 8] = Key::for_path::<Settings>("settings").to_bytes();

/// Hash of the last layout, that of `last::Settings`.
pub const LAST_LAYOUT: [u8; 8] = Key::for_path::<last::Settings>("settings").to_bytes();

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Size of a record, bytes, a multiple of the flash's word: 66 numbers of four bytes, header, checksum, and a
/// reserve.
pub const RECORD_BYTES: usize = 320;

/// Size of the header, bytes, the same in every layout: layout hash, sequence number, length of the settings.
const HEAD: usize = 8 + 4 + 4;

/// A record.
pub type Bytes = [u8; RECORD_BYTES];

/// The layout before this one: without the records of the calibrations.
mod last {
    use damprig_core::control::friction_spring::SpringConfig;
    use damprig_core::control::safety::SafetyConfig;
    use damprig_core::io::Calibration;
    use damprig_core::measure::impacts::ImpactConfig;
    use damprig_core::settings::Calibrated;
    use postcard_schema::Schema;
    use serde::Deserialize;

    /// The layout's hash contains the name of the type.
    #[derive(Deserialize, Schema)]
    pub struct Settings {
        calibration: Calibration,
        safety: SafetyConfig,
        spring: SpringConfig,
        impacts: ImpactConfig,
    }

    impl From<Settings> for damprig_core::settings::Settings {
        fn from(Settings { calibration, safety, spring, impacts }: Settings) -> Self {
            Self { calibration, safety, spring, impacts, calibrated: Calibrated::default() }
        }
    }
}

/// Content of the place of a record.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub enum SettingsRecord {
    /// Erased bytes.
    Blank,
    /// A wrong checksum, or settings out of range.
    Damaged,
    /// A valid record of an unknown layout.
    Other {
        /// Its sequence number.
        number: u32,
        /// Hash of its layout.
        layout: [u8; 8],
    },
    /// Settings of this layout, or of the last one.
    Settings {
        /// Their sequence number.
        number: u32,
        /// The settings.
        settings: Settings,
        /// They had the last layout: values that it lacks are the defaults.
        is_migrated: bool,
    },
}

impl SettingsRecord {
    /// Reads a record; bytes after its checksum are ignored.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Self {
        if bytes.iter().all(|byte| *byte == 0xff) {
            return Self::Blank;
        }
        Self::sound(bytes).unwrap_or(Self::Damaged)
    }

    /// Returns `None` for a record with a wrong checksum or invalid settings.
    fn sound(bytes: &[u8]) -> Option<Self> {
        let (number, length) = (word(bytes, 8)?, word(bytes, 12)? as usize);
        let end = HEAD.checked_add(length)?;
        if CRC.checksum(bytes.get(..end)?) != word(bytes, end)? {
            return None;
        }
        let layout = *bytes.first_chunk()?;
        let body = bytes.get(HEAD..end)?;
        let settings = match layout {
            LAYOUT => postcard::from_bytes(body).ok()?,
            LAST_LAYOUT => postcard::from_bytes::<last::Settings>(body).ok()?.into(),
            _ => return Some(Self::Other { number, layout }),
        };
        Prepared::new(&settings).ok()?;
        Some(Self::Settings { number, settings, is_migrated: layout == LAST_LAYOUT })
    }

    /// The sequence number of a valid record.
    #[must_use]
    pub fn number(&self) -> Option<u32> {
        match self {
            Self::Other { number, .. } | Self::Settings { number, .. } => Some(*number),
            Self::Blank | Self::Damaged => None,
        }
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

/// Encodes `settings` as a record, padded with erased bytes.
#[must_use]
pub fn encode(number: u32, settings: &Settings) -> Option<Bytes> {
    let mut record = [0xff; RECORD_BYTES];
    let length = postcard::to_slice(settings, record.get_mut(HEAD..RECORD_BYTES - 4)?).ok()?.len();
    record.get_mut(..8)?.copy_from_slice(&LAYOUT);
    record.get_mut(8..12)?.copy_from_slice(&number.to_le_bytes());
    record.get_mut(12..HEAD)?.copy_from_slice(&(length as u32).to_le_bytes());
    let end = HEAD + length;
    let checksum = CRC.checksum(record.get(..end)?);
    record.get_mut(end..end + 4)?.copy_from_slice(&checksum.to_le_bytes());
    Some(record)
}
