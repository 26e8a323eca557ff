//! Playback of a record on the base, and free vibration, on the rig with its simulated plant.

use damprig_core::control::experiment::Experiment;
use damprig_core::control::fault::FaultCause;
use damprig_core::control::outcome::ExperimentStage;
use damprig_core::control::transient::playback::{MAX_SAMPLES, PlaybackPlan, RecordId};
use damprig_core::control::transient::{FreeVibration, Playback, free_vibration};
use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::sampled::Sampled;
use damprig_core::integrator::units::Units;
use damprig_core::io::{DriveScale, Reading, Sensor, Sensors};
use damprig_core::measure::transient::TransientResult;
use damprig_core::model::{FrictionDamper, Initial, SetUp, Structure};
use damprig_core::rig::{Command, Event, Rig, RigState};
use damprig_simulator::plant::{Plant, PlantConfig};

const ZETA: f64 = 0.0038;

fn bare() -> SetUp {
    SetUp::bare(Structure::from_modal(1.6, 2.5, ZETA))
}

/// Record of a run: the events with their ticks, and x, z and drive of every tick.
#[derive(Default)]
struct Log {
    events: Vec<(u32, Event)>,
    x_m: Vec<f32>,
    drive_m: Vec<f32>,
}

impl Log {
    fn result(&self) -> TransientResult {
        let found = self.events.iter().find_map(|(_, event)| match event {
            Event::Transient(result) => Some(*result),
            _ => None,
        });
        found.unwrap_or_else(|| panic!("no result in {:?}", self.events))
    }

    fn fault(&self) -> Option<FaultCause> {
        self.events.iter().find_map(|(_, event)| if let Event::Fault(fault) = event { Some(fault.cause) } else { None })
    }
}

/// Runs until the rig is idle, or faulted with a silent drive; `meddle` may change each tick's sensors first.
fn run(
    config: &PlantConfig,
    experiment: Experiment,
    record: &[i16],
    mut meddle: impl FnMut(u32, &mut Rig, &mut Sensors),
) -> Log {
    let (mut rig, mut plant) = (Rig::new(), Plant::<f64>::new(config).unwrap());
    rig.handle(Command::Configure(experiment)).unwrap();
    rig.handle(Command::Start).unwrap();
    let (mut sensors, mut log) = (Sensors::default(), Log::default());
    while matches!(rig.state(), RigState::Running(_) | RigState::Stopping) && log.x_m.len() < 400_000 {
        let tick = rig.next_tick();
        meddle(tick, &mut rig, &mut sensors);
        rig.hear_host();
        let actuators = rig.tick(&sensors, record);
        log.events.extend(std::iter::from_fn(|| rig.pop_event()).map(|event| (tick, event)));
        log.x_m.push(sensors.readings.x.mean_m);
        log.drive_m.push(actuators.drive_m);
        if let Some(point) = rig.begins_from_rest() {
            plant.restart(point);
        }
        sensors = plant.tick(&actuators);
    }
    log
}

fn undisturbed(config: &PlantConfig, experiment: Experiment, record: &[i16]) -> Log {
    run(config, experiment, record, |_, _, _| {})
}

fn playback(record: &[i16], sample_rate_hz: f32) -> Playback {
    Playback {
        record: RecordId { samples: record.len() as u16, crc32: 0 },
        sample_rate_hz,
        scale_m: 1e-7,
        ramp_s: 0.0,
        tail_s: 1.0,
        rest_level_m: 1e-4,
        index: 0,
    }
}

fn plan(playback: Playback) -> Experiment {
    Experiment::Playback(PlaybackPlan::new(playback).unwrap())
}

/// A chirp with an envelope that rises and falls slowly, 2 mm high, in counts of 0.1 µm.
fn chirp(rate_hz: f64, duration_s: f64) -> Vec<i16> {
    let count = (rate_hz * duration_s) as u32;
    let at = |n: u32| wanted_chirp(f64::from(n) / rate_hz, duration_s);
    (0..=count).map(|n| (at(n) * 1e7).round() as i16).collect()
}

fn wanted_chirp(t: f64, duration_s: f64) -> f64 {
    use std::f64::consts::TAU;
    if !(0.0..=duration_s).contains(&t) {
        return 0.0;
    }
    let envelope = 0.5 * (1.0 - (TAU * t / duration_s).cos());
    2e-3 * envelope * (TAU * (1.0 + 0.25 * t) * t).sin()
}

#[test]
fn the_demand_interpolates_the_record_and_is_at_rest_at_both_ends() {
    for rate in [50.0, 128.0, 1000.0] {
        let record = chirp(rate, 8.0);
        let log = undisturbed(&PlantConfig::ideal(bare()), plan(playback(&record, rate as f32)), &record);
        let begins = log.drive_m.iter().position(|d| *d != 0.0).unwrap();
        // The playback begins two samples before the record. The first samples round to zero, so the test searches
        // for the start.
        let worst_at = |start: f64| -> f64 {
            let error = |(tick, drive): (usize, &f32)| {
                (f64::from(*drive) - wanted_chirp(tick as f64 * 1e-3 - start, 8.0)).abs()
            };
            log.drive_m.iter().enumerate().map(error).fold(0.0, f64::max)
        };
        let quiet_s = 0.5;
        let start = (0..4)
            .map(|n| quiet_s + f64::from(n) * 1e-3 + 2.0 / rate)
            .min_by(|a, b| worst_at(*a).total_cmp(&worst_at(*b)))
            .unwrap();
        // Tolerances: (Ωh)³/50 at the highest frequency of 1 + 2·0.25·8 = 5 Hz, half a count, and half the grid of
        // the search.
        let step = std::f64::consts::TAU * 5.0 / rate;
        let bound = 2e-3 * step.powi(3) / 50.0 + 0.6e-7 + 2e-3 * std::f64::consts::TAU * 5.0 * 0.05e-3;
        assert!(worst_at(start) < bound, "{rate} Hz: {:.2e} m of {bound:.2e}", worst_at(start));
        assert!(begins >= 500, "the drive started before the structure was at rest");
        assert_eq!(log.drive_m.last(), Some(&0.0));
        let jump = log.drive_m.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        assert!(jump < 2.1e-3 * std::f32::consts::TAU * 5.0 * 1e-3, "a step of {jump} m");
    }
}

#[test]
fn a_record_with_nonzero_ends_still_starts_and_ends_at_rest() {
    let record = [20_000; 400];
    for ramp_s in [0.0, 0.5] {
        let play = Playback { ramp_s, tail_s: 0.2, ..playback(&record, 100.0) };
        let log = undisturbed(&PlantConfig::ideal(bare()), plan(play), &record);
        let speed = |w: &[f32]| (w[1] - w[0]).abs();
        let (first, last) =
            (log.drive_m.iter().position(|d| *d != 0.0).unwrap(), log.drive_m.iter().rposition(|d| *d != 0.0).unwrap());
        // The start is from rest, so the first change is of second order in the tick.
        let rise_s = if ramp_s > 0.0 { ramp_s } else { 0.01 };
        let most = log.drive_m.windows(2).map(speed).fold(0.0, f32::max);
        assert!(most < 2e-3 * 1.6 / (rise_s * 1e3), "ramp {ramp_s}: {most} m a tick");
        assert!(log.drive_m[first] < 0.3 * most && log.drive_m[last] < 0.3 * most, "ramp {ramp_s}");
        assert!((log.drive_m.iter().fold(0.0f32, |a, b| a.max(*b)) - 2e-3).abs() < 3e-4);
    }
}

#[test]
fn the_response_to_a_record_agrees_with_the_integrator() {
    let (rate, duration) = (200.0, 8.0);
    let record = chirp(rate, duration);
    let log = undisturbed(&PlantConfig::ideal(bare()), plan(playback(&record, rate as f32)), &record);
    let result = log.result();
    // Reference: the exact record acting on the same structure, at eight times the tick rate.
    let step_s = 0.125e-3;
    let mut motion = Sampled::<f64>::new(&bare(), Units::metres(step_s), &Initial::default()).unwrap();
    let (mut peak, mut squares, mut relative, mut z_squares) = (0.0f64, 0.0, 0.0, 0.0);
    let steps = (f64::from(result.end_tick - result.start_tick) * 8.0) as u32;
    for n in 0..steps {
        let z = |n: u32| wanted_chirp(f64::from(n) * step_s, duration);
        let rate = |n: u32| 0.5 * (z(n + 1) - if n > 0 { z(n - 1) } else { 0.0 });
        motion.step(&BaseSegment::hermite(z(n), z(n + 1), rate(n), rate(n + 1)), &mut ());
        let x = motion.state().x;
        peak = peak.max(x.abs());
        squares += x * x;
        z_squares += z(n + 1) * z(n + 1);
        relative += (x - z(n + 1)) * (x - z(n + 1));
    }
    let rms = |sum: f64| (sum / f64::from(steps)).sqrt();
    // The measured window begins two samples and two ticks before the record. It lacks 12 ticks of 9000 at the end of
    // the motion, whose amplitude is near its peak there: at most 12/9000 of the mean square. The spline's error
    // (Ωh)³/50 is below 1e-4.
    for (name, value, expected) in [
        ("x peak", f64::from(result.max_abs_x_m), peak),
        ("x", f64::from(result.rms_x_m), rms(squares)),
        ("z", f64::from(result.rms_z_m), rms(z_squares)),
        ("x − z", f64::from(result.rms_x_minus_z_m), rms(relative)),
    ] {
        assert!((value / expected - 1.0).abs() < 2e-3, "{name}: {value} for {expected}");
    }
    let z_peak = (0..8000).map(|n| wanted_chirp(f64::from(n) * 1e-3, duration).abs()).fold(0.0, f64::max);
    // Half a step of the sensor's resolution.
    assert!((f64::from(result.max_abs_z_m) - z_peak).abs() < 15e-6, "{} for {z_peak}", result.max_abs_z_m);
    // The prescribed base is 2.45 ticks late and has no error of its own. The sensor contributes √((5 µm)² + (10
    // µm)²/12)/√10 = 1.8 µm.
    assert!((result.base_delay_s - 2.45e-3).abs() < 0.1e-3, "{}", result.base_delay_s);
    assert!(result.base_error_rms_m < 2.2e-6, "{}", result.base_error_rms_m);
    assert!(!result.drive_saturated);
}

/// A plateau at the drive's limit: the cubics between its samples overshoot it by a sixteenth at either end.
#[test]
fn a_demand_beyond_the_drives_range_between_samples_is_clipped_and_reported() {
    let most_m = DriveScale::default().range().amplitude_m();
    let plateau = |peak_m: f32| [vec![0; 50], vec![(peak_m / 2e-7) as i16; 50], vec![0; 50]].concat();
    for (peak_m, is_cut) in [(most_m, true), (0.9 * most_m, false)] {
        let record = plateau(peak_m);
        let log = undisturbed(
            &PlantConfig::ideal(bare()),
            plan(Playback { scale_m: 2e-7, ..playback(&record, 50.0) }),
            &record,
        );
        let largest = log.drive_m.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        assert_eq!(largest == most_m, is_cut, "{largest}");
        assert!(is_cut || (largest > 1.05 * peak_m && largest < most_m), "{largest}");
        assert_eq!(log.result().drive_saturated, is_cut);
    }
}

#[test]
fn a_stop_fades_the_record_out_and_gives_no_result() {
    let record = chirp(100.0, 8.0);
    let log = run(&PlantConfig::ideal(bare()), plan(playback(&record, 100.0)), &record, |tick, rig, _| {
        if tick == 4000 {
            rig.handle(Command::Stop).unwrap();
        }
    });
    assert!(log.events.is_empty(), "{:?}", log.events);
    assert!((4190..4210).contains(&log.drive_m.len()), "faded over {} ticks", log.drive_m.len() - 4000);
    let jump = log.drive_m.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(jump < 1.1e-4, "a step of {jump} m");
}

#[test]
fn an_interlock_ends_a_playback() {
    let record = chirp(100.0, 8.0);
    let play = || plan(playback(&record, 100.0));
    let log =
        run(&PlantConfig::ideal(bare()), play(), &record, |tick, _, sensors| sensors.emergency_stop = tick >= 3000);
    assert_eq!(log.fault(), Some(FaultCause::EmergencyStop));
    let log = run(&PlantConfig::ideal(bare()), play(), &record, |tick, _, sensors| {
        if tick >= 3000 {
            sensors.readings.z = Reading::still(1e-3);
        }
    });
    assert_eq!(log.fault(), Some(FaultCause::SensorFrozen(Sensor::Z)), "the base stands still while the demand moves");
}

#[test]
fn a_constant_demand_does_not_trip_the_frozen_sensor_check() {
    // A record with two seconds of zeros and a plateau, without noise.
    let mut record = vec![0; 200];
    record.extend([1000, 5000, 9000, 10_000]);
    record.extend([10_000; 300]);
    record.extend([9000, 5000, 1000, 0]);
    let log = undisturbed(&PlantConfig::ideal(bare()), plan(playback(&record, 100.0)), &record);
    assert_eq!(log.fault(), None);
    assert!(log.result().max_abs_z_m > 0.99e-3);
}

#[test]
fn a_record_longer_than_the_buffer_is_refused_with_the_limit() {
    let long = Playback { record: RecordId { samples: 20_481, crc32: 0 }, ..playback(&[0; 4], 100.0) };
    let refused = PlaybackPlan::new(long).unwrap_err();
    assert_eq!((refused.parameter, refused.value), ("record.samples", 20_481.0));
    assert!(refused.allowed.contains("20480"), "{}", refused.allowed);
    assert_eq!(MAX_SAMPLES * 2, 40 * 1024);
    for bad in [
        Playback { sample_rate_hz: 1000.1, ..playback(&[0; 4], 100.0) },
        Playback { sample_rate_hz: f32::NAN, ..playback(&[0; 4], 100.0) },
        Playback { scale_m: 0.0, ..playback(&[0; 4], 100.0) },
        Playback { ramp_s: 0.021, ..playback(&[0; 4], 100.0) },
        Playback { tail_s: f32::INFINITY, ..playback(&[0; 4], 100.0) },
    ] {
        assert!(PlaybackPlan::new(bad).is_err(), "{bad:?}");
    }
}

fn free() -> FreeVibration {
    FreeVibration { level_m: 0.02, hold_s: 0.5, timeout_s: 30.0, measure_s: 8.0, cycles: 10, index: 0 }
}

fn freed(free: FreeVibration) -> Experiment {
    Experiment::FreeVibration(free_vibration::FreeVibrationPlan::new(free).unwrap())
}

#[test]
fn a_free_vibration_gives_the_damping_and_the_frequency_of_its_structure() {
    let config = PlantConfig { structure_start_m: 0.035, ..PlantConfig::ideal(bare()) };
    let decay = undisturbed(&config, freed(free()), &[]).result().decay;
    // The plant moves freely for a tick between two resets: (Ωh)²/6 of x0. The mean over a tick reduces a peak by
    // (Ωh)²/8.
    assert!((decay.start_m / 0.035 - 1.0).abs() < 6e-5, "{decay:?}");
    assert_eq!(decay.cycles, 10);
    let decrement = (f64::from(decay.start_m) / f64::from(decay.end_m)).ln() / 10.0;
    let zeta = decrement / (decrement * decrement + std::f64::consts::TAU.powi(2)).sqrt();
    assert!((zeta - ZETA).abs() < 1e-4 / (10.0 * std::f64::consts::TAU) + 1e-7, "{zeta}");
    // A crossing is interpolated to 1e-3 of a tick.
    let frequency = 10.0 / f64::from(decay.span_s);
    assert!((frequency / (2.5 * (1.0 - ZETA * ZETA).sqrt()) - 1.0).abs() < 1e-5, "{frequency}");
}

#[test]
fn coulomb_friction_reduces_the_amplitude_by_4f_over_k_per_cycle() {
    let structure = Structure::from_modal(1.6, 2.5, 0.0);
    let force_n = 0.5;
    let set_up = SetUp { friction_damper: Some(FrictionDamper { force_n }), ..SetUp::bare(structure) };
    let config = PlantConfig { structure_start_m: 0.035, ..PlantConfig::ideal(set_up) };
    let decay = undisturbed(&config, freed(FreeVibration { cycles: 4, ..free() }), &[]).result().decay;
    let lost = 4.0 * force_n / structure.stiffness_n_per_m * 4.0;
    let measured = f64::from(decay.start_m - decay.end_m);
    assert!((measured / lost - 1.0).abs() < 2e-3, "{measured} for {lost}");
}

#[test]
fn a_decay_that_ends_early_reports_the_number_of_its_cycles() {
    let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.2));
    let config = PlantConfig { structure_start_m: 0.035, ..PlantConfig::ideal(set_up) };
    let result = undisturbed(&config, freed(free()), &[]).result();
    // A cycle leaves e^(−2π·0.2/√(1 − 0.04)) = 0.277 of the amplitude: 0.0059 after four cycles, so three end above a
    // hundredth.
    assert_eq!(result.decay.cycles, 3, "{:?}", result.decay);
    assert!((result.decay.end_m / 0.035 - 0.277f32.powi(3)).abs() < 1e-3);
}

/// A real structure, pulled by hand, which the rig cannot reset: pulled for 2 s, held unsteadily, released after 6 s.
fn by_hand(tick: u32, sensors: &mut Sensors, release_tick: u32) {
    let t = f64::from(tick) * 1e-3;
    let held =
        0.03 * (t / 2.0).min(1.0) * (1.0 - if (3.0..3.5).contains(&t) { 0.05 } else { 0.0 }) + 5e-5 * (7.0 * t).sin();
    let since = f64::from(tick.saturating_sub(release_tick)) * 1e-3;
    let x = if tick < release_tick { held } else { 0.03 * (-0.06 * since).exp() * (15.7 * since).cos() };
    sensors.readings.x = Reading::still(-x as f32);
}

#[test]
fn a_release_by_an_unsteady_hand_is_detected() {
    let log = run(&PlantConfig::ideal(bare()), freed(free()), &[], |tick, _, sensors| by_hand(tick, sensors, 6000));
    let result = log.result();
    // The release is detected when the displacement has fallen by a tenth: acos(0.9)/15.7 = 29 ms later.
    assert!((6025..6035).contains(&result.start_tick), "{}", result.start_tick);
    assert!((result.decay.start_m / 0.03 - 1.0).abs() < 2e-3, "{:?}", result.decay);
    let decrement = (result.decay.start_m / result.decay.end_m).ln() / f32::from(result.decay.cycles);
    assert!((decrement / (0.06 * std::f32::consts::TAU / 15.7) - 1.0).abs() < 2e-2, "{decrement}");
}

#[test]
fn a_structure_that_is_not_released_times_out_without_a_drive() {
    for held in [false, true] {
        let log = run(&PlantConfig::ideal(bare()), freed(free()), &[], |_, _, sensors| {
            sensors.readings.x = Reading::still(if held { 0.03 } else { 0.001 });
        });
        assert_eq!(log.fault(), Some(FaultCause::ReleaseTimeout));
        assert!(log.drive_m.iter().all(|d| *d == 0.0));
        assert!((30_000..30_010).contains(&log.drive_m.len()) || log.drive_m.len() < 30_400);
    }
}

#[test]
fn a_measurement_shorter_than_a_tick_would_never_end_and_is_refused() {
    for measure_s in [1e-9, 1e-4, 0.9e-3] {
        let refused = free_vibration::FreeVibrationPlan::new(FreeVibration { measure_s, ..free() }).unwrap_err();
        assert_eq!(refused.parameter, "measure_s", "{measure_s}");
    }
    assert!(free_vibration::FreeVibrationPlan::new(FreeVibration { measure_s: 1e-3, ..free() }).is_ok());
}

#[test]
fn a_free_vibration_is_held_released_and_measured() {
    let config = PlantConfig { structure_start_m: 0.035, ..PlantConfig::ideal(bare()) };
    let mut stages = Vec::new();
    let log = run(&config, freed(free()), &[], |_, rig, _| {
        if let RigState::Running(stage) = rig.state()
            && stages.last() != Some(&stage)
        {
            stages.push(stage);
        }
    });
    assert_eq!(stages, [ExperimentStage::Hold, ExperimentStage::Dwell]);
    assert!(
        matches!(log.events[..], [(_, Event::Transient(_)), (_, Event::Finished { points: 1, .. })]),
        "{:?}",
        log.events
    );
    let result = log.result();
    assert_eq!(result.end_tick - result.start_tick, 8001);
    assert!(log.x_m.iter().all(|x| x.abs() <= 0.0351));
}
