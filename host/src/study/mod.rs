//! Studies: a case, the keys that are varied, and what is computed at each point; docs/STUDIES.md is the
//! user's page.
//!
//! [`mod@file`] reads the study, [`ensemble`] its starts, [`axis`], [`distribution`], [`sampling`], [`points`] and [`given_points`] say which
//! values it has, [`varied_case`] and [`direct`] make cases of them, `samples` says which are checked, [`evaluate`] simulates them. [`band`] finds
//! peaks, [`over`] says what of several starts counts, [`sensitivity`] what results depend on, [`mod@overlay`] which curves are over a map.
//! [`data_set`] keeps the results as parts ([`part`]) that survive a kill in a [`store`], [`run`] does all of it on this machine, [`work`] a
//! share of it as one of several workers; [`inspect`] tells how far they are.

pub mod axis;
pub mod band;
pub mod basins;
pub mod bifurcation;
pub mod bootstrap;
pub mod data_set;
pub mod direct;
pub mod distribution;
pub mod elementary_effects;
pub mod ensemble;
pub mod evaluate;
pub mod file;
pub mod given_points;
pub mod inspect;
mod keys;
mod linear;
pub mod metric;
pub mod over;
pub mod overlay;
pub mod part;
mod peaks;
pub mod points;
pub mod run;
pub(crate) mod samples;
pub mod sampling;
pub mod sensitivity;
pub mod simulate;
pub mod sobol_indices;
pub mod store;
pub mod sums;
pub mod table;
pub mod varied_case;
pub mod work;

pub use file::Study;
pub use keys::{SHARED, TABLES};
