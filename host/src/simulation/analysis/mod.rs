//! Analysis of a simulated case: energy balance, steady state, periodic orbit and its stability.
//!
//! Closed forms, Poincaré sections and the energy meter are in [`damprig_core::analysis`]. This module adds the linear
//! algebra of Floquet multipliers.

mod lyapunov;
mod periodic_orbit;
mod repetition;
mod sensitivities;
mod steady_state;

pub use lyapunov::Lyapunov;
pub use periodic_orbit::{Multiplier, OrbitError, PeriodicOrbit, Stability};
pub use sensitivities::{Sensitivities, Sensitivity};
pub use steady_state::{Analysis, ForcedResponse, MotionKind, OrbitSummary, SectionState, TwoImpactOrbit};
