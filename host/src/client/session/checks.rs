//! Checks what a device sends of its own accord: how much waits, and whether what it says about itself can be used.

use std::collections::BTreeSet;

use damprig_core::settings::Settings;
use damprig_protocol::Signal;

use super::{Session, SessionError};
use crate::settings::entries;

/// Most reports that wait to be taken: minutes of every signal of a board at its fastest, about 40 MiB.
const MAX_REPORTS: usize = 1 << 17;

/// Most messages that nothing was asked of, since the device last answered a request.
const MAX_UNASKED: u32 = 100_000;

impl Session {
    /// Counts a message that nothing was asked of.
    pub(super) fn note_unasked(&mut self) {
        self.unasked = self.unasked.saturating_add(1);
    }

    /// Checks that the device does not send more than it was asked for; a defective one could fill the memory.
    pub(super) fn check_flood(&mut self) -> Result<(), SessionError> {
        let what = if self.reports.len() > MAX_REPORTS {
            format!("{} reports are waiting", self.reports.len())
        } else if self.unasked > MAX_UNASKED {
            format!("{} messages that answer nothing", self.unasked)
        } else {
            return Ok(());
        };
        self.reports.clear();
        Err(SessionError::Flood { link: self.name.clone(), what })
    }

    /// Counts a report that does not fit what the device was asked to do.
    ///
    /// # Errors
    /// When there are too many of them.
    pub fn note_misfit(&mut self) -> Result<(), SessionError> {
        self.note_unasked();
        self.check_flood()
    }

    /// The error of a device that reports what cannot be.
    #[must_use]
    pub fn unusable(&self, what: String) -> SessionError {
        SessionError::Unusable { link: self.name.clone(), what }
    }

    /// The error of a device whose saved settings cannot be read.
    pub(super) fn no_records(&self, why: &'static str) -> SessionError {
        SessionError::NoRecords { link: self.name.clone(), why }
    }

    /// Signals become columns of files, so their names are plain and different.
    pub(super) fn check_signals(&self, table: &[Signal]) -> Result<(), SessionError> {
        let mut names = BTreeSet::new();
        for signal in table {
            let name = signal.name.as_str();
            let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
            if name.is_empty() || !name.chars().all(is_plain) || !names.insert(name) {
                let allowed = "each name is used once and has small letters, digits and _";
                return Err(self.unusable(format!("a signal named {name:?}; {allowed}")));
            }
            if signal.unit.chars().any(char::is_control) {
                return Err(self.unusable(format!("the unit {:?} of the signal {name}", signal.unit.as_str())));
            }
        }
        Ok(())
    }

    /// Settings are compared, journaled and used as limits, so each is a number.
    pub(super) fn check_settings(&self, settings: &Settings) -> Result<(), SessionError> {
        match entries(settings).into_iter().find(|(_, value)| !value.is_finite()) {
            None => Ok(()),
            Some((place, value)) => Err(self.unusable(format!("the setting {} = {value}", place.join(".")))),
        }
    }
}
