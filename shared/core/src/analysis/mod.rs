//! Analysis of exact motions: symmetric orbits, Poincaré sections, periods, lock-in amplitudes, energy balance.
//!
//! Everything here is computed from the exact driver ([`crate::integrator::exact`]) in `f64`. Measurement on sensor
//! signals is in [`crate::measure`]. Periodic orbits and their stability need linear algebra and are in the host crate.

pub mod energy;
pub mod lock_in;
pub mod section;
pub mod symmetric_orbit;
