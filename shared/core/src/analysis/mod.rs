//! What a motion means: orbits, sections, periods, where the energy goes.
//!
//! Everything here is computed from the exact driver ([`crate::integrator::exact`]) in `f64`; measurement on sensor
//! signals is [`crate::measure`]. Periodic orbits and their stability need linear algebra and live on the host.

pub mod energy;
pub mod lock_in;
pub mod section;
pub mod symmetric_orbit;
