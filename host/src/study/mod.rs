//! Studies: a case, the keys that are varied, and what is computed at each point; docs/STUDIES.md is the
//! user's page.
//!
//! [`mod@file`] reads the study, [`axis`] and [`points`] say which cases it has, [`evaluate`] simulates them, [`data_set`] keeps the
//! results as parts that survive a kill, [`run`] does all of it on this machine.

pub mod axis;
pub mod data_set;
pub mod evaluate;
pub mod file;
mod keys;
pub mod metric;
pub mod points;
pub mod run;

pub use file::Study;
pub use keys::{SHARED, TABLES};
