//! Tests of the batch engine.

mod agreement;
mod points;
mod same_bits;
