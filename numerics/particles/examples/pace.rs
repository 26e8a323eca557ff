//! Prints how many steps of a sphere are computed in a second.
//!     cargo run --release -p damprig-particles --example pace

use std::time::Instant;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Structure;
use damprig_particles::{Cavity, Damper, Elasticity, Motion, Start};

fn main() {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let sine = Excitation::Sine { amplitude_m: 0.003, angular_frequency_rad_per_s: 15.7, phase_rad: 0.0 };
    let boxes = [
        (40, 0.01, Cavity { length_m: 0.07, width_m: 0.04, height_m: 0.03 }),
        (612, 0.004, Cavity { length_m: 0.1, width_m: 0.032, height_m: 0.032 }),
    ];
    for (count, diameter_m, cavity) in boxes {
        let damper = Damper {
            count,
            diameter_m,
            mass_kg: 0.16,
            restitution: 0.5,
            friction_coefficient: 0.3,
            elasticity: Elasticity::Spring { stiffness_n_per_m: 1e4 },
            cavity,
            gravity_m_per_s2: 9.81,
            steps_per_contact: 25.0,
            seed: 1,
        };
        let start = Start::default();
        let mut motion = Motion::new(structure, &damper, sine, start).expect("the box holds them");
        while motion.state().t_s < 1.0 {
            motion.step(&mut |_| ());
        }
        let (from_s, begin) = (motion.state().t_s, Instant::now());
        while begin.elapsed().as_secs_f64() < 2.0 {
            motion.step(&mut |_| ());
        }
        let (seconds, simulated_s) = (begin.elapsed().as_secs_f64(), motion.state().t_s - from_s);
        let steps = simulated_s / motion.step_s();
        println!(
            "{count} spheres: {:.2e} steps of a sphere per second, {:.3} s of motion per second",
            steps * count as f64 / seconds,
            simulated_s / seconds
        );
    }
}
