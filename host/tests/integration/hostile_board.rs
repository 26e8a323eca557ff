//! A defective board: frames with correct checksums that hold what was not asked for.

use std::io::Read;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Fate, PATIENCE, Served, damprig, folder_with, is_point, manifest, result_rows, short};
use damprig::run_folder::journal;
use damprig_core::io::SensorSet;
use damprig_core::measure::point::PointResult;
use damprig_protocol::{Event, FromDevice, Reply, Telemetry};
use predicates::str::contains;

/// Serves a board whose messages `change` replaces; those that it leaves alone pass.
fn served(mut change: impl FnMut(&FromDevice) -> Option<FromDevice> + Send + 'static) -> String {
    Served::again_and_again(move |message| change(message).map_or(Fate::Pass, |other| Fate::Replace(Box::new(other))))
}

#[test]
fn rows_of_a_wrong_width_are_counted_and_everything_else_is_kept() {
    for width in [0, 1, 2, 4, 255] {
        let folder = folder_with(&short());
        let mut messages = 0;
        let rig = served(move |message| {
            let FromDevice::Telemetry(rows) = message else { return None };
            messages += 1;
            (messages == 3).then(|| FromDevice::Telemetry(Telemetry { width, ..rows.clone() }))
        });
        let answer = damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out"]).assert().success();
        answer.stdout(contains("1 messages of the board did not fit the campaign and were dropped"));
        let run = folder.path().join("out");
        let manifest = manifest(&run);
        assert_eq!((manifest["counters"]["misfit_messages"].as_u64(), result_rows(&run)), (Some(1), 6), "{width}");
        assert_eq!(manifest["counters"]["lost_rows"], 21, "the rows of one message: {width}");
        let verify = damprig(&folder).args(["runs", "verify", "out"]).assert().code(1);
        verify.stdout(contains("1 messages of the board did not fit the campaign"));
    }
}

#[test]
fn rows_of_another_spacing_or_beyond_the_end_do_not_move_the_others() {
    let folder = folder_with(&short());
    let mut messages = 0;
    let rig = Served::again_and_again(move |message| {
        let FromDevice::Telemetry(rows) = message else { return Fate::Pass };
        messages += 1;
        let other = |change: fn(&mut Telemetry)| {
            let mut other = Telemetry { seq: rows.seq + 1, ..rows.clone() };
            change(&mut other);
            FromDevice::Telemetry(other)
        };
        match messages {
            3 => Fate::Also(vec![other(|rows| rows.every_ticks = 7), other(|rows| rows.first_tick += 3)]),
            _ => Fate::Pass,
        }
    });
    damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out"]).assert().success();
    let counters = &manifest(&folder.path().join("out"))["counters"];
    assert_eq!((counters["misfit_messages"].as_u64(), counters["lost_rows"].as_u64()), (Some(2), Some(0)));
}

#[test]
fn results_of_points_that_were_not_asked_for_are_dropped() {
    let folder = folder_with(&short());
    let rig = Served::again_and_again(move |message| {
        let FromDevice::Event { seq, tick, event: Event::Point(result) } = message else { return Fate::Pass };
        let other = |result: PointResult| FromDevice::Event { seq: *seq, tick: *tick, event: Event::Point(result) };
        let index = result.index + 1;
        let beyond = PointResult { index: u16::MAX, clipped: SensorSet::default(), ..*result };
        Fate::Also(vec![other(PointResult { index, ..*result }), other(beyond)])
    });
    damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    assert_eq!((result_rows(&run), manifest(&run)["counters"]["misfit_messages"].as_u64()), (6, Some(12)));
}

#[test]
fn an_impact_that_is_no_number_leaves_a_journal_that_can_be_resumed() {
    let folder = folder_with(&short());
    let (mut points, mut damaged) = (0, 0);
    let rig = Served::again_and_again(move |message| {
        points += usize::from(is_point(message));
        match message {
            FromDevice::Event { seq, tick, event: Event::Impact(impact) } => {
                damaged += 1;
                let mut impact = *impact;
                match damaged % 3 {
                    0 => impact.contact_s = f32::NAN,
                    1 => impact.peak_n = f32::INFINITY,
                    _ => return Fate::Pass,
                }
                Fate::Replace(Box::new(FromDevice::Event { seq: *seq, tick: *tick, event: Event::Impact(impact) }))
            }
            _ if is_point(message) && points == 5 => Fate::Close,
            _ => Fate::Pass,
        }
    });
    let arguments = ["run", "test.toml", "--rig", &rig, "--out", "out", "--reconnect-s", "0"];
    damprig(&folder).args(arguments).assert().code(1).stdout(contains("did not fit the campaign"));
    let run = folder.path().join("out");
    let lines = journal::read(&run).unwrap();
    assert_eq!((lines.damaged, lines.torn), (vec![], vec![]));
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    assert_eq!(result_rows(&run), 6);
}

#[test]
fn a_setting_that_is_no_number_is_refused_by_name_before_anything_moves() {
    for value in [f32::NAN, f32::INFINITY] {
        let folder = folder_with(&short());
        let rig = served(move |message| {
            let FromDevice::Reply { seq, answer: Ok(Reply::Settings { settings, source }) } = message else {
                return None;
            };
            let mut settings = *settings;
            settings.spring.step_m = value;
            Some(FromDevice::Reply { seq: *seq, answer: Ok(Reply::Settings { settings, source: *source }) })
        });
        let refused = contains(format!("reports the setting spring.step_m = {value}"));
        damprig(&folder)
            .args(["run", "test.toml", "--rig", &rig, "--out", "out"])
            .assert()
            .code(1)
            .stderr(refused.clone());
        assert!(!folder.path().join("out").exists());
        damprig(&folder).args(["settings", "show", "--rig", &rig]).assert().code(1).stderr(refused);
    }
}

#[test]
fn signals_that_cannot_be_columns_are_refused() {
    for name in ["", "x", "tick\n", "../x", "X"] {
        let folder = folder_with(&short());
        let rig = served(move |message| {
            let FromDevice::Reply { seq, answer: Ok(Reply::Signals(part)) } = message else { return None };
            let mut part = part.clone();
            // Not the first of the table, so that a name may be there already.
            part.iter_mut().skip(1).for_each(|signal| signal.name = name.try_into().unwrap());
            Some(FromDevice::Reply { seq: *seq, answer: Ok(Reply::Signals(part)) })
        });
        let answer = damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out"]).assert().code(1);
        answer.stderr(contains(format!("reports a signal named {name:?}")));
    }
}

/// Runs the campaign on a board that sends a message without end from the first message for which `is_start`; gives the
/// standard error and the most memory that the program had, MB.
fn flooded(flood: FromDevice, is_start: fn(&FromDevice) -> bool) -> (String, f64) {
    let folder = folder_with(&short());
    let board =
        Served::start(move |message| if is_start(message) { Fate::Flood(Box::new(flood.clone())) } else { Fate::Pass });
    let mut child = Command::new(assert_cmd::cargo::cargo_bin("damprig"))
        .args(["run", "test.toml", "--rig", &board.rig, "--out", "out", "--timeout", "20"])
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (begun, mut most_mb) = (Instant::now(), 0.0);
    let status = loop {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let peak =
            status.lines().find_map(|l| l.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse::<f64>().ok());
        most_mb = peak.map_or(most_mb, |kb| kb / 1000.0);
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        assert!(begun.elapsed() < PATIENCE, "the run does not end");
        std::thread::sleep(Duration::from_millis(5));
    };
    assert_eq!(status.code(), Some(1));
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    (said, most_mb)
}

#[test]
fn a_flood_of_valid_frames_is_ended_and_fills_no_memory() {
    let rows = Telemetry { seq: 0, first_tick: 0, every_ticks: 10, width: 3, values: [0.0; 63].into_iter().collect() };
    let answers = |message: &FromDevice| matches!(message, FromDevice::Reply { answer: Ok(Reply::Description(_)), .. });
    type Start = fn(&FromDevice) -> bool;
    let floods: [(FromDevice, Start); 4] = [
        (FromDevice::Telemetry(rows.clone()), is_point),
        (FromDevice::Telemetry(rows), answers),
        (FromDevice::Reply { seq: 60_000, answer: Ok(Reply::Done) }, is_point),
        (FromDevice::Clock { tick: 0 }, answers),
    ];
    for (flood, is_start) in floods {
        let (said, most_mb) = flooded(flood.clone(), is_start);
        assert!(said.contains("sends more than it was asked for"), "{flood:?}: {said}");
        assert!(most_mb > 1.0 && most_mb < 250.0, "{flood:?}: {most_mb} MB");
    }
}
