//! Reads the table `many_particles` of a case.

use std::f64::consts::PI;

use damprig_core::model::Structure;
use damprig_particles::{Cavity, Damper, Elasticity};

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
    let poisson_ratio = s.scalar(&keys::POISSON_RATIO);
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
    let elasticity = match stiffness? {
        (0, stiffness_n_per_m) => Elasticity::Spring { stiffness_n_per_m },
        (1, contact_s) => Elasticity::Spring { stiffness_n_per_m: contact_stiffness_n_per_m(sphere_kg, contact_s) },
        (_, youngs_modulus_pa) => Elasticity::Hertz { youngs_modulus_pa, poisson_ratio: poisson_ratio? },
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
        elasticity,
        cavity,
        gravity_m_per_s2,
        steps_per_contact: steps?,
        seed: seed? as u64,
    })
}

/// Longest contact over the shorter period of structure and drive.
const LONGEST_CONTACT: f64 = 0.1;

/// Rejects contacts that are not short against the shorter period of structure and drive, s: such a contact is no impact but a spring
/// that couples the masses, and is seen in fewer steps of that period than the scheme needs.
pub fn check_contact(s: &Section, damper: &Damper, period_s: f64) {
    let longest_s = LONGEST_CONTACT * period_s;
    let why = "a contact lasts at most a tenth of the period of structure or drive, else it is no impact";
    let stiffness_n_per_m = match damper.elasticity {
        Elasticity::Spring { stiffness_n_per_m } => stiffness_n_per_m,
        Elasticity::Hertz { youngs_modulus_pa, .. } => {
            let contact_s = damper.slow_contact_s();
            if contact_s > longest_s {
                // The duration falls with the modulus to the power −2/5.
                let least_pa = rounded_up(youngs_modulus_pa * (contact_s / longest_s).powf(2.5));
                let allowed = format!("must be at least {least_pa} Pa: {why}");
                s.reject("youngs_modulus_pa", allowed, Some("make it larger: that of steel is 2.1e11".into()));
            }
            return;
        }
    };
    let least_n_per_m = contact_stiffness_n_per_m(damper.sphere_kg(), longest_s);
    // A contact of just that time is allowed, whatever the rounding.
    if stiffness_n_per_m >= least_n_per_m * (1.0 - 1e-9) {
        return;
    }
    let (allowed, help) = match s.written(&keys::STIFFNESS).map(|key| key.name) {
        Some("stiffness_n_per_m") => {
            (format!("must be at least {} N/m: {why}", rounded_up(least_n_per_m)), "make it larger")
        }
        _ => (
            format!("must be at most {} s: {why}", -rounded_up(-longest_s)),
            "make it shorter: a thousandth of the period is usual",
        ),
    };
    let name = s.written(&keys::STIFFNESS).map_or(keys::STIFFNESS.name(), |key| key.name);
    s.reject(name, allowed, Some(help.into()));
}

/// To three significant digits, towards larger numbers: what a message allows is allowed.
fn rounded_up(value: f64) -> f64 {
    let unit = 10f64.powf(value.abs().log10().floor() - 2.0);
    let rounded = (value / unit).ceil() * unit;
    format!("{rounded:.2e}").parse().unwrap_or(rounded)
}

/// Stiffness of contacts between two spheres that last so long without damping, N/m.
fn contact_stiffness_n_per_m(sphere_kg: f64, contact_s: f64) -> f64 {
    0.5 * sphere_kg * (PI / contact_s).powi(2)
}

#[cfg(test)]
mod tests {
    use super::rounded_up;

    #[test]
    fn a_bound_is_shown_on_the_side_that_is_allowed() {
        assert_eq!([rounded_up(12.3456), rounded_up(-0.040_01), rounded_up(0.5)], [12.4, -0.04, 0.5]);
        assert!(rounded_up(-0.039_999) == -0.0399);
    }
}
