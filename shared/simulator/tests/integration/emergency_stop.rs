//! The emergency stop and the brake, from the button to the motor.

use damprig_core::control::fault::FaultCause;
use damprig_core::control::friction_spring::{SpringCommand, SpringStage, Target};
use damprig_core::control::safety::{Limits, SafetyConfig};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{SetUp, Structure};
use damprig_core::rig::{Brake, RigState};
use damprig_core::settings::Settings;
use damprig_protocol::Request;
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::{InjectedFault, PlantConfig};

use crate::support::host::Host;

fn host() -> Host {
    let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038));
    Host::new(PlantConfig { spring: Some(SpringPlant::default()), ..PlantConfig::ideal(set_up) })
}

/// A host whose spring is homed and touched off.
fn touched_off() -> Host {
    let mut host = host();
    host.spring(SpringCommand::Home);
    host.spring(SpringCommand::TouchOff);
    host
}

const BRAKE_N: f32 = 6.0;

/// Limits with a brake, and this displacement limit of the structure, m.
fn with_brake(structure_m: f32) -> Request {
    let limits = Limits { structure_m, ..Limits::default() };
    let restart_m = SafetyConfig::default().restart_m.min(0.5 * structure_m);
    let safety =
        SafetyConfig { limits, restart_m, half_cycles_ahead: 0.0, brake_n: BRAKE_N, ..SafetyConfig::default() };
    Request::SetSettings(Settings { safety, ..Settings::default() })
}

/// A limit that the structure does not reach.
const FAR_M: f32 = 0.07;

/// A limit that the structure reaches one second after the start of [`sine`].
const NEAR_M: f32 = 5e-3;

/// A limit that the sensor's noise exceeds.
const AT_ONCE_M: f32 = 1e-6;

fn sine() -> Request {
    Request::Configure(SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: 1e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 10.0,
        dwell_s: 20.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.2].into_iter().collect(),
    })
}

/// True position of the spring's seat, m.
fn seat_m(host: &mut Host) -> f32 {
    host.board.plant_mut().unwrap().spring_mut().unwrap().position_m()
}

fn press(host: &mut Host, pressed: bool) {
    host.inject(InjectedFault::EmergencyStop { pressed });
}

/// Presses the stop and checks the motor from the first tick that can react.
fn press_and_expect_no_motion(host: &mut Host, what: &str) {
    press(host, true);
    // The next samples of the plant show the pressed button.
    host.pass(1);
    let before = seat_m(host);
    for _ in 0..500 {
        host.pass(1);
        assert_eq!(seat_m(host), before, "{what}: the motor made a step");
        assert!(!host.board.plant_mut().unwrap().spring_mut().unwrap().is_energised(), "{what}: the motor is on");
    }
    let status = host.status();
    assert_eq!(status.spring.stage, SpringStage::Unhomed, "{what}");
    assert_eq!(status.state, RigState::Faulted, "{what}");
}

#[test]
fn the_emergency_stop_ends_every_task_of_the_spring_at_once() {
    let homing = || {
        let mut host = host();
        host.done(Request::Spring(SpringCommand::Home));
        host
    };
    let touching_off = || {
        let mut host = host();
        host.spring(SpringCommand::Home);
        host.done(Request::Spring(SpringCommand::TouchOff));
        host
    };
    let setting = || {
        let mut host = touched_off();
        host.done(Request::Spring(SpringCommand::Set(Target::Force { force_n: 10.0 })));
        host
    };
    let holding = || {
        let mut host = touched_off();
        host.spring(SpringCommand::Set(Target::Force { force_n: 10.0 }));
        host
    };
    let releasing = || {
        let mut host = holding();
        host.done(Request::Spring(SpringCommand::Release));
        host
    };
    let cases: [(&str, &dyn Fn() -> Host, SpringStage); 5] = [
        ("homing", &homing, SpringStage::Homing),
        ("touch-off", &touching_off, SpringStage::TouchingOff),
        ("setting", &setting, SpringStage::Setting),
        ("holding", &holding, SpringStage::Holding),
        ("releasing", &releasing, SpringStage::Releasing),
    ];
    for (what, begin, stage) in cases {
        let mut host = begin();
        host.done(with_brake(FAR_M));
        host.pass(300);
        assert_eq!(host.status().spring.stage, stage, "{what}");
        press_and_expect_no_motion(&mut host, what);
        assert_eq!(host.fault(), Some(FaultCause::EmergencyStop), "{what}");
    }
}

#[test]
fn the_emergency_stop_does_not_close_the_brake_in_an_experiment() {
    let mut host = touched_off();
    host.done(with_brake(FAR_M));
    host.done(sine());
    host.done(Request::Start);
    host.pass(3_000);
    press_and_expect_no_motion(&mut host, "in an experiment");
    press(&mut host, false);
    let released = seat_m(&mut host);
    host.pass(5_000);
    assert_eq!(seat_m(&mut host), released, "the release moves nothing");
}

#[test]
fn the_emergency_stop_ends_a_brake_that_another_fault_has_closed() {
    let mut host = touched_off();
    host.done(with_brake(NEAR_M));
    host.done(sine());
    host.done(Request::Start);
    let before = seat_m(&mut host);
    (0..3_000).find(|_| {
        host.pass(1);
        host.fault().is_some()
    });
    host.pass(300);
    assert_eq!(host.fault(), Some(FaultCause::StructureDisplacement));
    assert!(seat_m(&mut host) > before, "the brake moves before the stop");
    press_and_expect_no_motion(&mut host, "braking");
}

#[test]
fn after_an_emergency_stop_the_spring_must_be_homed_before_it_moves() {
    let mut host = touched_off();
    press(&mut host, true);
    host.pass(10);
    let target = SpringCommand::Set(Target::Force { force_n: 1.0 });
    for command in [SpringCommand::Home, SpringCommand::TouchOff, target, SpringCommand::Release] {
        let refused = host.ask(Request::Spring(command)).unwrap_err().to_string();
        assert!(refused.contains("release the emergency stop first"), "{command:?}: {refused}");
    }
    press(&mut host, false);
    host.pass(1_000);
    host.done(Request::ClearFault);
    for command in [SpringCommand::TouchOff, target, SpringCommand::Release] {
        let refused = host.ask(Request::Spring(command)).unwrap_err().to_string();
        assert!(refused.contains("home the spring first"), "{command:?}: {refused}");
    }
    host.spring(SpringCommand::Home);
    host.spring(SpringCommand::TouchOff);
    assert_eq!(host.status().spring.stage, SpringStage::Holding);
}

/// A fault of the rig during a touch-off: the brake cannot close yet, and must close as soon as it can.
#[test]
fn a_brake_that_cannot_close_at_once_closes_as_soon_as_it_can() {
    let mut host = host();
    host.spring(SpringCommand::Home);
    host.done(Request::Spring(SpringCommand::TouchOff));
    host.pass(200);
    host.done(with_brake(AT_ONCE_M));
    host.pass(10);
    assert_eq!(host.fault(), Some(FaultCause::StructureDisplacement));
    assert_eq!(host.status().spring.stage, SpringStage::TouchingOff, "the touch-off continues");
    host.pass(20_000);
    let status = host.status();
    assert_eq!(status.brake, Brake::Holds, "{status:?}");
    let force_n = host.board.plant_mut().unwrap().spring_mut().unwrap().normal_force_n();
    // Tolerance: the dead band and the noise of the average.
    assert!((force_n - BRAKE_N).abs() < 0.022, "{force_n}");
}

#[test]
fn a_brake_that_holds_is_not_released_before_the_fault_is_cleared() {
    let mut host = touched_off();
    host.done(with_brake(NEAR_M));
    host.done(sine());
    host.done(Request::Start);
    host.pass(13_000);
    assert_eq!((host.fault(), host.status().brake), (Some(FaultCause::StructureDisplacement), Brake::Holds));
    for command in [SpringCommand::Release, SpringCommand::Halt] {
        let refused = host.ask(Request::Spring(command)).unwrap_err().to_string();
        assert!(refused.contains("clear the fault first"), "{refused}");
    }
    host.done(Request::ClearFault);
    host.pass(5_000);
    let status = host.status();
    assert_eq!((status.brake, status.spring.stage), (Brake::Open, SpringStage::Ready));
}
