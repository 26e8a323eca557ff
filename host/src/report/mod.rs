//! Results of runs and simulations for people and other programs: figures, the report page, exports and terminal
//! text.
//!
//! `numbers`, `parameters` and `describe` are the lowest layer, then [`figures`]; [`page`], [`exports`] and [`terminal`] do not import each
//! other.

pub mod branch_table;
pub mod compared;
pub mod describe;
pub mod exports;
pub mod figures;
pub mod numbers;
pub mod page;
pub mod parameters;
pub mod terminal;
