//! Fault tests on the board: from the cause to the safe state (relay open, motor off) and the reported crash cause.

use damprig_board::peripherals::rcc::ResetCause;
use damprig_board::{Board, Config, Time};
use damprig_core::control::fault::FaultCause;
use damprig_protocol::{CrashCause, Description, Reset};

use crate::common::{Host, TICK, bare, description, driving, is_driving, opened, pass, run};

/// The interrupts of a block of samples (DMA1 channel 1), of the stall watch (TIM7) and of the serial line (LPUART1).
const SAMPLES: u16 = 16 + 11;
const STALL_WATCH: u16 = 16 + 55;
const LINE: u16 = 16 + 91;

/// Code outside any handler: the tasks of the serial line.
const THREAD: u16 = 0;

/// Slowest and fastest watchdog oscillator (DS12288, table 48), Hz.
const LSI_HZ: [u64; 2] = [31_000, 34_000];

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
fn a_stack_that_overflows_opens_the_relay_and_is_reported_with_its_calls() {
    // Outside handlers and in the control tick, in a call, or in an interrupt that finds no room for its frame.
    for exception in [THREAD, TICK] {
        let Some(mut board) = driving(&Config::new(bare())) else { return };
        let at = board.now();
        board.overflow_in(exception);
        let (opened, description) = after_fault(board, at);
        assert!(opened < Time::from_ms(2), "{} ms", opened.us() / 1e3);
        assert_eq!(description.reset, Reset::Software);
        let crash = description.last_crash.expect("a crash is reported");
        assert_eq!(crash.cause, CrashCause::StackOverflow);
        assert!(crash.to_string().starts_with("the stack overflowed in tick "), "{crash}");
        assert!(crash.tick > 0, "the record of the tick is intact: {crash}");
    }
}

/// The stall watch is above the samples' interrupt; its own hang is left to the watchdog.
#[test]
fn an_interrupt_of_the_tick_that_hangs_is_reset_in_55_ms_and_told_as_such() {
    for lsi_hz in LSI_HZ {
        for (interrupt, cause) in [(SAMPLES, CrashCause::ControlStalled), (STALL_WATCH, CrashCause::Watchdog)] {
            let Some(mut board) = driving(&Config { lsi_hz, ..Config::new(bare()) }) else { return };
            let at = board.now();
            board.hang_in(interrupt);
            let (opened, description) = after_fault(board, at);
            // The stall watch runs every 5 ms.
            assert!(opened < Time::from_ms(60), "{} ms at {lsi_hz} Hz", opened.us() / 1e3);
            assert_eq!(description.last_crash.map(|crash| crash.cause), Some(cause), "{interrupt}");
        }
    }
}

#[test]
fn a_hanging_serial_line_task_is_reset_and_reported() {
    for lsi_hz in LSI_HZ {
        for hung in [THREAD, LINE] {
            let Some(mut board) = driving(&Config { lsi_hz, ..Config::new(bare()) }) else { return };
            let at = board.now();
            board.hang_in(hung);
            board.chip_mut().host_sends(&[0; 8]);
            run(&mut board, at + Time::from_ms(500));
            let (opened, description) = after_fault(board, at);
            // Half a second without a reply, then the watchdog's time.
            assert!(opened < Time::from_ms(560), "{} ms", opened.us() / 1e3);
            assert_eq!(description.last_crash.map(|crash| crash.cause), Some(CrashCause::CommunicationStalled));
        }
    }
}

#[test]
fn a_debugger_that_halts_the_core_while_the_rig_drives_opens_the_relay() {
    for lsi_hz in LSI_HZ {
        let Some(mut board) = driving(&Config { lsi_hz, ..Config::new(bare()) }) else { return };
        let at = board.now();
        board.halt(Time::from_ms(100));
        let (opened, description) = after_fault(board, at);
        assert!(opened < Time::from_ms(55), "{} ms", opened.us() / 1e3);
        assert_eq!(description.reset, Reset::Watchdog);
    }
}

/// The watchdog allows at least 47 ms.
#[test]
fn a_core_that_is_held_for_some_milliseconds_loses_a_block_and_ends_the_drive_without_a_reset() {
    for held_ms in [3, 10, 40] {
        let Some(mut board) = driving(&Config::new(bare())) else { return };
        let at = board.now();
        board.halt(Time::from_ms(held_ms));
        pass(&mut board, held_ms + 250);
        let opened = opened(&board, at);
        // The drive fades out in 200 ms.
        assert!(opened < Time::from_ms(held_ms + 210), "{} ms after {held_ms} ms", opened.us() / 1e3);
        let status = Host::new(&mut board).status();
        let cause = status.fault.expect("a lost block is a fault").cause;
        assert!(matches!(cause, FaultCause::SensorInvalid(_)), "{cause:?}");
        assert_eq!(description(&mut board).last_crash, None);
    }
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
