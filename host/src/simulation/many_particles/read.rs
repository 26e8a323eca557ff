//! Reads the table `many_particles` of a case.

use std::f64::consts::PI;

use damprig_core::model::Structure;
use damprig_particles::{Cavity, Damper};

use crate::input::Section;
use crate::simulation::keys::many_particles as keys;

/// Reads the table; `None` after a problem has been reported.
pub fn read(s: &Section, structure: Option<&Structure>, gravity_m_per_s2: f64) -> Option<Damper> {
    let count = s.scalar(&keys::COUNT).map(|count| count as usize);
    let diameter = s.scalar(&keys::DIAMETER);
    let mass = s.one_of(&keys::MASS);
    let restitution = s.scalar(&keys::RESTITUTION);
    let friction = s.scalar(&keys::FRICTION);
    let stiffness = s.one_of(&keys::STIFFNESS);
    let length = s.one_of(&keys::LENGTH);
    let (width, height) = (s.scalar(&keys::WIDTH), s.scalar(&keys::HEIGHT));
    let steps = s.scalar(&keys::STEPS);
    let seed = s.scalar(&keys::SEED);
    s.finish();
    let (count, diameter_m) = (count?, diameter?);
    let mass_kg = match mass? {
        (0, mass_kg) => mass_kg,
        (_, ratio) => ratio * structure?.mass_kg,
    };
    if let Some(structure) = structure {
        s.warn_if_it_means(&keys::MASS, "mass_ratio", mass_kg / structure.mass_kg);
    }
    let sphere_kg = mass_kg / count as f64;
    let stiffness_n_per_m = match stiffness? {
        (0, stiffness) => stiffness,
        (_, contact_s) => 0.5 * sphere_kg * (PI / contact_s).powi(2),
    };
    let mut cavity = Cavity { length_m: 0.0, width_m: width?, height_m: height? };
    for (key, side_m) in [(&keys::WIDTH, cavity.width_m), (&keys::HEIGHT, cavity.height_m)] {
        if side_m < diameter_m * (1.0 - 1e-9) {
            s.reject(key.name(), format!("must be at least the spheres' diameter, {diameter_m} m"), None);
            return None;
        }
    }
    cavity.length_m = match length? {
        (0, length_m) => length_m,
        (_, clearance_m) => 2.0 * clearance_m + cavity.taken_length_m(count, diameter_m)?,
    };
    let most = cavity.capacity(diameter_m);
    if count > most {
        let allowed = format!(
            "must be at most {most}: so many spheres of {diameter_m} m fit into {} × {} × {} m in straight layers",
            cavity.length_m, cavity.width_m, cavity.height_m
        );
        s.reject(keys::COUNT.name(), allowed, Some("make the box larger, or the spheres smaller or fewer".into()));
        return None;
    }
    Some(Damper {
        count,
        diameter_m,
        mass_kg,
        restitution: restitution?,
        friction_coefficient: friction?,
        stiffness_n_per_m,
        cavity,
        gravity_m_per_s2,
        steps_per_contact: steps?,
        seed: seed? as u64,
    })
}
