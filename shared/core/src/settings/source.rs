//! Where the settings in use come from, and whether an experiment may drive on them without a person's consent.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Origin of the settings in use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Source {
    /// The defaults: nothing was ever saved.
    #[default]
    Default,
    /// The settings that were saved last.
    Stored,
    /// The defaults, or settings set since: the saved settings are damaged or cannot be read.
    Damaged,
    /// Set by a host and not saved.
    Host,
    /// The defaults, or settings set since: those that were saved have a layout that this firmware does not know.
    OtherLayout,
    /// The settings that were saved last, by a firmware with the layout before this one. Values that it did not have
    /// are the defaults.
    Migrated,
    /// Saved settings, perhaps not the last: another record is damaged, or is newer and of an unknown layout.
    Older,
}

impl Source {
    /// Whether settings that somebody saved do not act, so that limits may be looser than the saved ones. The rig then
    /// does not drive until a host accepts the settings in use, or saves settings.
    #[must_use]
    pub fn needs_consent(self) -> bool {
        match self {
            Self::Damaged | Self::OtherLayout | Self::Older => true,
            Self::Default | Self::Stored | Self::Host | Self::Migrated => false,
        }
    }

    /// The origin after a host has set other settings without saving them. What was saved still does not act.
    #[must_use]
    pub fn once_set(self) -> Self {
        if self.needs_consent() { self } else { Self::Host }
    }
}
