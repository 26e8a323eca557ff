//! Text for the terminal: plans, tables of results, summaries.

pub mod analysis;
pub mod campaign;
pub mod simulation;
pub mod transients;
