//! How long a friction damper holds the structure: one that holds it all the time damps nothing.

use damprig_core::integrator::exact::Exact;
use damprig_core::integrator::modes::Grip;

use super::cases::BandCases;
use super::evaluate::{Evaluated, GoOnAfter};
use super::file::Optimisation;
use crate::failure::Failure;
use crate::simulation::Case;
use crate::study::simulate::Counted;

/// Instants of the last cycle at which the structure is looked at.
const LOOKS: u32 = 32;

/// The share of the last counted cycle in which the structure sticks to the base, over the band's grid; `None` without a friction damper,
/// on a record, or on a structure with several places.
///
/// # Errors
/// The refusal of a case that the values make, or that `go_on` said no.
pub fn share(optimisation: &Optimisation, best: &Evaluated, go_on: GoOnAfter) -> Result<Option<f64>, Failure> {
    let cases = BandCases::at(optimisation, &best.values)?;
    let mut stuck = 0;
    for point in 0..optimisation.band_points() {
        let case = cases.case(&optimisation.band_values(point))?;
        if case.set_up.friction_damper.is_none() || case.multi_degree.is_some() || case.record.is_some() {
            return Ok(None);
        }
        if !go_on(1) {
            return Err(Failure::stopped());
        }
        stuck += looks(&case, optimisation)?;
    }
    Ok(Some(f64::from(stuck) / (f64::from(LOOKS) * optimisation.band_points() as f64)))
}

/// At how many instants of the last cycle the structure is stuck.
fn looks(case: &Case, optimisation: &Optimisation) -> Result<u32, Failure> {
    let counted = Counted::of(case, optimisation.record);
    let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial)?;
    let mut is_stuck = |look: u32| {
        motion.run(counted.end_s - counted.cycle_s * (1.0 - f64::from(look) / f64::from(LOOKS)), &mut ());
        motion.mode().grip == Grip::Stuck
    };
    Ok((0..LOOKS).map(|look| u32::from(is_stuck(look))).sum())
}
