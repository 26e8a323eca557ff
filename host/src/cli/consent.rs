//! `--accept-settings`: the consent to go on although settings that somebody saved on the board do not act.

use clap::Args;

use crate::client::session::Session;
use crate::failure::{Failure, Outcome};

/// The flag.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct ConsentArg {
    /// Go on although the settings saved on the board do not act (damaged, of another layout, perhaps not the last): the settings
    /// in use act instead, and their limits may be looser
    #[arg(long)]
    accept_settings: bool,
}

impl ConsentArg {
    pub(super) fn is_given(self) -> bool {
        self.accept_settings
    }

    /// Lets the board drive for this session if the flag is given.
    ///
    /// # Errors
    /// The board needs consent and the flag is missing; `what` is refused then.
    pub(super) fn check(self, session: &mut Session, what: &str) -> Outcome {
        if self.accept_settings {
            return session.accept_settings().map_err(Failure::failed);
        }
        if !session.needs_consent() {
            return Ok(());
        }
        Err(Failure::Input(format!(
            "{what}: the settings that were saved on the board do not act\n  {}\n  restore them (`damprig settings restore BACKUP`, or \
             `damprig settings import FILE --save`), or keep those in use (`damprig settings save`);\n  --accept-settings goes on with \
             those in use this time. Nothing has moved",
            session.settings_line()
        )))
    }
}
