//! Hertz contacts against their closed forms and against measured oblique impacts.

use std::path::{Path, PathBuf};

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Hertz, Structure};
use damprig_particles::{Cavity, Damper, Elasticity, Motion, Start};

use crate::spheres;

/// Aluminium oxide.
const OXIDE: Elasticity = Elasticity::Hertz { youngs_modulus_pa: 380e9, poisson_ratio: 0.23 };
const DIAMETER_M: f64 = 0.005;
const DENSITY_KG_PER_M3: f64 = 4000.0;

/// A structure so heavy that its walls stay where they are.
const HEAVY: Structure = Structure { mass_kg: 1e6, stiffness_n_per_m: 1.0, damping_n_s_per_m: 0.0 };

fn sphere_kg() -> f64 {
    DENSITY_KG_PER_M3 * std::f64::consts::PI / 6.0 * DIAMETER_M.powi(3)
}

/// A single sphere of aluminium oxide just above the floor, thrown at it, without gravity.
fn thrown(
    restitution: f64,
    friction_coefficient: f64,
    (along, down): (f64, f64),
    steps_per_contact: f64,
) -> Motion<Excitation> {
    let cavity = Cavity { length_m: 1.0, width_m: 1.0, height_m: 1.0 };
    let damper = Damper {
        mass_kg: sphere_kg(),
        elasticity: OXIDE,
        restitution,
        friction_coefficient,
        gravity_m_per_s2: 0.0,
        steps_per_contact,
        ..spheres(1, DIAMETER_M, cavity)
    };
    let start = (vec![[0.0, 0.0, 0.5 * DIAMETER_M]], vec![[along, 0.0, -down]]);
    Motion::placed(HEAVY, &damper, Excitation::Fixed, Start::default(), start).expect("physical")
}

/// Follows the sphere until it has left the floor; gives the time of contact, s.
fn until_it_leaves(motion: &mut Motion<Excitation>) -> f64 {
    while motion.centres_m()[0][2] < 0.5 * DIAMETER_M || motion.velocities_m_per_s()[0][2] < 0.0 {
        motion.step(&mut |_| ());
    }
    motion.state().t_s
}

/// The sphere on the floor.
fn wall() -> Hertz {
    Hertz::elastic(Hertz::stiffness_of_sphere_n_per_m15([380e9; 2], [0.23; 2], 0.5 * DIAMETER_M))
}

#[test]
fn an_elastic_contact_lasts_and_presses_as_its_closed_forms_say_over_five_decades_of_speed() {
    for speed in [1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0] {
        let closed_s = wall().elastic_duration_s(sphere_kg(), speed);
        let mut motion = thrown(1.0, 0.0, (0.0, speed), 400.0);
        let found_s = until_it_leaves(&mut motion);
        // The last step is counted in full; the scheme's own error is (Δt/duration)².
        let step_s = motion.step_s();
        assert!(
            (found_s - closed_s).abs() < 1.5 * step_s + 2.0 * step_s * step_s / closed_s,
            "{speed} m/s: {found_s} s, {closed_s} s"
        );
        let deepest_m = wall().peak_penetration_m(sphere_kg(), speed);
        assert!((motion.largest_overlap_m() / deepest_m - 1.0).abs() < 1e-4, "{speed} m/s");
        let rebound = motion.velocities_m_per_s()[0][2];
        assert!((rebound / speed - 1.0).abs() < 1e-4, "{speed} m/s: {rebound}");
    }
}

#[test]
fn the_restitution_of_a_hertz_contact_is_the_stated_one_at_every_speed() {
    for wanted in [0.05, 0.3, 0.6, 0.98] {
        for speed in [1e-3, 0.1, 10.0] {
            let error_at = |steps: f64| {
                let mut motion = thrown(wanted, 0.0, (0.0, speed), steps);
                until_it_leaves(&mut motion);
                (motion.velocities_m_per_s()[0][2] / speed - wanted).abs()
            };
            let (coarse, fine) = (error_at(100.0), error_at(1600.0));
            println!("e = {wanted}, {speed} m/s: {coarse:.1e} with 100 steps, {fine:.1e} with 1600");
            assert!(fine < 1e-3, "e = {wanted}, {speed} m/s: {fine}");
        }
    }
}

struct Rebound {
    tangential_restitution: f64,
    spin_rad_per_s: f64,
}

/// An impact at 3.9 m/s, with μ = 0.092 and e = 0.98, without spin before.
fn rebound(incidence_deg: f64, steps_per_contact: f64) -> Rebound {
    let (sine, cosine) = incidence_deg.to_radians().sin_cos();
    let mut motion = thrown(0.98, 0.092, (3.9 * sine, 3.9 * cosine), steps_per_contact);
    until_it_leaves(&mut motion);
    Rebound {
        tangential_restitution: motion.velocities_m_per_s()[0][0] / (3.9 * sine),
        spin_rad_per_s: motion.spins_rad_per_s()[0][1],
    }
}

/// Tangential restitution of a sphere that slides through the whole contact: μ(1 + e) times its normal speed is lost along the floor.
fn of_sliding(incidence_deg: f64) -> f64 {
    1.0 - 0.092 * 1.98 / incidence_deg.to_radians().tan()
}

#[test]
fn a_flat_impact_slides_throughout() {
    for incidence_deg in [35.0, 45.0, 60.0, 75.0, 85.0] {
        let found = rebound(incidence_deg, 400.0).tangential_restitution;
        // The stretched spring presses the surfaces apart by up to 0.4·μ² of the normal force.
        assert!((found - of_sliding(incidence_deg)).abs() < 0.004 * (1.0 - found), "{incidence_deg}°: {found}");
    }
}

/// The published values of a quantity: incidence, °, and value. `None`, with a message, where they are absent.
fn published(set: &str, quantity: &str) -> Option<Vec<(f64, f64)>> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/field");
    let folder = std::env::var_os("DAMPRIG_FIELD").map_or_else(beside, PathBuf::from);
    let file = folder.join("oblique-impact/test4-oblique-impact.csv");
    let Ok(text) = std::fs::read_to_string(&file) else {
        println!("skipped: {} is absent", file.display());
        return None;
    };
    let wanted = format!("{set},{quantity},");
    let rows = text.lines().filter_map(|line| line.strip_prefix(&wanted)?.split_once(','));
    Some(rows.map(|(deg, value)| (deg.parse().expect("a number"), value.parse().expect("a number"))).collect())
}

/// Steeper impacts were measured to lose more than elastic theories say: 0.75 at 4.2°, where finite elements give 0.95.
const STEEP_DEG: f64 = 9.0;

#[test]
fn oblique_impacts_are_as_measured_within_the_measurements_scatter() {
    let along = |r: &Rebound| r.tangential_restitution;
    // A scatter of the velocity along the floor, whatever that is before the impact.
    compare("tangential_restitution", of_sliding, along, |deg| 3.9 * deg.to_radians().sin());
    let spin_of_sliding = |deg: f64| -2.5 * 0.092 * 1.98 * 3.9 * deg.to_radians().cos() / (0.5 * DIAMETER_M);
    compare("spin_rad_s", spin_of_sliding, |r| -r.spin_rad_per_s, |_| 1.0);
}

/// Where the sphere slides throughout, friction alone decides: what the measurements scatter by there is their scatter.
fn compare(quantity: &str, of_sliding: impl Fn(f64) -> f64, of: impl Fn(&Rebound) -> f64, scale: impl Fn(f64) -> f64) {
    let Some(measured) = published("experiment", quantity) else { return };
    let sliding: Vec<_> = measured.iter().filter(|(deg, _)| *deg > 35.0).collect();
    let squares = sliding.iter().map(|(deg, value)| ((value - of_sliding(*deg)) * scale(*deg)).powi(2));
    let scatter = (squares.sum::<f64>() / sliding.len() as f64).sqrt();
    for (deg, value) in &measured {
        let found = of(&rebound(*deg, 100.0));
        let off = (found - value) * scale(*deg) / scatter;
        println!("{quantity} {deg:4.1}°: measured {value:.3}, computed {found:.3}, {off:+.1} times the scatter");
        assert!(off.abs() < 3.0 || *deg < STEEP_DEG, "{quantity} at {deg}°: {off}");
    }
}

#[test]
fn oblique_impacts_are_those_of_finite_elements_but_for_partial_slip() {
    for (deg, value) in published("fem_oxide", "tangential_restitution").unwrap_or_default() {
        let found = rebound(deg, 100.0).tangential_restitution;
        println!("{deg:5.1}° finite elements {value:.3}, computed {found:.3}");
        // The contact sticks or slips as a whole: in between its parts do so one after the other.
        assert!((found / value - 1.0).abs() < 0.02, "{deg}°: {found}, finite elements {value}");
    }
}

#[test]
fn an_oblique_impact_gains_no_energy() {
    for friction_coefficient in [0.05, 0.3, 1.0] {
        for incidence_deg in [2.0_f64, 10.0, 20.0, 35.0, 50.0, 65.0, 80.0] {
            let (sine, cosine) = incidence_deg.to_radians().sin_cos();
            let mut motion = thrown(1.0, friction_coefficient, (3.9 * sine, 3.9 * cosine), 400.0);
            until_it_leaves(&mut motion);
            let [along, _, up] = motion.velocities_m_per_s()[0];
            let surface = 0.5 * DIAMETER_M * motion.spins_rad_per_s()[0][1];
            let gain = (along * along + up * up + 0.4 * surface * surface) / (3.9 * 3.9) - 1.0;
            // (ωΔt)³ of the scheme in the tangential motion.
            assert!(gain < 1e-6, "μ = {friction_coefficient}, {incidence_deg}°: {gain}");
        }
    }
}
