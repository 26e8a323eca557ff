//! Text for the terminal: plans, tables of results, summaries.

pub mod analysis;
pub mod calibration;
pub mod campaign;
pub mod comparison;
pub mod continuation;
pub mod multi_degree;
pub mod optimise;
pub mod sensitivity;
pub mod set_ups;
pub mod simulation;
pub mod study;
mod table;
pub mod transients;

pub use table::{plain_table, table};
