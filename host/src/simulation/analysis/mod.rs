//! Analysis of a simulated case: energy balance, steady state, periodic orbit and its stability.
//!
//! Closed forms, Poincaré sections and the energy meter are in [`damprig_core::analysis`]. This module adds the linear
//! algebra of Floquet multipliers.

mod lyapunov;
mod periodic_orbit;
mod repetition;
mod run_sensitivities;
mod sensitivities;
mod steady_state;

pub use lyapunov::Lyapunov;
pub use periodic_orbit::{Multiplier, OrbitError, PeriodicOrbit, Stability};
pub use run_sensitivities::WrittenCase;
pub(crate) use sensitivities::MORE;
pub use sensitivities::{RunKeys, Sensitivities, Sensitivity};
pub(crate) use steady_state::AnalysedPeriods;
pub use steady_state::{Analysis, ForcedResponse, MotionKind, OrbitSummary, SectionState, TwoImpactOrbit};

use damprig_continuation::ReturnMap;
use damprig_core::integrator::exact::Excitation;
use damprig_core::io::Invalid;

use crate::simulation::Case;

/// The map of a case over `periods` periods of its sine, from the drive's phase `from_rad`.
fn return_map(case: &Case, from_rad: f64, periods: u32) -> Result<ReturnMap, Invalid> {
    let mut drive = case.excitation;
    if let Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. } = &mut drive {
        *phase_rad = from_rad;
    }
    ReturnMap::new(&case.set_up, &drive, periods)
}
