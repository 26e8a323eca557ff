//! The loop that keeps the structure's amplitude: accuracy, range of its gain, hidden branches, and what it does at its limits.

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::fault::FaultCause;
use damprig_core::control::response_loop::{KeptQuantity, MAX_GAIN_PER_CYCLE, ResponseLoop};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::point::PointResult;
use damprig_core::model::{Cavity, FrictionDamper, Particle, Release, SetUp, Tmd, Wall};
use damprig_simulator::plant::{Base, PlantConfig, SensorModel};

use super::base_loop::{bare, hybrid, plan, plant, run, spid};

/// Soft walls that the particle hardly leaves: above 3 Hz the response at Z = 1 mm has a fold at either end of an unstable part.
fn soft() -> SetUp {
    let wall = Wall::Voigt { stiffness_n_per_m: 55.0, damping_n_s_per_m: 0.25, release: Release::ZeroForce };
    let cavity = Cavity::default();
    let particle = Particle { mass_kg: 0.16, clearance_m: 1.8e-3, friction_coefficient: 0.0, wall, cavity };
    SetUp { particle: Some(particle), ..bare() }
}

fn of(amplitude_m: f32) -> KeptQuantity {
    KeptQuantity::Displacement { amplitude_m }
}

/// A sweep that keeps the response; on a shaker its base follows in closed loop.
fn held(parameters: ResponseLoop) -> SteppedSine {
    SteppedSine {
        start: Start::CarryOver,
        drive: DriveMode::Response(ResponseLoop { drive_limit_m: 0.03, ..parameters }),
        ramp_s: 1.0,
        dwell_s: 6.0,
        points: (0..=12).map(|n| 2.0 + 0.1 * n as f32).collect(),
        ..plan(1e-3)
    }
}

fn on_shaker(response: KeptQuantity) -> ResponseLoop {
    let base = ClosedLoop { drive_limit_m: 0.03, ..ClosedLoop::default() };
    ResponseLoop::new(response, Some(base))
}

/// The largest relative deviation of the held amplitudes.
fn worst(points: &[PointResult], asked_m: impl Fn(&PointResult) -> f32) -> f32 {
    points.iter().map(|p| (p.x_amplitude_m / asked_m(p) - 1.0).abs()).fold(0.0, f32::max)
}

/// Every point within 1 % of its amplitude, and none after the whole wait.
fn assert_held(name: &str, config: &PlantConfig, sine: &SteppedSine, amplitude_m: f32) -> Vec<PointResult> {
    let outcome = run(config, sine);
    let worst = worst(&outcome.points, |_| amplitude_m);
    let longest = outcome.points.windows(2).map(|pair| pair[1].start_tick - pair[0].end_tick).max().unwrap_or(0);
    println!("{name}: x within {:.2} %, {} s, longest wait {} s", 100.0 * worst, outcome.ticks / 1000, longest / 1000);
    assert_eq!((outcome.fault, outcome.points.len()), (None, sine.points.len()), "{name}");
    assert!(worst < 0.01, "{name}: {worst}");
    assert!(longest < 100_000, "{name}: a point was measured after its whole wait");
    outcome.points
}

#[test]
fn the_structure_keeps_its_amplitude_from_0_8_to_1_28_fn_under_every_damper() {
    let friction = SetUp { friction_damper: Some(FrictionDamper { force_n: 0.237 }), ..bare() };
    let tuned = SetUp { tmd: Some(Tmd { mass_kg: 0.08, stiffness_n_per_m: 17.9, damping_n_s_per_m: 0.32 }), ..bare() };
    let all = [("bare", bare()), ("SPID", spid()), ("friction", friction), ("hybrid", hybrid()), ("tuned mass", tuned)];
    for (name, set_up) in all {
        for gain_per_cycle in [1.5, MAX_GAIN_PER_CYCLE] {
            let amplitude_m = 0.012;
            let parameters = ResponseLoop { gain_per_cycle, ..on_shaker(of(amplitude_m)) };
            let sine = held(parameters);
            assert_held(&format!("{name}, gain {gain_per_cycle}"), &plant(set_up), &sine, amplitude_m);
        }
    }
}

/// At constant |x| the bare structure needs Z = |x| |1 − r² + 2jζr|/|1 + 2jζr|, r = f/fn.
#[test]
fn the_base_of_the_bare_structure_is_its_closed_form() {
    let config = PlantConfig::ideal(bare());
    let sine = SteppedSine { settle_s: 20.0, ..held(ResponseLoop::new(of(0.01), None)) };
    for point in assert_held("bare, ideal", &config, &sine, 0.01) {
        let (r, zeta) = (f64::from(point.frequency_hz) / 2.5, 0.0038);
        let own = libm::hypot(1.0 - r * r, 2.0 * zeta * r) / libm::hypot(1.0, 2.0 * zeta * r);
        let z_m = own * f64::from(point.x_amplitude_m);
        // The integrator ends a deviation as e^(−g f t/8): 20 s leave e^(−9). A cycle's ends are known to a tick of 400.
        assert!((f64::from(point.z_amplitude_m) / z_m - 1.0).abs() < 4e-3, "{point:?}");
    }
}

#[test]
fn velocity_and_the_displacement_relative_to_the_base_are_kept_too() {
    let velocity = held(on_shaker(KeptQuantity::Velocity { amplitude_m_per_s: 0.15 }));
    let outcome = run(&plant(spid()), &velocity);
    let asked_m = |p: &PointResult| 0.15 / (core::f32::consts::TAU * p.frequency_hz);
    assert!(outcome.points.len() == 13 && worst(&outcome.points, asked_m) < 0.01);
    let relative = held(on_shaker(KeptQuantity::Relative { amplitude_m: 0.008 }));
    for p in run(&plant(hybrid()), &relative).points {
        let between = p.x_amplitude_m * p.x_amplitude_m + p.z_amplitude_m * p.z_amplitude_m
            - 2.0 * p.x_amplitude_m * p.z_amplitude_m * libm::cosf(p.phase_rad);
        assert!((libm::sqrtf(between) / 0.008 - 1.0).abs() < 0.01, "{p:?}");
    }
}

/// `damprig continue` at Z = 1 mm: stable to the fold at 3.1693 Hz (x 3.89 mm), unstable from there to the fold at 3.0679 Hz (2.12 mm).
/// At 3.12 Hz the three motions have x = 4.3, 2.6 and 1.8 mm: Z falls with the amplitude between the folds.
#[test]
fn a_part_of_the_response_that_a_sweep_jumps_over_is_held() {
    let z_mm = |amplitude_m: f32| {
        let points = [3.06, 3.12].into_iter().collect();
        let sine = SteppedSine { points, ..held(on_shaker(of(amplitude_m))) };
        let name = format!("soft walls, {amplitude_m} m");
        1e3 * assert_held(&name, &plant(soft()), &sine, amplitude_m)[1].z_amplitude_m
    };
    let all = [1.7e-3, 2.3e-3, 2.9e-3, 3.5e-3, 4.1e-3].map(z_mm);
    println!("{all:?}");
    assert!(all[1] > all[2] && all[2] > all[3], "Z falls: {all:?}");
    assert!(all[4] > all[3], "and rises again: {all:?}");
}

#[test]
fn the_base_moves_as_a_pure_sine_where_the_motion_repeats() {
    // Walls that differ give x a mean and even harmonics.
    let mut config = PlantConfig::ideal(spid());
    if let Some(particle) = &mut config.set_up.particle {
        particle.cavity.positive_wall = Some(Wall::Restitution { coefficient: 0.8 });
    }
    let points = [2.45, 2.5].into_iter().collect();
    let sine = SteppedSine { settle_s: 30.0, points, ..held(ResponseLoop::new(of(0.02), None)) };
    for point in run(&config, &sine).points {
        // The resolution of the distortion is 1/(cycles × ticks per cycle).
        let resolution = point.frequency_hz / (1000.0 * point.cycles as f32);
        assert!(point.scatter < 1e-3 && point.z_distortion < 2.0 * resolution, "{point:?}");
    }
}

/// Steps of half an octave, without a ramp: the base moves little more than the frequencies need.
#[test]
fn a_large_step_of_the_frequency_and_no_ramp_kick_the_base_little() {
    let points = [2.0, 3.0, 2.0].into_iter().collect();
    let sine = SteppedSine { ramp_s: 0.0, points, ..held(ResponseLoop::new(of(0.01), None)) };
    let outcome = run(&PlantConfig::ideal(spid()), &sine);
    let most_m = outcome.points.iter().map(|p| p.z_amplitude_m).fold(0.0, f32::max);
    assert_eq!((outcome.fault, outcome.points.len()), (None, 3));
    assert!(outcome.highest_m < 1.5 * most_m, "{} of {most_m}", outcome.highest_m);
}

#[test]
fn a_point_from_rest_does_not_depend_on_the_points_before_it() {
    // Without the noise, which is another for each point.
    let sensors = SensorModel { noise_rms_m: 0.0, ..SensorModel::default() };
    let config = PlantConfig { sensors, ..plant(hybrid()) };
    let from_rest = |list: &[f32]| {
        let points = list.iter().copied().collect();
        let start = Start::FromRest { level_m: 5e-4 };
        run(&config, &SteppedSine { start, points, ..held(on_shaker(of(0.006))) }).points
    };
    let (both, one) = (from_rest(&[2.6, 2.4]), from_rest(&[2.4]));
    let parts = |p: &PointResult| [p.z_amplitude_m, p.x_amplitude_m, p.phase_rad, p.drive_amplitude_m];
    assert_eq!((both.len(), one.len()), (2, 1));
    assert_eq!(parts(&both[1]), parts(&one[0]));
}

/// Of a sign that is wrong the loop of the base makes a runaway.
#[test]
fn a_base_that_runs_away_below_the_response_is_cut_off() {
    let config = PlantConfig { base: Base::Prescribed, ..plant(bare()) };
    let outcome = run(&config, &held(on_shaker(of(2e-3))));
    assert_eq!(outcome.fault, Some(FaultCause::BaseRunaway));
}

#[test]
fn a_drive_at_its_limit_is_reported_and_does_not_wind_up() {
    let limited = ResponseLoop { drive_limit_m: 1e-3, wait_s: 5.0, ..ResponseLoop::new(of(0.01), None) };
    let drive = DriveMode::Response(limited);
    // At 3 Hz x = 10 mm needs Z = 4.4 mm, at 2.55 Hz 0.4 mm.
    let points = [3.0, 2.55].into_iter().collect();
    let sine = SteppedSine { drive, points, ..held(limited) };
    let [far, near] = run(&PlantConfig::ideal(bare()), &sine).points.try_into().unwrap();
    assert!(far.drive_saturated && far.x_amplitude_m < 0.5 * 0.01, "{far:?}");
    assert!((far.drive_amplitude_m / 1e-3 - 1.0).abs() < 0.02, "{far:?}");
    // An integrator that had wound up in the whole dwell and wait before would not be back.
    assert!(!near.drive_saturated && (near.x_amplitude_m / 0.01 - 1.0).abs() < 0.01, "{near:?}");
}

/// At 3 Hz |x| of 250 mm needs Z of 110 mm.
#[test]
fn a_demand_beyond_the_limit_of_the_base_stops_the_rig_before_the_base_is_there() {
    let config = PlantConfig { base: Base::Prescribed, ..plant(bare()) };
    let high = ResponseLoop { drive_limit_m: 0.05, ..ResponseLoop::new(of(0.25), None) };
    let points = [3.0].into_iter().collect();
    let sine = SteppedSine { drive: DriveMode::Response(high), points, ..held(high) };
    let outcome = super::base_loop::run_within(&config, &sine, 0.04);
    assert_eq!(outcome.fault, Some(FaultCause::BaseForeseen));
    assert!(outcome.highest_m < 0.04, "{}", outcome.highest_m);
}
