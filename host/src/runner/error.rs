//! Why a run ended early.

use damprig_core::control::friction_spring;

use super::fault_text::{cause_text, drive_text};
use crate::client::session::SessionError;
use crate::failure::Failure;

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The campaign needs something that this device lacks, and nothing has moved, or the disk could not be written.
    #[error(transparent)]
    Other(#[from] Failure),
    /// The session failed: the device or the link.
    #[error(transparent)]
    Session(SessionError),
    /// An interlock ended the drive.
    #[error(
        "{}: {}; set-up {set_up:?}, t = {t_s:.3} s",
        drive_text(*cause),
        cause_text(*cause, *value, *limit)
    )]
    Fault {
        /// The set-up.
        set_up: String,
        /// Cause of the fault.
        cause: damprig_core::control::fault::FaultCause,
        /// Time since the start of the experiment, s.
        t_s: f64,
        /// The value that violated the limit.
        value: f32,
        /// The limit.
        limit: f32,
    },
    /// The friction damper's spring could not be set.
    #[error("the drive was not started on set-up {set_up:?}: {}", cause_text(*cause, *value, *limit))]
    Spring {
        /// The set-up.
        set_up: String,
        /// Cause of the fault.
        cause: damprig_core::control::fault::FaultCause,
        /// The value that violated the limit.
        value: f32,
        /// The limit.
        limit: f32,
    },
    /// The friction damper's spring did not finish a step.
    #[error("set-up {set_up:?}: the friction damper's spring did not finish its step; it is {}", stage.text())]
    SpringLost {
        /// The set-up.
        set_up: String,
        /// Stage of the spring.
        stage: friction_spring::SpringStage,
    },
    /// The same point was started repeatedly and never finished.
    #[error(
        "set-up {set_up:?}: {tries} starts in a row gave no new point (the last one: {last}); {missing} are missing"
    )]
    NoProgress {
        /// The set-up.
        set_up: String,
        /// Number of starts.
        tries: u32,
        /// How the last start ended.
        last: String,
        /// Number of points that are missing.
        missing: usize,
    },
    /// The run was interrupted by Ctrl-C or a termination signal.
    #[error("interrupted")]
    Interrupted,
    /// A person stopped the run because the rig was not at rest after it was changed.
    #[error(
        "set-up {set_up:?} was not at rest before experiment {experiment:?}: stopped; nothing was driven since the prompt"
    )]
    NotAtRest {
        /// The set-up.
        set_up: String,
        /// The experiment.
        experiment: String,
    },
    /// The mounting of a set-up was not confirmed, or the program runs without a terminal.
    #[error("{0}")]
    NobodyThere(String),
}

impl From<SessionError> for RunError {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Interrupted => Self::Interrupted,
            error => Self::Session(error),
        }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Other(failure) => failure,
            RunError::Interrupted => Self::stopped(),
            error => Self::failed(error),
        }
    }
}
