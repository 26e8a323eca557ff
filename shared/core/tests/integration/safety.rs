//! The interlocks: every fault leads to the safe state, and the drive cannot restart before it.

use damprig_core::control::fault::{Fault, FaultCause};
use damprig_core::control::safety::{Allowed, Limits, SafeStage, Safety, SafetyConfig, Signs};
use damprig_core::io::{Rail, Reading, Readings, SUBSAMPLES, Sensor, Sensors, Usable};

/// The laser's usable span: ±80 mm less 1 % of its span at either end.
const LASER: Usable<f32> = Usable { low: -0.0784, high: 0.0784 };

/// The faults that a fade of the drive would prolong.
const CUT_AT_ONCE: [FaultCause; 4] =
    [FaultCause::EmergencyStop, FaultCause::BaseDisplacement, FaultCause::BaseRunaway, FaultCause::BaseOverdriven];

struct Bench {
    safety: Safety,
    tick: u32,
    x_m: f32,
    z_m: f32,
    signs: Signs,
}

impl Bench {
    fn with(config: SafetyConfig) -> Self {
        let signs =
            Signs { driving: true, swinging: true, running: true, drive_m: 2e-3, host_heard: true, ..Signs::default() };
        Self { safety: Safety::new(&config).unwrap(), tick: 0, x_m: 0.02, z_m: 2e-3, signs }
    }

    fn new() -> Self {
        Self::with(SafetyConfig { saturated_s: 0.5, host_silent_s: 2.0, brake_n: 6.0, ..SafetyConfig::default() })
    }

    /// Structure and base vibrate at 2.5 Hz with these amplitudes.
    fn sensors(&mut self) -> Sensors {
        let tick = f64::from(self.tick);
        let sine = |n: usize| libm::sin(15.708e-3 * (tick + n as f64 / SUBSAMPLES as f64)) as f32;
        self.tick += 1;
        let block = |amplitude: f32| std::array::from_fn(|n| amplitude * sine(n));
        let [x, z] = [self.x_m, self.z_m].map(|amplitude| Reading::within(&block(amplitude), &LASER));
        Sensors { readings: Readings { x, z, ..Readings::default() }, ..Sensors::default() }
    }

    fn tick(&mut self) -> (Allowed, Option<FaultCause>) {
        let sensors = self.sensors();
        let (allowed, fault) = self.safety.tick(&sensors.readings, &self.signs);
        (allowed, fault.map(|fault| fault.cause))
    }

    fn run(&mut self, ticks: u32) -> Allowed {
        (1..ticks).for_each(|_| _ = self.tick());
        self.tick().0
    }

    /// Runs until a fault is latched, which must have `cause`, then until the rig is safe, and checks the sequence.
    fn expect(&mut self, cause: FaultCause) {
        let found = (0..20_000).find_map(|_| self.tick().1);
        assert_eq!(found, Some(cause));
        self.expect_safe_path(cause);
    }

    fn expect_safe_path(&mut self, cause: FaultCause) {
        (self.signs.driving, self.signs.swinging, self.signs.running) = (false, false, false);
        let mut drive = 1.0;
        let fade = if CUT_AT_ONCE.contains(&cause) { 0 } else { 201 };
        for tick in 0..400 {
            let (allowed, again) = self.tick();
            assert!(again.is_none(), "latched once only");
            assert!(allowed.drive <= drive, "the drive never rises again");
            assert_eq!(allowed.brake_n, (cause != FaultCause::EmergencyStop).then_some(6.0));
            assert!(allowed.relay || allowed.drive == 0.0);
            if tick >= fade {
                assert!(!allowed.relay && allowed.drive == 0.0, "tick {tick}: {allowed:?}");
            }
            drive = allowed.drive;
            assert!(self.safety.clear().is_err(), "the fault cannot be cleared while the structure rings");
            assert_eq!(self.safety.fault().unwrap().cause, cause, "the first cause stays");
        }
        assert_eq!(self.safety.stage(), SafeStage::Ringing);
        // The cause has been removed and the rig is at rest.
        (self.x_m, self.z_m, self.signs) = (1e-5, 1e-5, Signs { host_heard: true, ..Signs::default() });
        // |x| was below 1 mm for 3 ms at the last zero crossing of 20 mm; these count too.
        self.run(490);
        assert_eq!(self.safety.stage(), SafeStage::Ringing, "less than half a second of rest is not enough");
        self.run(20);
        assert_eq!(self.safety.stage(), SafeStage::Safe);
        assert_eq!(self.safety.fault().unwrap().cause, cause, "the fault can be read until it is cleared");
        self.safety.clear().unwrap();
        let (allowed, _) = self.tick();
        assert_eq!(allowed, Allowed { drive: 1.0, relay: true, brake_n: None });
    }
}

#[test]
fn a_healthy_rig_causes_no_fault() {
    let mut bench = Bench::new();
    assert_eq!(bench.run(60_000), Allowed { drive: 1.0, relay: true, brake_n: None });
    assert_eq!(bench.safety.stage(), SafeStage::Clear);
}

#[test]
fn the_emergency_stop_opens_the_relay_in_the_same_tick_and_holds_until_released() {
    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.emergency_stop = true;
    let (allowed, cause) = bench.tick();
    assert_eq!(cause, Some(FaultCause::EmergencyStop));
    assert!(!allowed.relay && allowed.drive == 0.0);
    (bench.x_m, bench.z_m) = (0.0, 0.0);
    bench.run(5000);
    assert_eq!(bench.safety.stage(), SafeStage::Ringing, "still pressed");
    assert!(bench.safety.clear().is_err());
    bench.x_m = 0.02;
    bench.expect_safe_path(FaultCause::EmergencyStop);
}

#[test]
fn the_brake_stays_open_after_an_emergency_stop_and_opens_in_one_after_another_fault() {
    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.emergency_stop = true;
    bench.run(100);
    bench.signs.emergency_stop = false;
    assert_eq!(bench.run(100).brake_n, None, "the operator has released the stop and not cleared it");

    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.wall_force_n = 501.0;
    assert_eq!(bench.run(10).brake_n, Some(6.0));
    bench.signs.emergency_stop = true;
    assert_eq!(bench.tick().0.brake_n, None, "a hand may be at the spring");
}

#[test]
fn both_displacement_limits_end_the_drive() {
    let limits = Limits { structure_m: 0.05, base_m: 0.005 };
    let mut bench = Bench::with(SafetyConfig { limits, brake_n: 6.0, ..SafetyConfig::default() });
    bench.run(1000);
    bench.z_m = 0.0051;
    bench.expect(FaultCause::BaseDisplacement);
    let config = SafetyConfig { limits, half_cycles_ahead: 0.0, brake_n: 6.0, ..SafetyConfig::default() };
    let mut bench = Bench::with(config);
    bench.run(1000);
    bench.x_m = 0.0501;
    bench.expect(FaultCause::StructureDisplacement);
}

#[test]
fn a_displacement_of_either_sign_exactly_at_its_limit_ends_the_drive() {
    let limits = Limits { structure_m: 0.05, base_m: 0.005 };
    for sign in [1.0, -1.0] {
        for (x_m, z_m, cause) in
            [(0.05, 0.0, FaultCause::StructureDisplacement), (0.0, 0.005, FaultCause::BaseDisplacement)]
        {
            let mut bench = Bench::with(SafetyConfig { limits, ..SafetyConfig::default() });
            bench.run(1000);
            let (x, z) = (Reading::still(sign * x_m), Reading::still(sign * z_m));
            let readings = Readings { x, z, ..Sensors::default().readings };
            let (_, fault) = bench.safety.tick(&readings, &bench.signs);
            assert_eq!(fault.map(|fault| fault.cause), Some(cause), "{sign}");
        }
    }
}

#[test]
fn a_base_that_is_found_to_run_away_or_to_move_too_far_is_cut_in_the_next_tick() {
    for cause in [FaultCause::BaseRunaway, FaultCause::BaseOverdriven] {
        let mut bench = Bench::new();
        bench.run(1000);
        assert!(bench.safety.latch(Fault { cause, tick: bench.tick, value: 0.01, limit: 0.005 }));
        bench.expect_safe_path(cause);
    }
}

#[test]
fn a_growing_vibration_is_ended_before_it_reaches_its_limit() {
    let mut bench = Bench::new();
    let mut cause = None;
    let mut largest: f32 = 0.0;
    for tick in 0..20_000u32 {
        bench.x_m = 5e-6 * tick as f32;
        largest = largest.max(bench.x_m);
        cause = bench.tick().1;
        if cause.is_some() {
            break;
        }
    }
    assert_eq!(cause, Some(FaultCause::StructureForeseen));
    // In six half-cycles of 200 ms the amplitude grows by 6 mm at 5 µm/ms, before 78 mm; up to one more half-cycle
    // passes until the maximum is known.
    assert!((0.071..0.074).contains(&largest), "{largest}");
    bench.expect_safe_path(FaultCause::StructureForeseen);
}

#[test]
fn unreliable_sensors_end_the_drive() {
    for (broken, cause) in [
        (f32::NAN, FaultCause::SensorInvalid as fn(Sensor) -> FaultCause),
        (f32::NEG_INFINITY, FaultCause::SensorAtRail),
        (0.0785, FaultCause::SensorAtRail),
        (0.0123, FaultCause::SensorFrozen),
    ] {
        for sensor in [Sensor::X, Sensor::Z] {
            let mut bench = Bench::new();
            bench.run(1000);
            let mut found = None;
            for _ in 0..600 {
                let mut sensors = bench.sensors();
                let Readings { x, z, .. } = &mut sensors.readings;
                *(if sensor == Sensor::X { x } else { z }) = Reading::within(&[broken; SUBSAMPLES], &LASER);
                let (allowed, fault) = bench.safety.tick(&sensors.readings, &bench.signs);
                found = found.or(fault.map(|fault| fault.cause));
                assert!(allowed.drive.is_finite());
            }
            assert_eq!(found, Some(cause(sensor)), "{broken} on {sensor:?}");
            // Still broken, with readings as at rest: these give no evidence of rest.
            if cause(sensor) != FaultCause::SensorFrozen(sensor) {
                for _ in 0..2000 {
                    let x = Reading::within(&[broken; SUBSAMPLES], &LASER);
                    bench.safety.tick(&Readings { x, ..Sensors::default().readings }, &bench.signs);
                    assert!(bench.safety.clear().is_err());
                }
            }
            bench.expect_safe_path(cause(sensor));
        }
    }
}

#[test]
fn every_sensor_at_a_rail_for_five_milliseconds_ends_an_experiment_and_is_named() {
    let lost = Rail::All { reading: -5.5, edge: -5.0 };
    for sensor in Sensor::ALL {
        let mut bench = Bench::new();
        bench.run(1000);
        for tick in 1..=5 {
            let mut readings = bench.sensors().readings;
            match sensor {
                Sensor::X => readings.x.rail = lost,
                Sensor::Z => readings.z.rail = lost,
                Sensor::SpringForce => readings.spring_rail = lost,
                Sensor::WallLow => bench.signs.wall_rails[0] = lost,
                Sensor::WallHigh => bench.signs.wall_rails[1] = lost,
            }
            let (_, fault) = bench.safety.tick(&readings, &bench.signs);
            let cause = (tick == 5).then_some(FaultCause::SensorAtRail(sensor));
            assert_eq!(fault.map(|fault| fault.cause), cause, "{sensor:?}, tick {tick}");
        }
        assert!(bench.safety.sensors().lost.contains(sensor));
    }
}

#[test]
fn a_sensor_that_reads_between_ticks_at_a_rail_is_not_lost() {
    let mut bench = Bench::new();
    bench.run(1000);
    let lost = Rail::All { reading: -5.5, edge: -5.0 };
    for spring_rail in [lost; 4].into_iter().chain([Rail::Clear]).cycle().take(50) {
        let readings = Readings { spring_rail, ..bench.sensors().readings };
        assert_eq!(bench.safety.tick(&readings, &bench.signs).1, None);
    }
}

/// Readings as of a structure at rest that are none: the x sensor is at a rail whose reading is near zero.
#[test]
fn a_sensor_at_a_rail_near_zero_is_no_evidence_of_rest() {
    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.wall_force_n = 501.0;
    bench.tick();
    let x = Reading { rail: Rail::All { reading: -1e-4, edge: -1e-5 }, ..Reading::still(-1e-4) };
    for _ in 0..2000 {
        bench.safety.tick(&Readings { x, ..Sensors::default().readings }, &Signs::default());
    }
    assert_eq!(bench.safety.stage(), SafeStage::Ringing);
    assert!(bench.safety.clear().is_err());
}

#[test]
fn a_fault_whose_cause_persists_cannot_be_cleared_though_the_structure_is_at_rest() {
    let mut bench = Bench::new();
    bench.run(1000);
    for _ in 0..2000 {
        let signs = Signs { wall_force_n: 501.0, ..Signs::default() };
        bench.safety.tick(&Sensors::default().readings, &signs);
    }
    assert_eq!(bench.safety.fault().unwrap().cause, FaultCause::WallForce);
    assert!(bench.safety.clear().is_err());
}

#[test]
fn a_lost_sensor_of_an_idle_rig_is_reported_and_latches_no_fault() {
    let mut bench = Bench::new();
    bench.signs = Signs { host_heard: true, ..Signs::default() };
    let lost = Readings { x: Reading::within(&[-0.08; SUBSAMPLES], &LASER), ..Sensors::default().readings };
    for _ in 0..2000 {
        assert_eq!(bench.safety.tick(&lost, &bench.signs).1, None);
    }
    assert!(bench.safety.sensors().lost.contains(Sensor::X));
    assert_eq!(bench.safety.stage(), SafeStage::Clear);
}

#[test]
fn a_sensor_may_stand_still_while_the_rig_is_not_driven() {
    let mut bench = Bench::new();
    (bench.signs.driving, bench.signs.swinging) = (false, false);
    (bench.x_m, bench.z_m) = (0.0, 0.0);
    bench.run(10_000);
    assert_eq!(bench.safety.stage(), SafeStage::Clear);
}

/// Number of ticks for which both sensors may stand still before the fault, at most 3000.
fn still_for(bench: &mut Bench) -> Option<u32> {
    bench.run(1000);
    let still = Readings { x: Reading::still(2e-3), z: Reading::still(1e-3), ..Sensors::default().readings };
    (0..3000).find(|_| bench.safety.tick(&still, &bench.signs).1.is_some())
}

#[test]
fn a_slow_sine_may_stand_still_for_half_a_period_before_its_sensor_counts_as_frozen() {
    // The configured time is 0.5 s; half a period of 0.4 Hz is 1.25 s. The first constant block contains a step and
    // does not count.
    for (frequency_hz, ticks) in [(0.0, 500), (2.5, 500), (0.4, 1250)] {
        let mut bench = Bench::new();
        bench.signs.frequency_hz = frequency_hz;
        assert_eq!(still_for(&mut bench), Some(ticks), "{frequency_hz} Hz");
    }
}

#[test]
fn a_drive_below_the_sensors_resolution_trips_no_frozen_sensor_check() {
    for (drive_m, resolution_m, is_judged) in [(2e-3, 1e-5, true), (4e-5, 1e-5, false), (2e-3, 1e-3, false)] {
        let mut bench = Bench::with(SafetyConfig { resolution_m, ..SafetyConfig::default() });
        bench.signs.drive_m = drive_m;
        assert_eq!(still_for(&mut bench).is_some(), is_judged, "{drive_m} m of drive, steps of {resolution_m} m");
    }
}

#[test]
fn saturation_that_is_only_reported_does_not_end_the_drive() {
    let mut bench = Bench::with(SafetyConfig::default());
    bench.signs.saturated = true;
    bench.run(60_000);
    assert!(bench.safety.fault().is_none());
}

#[test]
fn a_wall_force_that_is_no_number_ends_the_drive() {
    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.wall_force_n = f32::NAN;
    assert_eq!(bench.tick().1, Some(FaultCause::WallForce));
}

#[test]
fn wall_force_saturation_and_host_silence_end_the_drive_after_their_time() {
    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.wall_force_n = 501.0;
    bench.expect(FaultCause::WallForce);

    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.saturated = true;
    bench.run(500);
    assert!(bench.safety.fault().is_none(), "half a second is allowed");
    bench.expect(FaultCause::DriveSaturated);

    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.host_heard = false;
    bench.run(1999);
    assert!(bench.safety.fault().is_none(), "two seconds are allowed");
    bench.expect(FaultCause::HostSilent);
}

#[test]
fn a_second_fault_during_the_fade_can_only_shorten_it() {
    let mut bench = Bench::new();
    bench.run(1000);
    bench.signs.wall_force_n = 501.0;
    assert!(bench.tick().0.relay, "fading");
    bench.signs.emergency_stop = true;
    let (allowed, cause) = bench.tick();
    assert!(!allowed.relay && cause.is_none());
    assert_eq!(bench.safety.fault().unwrap().cause, FaultCause::WallForce);
}

#[test]
fn invalid_settings_are_rejected_by_name() {
    let good = SafetyConfig::default();
    for (bad, name) in [
        (SafetyConfig { half_cycles_ahead: 21.0, ..good }, "safety.half_cycles_ahead"),
        (SafetyConfig { restart_m: 0.078, ..good }, "safety.restart_m"),
        (SafetyConfig { saturated_s: -1.0, ..good }, "safety.saturated_s"),
        (SafetyConfig { resolution_m: -1e-5, ..good }, "safety.resolution_m"),
        (SafetyConfig { frozen_s: f32::NAN, ..good }, "safety.frozen_s"),
        // A tick, and a time in which a record may stand still.
        (SafetyConfig { frozen_s: 0.0006, ..good }, "safety.frozen_s"),
        (SafetyConfig { frozen_s: 0.2, ..good }, "safety.frozen_s"),
        (SafetyConfig { limits: Limits { base_m: -1.0, ..Limits::default() }, ..good }, "safety.limits.base_m"),
    ] {
        assert_eq!(Safety::new(&bad).unwrap_err().parameter, name);
    }
}
