//! What the board reports of its own timing and its line, against what is done to it: late ticks, long ticks, masked interrupts,
//! lost blocks, damaged frames, dropped requests.

use damprig_board::{Board, Config, Output, Time};
use damprig_protocol::{FromDevice, Request, Timing};

use crate::common::{Host, TICK, bare, board, driving, image, pass, run, run_into_tick};

/// A microsecond is the resolution of the reports.
const RESOLUTION_US: f64 = 1.0;

fn timing(board: &mut Board) -> Timing {
    Host::new(board).counters().timing
}

/// Largest deviation of a change of the drive from the tick after the change before it, µs, since `since`. The output is set in
/// every tick, at nearly the same time after its start.
fn largest_deviation_us(board: &Board, since: Time) -> f64 {
    let trace = board.chip().trace().iter();
    let drive = trace.filter(|(at, output)| *at >= since && matches!(output, Output::Drive(_)));
    let times: Vec<f64> = drive.map(|(at, _)| at.us()).collect();
    let off = times.windows(2).map(|pair| (pair[1] - pair[0] - 1_000.0).abs()).filter(|off| *off < 990.0);
    off.fold(0.0, f64::max)
}

fn drive_code(board: &Board) -> u16 {
    let code = |output: &Output| if let Output::Drive(code) = output { *code } else { None };
    board.chip().trace().iter().rev().find_map(|(_, output)| code(output)).expect("the output is on")
}

#[test]
fn the_reported_jitter_is_how_late_a_tick_was() {
    let Some(mut board) = driving(&Config::new(bare())) else { return };
    let begun = board.now();
    pass(&mut board, 200);
    let (quiet, seen_us) = (timing(&mut board), largest_deviation_us(&board, begun));
    println!("undisturbed: {} us reported, {seen_us:.1} us seen at the output", quiet.largest_jitter_us);
    // The samples' interrupt wakes the tick, and nothing of a higher priority takes long.
    assert!(quiet.largest_jitter_us < 20, "{quiet:?}");
    let mut before = f64::from(quiet.largest_jitter_us);
    for late_us in [150, 400, 800] {
        // Near its zero crossing the drive changes in every tick.
        while drive_code(&board).abs_diff(2_048) > 60 {
            pass(&mut board, 1);
        }
        // The core stands from the middle of one tick until so long after the start of the next.
        run_into_tick(&mut board);
        let started = board.now();
        run(&mut board, started + Time::from_us(500));
        board.halt(Time::from_us(500 + late_us));
        pass(&mut board, 20);
        let reported = f64::from(timing(&mut board).largest_jitter_us);
        let seen_us = largest_deviation_us(&board, started);
        println!("{late_us} us late: {reported} us reported, {seen_us:.1} us seen at the output");
        assert!(reported > before);
        // The start of the tick before was found within a step of 2 us.
        assert!((reported - late_us as f64).abs() <= 2.0 + RESOLUTION_US, "{reported} us reported");
        // What a tick does before it sets the output takes some us more or less with each tick.
        assert!((reported - seen_us).abs() < 10.0, "{reported} us reported, {seen_us} us seen");
        before = reported;
    }
}

#[test]
fn the_reported_longest_tick_is_how_long_a_tick_took() {
    let Some(mut board) = driving(&Config::new(bare())) else { return };
    pass(&mut board, 100);
    let quiet = f64::from(timing(&mut board).longest_tick_us);
    // An instruction takes a cycle of 1/170 us here; the tick begins and ends within the handler.
    let longest_us = board.costs()[&TICK].most as f64 / 170.0;
    println!("undisturbed: {quiet} us reported, the longest handler has {longest_us:.1} us of instructions");
    assert!(
        quiet > 0.5 * longest_us && quiet < 1.5 * longest_us,
        "{quiet} us reported, {longest_us} us of instructions"
    );
    for held_us in [200, 500] {
        run_into_tick(&mut board);
        // Beyond the start of the tick's measurement.
        let next = board.now() + Time::from_us(10);
        run(&mut board, next);
        board.halt(Time::from_us(held_us));
        pass(&mut board, 20);
        let reported = f64::from(timing(&mut board).longest_tick_us);
        println!("held for {held_us} us: {reported} us reported");
        assert!(reported >= held_us as f64 && reported <= held_us as f64 + quiet + RESOLUTION_US, "{reported} us");
    }
}

#[test]
fn the_reported_masked_time_is_how_long_interrupts_were_masked() {
    let Some(image) = image() else { return };
    let mut board = board(image);
    pass(&mut board, 100);
    let mut host = Host::new(&mut board);
    let tenths_us = |host: &mut Host| f64::from(host.counters().timing.longest_masked_tenths_us);
    let quiet = tenths_us(&mut host);
    println!("undisturbed: {} us reported", quiet / 10.0);
    assert!(quiet > 0.0 && quiet < 100.0, "{quiet}");
    for held_us in [30, 100] {
        // Some of the instructions with masked interrupts lie outside the measurement: hold the core in many sections.
        for _ in 0..20 {
            host.send(Request::Status);
            let until = host.board.now() + Time::from_ms(20);
            while !host.board.masks_interrupts() {
                let next = host.board.now() + Time::from_us(1);
                run(host.board, next);
                assert!(host.board.now() < until, "no critical section in 20 ms");
            }
            host.board.halt(Time::from_us(held_us));
            host.pass(Time::from_ms(5));
        }
        let held = 10.0 * held_us as f64;
        let reported = tenths_us(&mut host);
        println!("held for {held_us} us in critical sections: {} us reported", reported / 10.0);
        assert!(held > quiet && reported >= held && reported <= held + quiet + 1.0, "{reported}");
    }
}

/// Nothing is driven during the start-up, and no tick is delayed.
#[test]
fn masked_interrupts_of_the_start_up_are_not_reported() {
    let Some(image) = image() else { return };
    let mut board = board(image);
    let (held_us, mut held, mut was_masked) = (50, 0, false);
    // Until the control task runs for the first time, which starts the ticks.
    while board.handles() != TICK {
        let next = board.now() + Time(Time::from_us(1).0 / 5);
        run(&mut board, next);
        let is_masked = board.masks_interrupts();
        if is_masked && !was_masked {
            board.halt(Time::from_us(held_us));
            held += 1;
        }
        was_masked = is_masked;
    }
    assert!(held > 1, "{held} critical sections");
    pass(&mut board, 20);
    let reported = timing(&mut board).longest_masked_tenths_us;
    println!("{held} critical sections held for {held_us} us each: {} us reported", f64::from(reported) / 10.0);
    assert!(u64::from(reported) < 10 * held_us, "{reported}");
}

#[test]
fn every_lost_block_of_samples_is_counted() {
    let Some(image) = image() else { return };
    let mut board = board(image);
    pass(&mut board, 100);
    assert_eq!(timing(&mut board).overruns, 0);
    for lost in 1..=3 {
        board.halt(Time::from_ms(5));
        pass(&mut board, 100);
        // Sampling starts anew after a loss.
        assert_eq!(timing(&mut board).overruns, lost);
    }
}

#[test]
fn damaged_frames_and_requests_without_room_are_counted() {
    let Some(image) = image() else { return };
    let mut board = board(image);
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    assert_eq!((host.counters().bad_frames, host.counters().requests_dropped), (0, 0));
    for _ in 0..3 {
        host.board.chip_mut().host_sends(&[7, 1, 2, 3, 4, 5, 6, 0]);
    }
    host.pass(Time::from_ms(5));
    assert_eq!(host.counters().bad_frames, 3);
    // Two requests have room, and one is served in a tick: a dozen within a millisecond is too many.
    host.received.clear();
    let sent: Vec<u16> = (0..12).map(|_| host.send(Request::Status)).collect();
    host.pass(Time::from_ms(40));
    let answered =
        host.messages().iter().filter(|m| matches!(m, FromDevice::Reply { seq, .. } if sent.contains(seq))).count();
    let counters = host.counters();
    println!("{} sent, {answered} answered, {} dropped", sent.len(), counters.requests_dropped);
    assert!(answered >= 3 && counters.requests_dropped > 0);
    assert_eq!(answered as u32 + counters.requests_dropped, sent.len() as u32);
    assert_eq!(counters.bad_frames, 3);
}
