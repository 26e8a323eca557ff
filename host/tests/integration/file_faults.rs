//! Each file operation of a run fails once: the rig is stopped, the error names the file, and the run is resumed to the same
//! results. `faults.c`, loaded into the program, makes them fail; without a C compiler these tests are skipped.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::common::{damprig, folder_with, is_full, manifest, result_rows, short};
use assert_cmd::Command;
use damprig::run_folder::journal;
use tempfile::TempDir;

/// The library of `faults.c`.
pub fn preload() -> Option<PathBuf> {
    static LIBRARY: OnceLock<Option<(TempDir, PathBuf)>> = OnceLock::new();
    let made = LIBRARY.get_or_init(|| {
        let folder = TempDir::new().unwrap();
        let (source, library) = (folder.path().join("faults.c"), folder.path().join("faults.so"));
        std::fs::write(&source, include_str!("faults.c")).unwrap();
        let mut compiler = std::process::Command::new("cc");
        let compiled = compiler.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(&source).arg("-ldl").status();
        match compiled {
            Ok(status) => {
                assert!(status.success(), "faults.c");
                Some((folder, library))
            }
            Err(error) => {
                println!("skipped: no C compiler ({error})");
                None
            }
        }
    });
    made.as_ref().map(|(_, library)| library.clone())
}

/// Two points of one set-up.
fn two_points() -> String {
    short().replace("frequencies_hz = [2.4, 2.5, 2.6]", "frequencies_hz = [2.4, 2.5]\nset_ups = [\"hybrid\"]")
}

/// Errors as Linux numbers them.
const NO_ENTRY: i32 = 2;
const BROKEN: i32 = 5;
const NO_PERMISSION: i32 = 13;
const FULL: i32 = 28;
const READ_ONLY: i32 = 30;

struct Fault<'a> {
    operation: &'a str,
    errno: i32,
    at: u32,
    /// All later ones fail too.
    stays: bool,
}

fn with_fault(command: &mut Command, library: &Path, fault: &Fault) {
    command.env("LD_PRELOAD", library).env("FAULT_UNDER", "/out").env("FAULT_OP", fault.operation);
    command.env("FAULT_AT", fault.at.to_string()).env("FAULT_ERRNO", fault.errno.to_string());
    if fault.stays {
        command.env("FAULT_ON", "1");
    }
}

/// Names of files that were left before they were whole.
fn left(run: &Path) -> Vec<String> {
    let entries = [run.to_path_buf(), run.join("samples.parts")].into_iter().filter_map(|f| std::fs::read_dir(f).ok());
    let names = entries.flatten().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    names.filter(|name| name.ends_with(".tmp")).collect()
}

/// Runs the campaign with one fault; whether the fault occurred.
fn survives(library: &Path, whole: &[String], fault: &Fault) -> bool {
    let folder = folder_with(&two_points());
    let run = folder.path().join("out");
    let what = format!("{} {}, error {}, stays: {}", fault.operation, fault.at, fault.errno, fault.stays);
    let mut command = damprig(&folder);
    // An absolute path, as the operations have it.
    with_fault(command.args(["run", "test.toml", "--out", run.to_str().unwrap()]), library, fault);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!said.contains("panicked"), "{what}: {said}");
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 1)), "{what}: {code:?}: {said}");
    assert!(!said.contains("fault:") || code == Some(0) || said.contains("/out"), "{what} names no file: {said}");
    if !fault.stays && fault.operation != "unlink" {
        assert_eq!(left(&run), Vec::<String>::new(), "{what}");
    }
    if !run.join("campaign.toml").exists() {
        // Nothing has moved, and there is nothing to resume.
        assert_eq!(code, Some(1), "{what}: {said}");
        return true;
    }
    let resumed = damprig(&folder).args(["run", "--resume", "out"]).output().unwrap();
    assert!(resumed.status.success(), "{what}: {said}\n{}", String::from_utf8_lossy(&resumed.stderr));
    assert_eq!((manifest(&run)["status"].as_str(), result_rows(&run)), (Some("complete"), 2), "{what}");
    assert_eq!(measured(&run), whole, "{what}");
    assert_eq!(left(&run), Vec::<String>::new(), "{what}");
    // Rows may be lost, and then they are counted; nothing is damaged.
    let verify = damprig(&folder).args(["runs", "verify", "out"]).output().unwrap();
    let found = String::from_utf8_lossy(&verify.stdout).into_owned();
    let damage =
        found.lines().filter(|l| l.starts_with("FAILED") && !l.contains("rows lost") && !l.contains("telemetry:"));
    assert_eq!(damage.collect::<Vec<_>>(), Vec::<&str>::new(), "{what}: {said}");
    said.contains("fault:")
}

/// What was measured, without the places in time.
fn measured(run: &Path) -> Vec<String> {
    let state = damprig::run_folder::schema::journal_state::JournalState::of(&journal::read(run).unwrap().entries);
    let mut rows: Vec<_> = state.rows().to_vec();
    for row in &mut rows {
        (row.start_tick, row.end_tick, row.segment) = (0, 0, 0);
    }
    rows.iter().map(|row| format!("{row:?}")).collect()
}

#[test]
fn each_file_operation_of_a_run_may_fail_once() {
    let Some(library) = preload() else { return };
    let folder = folder_with(&two_points());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let whole = measured(&folder.path().join("out"));
    let step = if is_full() { 1 } else { 150 };
    for (operation, errno, stays) in [
        ("open", READ_ONLY, false),
        ("open", NO_ENTRY, true),
        ("write", FULL, false),
        ("write", FULL, true),
        ("write", BROKEN, true),
        ("rename", READ_ONLY, false),
        ("rename", FULL, true),
        ("sync", BROKEN, false),
        ("unlink", NO_PERMISSION, false),
        ("unlink", READ_ONLY, true),
        ("mkdir", FULL, false),
    ] {
        let mut at = 1;
        while survives(&library, &whole, &Fault { operation, errno, at, stays }) {
            // The first operations are each a different file; later ones repeat.
            at += if at < 5 { 1 } else { step };
            assert!(at < 500, "{operation}: no end");
        }
        assert!(at > 1, "no {operation} was met");
        println!("{operation}, error {errno}, stays: {stays}: {} operations", at - 1);
    }
}
