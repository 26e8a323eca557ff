//! Optimisation: the values of a case's keys at which a metric is best, and how sure that is; docs/OPTIMISE.md is the user's page.
//!
//! What is asked: [`mod@file`] with [`constraint`] and `alternative`; [`variable`] says what can be made, [`scenarios`] what may become of
//! it; what of that counts is one of [`crate::study::over`].
//!
//! How it is found: [`evaluate`] gives the objective at a point, [`search`] looks for the best point, `gradient` where it is smooth, [`mount`] for values near it that a
//! person can set, `verify` tries these in many more scenarios; [`size`] says how many simulations all that takes.
//!
//! What is said about it: [`neighbourhood`] what small changes do, [`references`] what other dampers do, [`mod@over_band`] the curve over
//! the band, `stuck` how long friction holds the structure; [`front`] what a second objective costs; [`answer`] has all of it, [`run`] does all that and [`table`] writes it.

mod alternative;
pub mod answer;
mod cases;
pub mod constraint;
pub mod evaluate;
pub mod file;
pub mod front;
mod gradient;
mod keys;
pub mod mount;
pub mod neighbourhood;
pub mod over_band;
pub mod references;
pub mod run;
pub mod scenarios;
pub mod search;
pub mod size;
mod stuck;
pub mod table;
pub mod variable;
mod verify;

pub use answer::Optimum;
pub use file::Optimisation;
pub use keys::TABLES;
