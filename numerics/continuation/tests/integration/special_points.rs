//! Special points: against closed forms, and against simulations on both sides.

use std::f64::consts::TAU;

use damprig_continuation::{Branch, Diagram, Orbit, Origin, Parameter, SpecialKind, Steps, System, Task, Ties};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::{Cavity, Particle, SetUp, Structure, Wall};

use crate::common::{NATURAL, diagram, impact_damper, sine, start_on_symmetric_orbit, task, text};

/// d at which the symmetric two-impact orbit ceases to exist: A/d = |s₂|/√(s₁² + s₂²) of its quadratic equation.
fn fold_clearance(ratio: f64, e: f64) -> f64 {
    let (zeta, mass_ratio, turning) = (0.0038, 0.1, ratio * NATURAL);
    let (stiff, damped) = (1.0 - ratio * ratio, 2.0 * zeta * ratio);
    let response = ((1.0 + damped * damped) / (stiff * stiff + damped * damped)).sqrt();
    let half = 0.5 * TAU / turning;
    let (decay, ringing) = (zeta * NATURAL, NATURAL * f64::sqrt(1.0 - zeta * zeta));
    let h = f64::exp(-decay * half);
    let (sine, cosine) = (f64::sin(ringing * half), f64::cos(ringing * half));
    let a = [h * sine, h * cosine + 1.0];
    let b = [h * (ringing * cosine - decay * sine) + ringing, -h * (ringing * sine + decay * cosine) - decay];
    let determinant = a[0] * b[1] - a[1] * b[0];
    let (b1, b2) = (-2.0 * mass_ratio * a[1] / determinant, 2.0 * mass_ratio * a[0] / determinant);
    let s1 = 0.5 * half - b2;
    let s2 = ((2.0 * mass_ratio * e - 1.0 + e) / (1.0 + e) + decay * b2 - ringing * b1) / turning;
    response * s1.hypot(s2) / s2.abs()
}

#[test]
fn a_fold_of_the_two_impact_orbit_lies_where_its_closed_form_ends() {
    for (ratio, e, start) in [(1.1, 0.5, 5.0), (0.9, 0.3, 10.0)] {
        let mut task = task(Parameter::Clearance, (2.0, 40.0), start);
        start_on_symmetric_orbit(&mut task, start, e, ratio);
        let found = diagram(&impact_damper(start, e), &sine(ratio), &task);
        let folds: Vec<f64> = specials(&found.branches[0], &SpecialKind::Fold);
        let expected = fold_clearance(ratio, e);
        assert!(folds.len() == 1 && (folds[0] / expected - 1.0).abs() < 1e-10, "{folds:?} {expected}");
    }
}

fn specials(branch: &Branch, kind: &SpecialKind) -> Vec<f64> {
    branch.specials.iter().filter(|(_, s)| s.kind == *kind).map(|(_, s)| s.parameter).collect()
}

/// Distance from the orbit, relative to it, after `periods` of it, of a simulation at `value` that starts `off` from it.
fn distance(system: &System, task: &Task, orbit: &Orbit, value: f64, off: f64, periods: f64) -> f64 {
    let (set_up, mut excitation) = system.at(&[(task.parameter, value)]);
    if let Excitation::Sine { phase_rad, .. } | Excitation::ForceSine { phase_rad, .. } = &mut excitation {
        *phase_rad = orbit.start_phase_rad;
    }
    let period_s = TAU / excitation.angular_frequency_rad_per_s() * f64::from(orbit.periods);
    let mut initial = orbit.initial();
    let mut on_it = Exact::new(&set_up, &excitation, &initial).expect("physical");
    initial.v_m_per_s += off * orbit.max_abs_x_m / period_s;
    let mut beside = Exact::new(&set_up, &excitation, &initial).expect("physical");
    // Between events, where states are continuous.
    on_it.run(0.013 * period_s, &mut ());
    beside.run((periods + 0.013) * period_s, &mut ());
    (beside.state().x_m - on_it.state().x_m).abs() / orbit.max_abs_x_m
}

/// The force-driven damper whose branch has period doublings.
fn doubling() -> (SetUp, Excitation, Task) {
    let k = Structure::from_modal(1.0, 2.5, 0.0038).stiffness_n_per_m;
    let excitation =
        Excitation::ForceSine { amplitude_n: k, angular_frequency_rad_per_s: 1.05 * NATURAL, phase_rad: 0.4 };
    let task = Task { switch: true, ..task(Parameter::ForceAmplitude, (0.5 * k, 2.0 * k), k) };
    (impact_damper(5.0, 0.5), excitation, task)
}

#[test]
fn a_motion_beside_the_orbit_returns_before_a_period_doubling_and_leaves_behind_it() {
    let (set_up, excitation, task) = doubling();
    let system = System::new(&set_up, &excitation, Ties::default()).expect("physical");
    let found = system.explore(&task).expect("periodic");
    println!("{}", text(&found));
    let branch = &found.branches[0];
    let (place, point) = branch.specials.iter().find(|(_, s)| s.kind == SpecialKind::PeriodDoubling).expect("one");
    let nearest = point.orbit.multipliers.iter().map(|m| (m + 1.0).norm()).fold(f64::INFINITY, f64::min);
    assert!(nearest < 1e-8, "{point:?}");
    // A motion whose distance would change by less than e^10 in 400 periods is too near to the point to tell.
    let decides = |orbit: &&Orbit| orbit.multipliers[0].norm().ln().abs() * 400.0 > 10.0;
    let beside: Vec<&Orbit> = branch.orbits[place - 5..place + 5].iter().filter(decides).collect();
    assert!(beside.iter().any(|orbit| orbit.is_stable()) && beside.iter().any(|orbit| !orbit.is_stable()));
    for orbit in beside {
        let later = distance(&system, &task, orbit, orbit.parameters[0], 1e-7, 400.0);
        assert_eq!(later < 1e-9, orbit.is_stable(), "{} {later} {:?}", orbit.parameters[0], orbit.multipliers);
    }
}

#[test]
fn the_branch_of_twice_the_period_leaves_at_the_period_doubling_and_its_stable_orbits_are_simulated_motions() {
    let (set_up, excitation, task) = doubling();
    let system = System::new(&set_up, &excitation, Ties::default()).expect("physical");
    let found = system.explore(&task).expect("periodic");
    let twice = found
        .branches
        .iter()
        .find(|b| {
            matches!(b.origin, Origin::BranchPoint { .. })
                && b.sequence.periods == 2 * found.branches[0].sequence.periods
        })
        .unwrap_or_else(|| panic!("{}", text(&found)));
    let doublings = specials(&found.branches[0], &SpecialKind::PeriodDoubling);
    assert!(doublings.contains(&twice.orbits[0].parameters[0]));
    let stable: Vec<&Orbit> = twice.orbits[2..].iter().filter(|orbit| orbit.is_stable()).collect();
    assert!(!stable.is_empty(), "{}", text(&found));
    for orbit in stable.iter().step_by(1 + stable.len() / 4) {
        let later = distance(&system, &task, orbit, orbit.parameters[0], 1e-6, 300.0);
        assert!(later < 1e-8, "{} {later} {:?}", orbit.parameters[0], orbit.multipliers);
        // It does not repeat after half its period.
        assert!(distance(&system, &task, orbit, orbit.parameters[0], 0.0, 300.5) > 1e-5);
    }
}

#[test]
fn a_fold_curve_over_clearance_and_restitution_is_that_of_the_closed_form() {
    let mut task = task(Parameter::Clearance, (2.0, 60.0), 10.0);
    start_on_symmetric_orbit(&mut task, 10.0, 0.3, 0.9);
    let system = System::new(&impact_damper(10.0, 0.3), &sine(0.9), Ties::default()).expect("physical");
    let found = system.explore(&task).expect("periodic");
    let (_, fold) = found.branches[0].specials.iter().find(|(_, s)| s.kind == SpecialKind::Fold).expect("one");
    let parameters = [Parameter::Clearance, Parameter::Restitution];
    let curve = system
        .curve(&found.branches[0].sequence, fold, parameters, [(2.0, 60.0), (0.05, 0.9)], Steps::default())
        .expect("a curve");
    println!("{:?} {} orbits", curve.ends, curve.orbits.len());
    assert!(curve.orbits.len() > 30);
    for orbit in &curve.orbits {
        let expected = fold_clearance(0.9, orbit.parameters[1]);
        assert!((orbit.parameters[0] / expected - 1.0).abs() < 1e-9, "{:?} {expected}", orbit.parameters);
    }
}

#[test]
fn orbits_of_a_period_doubling_curve_have_the_multiplier_minus_one() {
    let (set_up, excitation, task) = doubling();
    let task = Task { switch: false, ..task };
    let system = System::new(&set_up, &excitation, Ties::default()).expect("physical");
    let found = system.explore(&task).expect("periodic");
    let branch = &found.branches[0];
    let (_, point) = branch.specials.iter().find(|(_, s)| s.kind == SpecialKind::PeriodDoubling).expect("one");
    let parameters = [Parameter::ForceAmplitude, Parameter::Restitution];
    let curve =
        system.curve(&branch.sequence, point, parameters, [task.range, (0.2, 0.9)], Steps::default()).expect("a curve");
    println!("{:?} {} orbits", curve.ends, curve.orbits.len());
    assert!(curve.orbits.len() > 10);
    for orbit in &curve.orbits {
        let nearest = orbit.multipliers.iter().map(|m| (m + 1.0).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-7, "{:?} {:?}", orbit.parameters, orbit.multipliers);
    }
}

/// Follows the first special point of a kind over clearance and restitution, and compares points of the curve with the special points of
/// branches at other restitutions.
fn assert_curve_meets_branches(
    is_of_kind: fn(&SpecialKind) -> bool,
    restitutions: (f64, f64),
    on_orbit: fn(&Orbit) -> f64,
) {
    let mut task = task(Parameter::Clearance, (2.0, 40.0), 10.0);
    start_on_symmetric_orbit(&mut task, 10.0, 0.5, 1.0);
    let system = System::new(&impact_damper(10.0, 0.5), &sine(1.0), Ties::default()).expect("physical");
    let found = system.explore(&task).expect("periodic");
    let first = |branch: &Branch| {
        let special = branch.specials.iter().find(|(_, special)| is_of_kind(&special.kind));
        special.unwrap_or_else(|| panic!("{:?}", branch.specials.len())).1.clone()
    };
    let parameters = [Parameter::Clearance, Parameter::Restitution];
    let (branch, ranges) = (&found.branches[0], [task.range, restitutions]);
    let curve = system.curve(&branch.sequence, &first(branch), parameters, ranges, Steps::default()).expect("a curve");
    println!("{:?} {} orbits", curve.ends, curve.orbits.len());
    assert!(curve.orbits.len() > 10);
    for orbit in &curve.orbits {
        assert!(on_orbit(orbit) < 1e-7, "{:?} {:?}", orbit.parameters, orbit.multipliers);
    }
    for orbit in curve.orbits.iter().step_by(7) {
        let e = orbit.parameters[1];
        start_on_symmetric_orbit(&mut task, 10.0, e, 1.0);
        let there = diagram(&impact_damper(10.0, e), &sine(1.0), &task);
        let expected = first(&there.branches[0]).parameter;
        assert!((orbit.parameters[0] / expected - 1.0).abs() < 1e-9, "{:?} {expected}", orbit.parameters);
    }
}

#[test]
fn a_grazing_curve_meets_the_grazings_of_branches_at_other_values_of_the_second_parameter() {
    assert_curve_meets_branches(|kind| matches!(kind, SpecialKind::Grazing(_)), (0.35, 0.6), |_| 0.0);
}

#[test]
fn a_neimark_sacker_curve_has_multipliers_on_the_unit_circle_and_meets_the_points_of_branches() {
    let off_circle = |orbit: &Orbit| {
        let complex = orbit.multipliers.iter().filter(|m| m.im.abs() > 1e-3);
        complex.map(|m| (m.norm() - 1.0).abs()).fold(f64::INFINITY, f64::min)
    };
    assert_curve_meets_branches(|kind| *kind == SpecialKind::NeimarkSacker, (0.4, 0.6), off_circle);
}

#[test]
fn a_curve_of_broken_symmetry_has_a_multiplier_of_one_and_meets_the_points_of_branches() {
    let off_one = |orbit: &Orbit| orbit.multipliers.iter().map(|m| (m - 1.0).norm()).fold(f64::INFINITY, f64::min);
    assert_curve_meets_branches(|kind| *kind == SpecialKind::SymmetryBreaking, (0.4, 0.6), off_one);
}

/// The numbers of branches of which one has the middle orbit of the other: its max |x| and max |y − x| within the error of a straight line
/// between two orbits of a branch.
fn repeated(diagram: &Diagram) -> Vec<(usize, usize)> {
    let branches = || diagram.branches.iter().enumerate();
    let has = |branch: &Branch, orbit: &Orbit| {
        branch.sequence.periods == orbit.periods
            && branch.orbits.windows(2).any(|pair| {
                let [from, to] = [&pair[0], &pair[1]];
                let share = (orbit.parameters[0] - from.parameters[0]) / (to.parameters[0] - from.parameters[0]);
                let is_near = |value: fn(&Orbit) -> f64| {
                    let on_line = value(from) + share * (value(to) - value(from));
                    (on_line / value(orbit) - 1.0).abs() < 1e-4
                };
                (0.0..=1.0).contains(&share) && is_near(|o| o.max_abs_x_m) && is_near(|o| o.max_abs_y_minus_x_m)
            })
    };
    let others = |n: usize, orbit: &Orbit| {
        branches().filter(|(other, branch)| *other != n && has(branch, orbit)).map(move |(m, _)| (n, m)).collect()
    };
    branches().flat_map(|(n, branch)| -> Vec<_> { others(n, &branch.orbits[branch.orbits.len() / 2]) }).collect()
}

/// Over the frequency two asymmetric branches were listed as a whole with their mirror images, and again from the points where they
/// branch off; over the clearance a branch of four periods; over the mass one and its mirror image, with other names of their grazings.
#[test]
fn a_branch_is_listed_once() {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let spid = |clearance_m, friction_coefficient, coefficient| {
        let wall = Wall::Restitution { coefficient };
        SetUp {
            particle: Some(Particle {
                mass_kg: 0.16,
                clearance_m,
                friction_coefficient,
                wall,
                cavity: Cavity::default(),
            }),
            ..SetUp::bare(structure)
        }
    };
    let base = |amplitude_m| Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: NATURAL, phase_rad: 0.0 };
    let with_friction = spid(0.03, 0.05, 0.5);
    let frequencies = task(Parameter::Frequency, (2.0, 3.0), 2.5);
    let masses = task(Parameter::Mass, (0.032, 0.48), 0.16);
    let clearances = task(Parameter::Clearance, (0.002, 0.04), 0.01);
    for (set_up, amplitude_m, task, restarts, least) in [
        (&with_friction, 0.003, &frequencies, 6, 4),
        (&with_friction, 0.003, &masses, 30, 10),
        (&spid(0.01, 0.0, 0.8), 0.001, &clearances, 6, 6),
    ] {
        let task = Task { switch: true, most_restarts: restarts, ..task.clone() };
        let found = diagram(set_up, &base(amplitude_m), &task);
        let repeated = repeated(&found);
        assert!(repeated.is_empty() && found.branches.len() >= least, "{repeated:?}\n{}", text(&found));
    }
}
