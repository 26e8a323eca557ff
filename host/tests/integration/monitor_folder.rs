//! A run folder on the live monitor: one that another program records, and one that is over.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::common::{PATIENCE, damprig, folder_with, short};
use crate::monitor::{Viewer, monitor};
use damprig::monitor::{Handles, Monitor, folder};
use damprig::table::values::{numbers, texts};

/// A monitor of a run folder, until it is dropped.
struct Watching {
    monitor: Monitor,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), String>>>,
}

impl Watching {
    fn start(run: &Path, speed: f64) -> Self {
        let mut monitor = monitor(None, Handles { can_replay: true, ..Handles::default() });
        let (feed, actions) = (monitor.feed(), monitor.take_actions().expect("a queue of actions"));
        let stop = Arc::new(AtomicBool::new(false));
        let (theirs, run) = (Arc::clone(&stop), run.to_path_buf());
        let thread = std::thread::spawn(move || {
            folder::watch(&run, speed, &feed, &actions, &theirs).map_err(|error| error.to_string())
        });
        Self { monitor, stop, thread: Some(thread) }
    }

    fn end(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take().expect("a thread").join();
        ended.expect("no panic").expect("the folder can be read");
    }
}

/// Starts the short campaign on the real-time rig; returns when its first point is recorded.
fn recording(folder: &TempDir) -> Child {
    let mut run = Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    run.args(["run", "test.toml", "--out", "out", "--rig", "virtual:realtime", "--speed", "5"]);
    let run = run.current_dir(folder.path()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while !journal(folder).contains("\"entry\":\"result\"") {
        assert!(begun.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(10));
    }
    run
}

fn journal(folder: &TempDir) -> String {
    std::fs::read_to_string(folder.path().join("out/journal.jsonl")).unwrap_or_default()
}

fn last_s(message: &Value) -> Option<f64> {
    message["rows"]["t_s"].as_array()?.iter().rev().find_map(Value::as_f64)
}

fn times(message: &Value) -> impl Iterator<Item = f64> {
    message["rows"]["t_s"].as_array().into_iter().flatten().filter_map(Value::as_f64)
}

#[test]
fn a_growing_run_is_followed_to_its_end_and_every_row_is_told_once() {
    let folder = folder_with(&short());
    let mut run = recording(&folder);
    let watching = Watching::start(&folder.path().join("out"), 1.0);
    let mut viewer = Viewer::join(&watching.monitor);
    let all = viewer.until(|message| message["state"]["activity"] == "over");
    assert!(run.wait().unwrap().success());
    let last = &all[all.len() - 1]["state"];
    assert_eq!((&last["points_taken"], &last["headline"]), (&json!(6), &json!("State of the run: complete.")));
    // 35 s of rig time; the joined samples at the end repeat nothing.
    let told: Vec<f64> = all.iter().flat_map(times).collect();
    let end_s = told.iter().copied().fold(0.0, f64::max);
    assert!((34.0..37.0).contains(&end_s), "{end_s}");
    let begun = all.iter().rposition(|message| message["kind"] == "snapshot").unwrap_or(0);
    assert!(all[begun..].iter().flat_map(times).is_sorted());
    watching.end();
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn a_finished_run_is_replayed_and_can_be_moved() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let watching = Watching::start(&folder.path().join("out"), 20.0);
    let mut viewer = Viewer::join(&watching.monitor);
    // It stands at its first sample until somebody plays it.
    let mut all = viewer.until(|message| message["state"]["replay"].is_object());
    let state = &all[all.len() - 1]["state"];
    assert_eq!((&state["activity"], &state["replay"]["paused"]), (&json!("replay"), &json!(true)));
    assert_eq!((&state["link"]["rows"], &state["age_s"], &state["points_taken"]), (&json!(1), &json!(0.0), &json!(0)));
    assert_eq!(viewer.ask(json!({"do": "replay", "paused": false}))["ok"], true);
    all.extend(viewer.until(|message| message["state"]["points_taken"] == 6));
    // It never claims to run.
    assert!(all.iter().all(|message| message["state"]["activity"] != "running"));
    let first = all.iter().find(|message| message["kind"] == "snapshot" && message["is_replay"] == true);
    assert_eq!(first.expect("a replay")["curves"].as_array().unwrap().len(), 2);
    // Amplitudes are computed again from the samples, points come when their rows have.
    let ratio = |message: &Value| message["state"]["numbers"]["x_over_z_lock_in"].as_f64();
    assert!(all.iter().filter_map(ratio).any(|ratio| ratio > 1.0));
    assert!(all.iter().any(|message| message["state"]["points_taken"] == 3));
    for (to_s, shown_s) in [(-1e300, 0.0), (12.0, 12.0), (1e300, 34.0)] {
        let answer = viewer.ask(json!({"do": "replay", "to_s": to_s, "paused": true}));
        assert_eq!(answer["ok"], true, "{answer}");
        let at = |message: &Value| message["state"]["replay"]["t_s"].as_f64();
        viewer.until(|message| at(message).is_some_and(|t_s| (t_s - shown_s).abs() < 2.0));
    }
    for speed in [json!(0.0), json!(-1), json!(1e9)] {
        assert_eq!(viewer.ask(json!({"do": "replay", "speed": speed}))["ok"], false);
    }
    watching.end();
}

/// Everything that a replay shows up to its end, and the time of the gap between its two set-ups.
#[test]
fn a_replay_shows_samples_and_impacts_when_they_were_recorded_and_its_gaps() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = damprig::run_folder::RunFolder::open(&folder.path().join("out")).unwrap();
    let column = |batches: &[arrow_array::RecordBatch], name: &str| -> Vec<f64> {
        batches.iter().flat_map(|batch| numbers(batch, name).unwrap()).collect()
    };
    let samples: Vec<_> = run.samples().map(Result::unwrap).collect();
    let impacts = run.impacts().unwrap();
    // The clock of the run counts on from set-up to set-up: its second part begins at the last tick of the first.
    let names: Vec<String> = samples.iter().flat_map(|batch| texts(batch, "set_up").unwrap()).collect();
    let second = names.iter().position(|name| *name != names[0]).expect("two set-ups");
    let ticks = column(&samples, "tick");
    let journal = journal(&folder);
    let finished: Value = journal
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .find(|entry| entry["entry"] == "finished")
        .expect("an end");
    let start_s = finished["end_tick"].as_f64().unwrap() * 1e-3;
    let recorded_s = |set_up: &str, t_s: f64| t_s + if set_up == names[0] { 0.0 } else { start_s };
    let watching = Watching::start(&folder.path().join("out"), 1.0);
    let mut viewer = Viewer::join(&watching.monitor);
    viewer.until(|message| message["state"]["replay"].is_object());
    let close = |a: f64, b: f64| (a - b).abs() < 1e-6;
    // The 20 s around the border are shown as they were recorded, without a line across it.
    let to_s = start_s + 5.0;
    viewer.ask(json!({"do": "replay", "to_s": to_s}));
    // A row every 10 ms.
    let shown = viewer.until(|message| last_s(message).is_some_and(|t_s| (0.0..0.0101).contains(&(to_s - t_s))));
    let begun = shown.iter().rposition(|message| message["kind"] == "snapshot").unwrap_or(0);
    let mut rows: Vec<(f64, Option<f64>)> = Vec::new();
    for message in &shown[begun..] {
        let values = message["rows"]["values"]["x"].as_array().into_iter().flatten().map(Value::as_f64);
        rows.extend(times(message).zip(values));
    }
    let all_s: Vec<f64> = ticks.iter().zip(&names).map(|(tick, set_up)| recorded_s(set_up, tick * 1e-3)).collect();
    let x_m = column(&samples, "x_m");
    for (t_s, x) in &rows {
        let at = all_s.partition_point(|recorded_s| *recorded_s < t_s - 1e-6);
        assert!(close(all_s[at], *t_s), "nothing was recorded at {t_s} s");
        assert!(x.is_none_or(|x| x as f32 == x_m[at] as f32), "{x:?} at {t_s} s, recorded {}", x_m[at]);
    }
    let gaps: Vec<f64> = rows.iter().filter(|(_, x)| x.is_none()).map(|(t_s, _)| *t_s).collect();
    assert!(gaps.iter().any(|t_s| close(*t_s, all_s[second - 1])), "{gaps:?}, {}", all_s[second]);
    // The impacts of the table up to there.
    let told = |messages: &[Value]| -> Vec<f64> {
        let all = messages.iter().filter_map(|message| message["impacts"].as_array()).flatten();
        all.map(|impact| impact["t_s"].as_f64().unwrap()).collect()
    };
    let set_ups: Vec<String> = impacts.iter().flat_map(|batch| texts(batch, "set_up").unwrap()).collect();
    let table = column(&impacts, "t_s");
    let mut expected: Vec<f64> = table.iter().zip(&set_ups).map(|(t_s, set_up)| recorded_s(set_up, *t_s)).collect();
    // An impact is told with the row of its tick; its centre is within a few milliseconds.
    expected.retain(|t_s| *t_s < to_s - 0.02);
    let shown_s = told(&shown[begun..]);
    assert!(!expected.is_empty(), "the campaign has impacts");
    for impact_s in &expected {
        assert!(shown_s.iter().any(|t_s| close(*t_s, *impact_s)), "no impact at {impact_s} s among {shown_s:?}");
    }
    assert!(shown_s.iter().all(|t_s| *t_s < to_s + 0.02));
    // Back before the first whole cycle: no number of a later time is left.
    viewer.ask(json!({"do": "replay", "to_s": 0.05}));
    let back = viewer.until(|message| last_s(message).is_some_and(|t_s| t_s <= 0.05)).pop().unwrap();
    let numbers = &back["state"]["numbers"];
    assert!(numbers["x_over_z_lock_in"].is_null() && numbers["x_amplitude_m"].is_null(), "{numbers}");
    assert_eq!((&back["state"]["points_taken"], &back["state"]["set_up"]), (&json!(0), &json!(names[0])));
    watching.end();
}

#[test]
fn a_doctored_length_of_a_run_makes_no_replay_panic() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let path = folder.path().join("out/manifest.json");
    for rig_s in ["-5.0", "1e300"] {
        let mut manifest: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        manifest["clock"]["rig_s"] = serde_json::from_str(rig_s).unwrap();
        std::fs::write(&path, manifest.to_string()).unwrap();
        let watching = Watching::start(&folder.path().join("out"), 1.0);
        let mut viewer = Viewer::join(&watching.monitor);
        viewer.until(|message| message["state"]["replay"].is_object());
        assert_eq!(viewer.ask(json!({"do": "replay", "to_s": 3.0}))["ok"], true);
        watching.end();
    }
}
