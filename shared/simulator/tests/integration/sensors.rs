//! Sensor failures, from the cable to the reported fault.

use damprig_core::control::fault::{FaultCause, SpringFaultCause};
use damprig_core::control::friction_spring::{SpringCommand, SpringEvent as Spring, SpringStage};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::io::Sensor;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{Cavity, Particle, SetUp, Structure, Wall};
use damprig_core::rig::RigState;
use damprig_protocol::{Event, Request};
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Base, End, InjectedFault, PlantConfig, SensorFault, Shaker};

use crate::support::host::Host;

fn plant() -> PlantConfig {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 0.015,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity::default(),
    };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) };
    PlantConfig {
        walls: Some(WallSensors::default()),
        spring: Some(SpringPlant::default()),
        ..PlantConfig::ideal(set_up)
    }
}

fn sine(settle_s: f32, dwell_s: f32) -> Request {
    Request::Configure(SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: 1.5e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s,
        dwell_s,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.2].into_iter().collect(),
    })
}

fn breaks(host: &mut Host, sensor: Sensor, fault: Option<SensorFault>) {
    host.inject(InjectedFault::Sensor { sensor, fault });
}

/// Runs tick by tick until there is a fault; returns the number of ticks.
fn ticks_to_fault(host: &mut Host, most: u32) -> u32 {
    let found = (1..=most).find(|_| {
        host.pass(1);
        host.fault().is_some()
    });
    found.unwrap_or_else(|| panic!("no fault in {most} ticks: {:?}", host.status()))
}

#[test]
fn every_unplugged_sensor_ends_an_experiment_within_five_milliseconds_and_is_named() {
    for sensor in Sensor::ALL {
        for fault in [SensorFault::Unplugged, SensorFault::AtRail(End::Low), SensorFault::AtRail(End::High)] {
            let mut host = Host::new(plant());
            host.done(sine(10.0, 10.0));
            host.done(Request::Start);
            host.pass(3_000);
            assert_eq!(host.fault(), None);
            breaks(&mut host, sensor, Some(fault));
            // The samples that the plant makes in this tick are read in the next.
            let ticks = ticks_to_fault(&mut host, 10);
            assert_eq!(ticks, 6, "{sensor:?}, {fault:?}");
            assert_eq!(host.fault(), Some(FaultCause::SensorAtRail(sensor)), "{fault:?}");
            let words = host.fault().unwrap().text();
            assert!(words.contains(sensor.text()), "{words}");
        }
    }
}

#[test]
fn a_lost_z_sensor_does_not_increase_the_drive_of_the_closed_loop() {
    let mut host = Host::new(PlantConfig { base: Base::Shaker(Shaker::default()), ..plant() });
    let Request::Configure(open) = sine(10.0, 10.0) else { panic!() };
    let drive = DriveMode::ClosedLoop(Default::default());
    host.done(Request::Configure(SteppedSine { amplitude_m: 5e-4, ramp_s: 1.0, drive, ..open }));
    host.done(Request::SetTelemetry { every_ticks: 1, signals: [2].into_iter().collect(), impacts: false });
    host.done(Request::Start);
    host.pass(5_000);
    let most = |rows: &[Vec<f32>]| rows.iter().fold(0.0f32, |most, row| most.max(row[0].abs()));
    let before = most(&host.rows);
    host.rows.clear();
    breaks(&mut host, Sensor::Z, Some(SensorFault::Unplugged));
    host.pass(500);
    assert_eq!(host.fault(), Some(FaultCause::SensorAtRail(Sensor::Z)));
    assert!(most(&host.rows) <= 1.01 * before, "{} m after {before} m", most(&host.rows));
}

#[test]
fn a_touch_off_with_an_unplugged_force_sensor_stops_at_once() {
    for unplugged_after in [0, 1_000] {
        let mut host = Host::new(plant());
        host.spring(SpringCommand::Home);
        host.done(Request::Spring(SpringCommand::TouchOff));
        host.pass(unplugged_after);
        breaks(&mut host, Sensor::SpringForce, Some(SensorFault::Unplugged));
        let seat_m = |host: &mut Host| host.board.plant_mut().unwrap().spring_mut().unwrap().position_m();
        let before = seat_m(&mut host);
        host.pass(6);
        let status = host.status();
        assert_eq!(
            status.spring.fault.map(|fault| fault.cause),
            Some(FaultCause::Spring(SpringFaultCause::SensorLost)),
            "{status:?}"
        );
        // 400 steps/s of 5 µm for 6 ms.
        assert!(seat_m(&mut host) - before < 2e-5, "it moved {} m", seat_m(&mut host) - before);
        host.pass(20_000);
        assert_eq!(host.status().spring.stage, SpringStage::Faulted);
        assert!(seat_m(&mut host) <= 1.01e-3, "the block has moved away");
        assert!(!host.board.plant_mut().unwrap().spring_mut().unwrap().is_energised());
        assert_eq!(host.events.iter().filter(|e| matches!(e, Event::Spring(Spring::Fault(_)))).count(), 1);
        assert!(host.status().fault.is_none(), "an idle rig latches no fault");
    }
}

#[test]
fn a_lost_sensor_of_an_idle_rig_shows_in_the_status_and_latches_no_fault() {
    let mut host = Host::new(plant());
    for sensor in Sensor::ALL {
        breaks(&mut host, sensor, Some(SensorFault::Unplugged));
        host.pass(1_000);
        let status = host.status();
        assert_eq!((status.state, status.fault), (RigState::Idle, None), "{sensor:?}");
        assert!(status.sensors.lost.contains(sensor), "{status:?}");
        assert_eq!(status.sensors.lost.to_string(), sensor.text());
        breaks(&mut host, sensor, None);
        host.pass(1_000);
        assert!(host.status().sensors.lost.is_empty());
    }
}

#[test]
fn clipping_for_less_than_five_milliseconds_is_reported_with_the_result() {
    for sensor in [None, Some(Sensor::SpringForce)] {
        let mut host = Host::new(plant());
        host.done(sine(1.0, 5.0));
        host.done(Request::Start);
        if let Some(sensor) = sensor {
            // Noise within ±10.4 N: some samples are below −5 N, where the sensor's span ends.
            breaks(&mut host, sensor, Some(SensorFault::Noisy(3.0)));
        }
        host.pass(8_000);
        assert_eq!(host.fault(), None);
        let [point] = host.points()[..] else { panic!("{:?}", host.events) };
        let status = host.status();
        for clipped in [point.clipped, status.sensors.clipped] {
            assert_eq!(clipped.is_empty(), sensor.is_none());
            assert_eq!(clipped.contains(Sensor::SpringForce), sensor.is_some());
        }
        assert!(status.sensors.lost.is_empty());
    }
}

#[test]
fn a_stuck_displacement_sensor_is_reported_by_name() {
    for sensor in [Sensor::X, Sensor::Z] {
        let mut host = Host::new(plant());
        host.done(sine(10.0, 10.0));
        host.done(Request::Start);
        host.pass(3_000);
        breaks(&mut host, sensor, Some(SensorFault::Stuck));
        ticks_to_fault(&mut host, 600);
        assert_eq!(host.fault(), Some(FaultCause::SensorFrozen(sensor)));
    }
}

/// An amplifier whose zero has drifted to 3.5 % of its span: neither a rail nor a valid zero.
#[test]
fn a_wall_sensor_with_a_drifted_zero_is_reported_as_a_fault() {
    let walls = WallSensors { offset_n: -33.0, ..WallSensors::default() };
    let mut host = Host::new(PlantConfig { walls: Some(walls), ..plant() });
    host.done(sine(10.0, 10.0));
    host.done(Request::Start);
    host.pass(5_000);
    assert_eq!(host.fault(), Some(FaultCause::SensorDrifted(Sensor::WallLow)));
}

#[test]
fn a_force_beyond_the_limit_on_either_wall_ends_the_drive() {
    for sensor in [Sensor::WallLow, Sensor::WallHigh] {
        let mut host = Host::new(plant());
        host.done(sine(10.0, 10.0));
        host.done(Request::Start);
        host.pass(3_000);
        assert_eq!(host.fault(), None);
        breaks(&mut host, sensor, Some(SensorFault::Noisy(200.0)));
        ticks_to_fault(&mut host, 20);
        assert_eq!(host.fault(), Some(FaultCause::WallForce), "{sensor:?}");
    }
}

#[test]
fn a_large_displacement_within_the_span_trips_its_limit_and_not_the_sensor_check() {
    let start = PlantConfig { structure_start_m: 0.0785, ..plant() };
    for (config, lost) in [(PlantConfig { structure_start_m: 0.0782, ..start }, false), (start, true)] {
        let mut host = Host::new(config);
        host.pass(2);
        let status = host.status();
        let cause = status.fault.map(|fault| fault.cause);
        assert_eq!(cause, (!lost).then_some(FaultCause::StructureDisplacement), "{status:?}");
    }
}
