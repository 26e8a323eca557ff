//! Every numerical figure and table of the source document, computed anew and set beside the published values; docs/THESIS.md is
//! the user's page.
//!
//! [`files`] has the files that ship with the program, [`catalogue`] the items and their parts, [`published`] the printed values
//! and [`published_curve`] the curves of the figures.
//! [`mod@run`] computes parts, [`results`] reads what was computed, [`claims`] judges the document's claims by it, [`compared`] sets it
//! beside the published values, [`marked`] draws those over the computed curves, and [`page`] writes all that out.

pub mod catalogue;
pub mod claims;
pub mod cli;
pub mod compared;
pub mod files;
pub mod found;
mod keys;
pub mod marked;
pub mod page;
pub mod published;
pub mod published_curve;
pub mod results;
pub mod run;

pub use catalogue::Catalogue;
pub use keys::TABLES;
pub use published::Published;
pub use results::Results;
