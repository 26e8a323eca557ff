//! Every damper: the orbits of a branch against the exact integrator.

use std::f64::consts::TAU;

use damprig_continuation::{Parameter, System, Task, Ties};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::{FrictionDamper, Particle, Release, SetUp, Structure, Tmd, Wall};

use crate::common::{NATURAL, impact_damper, sine, task, text};

fn particle(clearance_m: f64, friction_coefficient: f64, wall: Wall) -> Option<Particle> {
    Some(Particle { mass_kg: 0.1, clearance_m, friction_coefficient, wall })
}

fn structure(damping_ratio: f64) -> SetUp {
    SetUp::bare(Structure::from_modal(1.0, 2.5, damping_ratio))
}

/// Set-up, excitation and task of each damper.
fn systems() -> Vec<(&'static str, SetUp, Excitation, Task)> {
    let hard = Wall::Restitution { coefficient: 0.5 };
    let soft = |release| Wall::Voigt { stiffness_n_per_m: 3_000.0, damping_n_s_per_m: 4.0, release };
    let k = structure(0.01).structure.stiffness_n_per_m;
    let damper = |ratio: f64| Some(FrictionDamper { force_n: ratio * k });
    let tmd = Tmd { mass_kg: 0.1, stiffness_n_per_m: 0.08 * k, damping_n_s_per_m: 0.3 };
    let force = Excitation::ForceSine { amplitude_n: k, angular_frequency_rad_per_s: 1.05 * NATURAL, phase_rad: 0.4 };
    vec![
        ("bare", structure(0.05), sine(0.9), task(Parameter::Frequency, (2.0, 3.0), 2.25)),
        (
            "tuned mass",
            SetUp { tmd: Some(tmd), ..structure(0.01) },
            sine(1.0),
            task(Parameter::Frequency, (2.0, 3.0), 2.5),
        ),
        (
            "internal friction",
            SetUp { particle: particle(10.0, 1.0, hard), ..structure(0.01) },
            sine(1.0),
            task(Parameter::Clearance, (5.0, 20.0), 10.0),
        ),
        (
            "soft walls, zero force",
            SetUp { particle: particle(10.0, 0.0, soft(Release::ZeroForce)), ..structure(0.01) },
            sine(1.0),
            task(Parameter::Clearance, (5.0, 20.0), 10.0),
        ),
        (
            "soft walls, zero penetration, friction",
            SetUp { particle: particle(10.0, 2.0, soft(Release::ZeroPenetration)), ..structure(0.01) },
            sine(1.0),
            task(Parameter::Clearance, (5.0, 20.0), 10.0),
        ),
        (
            "friction damper",
            SetUp { friction_damper: damper(0.2), ..structure(0.02) },
            sine(0.8),
            task(Parameter::Frequency, (1.3, 3.0), 2.0),
        ),
        (
            "hybrid",
            SetUp { particle: particle(5.0, 0.0, hard), friction_damper: damper(0.3), ..structure(0.01) },
            sine(1.0),
            task(Parameter::DamperForce, (0.1 * k, 0.6 * k), 0.3 * k),
        ),
        ("force", impact_damper(5.0, 0.5), force, task(Parameter::ForceAmplitude, (0.5 * k, 2.0 * k), k)),
    ]
}

#[test]
fn an_orbit_returns_in_the_simulation_and_its_multipliers_are_those_of_the_simulated_map() {
    for (name, set_up, excitation, task) in systems() {
        let system = System::new(&set_up, &excitation, Ties::default()).expect("physical");
        let found = match system.explore(&task) {
            Ok(found) => found,
            Err(why) => panic!("{name}: {why}"),
        };
        println!("{name}\n{}", text(&found));
        for orbit in found.branches.iter().flat_map(|b| b.orbits.iter().step_by(17)) {
            let (set_up, mut excitation) = system.at(&[(task.parameter, orbit.parameters[0])]);
            let (Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. }) = &mut excitation else {
                panic!("a sine")
            };
            *phase_rad = orbit.start_phase_rad;
            let period_s = TAU / excitation.angular_frequency_rad_per_s() * f64::from(orbit.periods);
            let mut motion = Exact::new(&set_up, &excitation, &orbit.initial()).expect("physical");
            // The start is at an event; half a millionth of a period later it has surely happened.
            motion.run(1e-3 * period_s, &mut ());
            let before = *motion.state();
            motion.run(1.001 * period_s, &mut ());
            let after = *motion.state();
            // An unstable orbit magnifies the error of its start, 1e-12 of the motion, by its multiplier.
            let growth = orbit.multipliers[0].norm().max(1.0);
            if growth > 1e6 {
                continue;
            }
            let size = orbit.peak_x_m.max(orbit.peak_offset_m);
            let off = (after.x_m - before.x_m).abs().max((after.offset_m - before.offset_m).abs());
            assert!(off < 1e-9 * growth * size, "{name} at {}: {off} {growth} {size}", orbit.parameters[0]);
        }
    }
}
