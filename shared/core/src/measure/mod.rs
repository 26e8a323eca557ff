//! Measurement of the sensor signals: amplitude and phase at the drive frequency, peaks, RMS, cycle maxima, impacts,
//! and steadiness of a point.
//!
//! Every quantity is a small state machine that is fed once per tick.

pub mod amplitude;
mod approach;
mod batches;
pub mod cycle_window;
pub mod impacts;
pub mod lock_in;
pub mod noise;
pub mod point;
mod pulse;
pub mod running;
pub mod snippet;
pub mod steadiness;
pub mod sum;
pub mod transient;
pub mod trend;
pub mod velocity;
