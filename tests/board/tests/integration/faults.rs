//! Fault tests on the board: from the cause to the safe state (relay open, motor off) and the reported crash cause.

use damprig_board::peripherals::rcc::ResetCause;
use damprig_board::{Board, Config, Output, Time};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::point::SteadyLimits;
use damprig_protocol::{CrashCause, Description, Reply, Request, Reset};

use crate::common::{Host, bare, image, run};

/// The interrupt that runs the control tick (UART5).
const TICK: u16 = 16 + 53;

/// Code outside any handler: the tasks of the serial line.
const THREAD: u16 = 0;

/// Slowest and fastest watchdog oscillator (DS12288, table 48), Hz.
const LSI_HZ: [u64; 2] = [31_000, 34_000];

fn description(board: &mut Board) -> Description {
    match Host::new(board).ask(Request::Describe) {
        Reply::Description(description) => description,
        other => panic!("{other:?}"),
    }
}

/// A board that drives its shaker at 2.5 Hz and 1 mm.
fn driving(config: &Config) -> Option<Board> {
    let mut board = Board::new(image()?, config).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    host.ask(Request::Configure(SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 1e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 2.0,
        dwell_s: 20.0,
        steady: SteadyLimits::default(),
        frequencies_hz: [2.5].into_iter().collect(),
        first_index: 0,
    }));
    host.ask(Request::Start);
    pass(&mut board, 500);
    assert!(is_driving(&board), "{:?}", board.chip().trace().last());
    Some(board)
}

fn pass(board: &mut Board, ms: u64) {
    run(board, board.now() + Time::from_ms(ms));
}

/// Whether the relay is closed.
fn is_driving(board: &Board) -> bool {
    let relay = board.chip().trace().iter().rev().find_map(|(_, output)| match output {
        Output::Relay(closed) => Some(*closed),
        _ => None,
    });
    relay == Some(true)
}

/// Time from `since` until the relay opened.
fn opened(board: &Board, since: Time) -> Time {
    let opened = board.chip().trace().iter().find(|(at, output)| *at >= since && *output == Output::Relay(false));
    opened.unwrap_or_else(|| panic!("the relay stays closed")).0 - since
}

/// Runs for 200 ms more. Returns how long the drive continued after the fault, and the board's description of itself.
fn after_fault(mut board: Board, since: Time) -> (Time, Description) {
    pass(&mut board, 200);
    let opened = opened(&board, since);
    assert!(!is_driving(&board));
    (opened, description(&mut board))
}

#[test]
fn a_hanging_control_tick_is_reset_within_55_ms_and_reported_over_the_watchdogs_whole_frequency_range() {
    for lsi_hz in LSI_HZ {
        // The stall watch runs every 5 ms: test ten instants between two of its runs.
        for offset_us in (0..5_000).step_by(500) {
            let Some(mut board) = driving(&Config { lsi_hz, ..Config::new(bare()) }) else { return };
            let at = board.now() + Time::from_us(offset_us);
            run(&mut board, at);
            board.hang_in(TICK);
            let (opened, description) = after_fault(board, at);
            assert!(opened < Time::from_ms(55), "{} ms at {lsi_hz} Hz", opened.us() / 1e3);
            assert_eq!(description.reset, Reset::Watchdog);
            assert_eq!(
                description.last_crash.map(|crash| crash.cause),
                Some(CrashCause::ControlStalled),
                "{offset_us}"
            );
        }
    }
}

#[test]
fn a_hanging_serial_line_task_is_reset_and_reported() {
    for lsi_hz in LSI_HZ {
        let Some(mut board) = driving(&Config { lsi_hz, ..Config::new(bare()) }) else { return };
        let at = board.now();
        board.hang_in(THREAD);
        run(&mut board, at + Time::from_ms(500));
        let (opened, description) = after_fault(board, at);
        // Half a second without a reply, then the watchdog's time.
        assert!(opened < Time::from_ms(560), "{} ms", opened.us() / 1e3);
        assert_eq!(description.last_crash.map(|crash| crash.cause), Some(CrashCause::CommunicationStalled));
    }
}

#[test]
fn a_debugger_that_halts_the_core_while_the_rig_drives_opens_the_relay() {
    let Some(mut board) = driving(&Config::new(bare())) else { return };
    let at = board.now();
    board.halt(Time::from_ms(100));
    let (opened, description) = after_fault(board, at);
    assert!(opened < Time::from_ms(55), "{} ms", opened.us() / 1e3);
    assert_eq!(description.reset, Reset::Watchdog);
}

#[test]
fn a_stopped_crystal_is_reported_and_the_board_continues_with_the_internal_oscillator() {
    let Some(mut board) = driving(&Config::new(bare())) else { return };
    let at = board.now();
    board.chip_mut().stop_crystal();
    let (opened, description) = after_fault(board, at);
    assert!(opened < Time::from_ms(1), "{} us", opened.us());
    assert_eq!(description.last_crash.map(|crash| crash.cause), Some(CrashCause::ClockFailed));
    assert_eq!(description.clock_source, damprig_protocol::ClockSource::InternalOscillator);
}

#[test]
fn a_damaged_program_word_is_reported_and_a_damaged_settings_word_changes_nothing() {
    let Some(mut board) = driving(&Config::new(bare())) else { return };
    board.chip_mut().damage_flash(true);
    pass(&mut board, 200);
    assert!(is_driving(&board));
    let at = board.now();
    board.chip_mut().damage_flash(false);
    let (opened, description) = after_fault(board, at);
    assert!(opened < Time::from_ms(1), "{} us", opened.us());
    assert_eq!(description.last_crash.map(|crash| crash.cause), Some(CrashCause::ProgramDamaged));
}

#[test]
fn a_falling_supply_opens_the_relay_at_2_9_v_and_the_board_waits_until_it_recovers() {
    let Some(mut board) = driving(&Config::new(bare())) else { return };
    // From 3.3 V to 2.8 V in 50 ms.
    let ramp: Vec<_> = (0..50).map(|ms| 3.3 - 0.01 * f64::from(ms)).collect();
    let begun = board.now();
    for volts in &ramp {
        board.chip_mut().set_supply(*volts);
        pass(&mut board, 1);
    }
    // The supply reaches 2.86 V after 44 ms.
    let opened = opened(&board, begun);
    assert!(opened >= Time::from_ms(44) && opened < Time::from_ms(46), "{} ms", opened.us() / 1e3);
    pass(&mut board, 500);
    assert!(!is_driving(&board) && board.chip_mut().take_sent().is_empty());
    board.chip_mut().set_supply(3.3);
    pass(&mut board, 50);
    assert_eq!(description(&mut board).last_crash.map(|crash| crash.cause), Some(CrashCause::SupplyLow));
}

#[test]
fn the_reset_button_pressed_during_a_drive_opens_the_relay_at_once_and_is_not_reported_as_a_crash() {
    let Some(mut board) = driving(&Config::new(bare())) else { return };
    let at = board.now();
    board.reset(ResetCause::Pin);
    let (opened, description) = after_fault(board, at);
    assert!(opened < Time::from_us(1), "{} us", opened.us());
    assert_eq!((description.reset, description.last_crash), (Reset::Pin, None));
}
