//! Branches of structures by shooting: against the branches of one degree of freedom, whose equations and method are others, and against closed forms.

use std::f64::consts::TAU;

use damprig_continuation::{
    BranchEnd, Diagram, Family, Parameter, SpecialKind, Steps, StructureDiagram, StructureOrbit, StructureTask, System,
    Task, Ties,
};
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{FrictionDamper, Initial, SetUp, Structure};
use damprig_structures::{Drive, ImpactDamper, Mode, Modes, MotionCase, NoDerivatives, State, base_at_start};

use crate::common::{NATURAL, diagram, impact_damper, sine, start_on_symmetric_orbit, task, text};

/// The same motion in the engine of structures.
fn motion(set_up: &SetUp, excitation: Excitation, initial: &Initial) -> MotionCase {
    let is_force = !excitation.moves_base();
    let base = base_at_start(&excitation);
    MotionCase {
        set_up: damprig_structures::SetUp { driven_place: is_force.then_some(0), ..set_up.into() },
        start: State::on_base(set_up, initial, base),
        drive: Drive::ClosedForm(excitation),
        duration_s: 1.0,
    }
}

/// Both diagrams of a system: by shooting, and by segments.
fn both(set_up: &SetUp, excitation: Excitation, task: &Task) -> (StructureDiagram, Diagram) {
    let system = System::new(set_up, &excitation, Ties::default()).expect("physical");
    let at = |value: f64| {
        let (set_up, mut excitation) = system.at(&[(task.parameter, value)]);
        if let Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. } = &mut excitation {
            *phase_rad = task.phase_rad;
        }
        Some(motion(&set_up, excitation, &task.initial))
    };
    let family = Family { at: &at, range: task.range, goes_on: &|_| true };
    let of_structures = StructureTask {
        start_at: task.start_at,
        most_periods: task.most_periods,
        switch: task.switch,
        most_restarts: task.most_restarts,
        steps: task.steps,
    };
    let found = family.explore(&of_structures).unwrap_or_else(|why| panic!("{why}"));
    (found, diagram(set_up, &excitation, task))
}

fn shown(diagram: &StructureDiagram) -> String {
    let mut text = String::new();
    for branch in &diagram.branches {
        let ends = [branch.orbits.first(), branch.orbits.last()].map(|orbit| orbit.map(|orbit| orbit.parameter));
        text += &format!(
            "{:?} periods {} orbits {} {ends:?} {:?} stable {}\n",
            branch.origin,
            branch.orbits[0].section.periods,
            branch.orbits.len(),
            branch.ends,
            branch.orbits.iter().filter(|orbit| orbit.is_stable()).count()
        );
        for (at, special) in &branch.specials {
            let (kind, value) = (special.kind.name(), special.orbit.parameter);
            text += &format!("  {at}: {kind} at {value} ± {:.1e}: {}\n", special.parameter_error, special.meaning);
        }
    }
    text + &format!("{:?}", diagram.gaps)
}

/// The parameters of the special points of a kind.
fn specials(diagram: &StructureDiagram, kind: &SpecialKind) -> Vec<f64> {
    let all = diagram.branches.iter().flat_map(|branch| &branch.specials);
    all.filter(|(_, special)| special.kind == *kind).map(|(_, special)| special.orbit.parameter).collect()
}

#[test]
fn orbits_of_the_two_impact_branch_are_those_of_the_closed_form_and_its_special_points_those_by_segments() {
    for (ratio, e, start) in [(1.1, 0.5, 5.0), (0.9, 0.3, 10.0)] {
        let mut task = task(Parameter::Clearance, (2.0, 40.0), start);
        start_on_symmetric_orbit(&mut task, start, e, ratio);
        let (found, by_segments) = both(&impact_damper(start, e), sine(ratio), &task);
        println!("{}\n{}", shown(&found), text(&by_segments));
        assert!(found.branches[0].orbits.len() > 20, "{}", shown(&found));
        // Shooting goes on where further impacts begin; where disturbances grow much, so does the last step of Newton's method.
        let is_known =
            |orbit: &&StructureOrbit| orbit.approach_speeds_m_per_s.len() == 2 && orbit.multipliers[0].norm() < 1e3;
        for orbit in found.branches[0].orbits.iter().filter(is_known) {
            let there = impact_damper(orbit.parameter, e);
            let known = SymmetricOrbit::both(&there, 1.0, ratio * NATURAL).expect("hard walls");
            let speed = orbit.approach_speeds_m_per_s.iter().copied().fold(0.0, f64::max);
            let off = known.iter().flatten().map(|known| (speed / known.approach_speed_m_per_s - 1.0).abs());
            let off = off.fold(f64::INFINITY, f64::min);
            // Newton's last step, 1e-10 of the motion, where the speed changes with the root of the distance to the fold.
            assert!(off < 1e-8, "{} {speed} {off}", orbit.parameter);
        }
        let mut compared = 0;
        for (_, special) in &by_segments.branches[0].specials {
            if !matches!(special.kind, SpecialKind::Grazing(_)) {
                let own = specials(&found, &special.kind);
                let off = own.iter().map(|own| (own / special.parameter - 1.0).abs()).fold(f64::INFINITY, f64::min);
                assert!(off < 1e-9, "{:?} {own:?} {}", special.kind, special.parameter);
                compared += 1;
            }
        }
        assert!(compared >= 2);
    }
}

#[test]
fn a_period_doubling_and_the_branch_that_leaves_there_are_those_of_one_degree_of_freedom() {
    let k = Structure::from_modal(1.0, 2.5, 0.0038).stiffness_n_per_m;
    let excitation =
        Excitation::ForceSine { amplitude_n: k, angular_frequency_rad_per_s: 1.05 * NATURAL, phase_rad: 0.4 };
    let task = Task { switch: true, phase_rad: 0.4, ..task(Parameter::ForceAmplitude, (0.5 * k, 2.0 * k), k) };
    let (found, by_segments) = both(&impact_damper(5.0, 0.5), excitation, &task);
    println!("{}\n{}", shown(&found), text(&by_segments));
    let of_kind = |branch: &damprig_continuation::Branch| -> Vec<f64> {
        let doublings = branch.specials.iter().filter(|(_, special)| special.kind == SpecialKind::PeriodDoubling);
        doublings.map(|(_, special)| special.parameter).collect()
    };
    let expected = of_kind(&by_segments.branches[0]);
    let doublings = specials(&found, &SpecialKind::PeriodDoubling);
    for value in &expected {
        let off = doublings.iter().map(|own| (own / value - 1.0).abs()).fold(f64::INFINITY, f64::min);
        assert!(off < 1e-8, "{doublings:?} {expected:?}");
    }
    assert!(!expected.is_empty());
    assert_eq!(found.branches[0].ends, [BranchEnd::SymmetryBreaking, BranchEnd::Grazing], "{}", shown(&found));
    let twice = 2 * found.branches[0].orbits[0].section.periods;
    assert!(found.branches.iter().any(|branch| branch.orbits[0].section.periods == twice), "{}", shown(&found));
}

#[test]
fn multipliers_of_a_friction_damper_are_those_of_one_degree_of_freedom_on_both_sides_of_a_new_stick() {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let friction_damper = Some(FrictionDamper { force_n: 0.1 * structure.stiffness_n_per_m });
    let set_up = SetUp { friction_damper, ..SetUp::bare(structure) };
    let k = structure.stiffness_n_per_m;
    let task = Task { most_restarts: 6, ..task(Parameter::DamperForce, (0.02 * k, 0.3 * k), 0.1 * k) };
    let (found, by_segments) = both(&set_up, sine(0.6), &task);
    println!("{}\n{}", shown(&found), text(&by_segments));
    let stick = specials(&found, &SpecialKind::Grazing(Vec::new()));
    let expected = by_segments
        .branches
        .iter()
        .flat_map(|branch| &branch.specials)
        .find_map(|(_, special)| matches!(special.kind, SpecialKind::Grazing(_)).then_some(special.parameter));
    let expected = expected.expect("sticking appears");
    assert!(stick.iter().any(|own| (own / expected - 1.0).abs() < 1e-6), "{stick:?} {expected}");
    // One branch passes it.
    let branch = &found.branches[0];
    assert_eq!(branch.ends, [BranchEnd::Range; 2], "{}", shown(&found));
    let all = by_segments.branches.iter().flat_map(|branch| &branch.orbits);
    let mut compared = 0;
    for orbit in all {
        let near = branch.orbits.iter().min_by(|a, b| {
            let off = |own: &damprig_continuation::StructureOrbit| (own.parameter - orbit.parameters[0]).abs();
            off(a).total_cmp(&off(b))
        });
        let near = near.expect("orbits");
        if (near.parameter / orbit.parameters[0] - 1.0).abs() < 1e-3 {
            let (own, other) = (near.multipliers[0].norm(), orbit.multipliers[0].norm());
            assert!((own - other).abs() < 0.02, "{} {own} {other}", near.parameter);
            compared += 1;
        }
    }
    assert!(compared > 20, "{compared}");
}

/// A structure of two modes with a particle on its second place, in SI units.
fn two_modes(clearance_m: f64) -> MotionCase {
    let mode = |frequency_hz: f64, shape: [f64; 2]| Mode {
        angular_frequency_rad_per_s: TAU * frequency_hz,
        damping_ratio: 0.01,
        shape: shape.to_vec(),
        // Both masses are 1 kg.
        participation: shape[0] + shape[1],
    };
    let structure = Modes {
        modes: vec![mode(2.0, [0.6, 0.8]), mode(5.2, [0.8, -0.6])],
        influence: vec![1.0; 2],
        coupling_per_s: Vec::new(),
    };
    let wall = damprig_core::model::Wall::Restitution { coefficient: 0.5 };
    let particle = damprig_core::model::Particle {
        mass_kg: 0.1,
        clearance_m,
        friction_coefficient: 0.0,
        wall,
        cavity: damprig_core::model::Cavity::default(),
    };
    let set_up = damprig_structures::SetUp {
        structure,
        impact_dampers: vec![ImpactDamper::new(1, particle)],
        friction_dampers: Vec::new(),
        tuned_masses: Vec::new(),
        gravity_m_per_s2: 0.0,
        driven_place: None,
        force_beside_base: None,
    };
    let excitation = Excitation::Sine { amplitude_m: 0.003, angular_frequency_rad_per_s: TAU * 2.0, phase_rad: 0.0 };
    let start = set_up.at_rest(base_at_start(&excitation));
    MotionCase { set_up, start, drive: Drive::ClosedForm(excitation), duration_s: 1.0 }
}

/// A stable orbit is where a simulation that begins at rest ends, and an unstable one is left.
#[test]
fn orbits_of_two_modes_return_and_their_multipliers_tell_whether_a_disturbance_decays() {
    let at = |value: f64| Some(two_modes(value));
    let family = Family { at: &at, range: (0.015, 0.05), goes_on: &|_| true };
    let task = StructureTask {
        start_at: 0.02,
        most_periods: 6_000,
        switch: true,
        most_restarts: 1,
        steps: Steps { longest: 0.02, ..Steps::default() },
    };
    let found = family.explore(&task).unwrap_or_else(|why| panic!("{why}"));
    println!("{}", shown(&found));
    for branch in &found.branches {
        // No step leads to another branch: it is no longer than the longest one.
        let steps = branch.orbits.windows(2).map(|pair| (pair[1].parameter - pair[0].parameter).abs());
        assert!(steps.fold(0.0, f64::max) <= 1.001 * 0.02 * (0.05 - 0.015), "{}", shown(&found));
        for orbit in branch.orbits.iter().step_by(5) {
            let case = &orbit.case;
            let distance = |bodies: &[f64], other: &[f64]| {
                bodies.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
            };
            let start = case.bodies_after(0.0).expect("a motion");
            let returned = case.bodies_after(case.duration_s).expect("a motion");
            let size = distance(&start, &vec![0.0; start.len()]);
            let growth = orbit.multipliers[0].norm().max(1.0);
            let apart = distance(&start, &returned) / size;
            assert!(apart < 1e-9 * growth, "{} {apart} {growth}", orbit.parameter);
            let Some(decay) = Some(orbit.multipliers[0].norm().ln()).filter(|decay| decay.abs() > 0.05) else {
                continue;
            };
            // A disturbance of 1e-7 changes by e^±6.
            let periods = (6.0 / decay.abs()).ceil();
            let mut beside = case.clone();
            beside.start.modal_rate[0] *= 1.0 + 1e-7;
            let later = distance(&beside.bodies_after(periods * case.duration_s).expect("a motion"), &start);
            assert_eq!(later < 1e-7 * size * 0.1, decay < 0.0, "{} {later} {decay}", orbit.parameter);
        }
    }
    assert!(found.branches.iter().map(|branch| branch.orbits.len()).sum::<usize>() > 40);
}

#[test]
fn a_particle_that_meets_no_wall_has_no_orbit_of_its_own() {
    let at = |value: f64| Some(two_modes(value));
    let family = Family { at: &at, range: (1.0, 2.0), goes_on: &|_| true };
    let task =
        StructureTask { start_at: 1.5, most_periods: 2_000, switch: false, most_restarts: 0, steps: Steps::default() };
    assert!(matches!(family.explore(&task), Err(NoDerivatives::NotIsolated)));
}

/// A structure that friction holds all the time may be held anywhere.
#[test]
fn a_structure_that_always_sticks_has_no_orbit_of_its_own() {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let k = structure.stiffness_n_per_m;
    let set_up = SetUp { friction_damper: Some(FrictionDamper { force_n: k }), ..SetUp::bare(structure) };
    let at = |value: f64| {
        let mut set_up = set_up;
        set_up.friction_damper = Some(FrictionDamper { force_n: value });
        Some(motion(&set_up, sine(0.6), &Initial::default()))
    };
    let family = Family { at: &at, range: (0.8 * k, 2.0 * k), goes_on: &|_| true };
    let task =
        StructureTask { start_at: k, most_periods: 2_000, switch: false, most_restarts: 0, steps: Steps::default() };
    assert!(matches!(family.explore(&task), Err(NoDerivatives::NotIsolated | NoDerivatives::NotPeriodic)));
}
