//! `damprig runs`: intact and damaged run folders, and exports. Damaged runs have truncated or changed files.

use std::path::{Path, PathBuf};

use crate::common::{damprig, folder_with, rows, short};
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::Value;
use tempfile::TempDir;

fn with_run() -> (TempDir, PathBuf) {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    (folder, run)
}

fn cut_in_half(path: &Path) -> Vec<u8> {
    let bytes = std::fs::read(path).unwrap();
    let half = bytes[..bytes.len() / 2].to_vec();
    std::fs::write(path, &half).unwrap();
    half
}

#[test]
fn an_intact_run_is_listed_shown_and_verified() {
    let (folder, _) = with_run();
    damprig(&folder).args(["runs", "."]).assert().success().stdout(contains("6/6").and(contains("complete")));
    damprig(&folder).args(["runs", "show", "out"]).assert().success().stdout(contains("x_m (m)"));
    damprig(&folder).args(["runs", "verify", "out"]).assert().success().stdout(contains("FAILED").not());
}

#[test]
fn a_run_is_listed_shown_and_verified_for_programs() {
    let (folder, run) = with_run();
    let json = |arguments: &[&str], code: i32| -> Value {
        let answer = damprig(&folder).args(arguments).arg("--json").assert().code(code);
        serde_json::from_slice(&answer.get_output().stdout).unwrap()
    };
    let list = json(&["runs", "."], 0);
    assert_eq!(
        (&list[0]["folder"], &list[0]["points_taken"], &list[0]["rig"]),
        (&"./out".into(), &6.into(), &"virtual".into())
    );
    let shown = json(&["runs", "show", "out"], 0);
    assert_eq!(shown["manifest"]["campaign"], list[0]["campaign"]);
    assert_eq!(shown["results"].as_array().unwrap().len(), 6);
    assert!(shown["results"][0]["frequency_hz"].as_f64().unwrap() > 0.0, "{shown}");
    let wrong = |verified: &Value| verified["checks"].as_array().unwrap().iter().any(|check| check["is_good"] == false);
    assert!(!wrong(&json(&["runs", "verify", "out"], 0)));
    cut_in_half(&run.join("samples.parquet"));
    assert!(wrong(&json(&["runs", "verify", "out"], 1)));
}

#[test]
fn every_damaged_file_is_named_and_the_others_pass() {
    let (folder, run) = with_run();
    let half = cut_in_half(&run.join("samples.parquet"));
    let verify = || damprig(&folder).args(["runs", "verify", "out"]).assert();
    let answer = verify().code(1);
    answer.stdout(contains("cut off or damaged").and(contains("results.parquet: 6 rows")));
    assert_eq!(std::fs::read(run.join("samples.parquet")).unwrap(), half, "nothing is rewritten");
    std::fs::remove_file(run.join("results.parquet")).unwrap();
    verify().code(1).stdout(contains("results.parquet: cannot read it"));
    let manifest = std::fs::read_to_string(run.join("manifest.json")).unwrap();
    std::fs::write(run.join("manifest.json"), manifest.replace("\"format\": 1", "\"format\": 99")).unwrap();
    verify().code(1).stdout(contains("the run has format 99"));
    std::fs::write(run.join("manifest.json"), &manifest[..manifest.len() / 2]).unwrap();
    verify().code(1).stdout(contains("the manifest is damaged"));
}

#[test]
fn a_single_flipped_bit_is_detected() {
    let (folder, run) = with_run();
    let path = run.join("figure.png");
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    damprig(&folder).args(["runs", "verify", "out"]).assert().code(1).stdout(contains("figure.png: changed"));
}

#[test]
fn a_folder_that_is_not_a_run_is_refused() {
    let folder = folder_with(&short());
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    damprig(&folder).args(["runs", "verify", "empty"]).assert().code(2).stderr(contains("this folder is no run"));
    damprig(&folder).args(["runs", "show", "nowhere"]).assert().code(2).stderr(contains("there is no run"));
}

#[test]
fn csv_has_every_selected_row_with_units_and_never_overwrites() {
    let (folder, run) = with_run();
    let export = ["runs", "export", "out", "--format", "csv", "--out", "all.csv"];
    damprig(&folder).args(export).assert().success();
    let text = std::fs::read_to_string(folder.path().join("all.csv")).unwrap();
    assert!(text.lines().next().unwrap().contains("x_m [m]"));
    assert_eq!(text.lines().count() - 1, rows(run.join("samples.parquet")));
    damprig(&folder).args(export).assert().code(2).stderr(contains("cannot write all.csv"));
    let one = ["--set-up", "bare", "--from-s", "1", "--to-s", "2", "--out", "one.csv"];
    damprig(&folder).args(["runs", "export", "out", "--format", "csv"]).args(one).assert().success();
    let text = std::fs::read_to_string(folder.path().join("one.csv")).unwrap();
    assert_eq!(text.lines().count() - 1, 100, "1 s at 100 Hz");
    let wrong = ["runs", "export", "out", "--format", "csv", "--set-up", "hybird"];
    damprig(&folder).args(wrong).assert().code(2).stderr(contains("did you mean hybrid"));
}

#[test]
fn runs_are_listed_by_start_time_across_time_zones() {
    let (folder, run) = with_run();
    let manifest = std::fs::read_to_string(run.join("manifest.json")).unwrap();
    let value: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let started = value["started"].as_str().unwrap();
    // The latest start comes first; sorted as text it would come last.
    let times = [
        ("late", "2026-11-21T01:00:00-05:00[America/New_York]"),
        ("early", "2026-11-21T05:00:00+02:00[Europe/Athens]"),
        ("middle", "2026-11-21T04:00:00+00:00[No/Such_Zone]"),
        ("never", "some day"),
    ];
    std::fs::create_dir(folder.path().join("all")).unwrap();
    for (name, time) in times {
        let copy = folder.path().join("all").join(name);
        std::fs::create_dir(&copy).unwrap();
        std::fs::write(copy.join("manifest.json"), manifest.replace(started, time)).unwrap();
    }
    let output = damprig(&folder).args(["runs", "all"]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let place = |name: &str| text.find(name).unwrap_or_else(|| panic!("{name}: {text}"));
    let order = ["late", "middle", "early", "never"].map(place);
    assert!(order.is_sorted(), "{text}");
}
