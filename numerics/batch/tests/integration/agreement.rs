//! The lanes agree with the exact engine.

use std::f64::consts::TAU;

use damprig_batch::{Outcome, Point, simulate};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{FrictionDamper, Initial, Release, Tmd, Wall};

use crate::points::{drawn, impact_damper};

/// The largest relative difference of two outcomes' displacements.
fn difference(a: &Outcome, b: &Outcome) -> f64 {
    let pairs = [
        (a.steady_mean_m, b.steady_mean_m),
        (a.steady_max_m, b.steady_max_m),
        (Some(a.last_cycle_max_m), Some(b.last_cycle_max_m)),
        (Some(a.max_abs_x_m), Some(b.max_abs_x_m)),
        (Some(a.rms_x_m), Some(b.rms_x_m)),
    ];
    let relative = |(a, b): &(Option<f64>, Option<f64>)| match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() / b.abs(),
        (None, None) => 0.0,
        _ => f64::INFINITY,
    };
    pairs.iter().map(relative).fold(0.0, f64::max)
}

fn both(points: &[Point]) -> Vec<(Outcome, Outcome)> {
    let lanes = simulate(points, 2).expect("physical points");
    lanes.into_iter().zip(points.iter().map(|p| p.by_exact_engine().expect("a physical point"))).collect()
}

#[test]
fn one_cycle_differs_by_roundings() {
    // Each of up to 20 steps and a few impacts adds some roundings to x; an impact near the end of a flight that almost
    // grazes may magnify those of its instant.
    let points = drawn(1, 1_000, 1);
    let outcomes = both(&points);
    for (n, (lanes, exact)) in outcomes.iter().enumerate() {
        assert_eq!((lanes.impacts, lanes.accumulations), (exact.impacts, exact.accumulations), "point {n}");
        assert!(difference(lanes, exact) < 64.0 * f64::EPSILON, "point {n}: {lanes:?} {exact:?}");
    }
    assert!(outcomes.iter().filter(|(lanes, _)| lanes.impacts > 0).count() > 200);
    assert!(outcomes.iter().filter(|(lanes, _)| lanes.lane_steps > lanes.exact_steps).count() > 500);
}

#[test]
fn regular_motions_stay_together_for_a_thousand_cycles() {
    // The orbit with two impacts a cycle forgets a disturbance within tens of cycles, so it holds at most a hundred
    // cycles' roundings at a time. Before, the start magnifies them.
    let points: Vec<Point> = (0..24)
        .map(|n| impact_damper(1.0, 0.45 + 0.02 * f64::from(n % 6), 9.5 + 0.3 * f64::from(n / 6), 1_000))
        .collect();
    for (n, (lanes, exact)) in both(&points).iter().enumerate() {
        let (a, b) = (lanes.steady_mean_m.unwrap_or(0.0), exact.steady_mean_m.unwrap_or(1.0));
        assert!((a / b - 1.0).abs() < 100.0 * 20.0 * f64::EPSILON, "point {n}: {a} {b}");
        assert!(lanes.exact_steps * 20 < lanes.lane_steps, "{lanes:?}");
    }
}

#[test]
fn chaotic_motions_are_samples_of_the_same_ensemble() {
    // Two hundred starts close together, by each engine: independent samples of one distribution after a few cycles.
    let points: Vec<Point> = (0..200)
        .map(|n| Point {
            initial: Initial { x_m: 1e-9 * f64::from(n), ..Initial::default() },
            ..impact_damper(1.0, 0.5, 15.0, 400)
        })
        .collect();
    let outcomes = both(&points);
    let count = outcomes.len() as f64;
    let moments = |of: fn(&(Outcome, Outcome)) -> &Outcome| {
        let means: Vec<f64> = outcomes.iter().map(|pair| of(pair).steady_mean_m.unwrap_or(0.0)).collect();
        let mean = means.iter().sum::<f64>() / count;
        (mean, means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0))
    };
    let (lanes, exact) = (moments(|pair| &pair.0), moments(|pair| &pair.1));
    assert!(outcomes.iter().any(|(a, b)| difference(a, b) > 1e-3), "the motion is chaotic");
    // Four standard errors of the difference of the means.
    let error = ((lanes.1 + exact.1) / count).sqrt();
    assert!((lanes.0 - exact.0).abs() < 4.0 * error, "{lanes:?} {exact:?}");
}

#[test]
fn a_driving_force_and_a_slow_drive_are_computed_in_lanes_too() {
    let mut points = drawn(3, 60, 2);
    for (n, point) in points.iter_mut().enumerate() {
        let stiffness = point.set_up.structure.stiffness_n_per_m;
        point.excitation = if n % 2 == 0 {
            Excitation::ForceSine {
                amplitude_n: stiffness,
                angular_frequency_rad_per_s: (0.5 + 0.02 * n as f64) * TAU * 2.5,
                phase_rad: 0.3,
            }
        } else {
            Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: 0.1 * TAU * 2.5, phase_rad: 1.0 }
        };
    }
    for (n, (lanes, exact)) in both(&points).iter().enumerate() {
        assert_eq!(lanes.impacts, exact.impacts, "point {n}");
        assert!(lanes.lane_steps > 0 && difference(lanes, exact) < 1e-10, "point {n}: {lanes:?} {exact:?}");
    }
}

#[test]
fn every_other_set_up_is_the_exact_engines() {
    let mut points = drawn(5, 6, 30);
    points[0].set_up.particle = None;
    points[1].set_up.friction_damper = Some(FrictionDamper { force_n: 3.0 });
    points[2].set_up.particle = None;
    points[2].set_up.tmd = Some(Tmd { mass_kg: 0.1, stiffness_n_per_m: 20.0, damping_n_s_per_m: 0.1 });
    if let Some(particle) = &mut points[3].set_up.particle {
        particle.friction_coefficient = 0.1;
    }
    if let Some(particle) = &mut points[4].set_up.particle {
        particle.wall =
            Wall::Voigt { stiffness_n_per_m: 1e4, damping_n_s_per_m: 1.0, release: Release::ZeroPenetration };
    }
    points[5].excitation = Excitation::HalfSine { amplitude_m: 1.0, duration_s: 0.1 };
    for (lanes, exact) in both(&points) {
        assert_eq!(lanes, exact);
    }
}

#[test]
fn the_first_invalid_point_is_named_and_nothing_is_simulated() {
    let mut points = drawn(9, 4, 1_000_000_000_000);
    points[3].cycles = 0;
    points[2].set_up.structure.mass_kg = -1.0;
    let refused = simulate(&points, 2).expect_err("a negative mass");
    assert_eq!(
        refused.to_string(),
        "point 2: structure.mass_kg = -1 is not allowed: must be a finite number greater than 0"
    );
    points[2].set_up.structure.mass_kg = 1.0;
    let refused = simulate(&points, 2).expect_err("no cycle");
    assert_eq!(refused.to_string(), "point 3: cycles = 0 is not allowed: must be 1 or more");
    assert_eq!(simulate(&[], 2), Ok(Vec::new()));
}
