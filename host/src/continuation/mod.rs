//! Follows periodic orbits of a case over a parameter, as `damprig continue` does.
//!
//! The mathematics is in the crate `damprig-continuation`, for systems of one degree of freedom and for structures with several places. This module reads the continuation file, which names a case, and collects the
//! result for tables, figures and JSON.

mod file;
mod found;
mod keys;
mod of_set_up;
mod of_structure;

pub use file::Continuation;
pub use found::{FoundBranch, FoundBranches, FoundCurve, FoundGap, FoundOrbit, FoundSpecial};
pub use keys::TABLES;
pub use of_set_up::over_frequency;
