//! Calibrates the channels of a rig: measures them at known references, fits their scales with uncertainties, and makes
//! settings of them.
//!
//! [`guide`] leads a person through the points, [`rig`] measures, [`fit`] and [`solve`] compute, [`readings`] reads and keeps the points,
//! [`record`] turns the result into settings and text. [`rehearsal`] is a simulated operator on a virtual rig whose true
//! scales are known.

pub mod channel;
pub mod fit;
pub mod guide;
mod moving;
pub mod readings;
pub mod record;
pub mod rehearsal;
pub mod rig;
pub mod solve;
mod walls;

pub use channel::Channel;
pub use readings::Point;
pub use solve::Solved;

use crate::client::session::SessionError;

/// Why a channel could not be calibrated.
#[derive(Debug, thiserror::Error)]
pub enum CannotCalibrate {
    /// The values cannot be used: what, where, and what to do.
    #[error("{0}")]
    Values(String),
    /// The rig or the disk failed.
    #[error("{0}")]
    Failed(String),
    /// Ctrl-C, or no more answers.
    #[error("interrupted; the board has its settings of before")]
    Interrupted,
}

impl CannotCalibrate {
    /// Values that cannot be used.
    pub fn values(text: impl Into<String>) -> Self {
        Self::Values(text.into())
    }
}

impl From<SessionError> for CannotCalibrate {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Interrupted => Self::Interrupted,
            error => Self::Failed(error.to_string()),
        }
    }
}

impl From<crate::identify::CannotIdentify> for CannotCalibrate {
    fn from(error: crate::identify::CannotIdentify) -> Self {
        Self::Values(error.to_string())
    }
}
