//! Every damper: the orbits of a branch against the exact integrator.

use std::f64::consts::TAU;

use damprig_continuation::{Branch, Orbit, Parameter, ReturnMap, System, Task, Ties};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::integrator::modes::Grip;
use damprig_core::model::{
    Cavity, FrictionDamper, Initial, Particle, Release, Restitution, SetUp, SpeedTable, Structure, Tmd, Wall,
};
use nalgebra::{Complex, DMatrix};

use crate::common::{NATURAL, impact_damper, sine, task, text};

fn particle(clearance_m: f64, friction_coefficient: f64, wall: Wall) -> Option<Particle> {
    Some(Particle { mass_kg: 0.1, clearance_m, friction_coefficient, wall, cavity: Cavity::default() })
}

/// Two walls, off the centre and inclined.
fn lopsided(wall: Wall, friction_coefficient: f64, positive: Wall) -> Option<Particle> {
    let cavity = Cavity { positive_wall: Some(positive), offset_m: 3.0, inclination_deg: 30.0 };
    particle(10.0, friction_coefficient, wall).map(|p| Particle { cavity, ..p })
}

fn structure(damping_ratio: f64) -> SetUp {
    SetUp::bare(Structure::from_modal(1.0, 2.5, damping_ratio))
}

/// Set-up, excitation and task of each damper.
fn systems() -> Vec<(&'static str, SetUp, Excitation, Task)> {
    let hard = Wall::Restitution { coefficient: 0.5 };
    let law = Restitution { coefficient: 0.5, reference_speed_m_per_s: 40.0, exponent: 0.25, maximum: 0.9 };
    let falling = Wall::SpeedRestitution(law);
    let table = SpeedTable::new(&[[5.0, 0.8], [30.0, 0.55], [100.0, 0.4]]).expect("three points");
    let tabulated = Wall::TableRestitution(table);
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
            "falling restitution",
            SetUp { particle: particle(10.0, 0.0, falling), ..structure(0.01) },
            sine(1.0),
            task(Parameter::Restitution, (0.3, 0.8), 0.5),
        ),
        (
            "falling restitution, friction",
            SetUp { particle: particle(10.0, 1.0, falling), ..structure(0.01) },
            sine(1.0),
            task(Parameter::Clearance, (5.0, 20.0), 10.0),
        ),
        (
            "table of restitution",
            SetUp { particle: particle(10.0, 1.0, tabulated), ..structure(0.01) },
            sine(1.0),
            task(Parameter::Clearance, (5.0, 20.0), 10.0),
        ),
        (
            "two walls on an incline",
            SetUp { particle: lopsided(falling, 0.0, hard), gravity_m_per_s2: 40.0, ..structure(0.01) },
            sine(1.0),
            task(Parameter::Restitution, (0.3, 0.7), 0.5),
        ),
        (
            "the exponent of falling restitution",
            SetUp { particle: particle(10.0, 0.0, falling), ..structure(0.01) },
            sine(1.0),
            task(Parameter::RestitutionExponent, (0.1, 0.4), 0.25),
        ),
        (
            "the wall at the positive side",
            SetUp { particle: lopsided(falling, 0.0, hard), gravity_m_per_s2: 40.0, ..structure(0.01) },
            sine(1.0),
            task(Parameter::PositiveRestitution, (0.3, 0.7), 0.5),
        ),
        (
            "the exponent at the positive side",
            SetUp { particle: lopsided(hard, 0.0, falling), gravity_m_per_s2: 40.0, ..structure(0.01) },
            sine(1.0),
            task(Parameter::PositiveRestitutionExponent, (0.1, 0.4), 0.25),
        ),
        (
            "a hard and a soft wall on an incline, friction",
            SetUp {
                particle: lopsided(hard, 0.1, soft(Release::ZeroForce)),
                gravity_m_per_s2: 40.0,
                ..structure(0.01)
            },
            sine(1.0),
            task(Parameter::Clearance, (5.0, 20.0), 10.0),
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
            task(Parameter::Frequency, (1.2, 3.0), 2.0),
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

/// The motion of an orbit at a value of the parameter, just after the event at its start, and the orbit's period, s.
fn motion_on(system: &System, task: &Task, orbit: &Orbit) -> (Exact, f64) {
    let (set_up, mut excitation) = system.at(&[(task.parameter, orbit.parameters[0])]);
    let turning = excitation.angular_frequency_rad_per_s();
    if let Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. } = &mut excitation {
        *phase_rad = orbit.start_phase_rad;
    }
    let period_s = TAU / turning * f64::from(orbit.periods);
    let mut motion = Exact::new(&set_up, &excitation, &orbit.initial()).expect("physical");
    motion.run(1e-3 * period_s, &mut ());
    (motion, period_s)
}

/// Multipliers beyond this magnify the rounding of the start too much for a comparison.
const MAX_GROWTH: f64 = 1e4;

fn assert_returns(name: &str, system: &System, task: &Task, orbit: &Orbit) {
    let (mut motion, period_s) = motion_on(system, task, orbit);
    let before = *motion.state();
    motion.run(1.001 * period_s, &mut ());
    let after = *motion.state();
    let growth = orbit.multipliers[0].norm().max(1.0);
    if growth > MAX_GROWTH {
        return;
    }
    // Within a period a disturbance may grow more than after it: on the way, not normal.
    let size = orbit.max_abs_x_m.max(orbit.max_abs_y_minus_x_m);
    let off = (after.x_m - before.x_m).abs().max((after.offset_m - before.offset_m).abs());
    assert!(off < 1e-9 * growth * size, "{name} at {}: {off} {growth} {size}", orbit.parameters[0]);
}

#[test]
fn every_orbit_returns_in_the_simulation() {
    for (name, set_up, excitation, task) in systems() {
        let system = System::new(&set_up, &excitation, Ties::default()).expect("physical");
        let found = system.explore(&task).unwrap_or_else(|why| panic!("{name}: {why}"));
        println!("{name}\n{}", text(&found));
        for orbit in found.branches.iter().flat_map(|branch| branch.orbits.iter().step_by(17)) {
            assert_returns(name, &system, &task, orbit);
        }
    }
}

#[test]
fn orbits_of_drawn_set_ups_return_in_the_simulation() {
    let mut draw = fastrand::Rng::with_seed(20);
    let mut between = |low: f64, high: f64| low + (high - low) * draw.f64();
    let mut followed = 0;
    for n in 0..60 {
        let wall = if n % 2 == 0 {
            Wall::Restitution { coefficient: between(0.2, 0.9) }
        } else {
            let release = if n % 4 == 1 { Release::ZeroForce } else { Release::ZeroPenetration };
            let (stiffness_n_per_m, damping_n_s_per_m) = (between(500.0, 2e4), between(0.5, 10.0));
            Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release }
        };
        let friction = if n % 3 == 0 { 0.0 } else { between(0.1, 3.0) };
        let clearance_m = between(1.0, 15.0);
        let mut set_up = SetUp { particle: particle(clearance_m, friction, wall), ..structure(between(0.005, 0.05)) };
        if n % 5 == 0 {
            set_up.friction_damper =
                Some(FrictionDamper { force_n: between(0.05, 0.5) * set_up.structure.stiffness_n_per_m });
        }
        let system = System::new(&set_up, &sine(between(0.8, 1.2)), Ties::default()).expect("physical");
        let task = Task {
            most_periods: 1_500,
            ..task(Parameter::Clearance, (0.9 * clearance_m, 1.1 * clearance_m), clearance_m)
        };
        // Chaotic motions and chatter cannot be followed.
        let found = match system.explore(&task) {
            Ok(found) => found,
            Err(why) => {
                println!("draw {n}: {why}");
                continue;
            }
        };
        followed += 1;
        for orbit in found.branches.iter().flat_map(|branch| branch.orbits.iter().step_by(29)) {
            assert_returns(&format!("draw {n}: {set_up:?}"), &system, &task, orbit);
        }
    }
    println!("{followed} of 60 draws are followed");
    assert!(followed >= 20, "{followed}");
}

#[test]
fn the_multipliers_are_those_of_the_simulated_map() {
    let mut compared = 0;
    for (name, set_up, excitation, task) in systems() {
        let system = System::new(&set_up, &excitation, Ties::default()).expect("physical");
        let found = system.explore(&task).unwrap_or_else(|why| panic!("{name}: {why}"));
        for orbit in found.branches.iter().flat_map(|branch| branch.orbits.iter().skip(9).step_by(23)) {
            let (set_up, mut excitation) = system.at(&[(task.parameter, orbit.parameters[0])]);
            let turning = excitation.angular_frequency_rad_per_s();
            let mut start_at = |start_phase_rad: f64| {
                if let Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. } = &mut excitation {
                    *phase_rad = start_phase_rad;
                }
                (
                    Exact::new(&set_up, &excitation, &orbit.initial()).expect("physical"),
                    ReturnMap::new(&set_up, &excitation, orbit.periods).expect("physical"),
                )
            };
            let (mut motion, map) = start_at(orbit.start_phase_rad);
            let parts_s = map.quiet_parts_s(&orbit.initial()).expect("resolved");
            let Some(quiet_s) = parts_s.first().map(|(from_s, to_s)| 0.5 * (from_s + to_s)) else { continue };
            motion.run(quiet_s, &mut ());
            let there = Initial {
                x_m: motion.state().x_m,
                v_m_per_s: motion.state().v_m_per_s,
                y_m: motion.state().y_m(),
                u_m_per_s: motion.state().u_m_per_s(),
            };
            let (_, map) = start_at(orbit.start_phase_rad + turning * quiet_s);
            let variation = map.variation(&there).expect("resolved");
            compared += 1;
            // Traces of the powers are smooth in the matrix, eigenvalues are not.
            let size = orbit.multipliers.len();
            let mut power = DMatrix::identity(size, size);
            for k in 1..=size {
                power *= &variation.matrix;
                let sum: f64 = orbit.multipliers.iter().map(|m| m.powi(k as i32).re).sum();
                let most = 1e-9 * (1.0 + variation.matrix.norm()).powi(k as i32);
                assert!((power.trace() - sum).abs() < most, "{name} {k}: {} {sum} {most}", power.trace());
            }
        }
    }
    println!("{compared} orbits are compared");
    assert!(compared > 60, "{compared}");
}

#[test]
fn the_orbit_of_a_tuned_mass_has_the_amplitude_of_the_linear_response() {
    let (_, set_up, excitation, task) =
        systems().into_iter().find(|(name, ..)| *name == "tuned mass").expect("it is there");
    let system = System::new(&set_up, &excitation, Ties::default()).expect("physical");
    let found = system.explore(&task).expect("periodic");
    let (structure, tmd) = (set_up.structure, set_up.tmd.expect("mounted"));
    assert!(found.branches[0].orbits.len() > 100);
    for orbit in &found.branches[0].orbits {
        let turning = TAU * orbit.parameters[0];
        let i = Complex::new(0.0, turning);
        let joint = tmd.stiffness_n_per_m + i * tmd.damping_n_s_per_m;
        let inertia = -turning * turning * tmd.mass_kg;
        // The tuned mass acts as its dynamic stiffness.
        let damper = joint * inertia / (joint + inertia);
        let base = structure.stiffness_n_per_m + i * structure.damping_n_s_per_m;
        let x = base / (base - turning * turning * structure.mass_kg + damper);
        assert!((orbit.max_abs_x_m / x.norm() - 1.0).abs() < 1e-11, "{orbit:?} {x}");
    }
}

#[test]
fn beyond_the_grazing_of_a_friction_damper_the_structure_sticks_as_simulated() {
    let (_, set_up, excitation, task) =
        systems().into_iter().find(|(name, ..)| *name == "friction damper").expect("it is there");
    let system = System::new(&set_up, &excitation, Ties::default()).expect("physical");
    let task = Task { most_restarts: 4, ..task };
    let found = system.explore(&task).expect("periodic");
    println!("{}", text(&found));
    let sticks = |branch: &Branch| branch.sequence.segments.iter().any(|s| s.phase.grip == Grip::Stuck);
    let sticking = found.branches.iter().find(|branch| sticks(branch)).unwrap_or_else(|| panic!("{}", text(&found)));
    for orbit in &sticking.orbits {
        assert_returns("sticking", &system, &task, orbit);
    }
    // It meets the branch without sticking where that one ends.
    let (from, to) = (sticking.orbits.first().expect("one"), sticking.orbits.last().expect("one"));
    let end = found.branches[0].specials.first().expect("a grazing").1.parameter;
    let nearest = (from.parameters[0] - end).abs().min((to.parameters[0] - end).abs());
    assert!(nearest < 1e-7 * end, "{end} {nearest}");
}
