//! The log of the running board, read from its memory and decoded as `damprig log` does it.

use std::fs;

use damprig_board::{Board, Config, Time};
use damprig_core::control::friction_spring::SpringCommand;
use damprig_protocol::Request;
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::{InjectedFault, PlantConfig};
use defmt_decoder::{DecodeError, Table};

use crate::common::{Host, bare, image, is_driving, project, sine};

/// Runs for `time` and returns the log lines: level and text.
fn lines(host: &mut Host<'_>, table: &Table, time: Time) -> Vec<String> {
    let mut decoder = table.new_stream_decoder();
    let mut lines = Vec::new();
    let end = host.board.now() + time;
    while host.board.now() < end {
        host.pass(Time::from_ms(10));
        decoder.received(&host.board.read_log());
        loop {
            match decoder.decode() {
                Ok(frame) => {
                    let level = frame.level().map_or("", |level| level.as_str());
                    lines.push(format!("{level} {}", frame.display_message()));
                }
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => panic!("a damaged line after {lines:?}"),
            }
        }
    }
    lines
}

fn table() -> Table {
    let path = project().join("firmware/target/images/nucleo-g474re.elf");
    Table::parse(&fs::read(path).unwrap()).unwrap().expect("the image has log lines")
}

#[test]
fn the_log_tells_the_link_the_state_the_spring_and_a_fault_with_its_limit() {
    let Some(image) = image() else { return };
    let table = table();
    let spring = SpringPlant { start_m: 5e-4, touch_m: 3e-3, ..SpringPlant::default() };
    let mut board = Board::new(image, &Config::new(PlantConfig { spring: Some(spring), ..bare() })).unwrap();
    let mut host = Host::new(&mut board);
    let mut told = lines(&mut host, &table, Time::from_ms(100));
    assert_eq!(told, [format!("info damprig {} on nucleo-g474re", env!("CARGO_PKG_VERSION"))]);

    host.ask(Request::Identify);
    host.ask(Request::Spring(SpringCommand::Home));
    told = lines(&mut host, &table, Time::from_ms(6_000));
    assert_eq!(
        told,
        ["info spring: homing", "info link: the host sends", "info spring: homed, without a zero reading"]
    );

    host.ask(Request::Configure(sine(1e-3, 2.5)));
    host.ask(Request::Start);
    told = lines(&mut host, &table, Time::from_ms(500));
    assert!(is_driving(host.board));
    assert_eq!(told, ["info state: settling"]);

    host.board.chip_mut().inject(&InjectedFault::EmergencyStop { pressed: true });
    told = lines(&mut host, &table, Time::from_ms(500));
    let fault = &told[1];
    assert_eq!(told[0], "info state: faulted");
    assert!(
        fault.starts_with("error fault in tick ") && fault.contains(": the emergency stop is pressed: "),
        "{told:?}"
    );

    told = lines(&mut host, &table, Time::from_ms(11_000));
    assert_eq!(told, ["warn link: no message for 10 s"]);
}

/// Nobody reads the ring in the other tests: the board does not wait. Here every line of a busy second is read.
#[test]
fn damaged_frames_are_told_at_most_once_a_second() {
    let Some(image) = image() else { return };
    let table = table();
    let mut board = Board::new(image, &Config::new(bare())).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    lines(&mut host, &table, Time::from_ms(1_500));
    let mut told = Vec::new();
    for _ in 0..200 {
        // Too short to be a message.
        host.board.chip_mut().host_sends(&[1, 2, 3, 0]);
        told.extend(lines(&mut host, &table, Time::from_ms(10)));
    }
    told.extend(lines(&mut host, &table, Time::from_ms(1_500)));
    assert!((2..=4).contains(&told.len()), "{told:?}");
    let last = told.last().unwrap();
    assert_eq!(last, "warn lost since the start: 200 frames, 0 requests, 0 replies, 0 rows");
}
