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
    let all = viewer.until(|message| message["state"]["points_taken"] == 6);
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
