//! One contact against its closed forms.

use core::f64::consts::PI;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Structure;
use damprig_particles::{Cavity, Damper, Motion, Start, damping_ratio};

use crate::{rig, spheres};

const DIAMETER_M: f64 = 0.01;

/// Two spheres in a row of room for ten, in a box that nothing holds.
fn two(restitution: f64, steps_per_contact: f64) -> Motion<Excitation> {
    let cavity = Cavity { length_m: 0.1, width_m: DIAMETER_M, height_m: DIAMETER_M };
    let damper = Damper { restitution, steps_per_contact, gravity_m_per_s2: 0.0, ..spheres(2, DIAMETER_M, cavity) };
    let centres = vec![[-0.013, 0.0, 0.005], [0.0131, 0.0, 0.005]];
    let velocities = vec![[0.3, 0.0, 0.0], [-0.2, 0.0, 0.0]];
    Motion::placed(rig(), &damper, Excitation::Fixed, Start::default(), (centres, velocities)).expect("physical")
}

#[test]
fn spheres_part_with_the_stated_restitution_to_the_first_order_of_the_step() {
    for wanted in [0.05, 0.3, 0.5, 0.9, 1.0] {
        for steps_per_contact in [25.0, 100.0, 400.0] {
            let mut motion = two(wanted, steps_per_contact);
            while motion.state().t_s < 0.06 {
                motion.step(&mut |_| ());
            }
            let speeds = motion.velocities_m_per_s();
            let found = (speeds[1][0] - speeds[0][0]) / 0.5;
            // A dashpot's force starts at full size somewhere within a step: 2ζω0·Δt of the approach speed at most. Where
            // the forces are smooth, the scheme's error is (ω0Δt)² or less.
            let ratio = damping_ratio(wanted);
            let angle = PI / steps_per_contact / (2.0 * ratio).max(1.0);
            let error = 2.0 * ratio * angle + angle * angle;
            assert!((found - wanted).abs() < error, "e = {wanted}, {steps_per_contact} steps: {found}");
            assert_eq!(motion.collisions(), 1);
        }
    }
}

#[test]
fn a_sliding_sphere_ends_rolling_at_five_sevenths_of_its_speed() {
    let heavy = Structure { mass_kg: 1e6, stiffness_n_per_m: 1.0, damping_n_s_per_m: 0.0 };
    for friction_coefficient in [0.1, 0.4] {
        let cavity = Cavity { length_m: 1.0, width_m: 0.1, height_m: 0.1 };
        let damper = Damper { friction_coefficient, ..spheres(1, DIAMETER_M, cavity) };
        let sunk_m = damper.mass_kg * damper.gravity_m_per_s2 / 2e4;
        let start = (vec![[-0.4, 0.0, 0.5 * DIAMETER_M - sunk_m]], vec![[0.5, 0.0, 0.0]]);
        let mut motion = Motion::placed(heavy, &damper, Excitation::Fixed, Start::default(), start).expect("physical");
        // It slides for 2/7·v/(μg), at most 0.15 s.
        while motion.state().t_s < 0.5 {
            motion.step(&mut |_| ());
        }
        let speed = motion.velocities_m_per_s()[0][0];
        assert!((speed / 0.5 * 7.0 / 5.0 - 1.0).abs() < 1e-4, "μ = {friction_coefficient}: {speed}");
        // What friction has lost: 2/7 of the kinetic energy.
        let [along, across] = motion.lost_in_contacts_j();
        let energy_j = 0.5 * damper.mass_kg * 0.25;
        assert!((across / energy_j - 2.0 / 7.0).abs() < 1e-3 && along.abs() < 1e-3 * energy_j, "{along} {across}");
    }
}
