//! Sensor faults while the rig drives: from the fault at the pin to the message that names the sensor, and to the open relay.

use damprig_board::{Board, Config, Output, Time};
use damprig_core::control::fault::FaultCause;
use damprig_core::control::friction_spring::{SpringCommand, SpringStage};
use damprig_core::control::safety::SafeStage;
use damprig_core::io::{Sensor, SensorSet};
use damprig_core::model::{Cavity, Particle, Structure, Wall};
use damprig_core::rig::{RigState, SIGNALS};
use damprig_core::twin::TwinConfig;
use damprig_protocol::{Event, Reply, Request};
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{End, InjectedFault, PlantConfig, SensorFault};

use crate::common::{Host, bare, image, is_driving, opened, sine};

/// A lost sensor is named within this time.
const NAMED: Time = Time::from_ms(20);

/// After a fault the drive fades out in 200 ms, then the relay opens.
const FADE: Time = Time::from_ms(200);

/// A rig with all five sensors, whose motion decays fast after a drive.
fn with_every_sensor() -> PlantConfig {
    let mut plant = PlantConfig {
        walls: Some(WallSensors::default()),
        spring: Some(SpringPlant { start_m: 3e-3, ..SpringPlant::default() }),
        ..bare()
    };
    plant.set_up.structure = Structure::from_modal(1.6, 2.5, 0.3);
    plant
}

fn board() -> Option<Board> {
    Some(Board::new(image()?, &Config::new(with_every_sensor())).unwrap())
}

fn set(host: &mut Host, sensor: Sensor, fault: Option<SensorFault>) {
    host.board.chip_mut().inject(&InjectedFault::Sensor { sensor, fault });
}

fn drive(host: &mut Host) {
    host.ask(Request::Configure(sine(2e-3, 2.5)));
    host.ask(Request::Start);
    host.pass(Time::from_ms(200));
    assert!(is_driving(host.board), "{:?}", host.status());
}

/// Breaks a sensor of a rig that drives. Returns the cause that the host is told, how long after the fault, and the sensors
/// that are lost then. Afterwards the relay is open, the sensor is sound again and the fault is cleared.
fn breaks(host: &mut Host, sensor: Sensor, fault: SensorFault, longest: Time) -> (FaultCause, Time, SensorSet) {
    drive(host);
    let broken = host.board.now();
    set(host, sensor, Some(fault));
    let told = host.wait_for(longest, |event| matches!(event, Event::Fault(_)));
    let cause = host.status().fault.expect("the fault stays until it is cleared").cause;
    host.pass(Time::from_ms(10));
    let lost = host.status().sensors.lost;
    host.pass(FADE);
    assert!(!is_driving(host.board));
    let open = opened(host.board, broken);
    assert!(
        open <= told + FADE + Time::from_ms(2),
        "{sensor:?}, {fault:?}: the relay opens after {} ms",
        open.us() / 1e3
    );
    let steps = host.board.chip().trace().iter().filter(|(at, output)| *at > broken && *output == Output::Step(true));
    assert_eq!(steps.count(), 0, "the motor has nothing to do");
    set(host, sensor, None);
    while host.status().safe != SafeStage::Safe {
        host.pass(Time::from_ms(50));
    }
    host.ask(Request::ClearFault);
    (cause, told, lost)
}

#[test]
fn every_sensor_without_a_signal_is_named_within_20_ms_and_the_relay_opens_after_the_fade() {
    let Some(mut board) = board() else { return };
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    for sensor in Sensor::ALL {
        for fault in [SensorFault::Unplugged, SensorFault::AtRail(End::High), SensorFault::AtRail(End::Low)] {
            let (cause, told, lost) = breaks(&mut host, sensor, fault, NAMED);
            println!("{sensor:?}, {fault:?}: told after {} ms", told.us() / 1e3);
            assert!(lost.contains(sensor), "{sensor:?}, {fault:?}");
            // A wall's force that jumps to the upper rail within a block is a force beyond the limit.
            let is_force =
                matches!(sensor, Sensor::WallLow | Sensor::WallHigh) && fault == SensorFault::AtRail(End::High);
            let expected = if is_force { FaultCause::WallForce } else { FaultCause::SensorAtRail(sensor) };
            assert_eq!(cause, expected, "{fault:?}");
        }
    }
}

/// `safety.frozen_s`, 0.5 s as delivered.
#[test]
fn a_displacement_sensor_that_sticks_is_named_after_half_a_second() {
    let Some(mut board) = board() else { return };
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    for sensor in [Sensor::X, Sensor::Z] {
        let (cause, told, _) = breaks(&mut host, sensor, SensorFault::Stuck, Time::from_ms(520));
        assert_eq!(cause, FaultCause::SensorFrozen(sensor));
        assert!(told > Time::from_ms(480), "{} ms", told.us() / 1e3);
    }
}

/// No interlock watches for it: without a motion of the motor and without impacts these forces do not change.
#[test]
fn a_force_sensor_that_sticks_at_rest_goes_unnoticed_and_disturbs_nothing() {
    let Some(mut board) = board() else { return };
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    drive(&mut host);
    for sensor in [Sensor::SpringForce, Sensor::WallLow, Sensor::WallHigh] {
        set(&mut host, sensor, Some(SensorFault::Stuck));
    }
    host.pass(Time::from_ms(1_000));
    assert_eq!((host.status().fault, is_driving(host.board)), (None, true));
}

/// Whether the twin's alarm for missing impacts is raised.
fn twin_alarm(host: &mut Host) -> bool {
    let place = SIGNALS.iter().position(|(name, _)| *name == "twin_alarm").unwrap();
    match host.ask(Request::SignalValues) {
        Reply::SignalValues(values) => values[place] == 1.0,
        other => panic!("{other:?}"),
    }
}

/// The twin foresees the impacts from the measured base motion: three on the stuck wall without a pulse, in three cycles of
/// 0.4 s, raise its alarm. It stops nothing: the limits of x act as before.
#[test]
fn a_wall_sensor_that_sticks_raises_the_twins_alarm_within_two_seconds() {
    let Some(image) = image() else { return };
    let mut plant = PlantConfig { walls: Some(WallSensors::default()), ..bare() };
    plant.set_up.particle = Some(Particle {
        mass_kg: 0.16,
        clearance_m: 15e-3,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity::default(),
    });
    let mut board = Board::new(image, &Config::new(plant)).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    host.ask(Request::SetTwin(Some(TwinConfig::new(plant.set_up))));
    host.ask(Request::Configure(sine(1.5e-3, 2.5)));
    host.ask(Request::Start);
    for _ in 0..12 {
        host.pass(Time::from_ms(1_000));
        // A host that is silent for 10 s ends the drive.
        assert!(!twin_alarm(&mut host));
    }
    assert!(host.board.chip().plant().impacts() > 20, "{} impacts", host.board.chip().plant().impacts());
    for sensor in [Sensor::WallLow, Sensor::WallHigh] {
        assert!(!twin_alarm(&mut host), "before {sensor:?}");
        set(&mut host, sensor, Some(SensorFault::Stuck));
        host.pass(Time::from_ms(2_000));
        assert!(twin_alarm(&mut host), "{sensor:?}");
        assert_eq!((host.status().fault, is_driving(host.board)), (None, true), "{sensor:?}");
        set(&mut host, sensor, None);
        host.pass(Time::from_ms(1_000));
    }
    assert!(!twin_alarm(&mut host));
}

/// Noise is a reading: below the limits it is measured like any motion, beyond them it ends the drive.
#[test]
fn a_noisy_sensor_acts_as_what_it_reads() {
    let Some(mut board) = board() else { return };
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    drive(&mut host);
    for (sensor, rms) in [
        (Sensor::X, 2e-3),
        (Sensor::Z, 2e-3),
        (Sensor::SpringForce, 0.5),
        (Sensor::WallLow, 1.0),
        (Sensor::WallHigh, 1.0),
    ] {
        set(&mut host, sensor, Some(SensorFault::Noisy(rms)));
        host.pass(Time::from_ms(300));
        let status = host.status();
        assert_eq!((status.fault, is_driving(host.board)), (None, true), "{sensor:?}");
        set(&mut host, sensor, None);
    }
    host.ask(Request::Stop);
    while host.status().state != RigState::Idle {
        host.pass(Time::from_ms(50));
    }
    let (cause, told, _) = breaks(&mut host, Sensor::WallLow, SensorFault::Noisy(200.0), NAMED);
    assert_eq!(cause, FaultCause::WallForce, "after {} ms", told.us() / 1e3);
}

/// The block moves away from the structure, because the position of the seat is still known; then the motor is switched off.
#[test]
fn a_force_sensor_that_is_unplugged_in_a_touch_off_stops_the_motor() {
    let Some(mut board) = board() else { return };
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    host.ask(Request::Spring(SpringCommand::Home));
    host.wait_for(Time::from_ms(8_000), |event| matches!(event, Event::Spring(_)));
    assert_eq!(host.status().spring.stage, SpringStage::Homed);
    host.ask(Request::Spring(SpringCommand::TouchOff));
    host.pass(Time::from_ms(500));
    let begun = host.board.chip().plant().seat_steps().unwrap();
    let broken = host.board.now();
    set(&mut host, Sensor::SpringForce, Some(SensorFault::Unplugged));
    let told = host.wait_for(NAMED, |event| matches!(event, Event::Spring(_)));
    println!("told after {} ms", told.us() / 1e3);
    // 400 steps/s.
    let steps = host.board.chip().plant().seat_steps().unwrap() - begun;
    assert!(steps <= 9, "{steps} steps towards the structure");
    host.pass(Time::from_ms(10_000));
    assert_eq!(host.status().spring.stage, SpringStage::Faulted);
    let trace = host.board.chip().trace();
    let off = trace.iter().find(|(at, output)| *at > broken && *output == Output::MotorOff(true));
    let off = off.expect("the motor goes off").0;
    assert!(!trace.iter().any(|(at, output)| *at > off && *output == Output::Step(true)));
    assert!(host.board.chip().plant().seat_steps().unwrap() < begun, "the block has moved away");
}
