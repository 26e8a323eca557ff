//! The largest force of a case's walls: of soft walls that of spring and dashpot, of hard walls that of their stated contact in the fastest
//! impact.

use damprig_core::integrator::exact::response::Response;
use damprig_core::model::{Particle, Wall};

use super::Case;
use crate::setup::StatedContact;

/// Whether each wall of the case's particles has a force: it is soft, or its contact is stated. False without a particle.
#[must_use]
pub fn is_known(case: &Case) -> bool {
    let particles: Vec<(Particle, [Option<StatedContact>; 2])> = match &case.multi_degree {
        Some(several) => {
            let dampers = several.set_up.impact_dampers.iter().map(|damper| damper.particle);
            dampers.zip(several.contacts.iter().copied()).collect()
        }
        None => case.set_up.particle.map(|particle| (particle, case.contacts)).into_iter().collect(),
    };
    let mut walls = particles.iter().flat_map(|(particle, contacts)| particle.walls().into_iter().zip(*contacts));
    !particles.is_empty() && walls.all(|(wall, contact)| wall.is_soft() || contact.is_some())
}

/// The largest force in a motion, N; `None` if no wall was touched, or if a hard wall's contact is not stated.
///
/// The force of a contact rises with the approach speed, so that it is that of the fastest impact on each wall.
#[must_use]
pub fn largest_n(case: &Case, response: &Response) -> Option<f64> {
    let particle = case.set_up.particle.filter(|_| is_known(case))?;
    let (mass_kg, light_kg) = (case.set_up.structure.mass_kg, particle.mass_kg);
    let reduced_mass_kg = light_kg * mass_kg / (mass_kg + light_kg);
    let sides = particle.walls().into_iter().zip(case.contacts).zip(response.fastest_m_per_s());
    let of_hard = |((wall, contact), speed): ((Wall, Option<_>), f64)| -> Option<f64> {
        let contact: StatedContact = contact.filter(|_| speed > 0.0)?;
        Some(contact.peak_force_n(&wall.impact_law(1.0)?, reduced_mass_kg, speed))
    };
    sides.filter_map(of_hard).chain(response.peak_contact_force_n()).reduce(f64::max)
}
