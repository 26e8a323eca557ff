//! The controller's counters of a run: counts from before the run are subtracted, every report shows them, and the
//! parts of a resumed run are added.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::common::{Fate, Served, damprig, folder_with, is_point, manifest, short};
use damprig_protocol::{FromDevice, Reply, Timing};
use predicates::prelude::*;
use predicates::str::contains;

/// Replaces the overrun count in a message that carries counters.
fn overrunning(message: &FromDevice, overruns: u32) -> Fate {
    match message.clone() {
        FromDevice::Reply { seq, answer: Ok(Reply::Status { status, mut counters }) } => {
            counters.timing =
                Timing { overruns, longest_tick_us: 1234, largest_jitter_us: 56, longest_masked_tenths_us: 78 };
            let answer = Ok(Reply::Status { status, counters });
            Fate::Replace(Box::new(FromDevice::Reply { seq, answer }))
        }
        _ => Fate::Pass,
    }
}

#[test]
fn late_ticks_are_reported_of_this_run_only() {
    let folder = folder_with(&short());
    // Forty overruns before the run, and one with every point.
    let mut overruns = 40;
    let board = Served::start(move |message| {
        overruns += u32::from(is_point(message));
        overrunning(message, overruns)
    });
    damprig(&folder)
        .args(["run", "test.toml", "--rig", &board.rig, "--out", "out"])
        .assert()
        .success()
        .stdout(contains("; 6 ticks of the board were late"));
    let run = folder.path().join("out");
    let told = &manifest(&run)["controller"];
    assert_eq!((&told["overruns"], &told["longest_tick_us"]), (&6.into(), &1234.into()), "{told}");
    assert_eq!(told["longest_masked_tenths_us"], 78);
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    let words = "6 ticks of the board came too late: blocks of samples were overwritten unread";
    assert!(page.contains(words) && page.contains("Late ticks"));
    damprig(&folder).args(["runs", "show", "out"]).assert().success().stdout(
        contains(words).and(contains("longest tick 1234 µs, jitter 56 µs, interrupts masked for 7.8 µs at most")),
    );
}

#[test]
fn a_controller_without_counts_gives_no_warning() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success().stdout(contains("too late").not());
    let run = folder.path().join("out");
    let told = &manifest(&run)["controller"];
    for count in ["overruns", "rows_dropped", "replies_dropped", "requests_dropped", "bad_frames", "longest_tick_us"] {
        assert_eq!(told[count], 0, "{count}");
    }
    assert!(told["most_replies_waiting"].as_u64() > Some(0), "the board's counters were read: {told}");
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("no tick durations"));
    for alarm in ["came too late:", "damaged when they reached the board", "queue was full"] {
        assert!(!page.contains(alarm), "{alarm}");
    }
    damprig(&folder).args(["runs", "show", "out"]).assert().success().stdout(contains("too late").not());
}

#[test]
fn a_resumed_run_adds_up_its_parts_without_counts_between_them() {
    let folder = folder_with(&short());
    let (overruns, mut points) = (Arc::new(AtomicU32::new(100)), 0);
    let counted = Arc::clone(&overruns);
    let rig = Served::again_and_again(move |message| {
        points += u32::from(is_point(message));
        counted.fetch_add(u32::from(is_point(message)), Ordering::Relaxed);
        // The first experiment has three points, so its end has been reported.
        if is_point(message) && points == 4 {
            return Fate::Close;
        }
        overrunning(message, counted.load(Ordering::Relaxed))
    });
    let arguments = ["run", "test.toml", "--rig", &rig, "--out", "out", "--reconnect-s", "0"];
    damprig(&folder).args(arguments).assert().code(1);
    let run = folder.path().join("out");
    assert_eq!(manifest(&run)["controller"]["overruns"], 3);
    // Overruns between the parts: they belong to no run.
    overruns.fetch_add(1000, Ordering::Relaxed);
    damprig(&folder).args(["run", "--resume", "out", "--rig", &rig]).assert().success();
    let told = &manifest(&run)["controller"];
    assert_eq!(told["overruns"], 6, "three more points: {told}");
}

#[test]
fn a_board_that_was_reset_during_the_run_counts_from_zero() {
    let folder = folder_with(&short());
    let (mut overruns, mut points) = (40, 0);
    let board = Served::start(move |message| {
        points += u32::from(is_point(message));
        overruns += u32::from(is_point(message));
        if is_point(message) && points == 2 {
            overruns = 0;
            return Fate::Reset;
        }
        overrunning(message, overruns)
    });
    damprig(&folder).args(["run", "test.toml", "--rig", &board.rig, "--out", "out"]).assert().success();
    let told = &manifest(&folder.path().join("out"))["controller"];
    // Points two to six. The counts before the reset were lost with it.
    assert_eq!(told["overruns"], 5, "{told}");
}
