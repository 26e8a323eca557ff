//! The dynamics: one mode machine ([`modes`]) under two drivers.
//!
//! [`sampled`] takes the base motion one sample at a time and runs in any [`crate::scalar::Scalar`]: it is the
//! board's twin, the virtual rig's plant and the way to play a recorded motion. [`exact`] knows it in closed form and
//! certifies every event: it is the simulation.

pub mod base;
pub mod exact;
pub mod modes;
pub mod polynomial;
pub mod sampled;
pub mod units;
