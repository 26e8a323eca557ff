//! The phase-locked loop that follows a resonance.

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::phase_lock::{MAX_GAIN_PER_CYCLE, PhaseLock};
use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
use damprig_core::control::stepped_sine::{DriveMode, Points, Start, SteppedSine};
use damprig_core::measure::point::PointResult;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{FrictionDamper, SetUp, Tmd};
use damprig_simulator::plant::PlantConfig;

use super::base_loop::{bare, hybrid, plan, plant, run, spid};

fn tracked(lock: PhaseLock, drive: DriveMode, amplitudes: &[f32]) -> SteppedSine {
    SteppedSine {
        start: Start::CarryOver,
        drive,
        ramp_s: 1.0,
        settle_s: 4.0,
        dwell_s: 8.0,
        points: Points::Resonance { lock, amplitudes: amplitudes.iter().copied().collect() },
        ..plan(1e-3)
    }
}

fn on_shaker() -> DriveMode {
    DriveMode::ClosedLoop(ClosedLoop { drive_limit_m: 0.03, ..ClosedLoop::default() })
}

fn response(base: Option<ClosedLoop>) -> DriveMode {
    let own = ResponseLoop::new(KeptQuantity::Displacement { amplitude_m: 1.0 }, base);
    DriveMode::Response(ResponseLoop { drive_limit_m: 0.03, ..own })
}

fn every_damper() -> [(&'static str, SetUp); 5] {
    let friction = SetUp { friction_damper: Some(FrictionDamper { force_n: 0.237 }), ..bare() };
    let tuned = SetUp { tmd: Some(Tmd { mass_kg: 0.08, stiffness_n_per_m: 17.9, damping_n_s_per_m: 0.32 }), ..bare() };
    [("bare", bare()), ("SPID", spid()), ("friction", friction), ("hybrid", hybrid()), ("tuned mass", tuned)]
}

fn lock() -> PhaseLock {
    PhaseLock { start_hz: 2.4, ..PhaseLock::new(2.0, 3.0) }
}

/// Amplitudes of the base that leave every damper's response below 60 mm, m.
fn bases_m(name: &str) -> &'static [f32] {
    if name == "bare" { &[1e-4, 2e-4] } else { &[1e-3, 1.5e-3] }
}

/// How far the phase is from the kept one, rad.
fn off(point: &PointResult, phase_rad: f32) -> f32 {
    (point.phase_rad - phase_rad).abs()
}

#[test]
fn every_damper_is_followed_to_its_resonance_at_given_base_and_at_given_response() {
    let base = ClosedLoop { drive_limit_m: 0.03, ..ClosedLoop::default() };
    for gain_per_cycle in [1.0, MAX_GAIN_PER_CYCLE] {
        for (name, set_up) in every_damper() {
            // At 12 mm the bare structure needs 0.09 mm of the base, which is 18 times the noise of a reading.
            let kept_m: &[f32] = if name == "bare" { &[0.012, 0.02] } else { &[0.005, 0.012] };
            let own_m = bases_m(name);
            let ways = [
                ("Z", PlantConfig::ideal(set_up), DriveMode::Constant, own_m),
                ("Z on a shaker", plant(set_up), on_shaker(), own_m),
                ("x", PlantConfig::ideal(set_up), response(None), kept_m),
                ("x on a shaker", plant(set_up), response(Some(base)), kept_m),
            ];
            for (way, config, drive, amplitudes) in ways {
                let lock = PhaseLock { gain_per_cycle, ..lock() };
                let outcome = run(&config, &tracked(lock, drive, amplitudes));
                println!("{name}, {way}, gain {gain_per_cycle}: {} s", outcome.ticks / 1000);
                assert_eq!((outcome.fault, outcome.points.len()), (None, 2), "{name}, {way}");
                for (point, amplitude_m) in outcome.points.iter().zip(amplitudes) {
                    // A dwell is measured while no cycle was beyond three tolerances.
                    assert!(off(point, lock.phase_rad) < lock.tolerance_rad, "{name}, {way}: {point:?}");
                    let reached_m = if way.starts_with('Z') { point.z_amplitude_m } else { point.x_amplitude_m };
                    assert!((reached_m / amplitude_m - 1.0).abs() < 0.015, "{name}, {way}: {point:?}");
                    assert!(point.start_tick < 100_000, "{name}, {way}: a point was measured after its whole wait");
                }
            }
        }
    }
}

/// (ωn² + 2jζωnΩ)(x − z) = Ω² x: every point of a linear structure tells fn and ζ.
#[test]
fn the_resonance_of_the_bare_structure_gives_its_frequency_and_damping() {
    let steady = SteadyLimits { longest_dwell_s: 300.0, ..SteadyLimits::default() };
    for (drive, amplitude) in [(DriveMode::Constant, 2e-4), (response(None), 0.02)] {
        let sine = SteppedSine { settle_s: 60.0, dwell_s: 20.0, steady, ..tracked(lock(), drive, &[amplitude]) };
        let point = run(&PlantConfig::ideal(bare()), &sine).points[0];
        let ratio = f64::from(point.x_amplitude_m / point.z_amplitude_m);
        let (sine, cosine) = (libm::sin(point.phase_rad.into()), libm::cos(point.phase_rad.into()));
        let (of_x, relative) = ((ratio * cosine, ratio * sine), (ratio * cosine - 1.0, ratio * sine));
        let square = relative.0 * relative.0 + relative.1 * relative.1;
        let real = (of_x.0 * relative.0 + of_x.1 * relative.1) / square;
        let imaginary = (of_x.1 * relative.0 - of_x.0 * relative.1) / square;
        let natural_hz = f64::from(point.frequency_hz) * libm::sqrt(real);
        let zeta = imaginary * f64::from(point.frequency_hz) / (2.0 * natural_hz);
        // A cycle's ends are known to a tick of 400, over 50 cycles; the phase then to 3e-4, of which fn has ζ.
        assert!((natural_hz / 2.5 - 1.0).abs() < 2e-5, "{natural_hz}");
        assert!((zeta / 0.0038 - 1.0).abs() < 0.01, "{zeta} {point:?}");
    }
}

#[test]
fn a_plain_sine_at_the_found_frequency_has_the_phase_and_the_amplitude() {
    for (name, set_up) in every_damper() {
        let config = PlantConfig::ideal(set_up);
        let sine = SteppedSine { settle_s: 40.0, dwell_s: 20.0, ..tracked(lock(), response(None), &[0.012]) };
        let found = run(&config, &sine).points[0];
        let plain = SteppedSine {
            amplitude_m: found.z_amplitude_m,
            points: [found.frequency_hz].into_iter().collect(),
            drive: DriveMode::Constant,
            settle_s: 120.0,
            ..sine
        };
        let alone = run(&config, &plain).points[0];
        // 120 s leave e^(−7) of the bare structure's start.
        assert!(off(&alone, found.phase_rad) < 0.01, "{name}: {alone:?} {found:?}");
        assert!((alone.x_amplitude_m / found.x_amplitude_m - 1.0).abs() < 0.01, "{name}: {alone:?} {found:?}");
    }
}

/// The bare structure rings on at the larger amplitude and moves the base.
#[test]
fn a_step_down_of_the_amplitude_is_no_fault() {
    let on_response = response(Some(ClosedLoop::default()));
    for (set_up, drive, amplitudes) in [
        (bare(), on_shaker(), [4e-4, 2e-4]),
        (hybrid(), on_shaker(), [2e-3, 4e-4]),
        (bare(), on_response, [0.04, 0.01]),
        (hybrid(), on_response, [0.02, 0.005]),
    ] {
        let outcome = run(&plant(set_up), &SteppedSine { amplitude_m: 2e-4, ..tracked(lock(), drive, &amplitudes) });
        assert_eq!((outcome.fault, outcome.points.len()), (None, 2), "{amplitudes:?}: {outcome:?}");
    }
}

#[test]
fn other_phases_are_kept_too() {
    for degrees in [-135.0_f32, -45.0] {
        let lock = PhaseLock { phase_rad: degrees.to_radians(), ..lock() };
        for (drive, amplitude) in [(on_shaker(), 1.2e-3), (response(Some(ClosedLoop::default())), 0.006)] {
            let outcome = run(&plant(hybrid()), &tracked(lock, drive, &[amplitude]));
            assert!(off(&outcome.points[0], lock.phase_rad) < lock.tolerance_rad, "{degrees}: {outcome:?}");
        }
    }
}

#[test]
fn a_point_from_rest_does_not_depend_on_the_one_before() {
    let from = |list: &[f32], first_index: u16| {
        let start = Start::FromRest { level_m: 5e-4 };
        let config = plant(hybrid());
        run(
            &config,
            &SteppedSine { start, first_index, ..tracked(lock(), response(Some(ClosedLoop::default())), list) },
        )
        .points
    };
    let (both, alone) = (from(&[0.004, 0.008], 0), from(&[0.008], 1));
    let without_time = |p: &PointResult| PointResult { start_tick: 0, end_tick: 0, ..*p };
    assert_eq!(without_time(&both[1]), without_time(&alone[0]));
}

#[test]
fn a_resonance_outside_the_range_is_measured_at_its_end_after_the_wait() {
    let lock = PhaseLock { wait_s: 20.0, ..PhaseLock::new(2.0, 2.3) };
    for (drive, amplitude) in [(on_shaker(), 1e-3), (response(Some(ClosedLoop::default())), 0.004)] {
        let outcome = run(&plant(spid()), &tracked(lock, drive, &[amplitude]));
        let point = outcome.points[0];
        assert!((point.frequency_hz - 2.3).abs() < 1e-3 && off(&point, lock.phase_rad) > 0.3, "{outcome:?}");
    }
}
