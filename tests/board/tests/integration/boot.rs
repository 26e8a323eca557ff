//! Tests from power-on to the first replies of the board.

use damprig_board::{Board, Config, Output, Time};
use damprig_protocol::{Clock, ClockSource, PlantKind, Reply, Request, Reset, SCHEMA, VERSION};

use crate::common::{Host, bare, board, description, image, run};

#[test]
fn the_board_identifies_itself_within_a_tenth_of_a_second_of_power_on() {
    let Some(image) = image() else { return };
    let mut board = board(image);
    let mut host = Host::new(&mut board);
    let Reply::Identity(identity) = host.ask(Request::Identify) else { panic!("no identity") };
    assert_eq!((identity.protocol, identity.schema, identity.board.as_str()), (VERSION, SCHEMA, "nucleo-g474re"));
    assert!(host.board.now() < Time::from_ms(100), "{} s", host.board.now().s());
    let description = description(host.board);
    assert_eq!((description.clock, description.plant), (Clock::RealTime, PlantKind::Real));
    assert_eq!((description.clock_source, description.reset), (ClockSource::Crystal, Reset::Power));
    assert_eq!(description.last_crash, None);
}

#[test]
fn without_its_crystal_the_board_runs_on_the_internal_oscillator_and_reports_it() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config { has_crystal: false, ..Config::new(bare()) }).unwrap();
    let description = description(&mut board);
    assert_eq!(description.clock_source, ClockSource::InternalOscillator);
}

#[test]
fn an_idle_board_keeps_the_relay_open_the_output_at_zero_drive_and_the_motor_off() {
    let Some(image) = image() else { return };
    let mut board = board(image);
    // A watchdog that is never fed resets the board after half a second.
    run(&mut board, Time::from_ms(1_000));
    // The output switches on at its negative end and is set to the middle at once.
    let drive: Vec<_> = board.chip().trace().iter().filter(|(_, output)| matches!(output, Output::Drive(_))).collect();
    assert_eq!(
        drive.iter().map(|(_, output)| *output).collect::<Vec<_>>(),
        [Output::Drive(Some(0)), Output::Drive(Some(2_048))]
    );
    assert!((drive[1].0 - drive[0].0) < Time::from_us(10), "{drive:?}");
    let others = board.chip().trace().iter().filter(|(_, output)| !matches!(output, Output::Drive(_)));
    assert!(others.clone().all(|(_, output)| matches!(output, Output::Step(_))), "{:?}", others.collect::<Vec<_>>());
}

#[test]
fn the_same_bytes_at_the_same_times_give_the_same_run() {
    let runs = [0; 2].map(|_| {
        let mut board = board(image()?);
        let mut host = Host::new(&mut board);
        host.ask(Request::Identify);
        host.ask(Request::Status);
        let received = std::mem::take(&mut host.received);
        run(&mut board, Time::from_ms(300));
        Some((received, board.instructions(), board.costs().clone(), board.chip().trace().to_vec()))
    });
    assert!(runs[0] == runs[1]);
}

#[test]
fn the_image_breaks_no_rule_of_the_reference_manual() {
    let Some(image) = image() else { return };
    let mut board = board(image);
    run(&mut board, Time::from_ms(100));
    assert_eq!(board.chip().deviations(), []);
}
