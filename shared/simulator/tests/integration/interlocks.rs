//! How an experiment ends: by a fault of the friction damper's spring, by a structure that never rests, by a stop.

use damprig_core::control::fault::{FaultCause, SpringFaultCause};
use damprig_core::control::friction_spring::{SpringCommand, SpringConfig};
use damprig_core::control::safety::{ExperimentLimits, Limits, SafetyConfig};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::io::Sensor;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{SetUp, Structure};
use damprig_core::rig::{Brake, RigState};
use damprig_core::settings::Settings;
use damprig_protocol::Request;
use damprig_simulator::plant::spring::{Breakage, SpringPlant};
use damprig_simulator::plant::{InjectedFault, PlantConfig, SensorFault};

use crate::support::host::Host;

fn host() -> Host {
    let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038));
    let mut host = Host::new(PlantConfig { spring: Some(SpringPlant::default()), ..PlantConfig::ideal(set_up) });
    // The drive of every tick.
    host.done(Request::SetTelemetry { every_ticks: 1, signals: [2].into_iter().collect(), impacts: false });
    host
}

fn sine() -> SteppedSine {
    SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 1e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 20.0,
        dwell_s: 20.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.0].into_iter().collect(),
    }
}

fn drive(host: &mut Host, sine: SteppedSine) {
    host.done(Request::Configure(sine));
    host.done(Request::Start);
}

/// Largest |drive| of the next ticks, m.
fn largest_drive_m(host: &mut Host, ticks: u32) -> f32 {
    host.rows.clear();
    host.pass(ticks);
    host.rows.iter().fold(0.0, |largest, row| row[0].abs().max(largest))
}

#[test]
fn the_drive_is_zero_from_the_tick_of_the_emergency_stop_on() {
    let mut host = host();
    drive(&mut host, sine());
    // An eighth of a cycle after a crest.
    host.pass(2_187);
    host.inject(InjectedFault::EmergencyStop { pressed: true });
    // The samples that the plant makes in this tick are read in the next.
    assert!(largest_drive_m(&mut host, 1) > 5e-4);
    assert_eq!(largest_drive_m(&mut host, 100), 0.0);
}

#[test]
fn a_fault_of_the_spring_ends_the_drive_and_the_experiment() {
    let mut host = host();
    host.spring(SpringCommand::Home);
    host.spring(SpringCommand::TouchOff);
    drive(&mut host, sine());
    host.pass(1_000);
    assert_eq!(host.fault(), None);
    host.inject(InjectedFault::SpringDrive(Breakage { switch_stuck: Some(true), ..Breakage::default() }));
    host.pass(250);
    let cause = FaultCause::Spring(SpringFaultCause::LimitReached);
    let status = host.status();
    assert_eq!((status.state, status.fault.map(|fault| fault.cause)), (RigState::Faulted, Some(cause)));
    assert_eq!(largest_drive_m(&mut host, 1_000), 0.0);
}

/// The wait for rest is at most 600 s.
#[test]
fn a_structure_that_does_not_come_to_rest_in_ten_minutes_is_a_fault() {
    let mut host = host();
    host.inject(InjectedFault::Sensor { sensor: Sensor::X, fault: Some(SensorFault::Noisy(2e-3)) });
    drive(&mut host, SteppedSine { start: Start::FromRest { level_m: 5e-4 }, ..sine() });
    host.done(Request::SetTelemetry { every_ticks: 0, signals: [2].into_iter().collect(), impacts: false });
    host.pass(599_999);
    assert_eq!(host.fault(), None);
    host.pass(3);
    assert_eq!(host.fault(), Some(FaultCause::RestTimeout));
}

/// However slowly the drive has risen.
#[test]
fn a_stop_fades_the_drive_in_a_fifth_of_a_second() {
    let mut host = host();
    drive(&mut host, SteppedSine { ramp_s: 5.0, ..sine() });
    host.pass(6_000);
    assert!(largest_drive_m(&mut host, 500) > 0.99e-3);
    host.done(Request::Stop);
    host.pass(201);
    assert_eq!((host.status().state, largest_drive_m(&mut host, 500)), (RigState::Idle, 0.0));
}

/// The board's own brake is within the working force; that of an experiment may be beyond it.
#[test]
fn a_brake_never_presses_with_more_than_the_springs_working_force() {
    let mut host = host();
    host.spring(SpringCommand::Home);
    host.spring(SpringCommand::TouchOff);
    let limits = Limits { structure_m: 3e-3, ..Limits::default() };
    let safety = SafetyConfig { limits, half_cycles_ahead: 0.0, ..SafetyConfig::default() };
    host.done(Request::SetSettings(Settings { safety, ..Settings::default() }));
    let working_n = SpringConfig::default().working_force_n();
    host.done(Request::Configure(sine()));
    host.done(Request::SetLimits(ExperimentLimits { brake_n: Some(1.08 * working_n), ..ExperimentLimits::default() }));
    host.done(Request::Start);
    let mut most_n = 0.0f32;
    for _ in 0..20_000 {
        host.pass(1);
        most_n = most_n.max(host.board.plant_mut().unwrap().spring_mut().unwrap().normal_force_n());
    }
    assert_eq!((host.fault(), host.status().brake), (Some(FaultCause::StructureDisplacement), Brake::Holds));
    // The touch-off's error of the zero reading, and the dead band.
    assert!((most_n / working_n - 1.0).abs() < 0.01, "{most_n} N of {working_n} N");
}
