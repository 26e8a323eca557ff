//! Restitution over the approach speed.

pub mod law;
mod least_squares;
