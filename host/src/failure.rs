//! Why a command or a call did not succeed: one type for the whole host, with the exit code that goes with it.
//!
//! Errors that are looked into (a session's, a run's end) are types of their own and turn into this one where they are told.

use std::fmt::Display;
use std::path::Path;

use arrow_schema::ArrowError;
use damprig_core::io::Invalid;
use damprig_identification::Refused;
use parquet::errors::ParquetError;

/// Why a command or a call did not succeed. The text names file, place and value, what is allowed, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The command line or a file is wrong (exit code 2); nothing has moved, nothing was written.
    #[error("{0}")]
    Input(String),
    /// The disk refuses a file or folder (exit code 1).
    #[error("{0}")]
    Disk(String),
    /// What is stored is damaged or missing, or a result cannot be made of it (exit code 1).
    #[error("{0}")]
    Storage(String),
    /// The rig, the link or a program that is needed failed (exit code 1).
    #[error("{0}")]
    Failed(String),
    /// Ctrl-C, a request to terminate, or a caller who wants no more (exit code 130).
    #[error("{0}")]
    Interrupted(String),
}

/// How a command ends.
pub type Outcome = Result<(), Failure>;

impl Failure {
    /// Wrong input.
    pub fn input(error: impl Display) -> Self {
        Self::Input(error.to_string())
    }

    /// What is stored is damaged or missing, or a result cannot be made of it.
    pub fn storage(error: impl Display) -> Self {
        Self::Storage(error.to_string())
    }

    /// A failure of rig, link or program.
    pub fn failed(error: impl Display) -> Self {
        Self::Failed(error.to_string())
    }

    /// Someone wanted no more.
    #[must_use]
    pub fn stopped() -> Self {
        Self::Interrupted("interrupted".into())
    }

    /// What cannot be done with a file or folder; `action` is a verb: "write", "create".
    pub fn cannot(action: &str, path: &Path, error: impl Display) -> Self {
        Self::Disk(format!("cannot {action} {}: {error}", path.display()))
    }

    /// A figure that cannot be drawn or written.
    pub fn undrawn(error: impl Display) -> Self {
        Self::Storage(format!("cannot draw the figure: {error}"))
    }

    /// A result, or `None` if it was interrupted.
    ///
    /// # Errors
    /// Any other failure.
    pub fn unless_interrupted<T>(result: Result<T, Self>) -> Result<Option<T>, Self> {
        match result {
            Err(Self::Interrupted(_)) => Ok(None),
            result => result.map(Some),
        }
    }

    /// The same failure with another text.
    #[must_use]
    pub fn with(self, text: impl FnOnce(&str) -> String) -> Self {
        match self {
            Self::Input(old) => Self::Input(text(&old)),
            Self::Disk(old) => Self::Disk(text(&old)),
            Self::Storage(old) => Self::Storage(text(&old)),
            Self::Failed(old) => Self::Failed(text(&old)),
            Self::Interrupted(old) => Self::Interrupted(text(&old)),
        }
    }

    /// Exit code of a command that ends so.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Disk(_) | Self::Storage(_) | Self::Failed(_) => 1,
            Self::Input(_) => 2,
            Self::Interrupted(_) => 130,
        }
    }
}

impl From<Invalid> for Failure {
    fn from(invalid: Invalid) -> Self {
        Self::input(invalid)
    }
}

impl From<Refused> for Failure {
    fn from(refused: Refused) -> Self {
        Self::Input(refused.0)
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Self::failed(error)
    }
}

impl From<ArrowError> for Failure {
    fn from(error: ArrowError) -> Self {
        Self::storage(error)
    }
}

impl From<ParquetError> for Failure {
    /// With the system's message where there is one.
    fn from(error: ParquetError) -> Self {
        match error {
            ParquetError::External(inner) => Self::storage(inner),
            other => Self::storage(other),
        }
    }
}
