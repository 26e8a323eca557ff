//! `damprig simulate`: a case from a file, its exact motion, and what is shown of it.
//!
//! The motion is [`damprig_core::integrator::exact`]; here are the file ([`case`]), and the run with its figures
//! ([`run`]).

pub mod case;
mod from_json;
pub mod run;

pub use case::Case;
pub use run::{Answer, Samples, simulate};
