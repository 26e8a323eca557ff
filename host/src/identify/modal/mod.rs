//! The mode of a frequency response of a laboratory's file: [`read`] reads H, its coherence and its frequencies; [`h1`] estimates H from
//! signals over time.

pub mod h1;
pub mod read;
pub mod unit;

pub use damprig_identification::modal::*;
