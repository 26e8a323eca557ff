//! The settings that a board keeps, in a file: read as bytes over the link from any firmware, and given back to any firmware.
//!
//! The file is TOML: the bytes of every page of the settings memory in hexadecimal, and as a comment what they say. It can be read
//! as long as a program knows the layout of the settings in it; the bytes stay what they are.

use std::fmt::Write;
use std::path::Path;
use std::time::Duration;

use damprig_core::settings::{Settings, Source as Origin};
use damprig_device::settings_record::SettingsRecord;
use damprig_device::settings_store::choose;
use damprig_protocol::Request;
use serde::{Deserialize, Serialize};

use crate::client::link::Address;
use crate::client::session::{AnyBoard, Session, SessionError, hex};
use crate::failure::Failure;
use crate::host_time;
use crate::input::Source;
use crate::settings::{differences, origin_text, to_toml};

/// The settings that a board kept when they were read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Backup {
    /// The board.
    pub board: String,
    /// Version of its firmware.
    pub firmware: String,
    /// Its protocol version and the hash of its messages.
    pub protocol: String,
    /// When they were read.
    pub at: String,
    /// Bytes of each page of its settings memory, in hexadecimal.
    pub records: Vec<String>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BackupFile {
    backup: Backup,
}

/// What a restore did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restored {
    /// The board kept these settings already.
    Unchanged,
    /// They are saved on the board again.
    Saved,
}

/// Why settings were not restored.
#[derive(Debug, thiserror::Error)]
pub enum NotRestored {
    /// The backup has no settings that this program can read.
    #[error("the backup has no settings to restore: {0}\n  nothing was written")]
    Unreadable(String),
    /// The board did not take them.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The board has others after it has saved them.
    #[error("the board has saved other settings than those of the backup:\n  {}", .0.join("\n  "))]
    Different(Vec<String>),
}

impl Backup {
    /// Reads the settings memory of a board, whatever its protocol.
    ///
    /// # Errors
    /// As [`AnyBoard::stored_records`].
    pub fn of(board: &mut AnyBoard) -> Result<Self, SessionError> {
        let records = board.stored_records()?;
        let it = board.identity();
        Ok(Self {
            board: it.board.to_string(),
            firmware: it.firmware.to_string(),
            protocol: format!("{} (schema {})", it.protocol, hex(&it.schema)),
            at: host_time::now().to_string(),
            records: records.iter().map(|bytes| hex(bytes)).collect(),
        })
    }

    /// Reads the settings memory of a board whose firmware is about to be replaced.
    ///
    /// # Errors
    /// As [`Backup::of`]; settings in use that are not saved, which the reset would lose.
    pub fn before_update(address: &Address, timeout: Duration) -> Result<Self, String> {
        let mut board = AnyBoard::open(address, timeout).map_err(|error| error.to_string())?;
        let backup = Self::of(&mut board).map_err(|error| error.to_string())?;
        if board.has_this_protocol() {
            let session = board.into_session().map_err(|error| error.to_string())?;
            if session.description.settings == Origin::Host {
                let what = "the settings in use are changed and not saved, and the reset loses them: `damprig settings save` first";
                return Err(what.into());
            }
        }
        Ok(backup)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or is no backup.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let source = Source::read(path)?;
        let refused = |why: &str| {
            Failure::Input(format!(
                "{}: this is not a backup of settings: {why}\n  `damprig settings backup FILE` writes one; `damprig settings import` reads \
                 files of `damprig settings export`",
                path.display()
            ))
        };
        let BackupFile { backup } = toml::from_str(source.text()).map_err(|error| refused(error.message()))?;
        match backup.records.iter().position(|text| bytes(text).is_none()) {
            Some(page) => Err(refused(&format!("record {} is not hexadecimal", page + 1))),
            None => Ok(backup),
        }
    }

    fn decoded(&self) -> Vec<SettingsRecord> {
        self.records
            .iter()
            .map(|text| bytes(text).map_or(SettingsRecord::Damaged, |bytes| SettingsRecord::read(&bytes)))
            .collect()
    }

    /// The settings in the records that would act on a board, and where they come from.
    #[must_use]
    pub fn settings(&self) -> (Settings, Origin) {
        choose(&self.decoded())
    }

    /// Whether no settings were ever saved on the board.
    #[must_use]
    pub fn is_blank(&self) -> bool {
        self.settings().1 == Origin::Default
    }

    /// Hashes of the layouts that this program does not know, in words; empty for none.
    fn unknown_layouts(&self) -> String {
        let layouts = self.decoded().into_iter().filter_map(|record| match record {
            SettingsRecord::Other { layout, .. } => Some(format!(" (layout {})", hex(&layout))),
            _ => None,
        });
        layouts.collect()
    }

    /// What the records say, in words.
    #[must_use]
    pub fn summary(&self) -> String {
        format!("{}{}", origin_text(self.settings().1), self.unknown_layouts())
    }

    /// The file's text.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut text = String::from(
            "# The settings that a board keeps. `damprig settings restore FILE` gives them back.\n# They are in `records`, byte by byte.",
        );
        let (settings, origin) = self.settings();
        let _ = writeln!(text, " They say: {}{}\n", origin_text(origin), self.unknown_layouts());
        // A table of strings.
        text.push_str(&toml::to_string(&BackupFile { backup: self.clone() }).unwrap_or_default());
        if matches!(origin, Origin::Stored | Origin::Migrated | Origin::Older) {
            text.push_str("\n# For people; not read:\n");
            for line in to_toml(&settings, "").lines() {
                let _ = writeln!(text, "{}", format!("# {line}").trim_end());
            }
        }
        text
    }

    /// The settings that a restore gives to a board.
    ///
    /// # Errors
    /// There are none that this program can read.
    pub fn restorable(&self) -> Result<Settings, NotRestored> {
        let (settings, origin) = self.settings();
        Err(NotRestored::Unreadable(match origin {
            Origin::Stored | Origin::Migrated | Origin::Older => return Ok(settings),
            Origin::Default => "none were ever saved on that board".into(),
            Origin::OtherLayout => format!(
                "they have another layout{}; restore them with the damprig of the firmware {}",
                self.unknown_layouts(),
                self.firmware
            ),
            Origin::Damaged | Origin::Host => "its records are damaged".into(),
        }))
    }

    /// Gives the settings back to a board: uses and saves them, and compares what the board then has and keeps.
    ///
    /// # Errors
    /// A backup without readable settings; a board that does not take them, or has others afterwards.
    pub fn restore(&self, session: &mut Session) -> Result<Restored, NotRestored> {
        let wanted = self.restorable()?;
        if session.read_settings()? == (wanted, Origin::Stored) {
            return Ok(Restored::Unchanged);
        }
        session.execute("use the settings", Request::SetSettings(wanted))?;
        session.execute("save its settings", Request::SaveSettings)?;
        let (in_use, origin) = session.read_settings()?;
        (session.settings, session.description.settings) = (in_use, origin);
        let kept: Vec<SettingsRecord> =
            session.stored_records()?.iter().map(|bytes| SettingsRecord::read(bytes)).collect();
        let kept = if kept.is_empty() { (in_use, origin) } else { choose(&kept) };
        let mut different = differences(&wanted, &in_use, |_| true);
        if kept != (wanted, Origin::Stored) {
            different.extend(differences(&wanted, &kept.0, |_| true));
            different.push(format!("what the board keeps: {}", origin_text(kept.1)));
        }
        if different.is_empty() { Ok(Restored::Saved) } else { Err(NotRestored::Different(different)) }
    }
}

/// The bytes of hexadecimal digits.
fn bytes(text: &str) -> Option<Vec<u8>> {
    let digits: Option<Vec<u8>> = text.chars().map(|c| c.to_digit(16).map(|digit| digit as u8)).collect();
    let digits = digits.filter(|digits| digits.len().is_multiple_of(2))?;
    Some(digits.chunks_exact(2).map(|pair| pair[0] << 4 | pair[1]).collect())
}
