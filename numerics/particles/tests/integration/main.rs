//! Tests of the many-particle damper.

mod books;
mod hertz;
mod limits;
mod single_contact;

use damprig_core::model::Structure;
use damprig_particles::{Cavity, Damper, Elasticity};

/// The structure of the rig.
pub fn rig() -> Structure {
    Structure::from_modal(1.6, 2.5, 0.0038)
}

/// A tenth of its mass in lossy spheres without friction, in a box of some room.
pub fn spheres(count: usize, diameter_m: f64, cavity: Cavity) -> Damper {
    Damper {
        count,
        diameter_m,
        mass_kg: 0.16,
        restitution: 0.5,
        friction_coefficient: 0.0,
        elasticity: spring(2e4),
        cavity,
        gravity_m_per_s2: 9.81,
        steps_per_contact: 25.0,
        seed: 1,
    }
}

/// Contacts with a spring of this stiffness, N/m.
pub fn spring(stiffness_n_per_m: f64) -> Elasticity {
    Elasticity::Spring { stiffness_n_per_m }
}
