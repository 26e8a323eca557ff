//! Integrators: one mode machine ([`modes`]) used by two drivers, [`sampled`] and [`exact`].
//!
//! [`sampled`] receives the base motion one sample at a time and runs in any [`crate::scalar::Scalar`]. The board's
//! digital twin, the plant of the virtual rig and the playback of recorded motions use it. [`exact`] has the base
//! motion in closed form and certifies every event; simulations use it.

pub mod base;
pub mod exact;
pub mod modes;
pub mod polynomial;
pub mod sampled;
pub mod units;
