//! Records from which nothing can be identified, and what the command says about them.

use std::f64::consts::TAU;

use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::damprig;

/// 8 s of a free vibration of 2.5 Hz at 200 Hz.
fn decay() -> Vec<(f64, f64)> {
    let x = |t: f64| 0.035 * (-0.15 * t).exp() * (TAU * 2.5 * t).cos();
    (0..1600).map(|n| f64::from(n) / 200.0).map(|t| (t, x(t))).collect()
}

fn csv(header: &str, rows: &[(f64, f64)]) -> String {
    let rows: Vec<String> = rows.iter().map(|(t, x)| format!("{t:.6},{x:.9}")).collect();
    format!("{header}\n{}\n", rows.join("\n"))
}

/// The message for a file; it must be refused as input.
fn message(text: &str) -> String {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("record.csv"), text).unwrap();
    let output =
        damprig(&folder).args(["identify", "decay", "record.csv"]).assert().code(2).get_output().stderr.clone();
    String::from_utf8(output).unwrap()
}

#[track_caller]
fn refused(text: &str, says: &[&str]) {
    let message = message(text);
    for part in says {
        assert!(message.contains(part), "{part:?} is not in:\n{message}");
    }
}

#[test]
fn columns_that_cannot_be_read_are_named_with_the_fix() {
    let rows = decay();
    refused(&csv("t_s,y", &rows), &["the unit of \"y\" is not known", "for example x_mm or a_g"]);
    refused(&csv("time,x_m", &rows), &["it has 2 signals: which one?", "record.csv#2: x"]);
    let headless = csv("t_s,x_m", &rows).lines().skip(1).collect::<Vec<_>>().join("\n");
    refused(&headless, &["there is no header", "t_s,x_m"]);
    refused(&csv("t_s,x_m", &rows).replace("0.500000,", "0.500000"), &["line 102", "glued together"]);
    refused("t_s,x_m\n0.000,0.035\n0.001,0.035-0.034\n", &["line 3", "0.035-0.034", "glued together"]);
    refused("t_s,x_m\n0.0,0.035\n0.1,nan\n", &["line 3, ", "nan"].map(|s| s.trim_end_matches(", ")));
    refused("t_s,x_m\n0.0,0.035\n0.1,\n", &["line 3", "a value is missing"]);
    refused("t_s,x_m\n0,0,0,035\n0,1,0,036\n", &["decimal"]);
    refused("t_s,x_m\n", &["no row"]);
}

#[test]
fn times_that_are_not_uniform_are_refused_with_their_line() {
    let rows = decay();
    let mut gap = rows.clone();
    gap.drain(300..340);
    refused(&csv("t_s,x_m", &gap), &["line 302", "a gap of 0.205", "a file of its own"]);
    let mut back = rows.clone();
    back.swap(10, 11);
    refused(&csv("t_s,x_m", &back), &["not later than the one before", "sort the rows"]);
    let uneven: Vec<(f64, f64)> =
        rows.iter().enumerate().map(|(n, (t, x))| (t + if n % 2 == 0 { 0.0 } else { 0.0013 }, *x)).collect();
    refused(&csv("t_s,x_m", &uneven), &["not uniform", "resample"]);
}

#[test]
fn a_unit_that_is_improbable_is_refused_and_the_stated_one_is_used() {
    let mm: Vec<(f64, f64)> = decay().iter().map(|(t, x)| (*t, x * 1e3)).collect();
    refused(&csv("t_s,x_m", &mm), &["x_m = 35.0", "not probable", "x_mm"]);
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("mm.csv"), csv("t_s,x_mm", &mm)).unwrap();
    let output = damprig(&folder).args(["identify", "decay", "mm.csv", "--json"]).assert().success();
    let answer: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    let zeta = answer["estimates"][1]["value"].as_f64().unwrap();
    assert!((zeta - 0.15 / (TAU * 2.5)).abs() < 1e-6, "{answer}");
}

#[test]
fn a_record_without_a_usable_decay_is_refused_in_words_of_the_experiment() {
    let rows = decay();
    let held: Vec<(f64, f64)> = rows.iter().map(|(t, _)| (*t, 0.035)).collect();
    refused(&csv("t_s,x_m", &held), &["does not swing", "was it released?"]);
    let creep: Vec<(f64, f64)> = rows.iter().map(|(t, _)| (*t, 0.035 * (-t / 4.0).exp())).collect();
    refused(&csv("t_s,x_m", &creep), &["was it released?"]);
    refused(&csv("t_s,x_m", &rows[..160]), &["too short", "record longer"]);
    let saturated: Vec<(f64, f64)> = rows.iter().map(|(t, x)| (*t, x.clamp(-0.02, 0.02))).collect();
    refused(&csv("t_s,x_m", &saturated), &["saturated", "larger range"]);
    let frozen: Vec<(f64, f64)> =
        rows.iter().enumerate().map(|(n, (t, x))| (*t, if n < 700 { *x } else { 0.011 })).collect();
    refused(&csv("t_s,x_m", &frozen), &["frozen", "check the sensor"]);
    let driven: Vec<(f64, f64)> = rows.iter().map(|(t, x)| (*t, x * (0.3 * t).exp())).collect();
    refused(&csv("t_s,x_m", &driven), &["the motion grows", "switch off the drive"]);
}

#[test]
fn a_run_without_a_free_vibration_is_refused_with_what_it_has() {
    let folder = crate::common::folder_with(&crate::common::short());
    damprig(&folder).args(["run", "test.toml", "--out", "run"]).assert().success();
    damprig(&folder)
        .args(["identify", "decay", "run"])
        .assert()
        .code(2)
        .stderr(contains("the run has no free vibration").and(contains("add an experiment of this kind")));
}
