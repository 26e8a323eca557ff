//! How a subcommand ends, and its exit code.

use std::process::ExitCode;

use crate::study::failure::StudyFailure;

/// Why a subcommand did not succeed: the message, under the exit code that goes with it.
#[derive(Debug)]
pub enum Failure {
    /// The command line or a file is wrong (exit code 2).
    Input(String),
    /// The rig, the link or the disk failed (exit code 1).
    Failed(String),
    /// Ctrl-C or a request to terminate (exit code 130).
    Interrupted(String),
}

/// How a subcommand ends.
pub type Outcome = Result<(), Failure>;

impl From<StudyFailure> for Failure {
    fn from(error: StudyFailure) -> Self {
        match error {
            StudyFailure::Refused(refusal) => Self::input(refusal),
            other => Self::failed(other),
        }
    }
}

impl Failure {
    /// Wrong input.
    pub fn input(error: impl std::fmt::Display) -> Self {
        Self::Input(error.to_string())
    }

    /// A failure of rig, link or disk.
    pub fn failed(error: impl std::fmt::Display) -> Self {
        Self::Failed(error.to_string())
    }

    /// Prints the message to standard error and gives the exit code.
    pub(super) fn report(self) -> ExitCode {
        let (code, message) = match self {
            Self::Failed(message) => (1, message),
            Self::Input(message) => (2, message),
            Self::Interrupted(message) => (130, message),
        };
        warn!("error: {message}");
        ExitCode::from(code)
    }
}
