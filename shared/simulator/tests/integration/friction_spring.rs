//! The controller of the friction spring with a simulated drive, intact and with failures.

use damprig_core::control::fault::{FaultCause, SpringFaultCause};
use damprig_core::control::friction_spring::{
    FrictionSpring, SpringCommand, SpringConfig, SpringEvent, SpringInputs, SpringRejected, SpringStage, Target,
};
use damprig_core::control::safety::rails::SensorVerdict;
use damprig_core::io::{Motor, SUBSAMPLES};
use damprig_simulator::plant::spring::{SimulatedSpring, SpringPlant};

struct Bench {
    spring: FrictionSpring,
    plant: SimulatedSpring,
    max_abs_x_m: f32,
    z_m: Option<f32>,
    /// Value that replaces the reading of the force sensor, N.
    reads_n: Option<f32>,
    force_sensor: SensorVerdict,
    /// The force sensor has the wrong sign.
    reversed: bool,
    events: Vec<SpringEvent>,
    drive: Motor,
    /// Steps in each tick.
    log: Vec<i8>,
}

impl Bench {
    fn with(config: &SpringConfig, plant: &SpringPlant) -> Self {
        let (spring, plant) = (FrictionSpring::new(config).unwrap(), SimulatedSpring::new(plant).unwrap());
        Self {
            spring,
            plant,
            max_abs_x_m: 0.0,
            z_m: None,
            reads_n: None,
            force_sensor: SensorVerdict::Reads,
            reversed: false,
            events: vec![],
            drive: Motor::default(),
            log: vec![],
        }
    }

    fn new() -> Self {
        Self::with(&SpringConfig::default(), &SpringPlant::default())
    }

    /// A bench that is homed and touched off.
    fn ready() -> Self {
        let mut bench = Self::new();
        bench.make_ready();
        bench
    }

    fn make_ready(&mut self) {
        self.command(SpringCommand::Home);
        self.until(SpringStage::Homed);
        self.command(SpringCommand::TouchOff);
        self.until(SpringStage::Holding);
    }

    fn command(&mut self, command: SpringCommand) {
        self.spring.handle(command).unwrap();
    }

    fn set(&mut self, target: Target) {
        self.command(SpringCommand::Set(target));
    }

    fn tick(&mut self) {
        // The motor moves after the controller's tick: the readings are one tick old.
        let (block, at_switch) = self.plant.tick(self.drive);
        let read_n = block.iter().sum::<f32>() / SUBSAMPLES as f32;
        let force_n = self.reads_n.unwrap_or(if self.reversed { -read_n } else { read_n });
        let inputs = SpringInputs {
            tick: self.log.len() as u32,
            force_n,
            force_sensor: self.force_sensor,
            at_switch,
            max_abs_x_m: self.max_abs_x_m,
            base_amplitude_m: self.z_m,
            emergency_stop: false,
        };
        let event;
        (self.drive, event) = self.spring.tick(&inputs);
        self.log.push(self.drive.steps);
        self.events.extend(event);
    }

    fn run(&mut self, ticks: usize) {
        (0..ticks).for_each(|_| self.tick());
    }

    fn until(&mut self, stage: SpringStage) {
        for _ in 0..200_000 {
            self.tick();
            if self.spring.stage() == stage {
                return;
            }
        }
        panic!("{stage:?} not reached: {:?}", self.spring.status());
    }

    /// Runs until this fault occurs and the motor stops; checks that it stays stopped.
    fn until_safe(&mut self, cause: SpringFaultCause) {
        self.until(SpringStage::Faulted);
        assert_eq!(self.spring.status().fault.unwrap().cause, FaultCause::Spring(cause));
        self.run(20_000);
        assert!(self.log.iter().rev().take(1000).all(|&steps| steps == 0), "the motor still moves");
        assert!(!self.drive.enabled, "the motor is still on");
        assert_eq!(self.events.iter().filter(|h| matches!(h, SpringEvent::Fault(_))).count(), 1);
    }
}

#[test]
fn homing_finds_the_same_edge_from_anywhere() {
    for start_m in [0.0, 1e-5, 0.5e-3, 3.3e-3, 11e-3] {
        let mut bench = Bench::with(&SpringConfig::default(), &SpringPlant { start_m, ..SpringPlant::default() });
        bench.command(SpringCommand::Home);
        bench.until(SpringStage::Homed);
        bench.run(2);
        // The edge is one step away from the switch.
        let error = bench.plant.position_m() - bench.spring.status().position_m - 5e-6;
        assert!(error.abs() < 1e-8, "from {start_m}: {error}");
        assert_eq!(bench.events, [SpringEvent::Homed]);
    }
}

/// The error of the zero reading agrees with its stated standard error, whether noise or the motor's step dominates.
#[test]
fn touch_off_finds_the_zero_reading_within_its_stated_error() {
    for noise_rms_n in [0.01, 0.2] {
        let (mut squares, mut stated) = (0.0, 0.0);
        let trials = 24;
        for seed in 0..trials {
            let touch_m = 8e-3 + 0.377e-3 * seed as f32;
            let plant = SpringPlant { noise_rms_n, touch_m, seed, ..SpringPlant::default() };
            let config = SpringConfig { touch_force_n: 0.4, ..SpringConfig::default() };
            let mut bench = Bench::with(&config, &plant);
            bench.make_ready();
            let zero = bench.spring.status().zero.unwrap();
            let error = zero.zero_m + 5e-6 - touch_m;
            // Scatter about the line, and the error of the mean without contact over 1500 samples, which the line
            // does not include.
            let bias = noise_rms_n / 1500.0f32.sqrt() / 537.0;
            let error_scale = zero.zero_error_m.hypot(bias);
            squares += error * error;
            stated += error_scale * error_scale;
            // One step, or the noise that is left after 1000 samples per point, over √Σ(F−F̄)² = 1.05 N.
            let slope_error = 5.0 * noise_rms_n / 1000.0f32.sqrt() / 1.05 + 1e-3;
            assert!((zero.stiffness_n_per_m / 537.0 - 1.0).abs() < slope_error, "{zero:?}");
        }
        let ratio = (squares / stated).sqrt();
        // A χ² of 24 errors, with scatter estimates of six degrees of freedom; positions in f32 and thresholds add to
        // small noise.
        assert!(ratio < 1.6, "errors are {ratio} times the stated ones");
        assert!((squares / trials as f32).sqrt() < if noise_rms_n < 0.1 { 3e-6 } else { 5e-5 }, "{squares}");
    }
}

#[test]
fn a_deflection_is_kept_as_a_position() {
    let mut bench = Bench::ready();
    bench.set(Target::Deflection { deflection_m: 4e-3 });
    bench.until(SpringStage::Setting);
    bench.until(SpringStage::Holding);
    let deflection = bench.plant.position_m() - 12.3456e-3;
    assert!((deflection - 4e-3).abs() < 5e-6, "{deflection}");
    assert!((bench.spring.status().force_n - 537.0 * 4e-3).abs() < 0.01);
}

#[test]
fn a_force_is_reached_within_the_dead_band_and_then_the_motor_rests() {
    let mut bench = Bench::ready();
    for force_n in [2.0, 8.0, 0.5, 0.0, 13.5] {
        bench.set(Target::Force { force_n });
        bench.until(SpringStage::Setting);
        bench.until(SpringStage::Holding);
        let truth = bench.plant.normal_force_n();
        // Tolerance: the dead band and the noise of the average, 5 × 0.01/√1000.
        assert!((truth - force_n).abs() < 0.02 + 0.002, "{force_n}: {truth}");
        bench.run(10_000);
        assert!(bench.log.iter().rev().take(9000).all(|&steps| steps == 0), "hunts at {force_n} N");
    }
}

#[test]
fn a_friction_ratio_holds_while_the_base_amplitude_changes() {
    let mut bench = Bench::ready();
    bench.set(Target::FrictionRatio { ratio: 0.6 });
    bench.run(1000);
    assert!(bench.spring.status().waiting && bench.spring.stage() == SpringStage::Setting, "no Z, no force");
    assert!(bench.plant.normal_force_n() < 0.01);
    for z_m in [3e-3, 1e-3, 2e-3, 2.2e-3, 5e-3] {
        bench.z_m = Some(z_m);
        bench.run(4000);
        let ratio = 0.3 * bench.plant.normal_force_n() / (394.78 * z_m);
        let band = 0.3 * 0.022 / (394.78 * z_m);
        assert!((ratio - 0.6).abs() < band, "Z = {z_m}: γF = {ratio}");
    }
    bench.z_m = None;
    let held = bench.plant.normal_force_n();
    bench.run(4000);
    assert!(bench.plant.normal_force_n() == held, "without a base amplitude the force stays");
    bench.z_m = Some(0.05);
    bench.run(6000);
    let status = bench.spring.status();
    assert!(status.saturated && status.fault.is_none());
    assert!((bench.plant.normal_force_n() - 13.5).abs() < 0.022);
}

#[test]
fn rate_and_acceleration_are_never_exceeded() {
    let mut bench = Bench::ready();
    bench.log.clear();
    bench.set(Target::Force { force_n: 13.0 });
    bench.until(SpringStage::Setting);
    bench.until(SpringStage::Holding);
    bench.command(SpringCommand::Release);
    bench.until(SpringStage::Ready);
    let sums: Vec<i32> = bench
        .log
        .iter()
        .scan(0, |sum, &steps| {
            *sum += i32::from(steps);
            Some(*sum)
        })
        .collect();
    let mut fastest = 0;
    for window in sums.windows(101) {
        fastest = fastest.max((window[100] - window[0]).abs());
    }
    // 1000 steps/s over 100 ticks, and one step at the edge of a window.
    assert!((99..=101).contains(&fastest), "{fastest}");
    // Mean rates of neighbouring windows differ by at most a·Δt = 4000/s² × 0.1 s = 40 steps in 0.1 s, and 2 steps at
    // the edges.
    for n in 0..sums.len() - 200 {
        let (a, b, c) = (sums[n], sums[n + 100], sums[n + 200]);
        assert!(((c - b) - (b - a)).abs() <= 42, "tick {n}");
    }
}

#[test]
fn no_step_is_made_while_the_structure_moves_too_much() {
    let config = SpringConfig { quiet_m: 1e-3, ..SpringConfig::default() };
    let mut bench = Bench::with(&config, &SpringPlant::default());
    bench.make_ready();
    bench.set(Target::Force { force_n: 5.0 });
    bench.run(200);
    bench.max_abs_x_m = 2e-3;
    bench.run(300);
    let stopped = bench.plant.position_m();
    // A vibration exceeds the limit only part of the time.
    for tick in 0..5000 {
        bench.max_abs_x_m = if tick % 200 < 20 { 2e-3 } else { 0.2e-3 };
        bench.tick();
    }
    assert_eq!(bench.plant.position_m(), stopped);
    assert!(bench.spring.status().waiting);
    bench.max_abs_x_m = 0.0;
    bench.until(SpringStage::Holding);
    assert!((bench.plant.normal_force_n() - 5.0).abs() < 0.022);
}

#[test]
fn the_brake_closes_whatever_the_structure_does() {
    let config = SpringConfig { quiet_m: 1e-3, ..SpringConfig::default() };
    let mut bench = Bench::with(&config, &SpringPlant::default());
    assert!(!bench.spring.brake(5.0), "the brake needs a zero reading");
    bench.make_ready();
    bench.max_abs_x_m = 0.05;
    assert!(bench.spring.brake(5.0));
    bench.run(5000);
    assert!((bench.plant.normal_force_n() - 5.0).abs() < 0.022);
}

#[test]
fn a_spring_that_softens_is_corrected_without_a_fault() {
    let mut bench = Bench::ready();
    bench.set(Target::Force { force_n: 3.0 });
    bench.until(SpringStage::Holding);
    bench.plant.set_stiffness(500.0);
    bench.run(5000);
    assert!((bench.plant.normal_force_n() - 3.0).abs() < 0.022, "{}", bench.plant.normal_force_n());
    assert!(bench.spring.status().fault.is_none());
}

mod faults;

#[test]
fn invalid_commands_are_refused_with_the_stage_and_what_to_do() {
    let mut bench = Bench::new();
    let force = |force_n| SpringCommand::Set(Target::Force { force_n });
    let advice = |bench: &mut Bench, command| match bench.spring.handle(command) {
        Err(SpringRejected::WrongStage { stage, advice }) => (stage, advice),
        other => panic!("{other:?}"),
    };
    assert_eq!(advice(&mut bench, SpringCommand::TouchOff), (SpringStage::Unhomed, "home the spring first"));
    assert_eq!(advice(&mut bench, force(1.0)), (SpringStage::Unhomed, "home the spring first"));
    bench.command(SpringCommand::Home);
    assert_eq!(advice(&mut bench, SpringCommand::TouchOff).0, SpringStage::Homing);
    bench.until(SpringStage::Homed);
    assert_eq!(advice(&mut bench, force(1.0)), (SpringStage::Homed, "find the zero reading first (touch off)"));
    bench.command(SpringCommand::TouchOff);
    assert_eq!(advice(&mut bench, force(1.0)).0, SpringStage::TouchingOff);
    bench.until(SpringStage::Holding);
    for (target, name) in [
        (Target::Force { force_n: -1.0 }, "force_n"),
        (Target::Force { force_n: f32::NAN }, "force_n"),
        (Target::Force { force_n: 13.6 }, "force_n"),
        (Target::Deflection { deflection_m: 0.0275 }, "deflection_m"),
        (Target::FrictionRatio { ratio: -0.1 }, "friction_ratio"),
    ] {
        match bench.spring.handle(SpringCommand::Set(target)) {
            Err(SpringRejected::Invalid(invalid)) => assert_eq!(invalid.parameter, name),
            other => panic!("{target:?}: {other:?}"),
        }
    }
    bench.reads_n = Some(f32::NAN);
    bench.until(SpringStage::Faulted);
    assert_eq!(advice(&mut bench, SpringCommand::Home), (SpringStage::Faulted, "clear the spring's fault first"));
}

#[test]
fn halt_stops_at_the_present_position_and_keeps_the_zero_reading() {
    let mut bench = Bench::ready();
    bench.set(Target::Force { force_n: 10.0 });
    bench.run(700);
    bench.command(SpringCommand::Halt);
    bench.run(300);
    assert_eq!(bench.spring.stage(), SpringStage::Ready);
    assert!(bench.log.iter().rev().take(20).all(|&steps| steps == 0));
    bench.set(Target::Force { force_n: 1.0 });
    bench.until(SpringStage::Holding);
    assert!((bench.plant.normal_force_n() - 1.0).abs() < 0.022);
}
