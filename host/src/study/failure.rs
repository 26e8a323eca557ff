//! Why a study cannot go on.

use crate::input::Refusal;
use crate::run_folder::{ReadError, StorageError};

/// Why a study cannot go on. The parts that are there stay.
#[derive(Clone, Debug, thiserror::Error)]
pub enum StudyFailure {
    /// The study, its case or the place of its results is wrong.
    #[error("{0}")]
    Refused(#[from] Refusal),
    /// A file cannot be written, read or listed.
    #[error("{0}")]
    Storage(#[from] StorageError),
    /// A file of the results is damaged or missing.
    #[error("{0}")]
    Damaged(#[from] ReadError),
}
