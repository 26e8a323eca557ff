//! Optimisation: the values of a case's keys at which a metric is best, and how sure that is; docs/OPTIMISE.md is the user's page.
//!
//! [`mod@file`] reads what is varied and what is wanted, [`variable`] what can be made and what is not known, [`scenarios`] what may become of it and [`over`] what of that counts; [`evaluate`] gives the objective at a point, [`search`] looks for the best
//! point, [`mount`] for values near it that a person can set, [`neighbourhood`] says what small changes do, [`references`] what other dampers do, [`size`] how many simulations all that takes, [`mod@over_band`] has it over the band, `stuck` says how long friction holds the structure; [`answer`] has all of it, [`run`] does all that and
//! [`table`] writes it.

pub mod answer;
mod cases;
pub mod evaluate;
pub mod file;
mod keys;
pub mod mount;
pub mod neighbourhood;
pub mod over;
pub mod over_band;
pub mod references;
pub mod run;
pub mod scenarios;
pub mod search;
pub mod size;
mod stuck;
pub mod table;
pub mod variable;

pub use answer::Answer;
pub use file::Optimisation;
pub use keys::TABLES;
