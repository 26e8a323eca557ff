//! Standard output that is closed or full, a terminal that closes, a clock beyond the years: the work is done all the same.
#![cfg(target_os = "linux")]

use std::fs::File;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use crate::common::{Fate, PATIENCE, Served, damprig, folder_with, manifest, short};
use crate::file_faults::preload;
use damprig_protocol::{Request, ToDevice};
use predicates::str::contains;
use tempfile::TempDir;

fn command(folder: &TempDir, arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    command.args(arguments).current_dir(folder.path()).stdin(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Runs a command with its standard output to a full disk, and to a pipe that nobody reads.
fn without_output(folder: &TempDir, arguments: &[&str]) -> [Output; 2] {
    let full = command(folder, arguments).stdout(File::create("/dev/full").unwrap()).output().unwrap();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    [full, command(folder, arguments).stdout(writer).output().unwrap()]
}

#[test]
fn no_command_panics_without_its_output_and_the_exit_code_tells_a_full_one() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let case = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("cases/spid.toml");
    for arguments in [
        &["--help"][..],
        &["runs", "."],
        &["runs", "show", "out"],
        &["runs", "verify", "out"],
        &["runs", "report", "out", "--force"],
        &["runs", "export", "out", "--format", "csv", "--force"],
        &["settings", "show"],
        &["settings", "set", "spring.step_m=4e-6", "--save"],
        &["simulate", case.to_str().unwrap(), "--json"],
        &["run", "test.toml", "--dry-run"],
    ] {
        let [full, closed] = without_output(&folder, arguments);
        let said = String::from_utf8_lossy(&full.stderr);
        assert_eq!(full.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(
            said.contains("standard output could not be written: No space left on device"),
            "{arguments:?}: {said}"
        );
        let said = String::from_utf8_lossy(&closed.stderr);
        assert_eq!((closed.status.code(), said.contains("error")), (Some(0), false), "{arguments:?}: {said}");
    }
    assert!(folder.path().join("out.html").exists() && folder.path().join("out-samples.csv").exists());
}

#[test]
fn a_run_without_output_is_complete() {
    for n in 0..2 {
        let folder = folder_with(&short());
        let output = without_output(&folder, &["run", "test.toml", "--out", "first"]);
        assert_eq!(output[0].status.code(), Some(1));
        assert_eq!(manifest(&folder.path().join("first"))["status"], "complete", "{n}");
    }
}

#[test]
fn settings_are_saved_although_nobody_reads_the_answer() {
    let folder = folder_with(&short());
    let board = Served::start(|_| Fate::Pass);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let arguments = ["settings", "set", "spring.step_m=4e-6", "--save", "--rig", &board.rig];
    command(&folder, &arguments).stdout(writer).status().unwrap();
    let is_save = |m: &ToDevice| matches!(m, ToDevice::Request(r) if r.request == Request::SaveSettings);
    assert!(board.received().iter().any(is_save));
}

/// Starts a run in a shell after `first`, sends it SIGHUP twice when its first point is there, and waits for its end.
fn hang_up(folder: &TempDir, first: &str) -> Output {
    let many = "frequencies_hz = { from_hz = 2.0, to_hz = 3.0, step_hz = 0.005 }";
    let campaign = short().replace("frequencies_hz = [2.4, 2.5, 2.6]", many);
    std::fs::write(folder.path().join("long.toml"), campaign).unwrap();
    // The tests themselves may have been started with `nohup`.
    let mut shell = Command::new("env");
    shell
        .args(["--default-signal=HUP", "sh", "-c"])
        .arg(format!("{first} exec \"$0\" run long.toml --out out"))
        .arg(assert_cmd::cargo::cargo_bin("damprig"));
    let child = shell.current_dir(folder.path()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let journal = folder.path().join("out/journal.jsonl");
    let begun = std::time::Instant::now();
    while !std::fs::read_to_string(&journal).is_ok_and(|text| text.contains("\"entry\":\"result\"")) {
        assert!(begun.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(5));
    }
    for _ in 0..2 {
        assert!(Command::new("kill").args(["-HUP", &child.id().to_string()]).status().unwrap().success());
    }
    child.wait_with_output().unwrap()
}

#[test]
fn a_terminal_that_closes_ends_a_run_in_an_orderly_way() {
    let folder = folder_with(&short());
    let output = hang_up(&folder, "");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("interrupted") && said.contains("continue with `damprig run --resume out`"), "{said}");
    assert_eq!(manifest(&folder.path().join("out"))["status"], "incomplete");
}

#[test]
fn a_run_that_was_started_to_outlive_its_terminal_does() {
    let folder = folder_with(&short());
    let output = hang_up(&folder, "trap '' HUP;");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_clock_before_1970_or_after_9999_does_not_prevent_a_run() {
    let Some(library) = preload() else { return };
    for seconds in ["-1000000000", "-99999999999999", "253402300800", "999999999999999"] {
        let folder = folder_with(&short());
        let with_clock = |arguments: &[&str]| {
            let mut command = damprig(&folder);
            command.env("LD_PRELOAD", &library).env("FAULT_CLOCK", seconds).args(arguments);
            command.assert()
        };
        with_clock(&["run", "test.toml", "--out", "out"]).success();
        with_clock(&["run", "--resume", "out"]).success().stdout(contains("The run is complete"));
        with_clock(&["run", "test.toml"]).success();
        with_clock(&["runs", "."]).success();
        with_clock(&["runs", "report", "out"]).success();
        with_clock(&["runs", "export", "out", "--format", "uff"]).success();
        with_clock(&["runs", "export", "out", "--format", "mat"])
            .code(1)
            .stderr(contains("set it, or use --format csv"));
        with_clock(&["runs", "verify", "out"]).success();
    }
}
