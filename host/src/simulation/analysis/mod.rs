//! Periodic orbits of the exact engine and their stability. Closed forms, sections and energy are in
//! [`damprig_core::analysis`]; this part needs linear algebra.

mod periodic_orbit;
mod steady_state;

pub use periodic_orbit::{Multiplier, NotFound, PeriodicOrbit, Stability};
pub use steady_state::{Analysis, Driven, Energy, Orbit, SectionState, TwoImpactOrbit};
