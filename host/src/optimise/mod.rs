//! Optimisation: the values of a case's keys at which a metric is best, and how sure that is; docs/OPTIMISE.md is the user's page.
//!
//! [`mod@file`] reads what is varied and what is wanted, [`evaluate`] gives the objective at a point, [`search`] looks for the best
//! point, [`mount`] for values near it that a person can set, [`neighbourhood`] says what small changes do, [`references`] what other dampers do, [`size`] how many simulations all that takes, [`answer`] has all of it and
//! [`table`] writes it.

pub mod answer;
mod cases;
pub mod evaluate;
pub mod file;
mod keys;
pub mod mount;
pub mod neighbourhood;
pub mod references;
pub mod search;
pub mod size;
pub mod table;

pub use answer::Answer;
pub use file::Optimisation;
pub use keys::TABLES;
