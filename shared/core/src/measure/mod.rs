//! What is read off the sensor signals: amplitude and phase at the drive frequency, peaks, RMS, cycle maxima,
//! and whether a point has become steady. Every quantity is a small state machine fed once a tick.

pub mod lock_in;
pub mod point;
pub mod trend;
