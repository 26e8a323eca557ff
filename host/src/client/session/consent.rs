//! Which settings act and where they come from, and the consent to drive on settings other than the saved ones.

use damprig_core::settings::Source;
use damprig_protocol::Request;

use super::{Session, SessionError};
use crate::settings::{limits_text, origin_text};

impl Session {
    /// Where the settings in use come from, in words.
    #[must_use]
    pub fn settings_origin(&self) -> String {
        match (&self.settings_file, self.description.settings) {
            (Some(file), Source::Stored) => format!("from {}", file.display()),
            (_, source) => origin_text(source).to_string(),
        }
    }

    /// The settings in use in words: where they come from, and the board's limits.
    #[must_use]
    pub fn settings_text(&self) -> String {
        format!("{}; {}", self.settings_origin(), limits_text(&self.settings))
    }

    /// The board and the settings in use, on one line.
    #[must_use]
    pub fn settings_line(&self) -> String {
        format!("Settings of {}: {}", self.identity.board, self.settings_text())
    }

    /// Whether settings that somebody saved do not act: the board then drives only with consent.
    #[must_use]
    pub fn needs_consent(&self) -> bool {
        self.description.settings.needs_consent()
    }

    /// Lets the board drive on the settings in use for this session, if it needs that consent.
    ///
    /// # Errors
    /// As [`Session::request`].
    pub fn accept_settings(&mut self) -> Result<(), SessionError> {
        if self.needs_consent() {
            self.execute("accept its settings", Request::AcceptSettings)?;
            self.has_accepted_settings = true;
        }
        Ok(())
    }

    /// Says that settings that somebody saved do not act, for the warnings of a board.
    #[must_use]
    pub fn consent_warning(&self) -> Option<String> {
        let accepted = if self.has_accepted_settings { "; accepted for this run (--accept-settings)" } else { "" };
        self.needs_consent().then(|| format!("settings {}{accepted}", self.settings_origin()))
    }
}
