//! Estimates of the rig's parameters from recorded motions, responses and impacts, with their uncertainties.
//!
//! Each method has a file with its equations. They take numbers; files and run folders are read in `damprig`.

pub mod backbone;
pub mod decay;
pub mod decay_motion;
mod decay_record;
mod estimate;
pub mod flights;
pub mod lack_of_fit;
pub mod modal;
pub mod modes;
pub mod response;
pub mod restitution;
pub mod sensors;
pub mod statistics;
pub mod time_response;

pub use estimate::Estimate;
pub use sensors::Sensors;

/// Why nothing can be identified from what was given: what was seen, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Refused(pub String);
