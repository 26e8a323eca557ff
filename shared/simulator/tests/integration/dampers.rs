//! The dampers through the protocol: friction spring, impacts, twin and interlocks.

use damprig_core::control::fault::{FaultCause, SpringFaultCause};
use damprig_core::control::friction_spring::{SpringCommand, SpringEvent as Spring, SpringSetUp, SpringStage, Target};
use damprig_core::control::safety::{SafeStage, SafetyConfig};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::impacts::ImpactRecord;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{Cavity, Particle, SetUp, Structure, Wall};
use damprig_core::rig::{RigState, SIGNALS};
use damprig_core::settings::Settings;
use damprig_core::twin::TwinConfig;
use damprig_protocol::{Event, Rejected, Reply, Request};
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{InjectedFault, PlantConfig};

use crate::support::host::Host;

const Z_M: f32 = 1.5e-3;

fn set_up(clearance_m: f64) -> SetUp {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) }
}

fn plant(set_up: SetUp) -> PlantConfig {
    PlantConfig {
        walls: Some(WallSensors::default()),
        spring: Some(SpringPlant::default()),
        ..PlantConfig::ideal(set_up)
    }
}

fn at_resonance(settle_s: f32, dwell_s: f32) -> Request {
    Request::Configure(SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: Z_M,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s,
        dwell_s,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.5].into_iter().collect(),
    })
}

fn signals(names: &[&str]) -> Request {
    let place = |name: &&str| SIGNALS.iter().position(|(known, _)| known == name).unwrap() as u8;
    Request::SetTelemetry { every_ticks: 10, signals: names.iter().map(place).collect(), impacts: true }
}

#[test]
fn a_requested_friction_ratio_becomes_the_friction_on_the_structure() {
    let mut host = Host::new(plant(SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038))));
    for command in [SpringCommand::Home, SpringCommand::TouchOff, SpringCommand::Set(Target::Force { force_n: 1.0 })] {
        host.spring(command);
    }
    host.done(Request::Spring(SpringCommand::Set(Target::FrictionRatio { ratio: 0.9 })));
    host.done(at_resonance(20.0, 20.0));
    host.done(Request::Start);
    host.pass(45_000);
    let status = host.status();
    assert_eq!(status.spring.stage, SpringStage::Holding, "{status:?}");
    // γF k Z/μe with the measured Z, within the dead band and the force sensor's noise.
    let expected = 0.9 * 394.78 * Z_M / 0.3;
    assert!((status.spring.force_n - expected).abs() < 0.04, "{status:?}, {expected}");
    // Above γF = π/4 friction bounds the resonance: without it Z/2ζ = 200 mm.
    let [point] = host.points()[..] else { panic!("{:?}", host.events) };
    assert!(point.max_abs_x_m < 10.0 * Z_M, "{point:?}");
}

#[test]
fn impacts_are_reported_with_the_impulse_of_the_impact_law_and_counted_per_cycle() {
    let mut host = Host::new(plant(set_up(10.0 * f64::from(Z_M))));
    host.done(at_resonance(60.0, 20.0));
    host.done(signals(&["impacts", "impacts_in_cycle"]));
    host.done(Request::Start);
    host.pass(82_000);
    let [point] = host.points()[..] else { panic!("{:?}", host.events) };
    assert_eq!(point.impacts_per_cycle, 2.0, "two impacts per cycle on the symmetric orbit");
    let impacts = host.impacts();
    assert!(impacts.len() > 250 && host.status().events_lost == 0);
    // Impacts before the end of the drive.
    let steady: Vec<_> = impacts.iter().filter(|record| (70_000..point.end_tick).contains(&record.tick)).collect();
    assert!(steady.len() > 45, "{}", steady.len());
    assert!(steady.windows(2).all(|pair| pair[0].side == -pair[1].side), "the sides alternate");
    let time = |record: &ImpactRecord| f64::from(record.tick) + f64::from(record.centre_ticks);
    let gaps: Vec<f64> = steady.windows(2).map(|pair| time(pair[1]) - time(pair[0])).collect();
    // Impacts are half a period apart. 12 bits and noise of 0.2 N on pulses of 50 N and more move a centre by some
    // µs.
    assert!(gaps.iter().all(|gap| (gap - 200.0).abs() < 0.1), "{gaps:?}");
    let row = &host.rows[point.end_tick as usize / 10 - 1];
    assert_eq!(row[1], 2.0, "impacts of the last whole cycle");
}

#[test]
fn the_twin_follows_the_rig_and_raises_its_alarm_when_a_force_sensor_is_dead() {
    let truth = set_up(10.0 * f64::from(Z_M));
    for walls in [Some(WallSensors::default()), None] {
        let hears = walls.is_some();
        let mut host = Host::new(PlantConfig { walls, ..plant(truth) });
        host.done(Request::SetTwin(Some(TwinConfig::new(truth))));
        host.done(at_resonance(40.0, 20.0));
        host.done(signals(&[
            "twin_residual",
            "twin_predicted",
            "twin_detected",
            "twin_missing",
            "twin_alarm",
            "x",
            "twin_x",
        ]));
        host.done(Request::Start);
        host.pass(60_000);
        let row = host.rows.last().unwrap().clone();
        println!("force sensors {hears}: {row:?}");
        assert_eq!(row[4] == 0.0, hears, "the alarm");
        if hears {
            assert!(row[0] < 1e-4 && row[2] > 100.0 && row[3] < 5.0, "{row:?}");
        } else {
            assert!(row[2] == 0.0 && row[3] > 3.0, "{row:?}");
        }
    }
}

#[test]
fn a_snippet_shows_the_next_impact_and_none_before() {
    let mut host = Host::new(plant(set_up(10.0 * f64::from(Z_M))));
    assert!(matches!(host.ask(Request::Snippet { from: 0 }), Err(Rejected::NotHere { .. })));
    host.done(at_resonance(10.0, 20.0));
    host.done(Request::ArmSnippet);
    assert!(matches!(host.ask(Request::Snippet { from: 0 }), Err(Rejected::NotHere { .. })), "not yet");
    host.done(Request::Start);
    host.pass(20_000);
    let (mut shape, mut length) = (vec![], 1);
    while shape.len() < length {
        let Ok(Reply::Snippet { scale, samples, length: whole, .. }) =
            host.ask(Request::Snippet { from: shape.len() as u16 })
        else {
            panic!()
        };
        length = usize::from(whole);
        shape.extend(samples.iter().map(|&counts| (f32::from(counts) - scale.zero_counts) * scale.newtons_per_count));
    }
    let (before, after) = shape.split_at(64);
    assert!(before.iter().all(|force| *force < 2.5 + 1.0) && after[0] >= 2.0, "{shape:?}");
    assert!(after.iter().copied().fold(0.0, f32::max) > 5.0);
}

#[test]
fn the_emergency_stop_ends_a_drive_at_once_and_each_refusal_says_how_to_recover() {
    let safety = SafetyConfig { brake_n: 6.0, ..SafetyConfig::default() };
    let mut host = Host::new(plant(set_up(10.0 * f64::from(Z_M))));
    host.done(Request::SetSettings(Settings { safety, ..Settings::default() }));
    host.spring(SpringCommand::Home);
    host.spring(SpringCommand::TouchOff);
    host.done(at_resonance(10.0, 20.0));
    host.done(signals(&["drive", "safety", "spring_target", "x"]));
    host.done(Request::Start);
    host.pass(9_000);
    host.rows.clear();
    host.inject(InjectedFault::EmergencyStop { pressed: true });
    host.pass(1_000);
    assert_eq!(host.fault(), Some(FaultCause::EmergencyStop));
    assert!(host.rows[1..].iter().all(|row| row[0] == 0.0), "the drive is zero from the next row on");
    assert!(host.rows.last().unwrap()[2] == 0.0, "no brake: {:?}", host.rows.last());
    for (ask, words) in [
        (Request::Start, "clear the fault first"),
        (Request::Spring(SpringCommand::Home), "release the emergency stop first"),
        (Request::ClearFault, "wait for rest; release the emergency stop"),
    ] {
        let refused = host.ask(ask).unwrap_err().to_string();
        assert!(refused.contains("faulted") && refused.contains(words), "{refused}");
    }
    host.pass(60_000);
    assert_eq!(host.status().safe, SafeStage::Ringing, "still pressed");
    host.inject(InjectedFault::EmergencyStop { pressed: false });
    host.pass(2_000);
    let status = host.status();
    assert_eq!((status.safe, status.state), (SafeStage::Safe, RigState::Faulted), "{status:?}");
    host.done(Request::ClearFault);
    assert_eq!(host.status().state, RigState::Idle);
}

#[test]
fn a_spring_that_faults_while_driven_ends_the_drive() {
    let mut host = Host::new(plant(SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038))));
    for command in [SpringCommand::Home, SpringCommand::TouchOff, SpringCommand::Set(Target::Force { force_n: 2.0 })] {
        host.spring(command);
    }
    host.done(at_resonance(5.0, 10.0));
    host.done(Request::Start);
    host.pass(2_000);
    host.board.plant_mut().unwrap().spring_mut().unwrap().set_stiffness(30_000.0);
    host.pass(2_000);
    assert_eq!(host.fault(), Some(FaultCause::Spring(SpringFaultCause::ForceAboveLargest)));
    let status = host.status();
    assert_eq!((status.state, status.spring.stage), (RigState::Faulted, SpringStage::Faulted));
}

#[test]
fn requests_that_are_invalid_in_the_present_state_are_refused_with_what_to_do() {
    let mut host = Host::new(plant(set_up(15e-3)));
    let target = |force_n| Request::Spring(SpringCommand::Set(Target::Force { force_n }));
    for (ask, words) in [
        (target(1.0), "not while the friction damper's spring is not homed: home the spring first"),
        (Request::Spring(SpringCommand::TouchOff), "home the spring first"),
        (
            Request::SetSpring(SpringSetUp {
                stiffness_n_per_m: Some(0.0),
                friction_coefficient: None,
                structure_stiffness_n_per_m: 395.0,
            }),
            "spring.stiffness_n_per_m = 0 is not allowed",
        ),
        (
            Request::SetTelemetry { every_ticks: 1, signals: [200].into_iter().collect(), impacts: false },
            "telemetry.signals = 200",
        ),
    ] {
        let refused = host.ask(ask).unwrap_err().to_string();
        assert!(refused.contains(words), "{refused}");
    }
    host.done(at_resonance(5.0, 10.0));
    host.done(Request::Spring(SpringCommand::Home));
    let refused = host.ask(Request::Start).unwrap_err().to_string();
    assert!(refused.contains("homing") && refused.contains("wait until it is done"), "{refused}");
    host.pass(16_000);
    assert_eq!(host.events, [Event::Spring(Spring::Homed)]);
    let refused = host.ask(target(1.0)).unwrap_err().to_string();
    assert!(refused.contains("find the zero reading first"), "{refused}");
    host.spring(SpringCommand::TouchOff);
    let refused = host.ask(target(100.0)).unwrap_err().to_string();
    assert!(refused.contains("force_n = 100 is not allowed"), "{refused}");
    host.done(Request::Start);
    let refused = host.ask(Request::Spring(SpringCommand::Home)).unwrap_err().to_string();
    assert!(refused.contains("stop the experiment first"), "{refused}");
}

#[test]
fn the_device_announces_every_signal_by_its_whole_name_and_unit() {
    let mut host = Host::new(plant(set_up(1e-3)));
    let mut announced = Vec::new();
    while announced.len() < SIGNALS.len() {
        match host.ask(Request::Signals { from: announced.len() as u8 }) {
            Ok(Reply::Signals(part)) if !part.is_empty() => announced.extend(part),
            other => panic!("{other:?}"),
        }
    }
    let announced: Vec<_> = announced.iter().map(|signal| (signal.name.as_str(), signal.unit.as_str())).collect();
    assert_eq!(announced, SIGNALS);
}
