//! Text for the terminal: plans, tables of results, summaries.

pub mod analysis;
pub mod calibration;
pub mod campaign;
pub mod comparison;
pub mod continuation;
pub mod multi_degree;
pub mod set_ups;
pub mod simulation;
pub mod transients;

pub use super::text_table::{plain_table, table};
