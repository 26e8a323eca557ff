//! What the controller refuses, the dry run and the start of a run refuse, before a run folder exists, with the line of the key.

use std::time::{Duration, Instant};

use crate::common::{Fate, Served, damprig, folder_with};
use damprig_protocol::{FromDevice, Request, ToDevice};
use predicates::prelude::*;
use predicates::str::contains;

const SINE: &str = include_str!("mutations/sine.toml");
const SPRING: &str = include_str!("mutations/spring.toml");
const SHAKER: &str = include_str!("mutations/shaker.toml");

fn edited(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "no {from:?}");
    text.replacen(from, to, 1)
}

/// The dry run and the run must refuse the campaign with these words, at the line of `at`, and leave no run folder.
fn refused(campaign: &str, at: &str, words: &[&str]) {
    let folder = folder_with(campaign);
    let line = 1 + campaign[..campaign.find(at).expect("the text is there")].matches('\n').count();
    let place = format!("--> test.toml:{line}:");
    for arguments in [&["run", "test.toml", "--dry-run"][..], &["run", "test.toml"]] {
        let output = damprig(&folder).args(arguments).output().unwrap();
        let answer = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {answer}");
        for word in words.iter().copied().chain([place.as_str()]) {
            assert!(answer.contains(word), "no {word:?} in:\n{answer}");
        }
        assert!(!folder.path().join("runs").exists(), "a run was begun");
    }
}

#[test]
fn a_drive_limit_below_the_amplitude_is_refused_although_it_is_in_a_later_experiment() {
    let limit = "drive_limit_m = 0.001";
    let words =
        ["`experiment[2].closed_loop` = ", "drive.drive_limit_m = 0.001", "greater than amplitude_m", "\"closed\""];
    refused(&edited(SHAKER, "drive_limit_m = 0.004", limit), limit, &words[1..]);
}

#[test]
fn a_friction_ratio_beyond_the_springs_force_is_refused_with_one_that_fits() {
    let ratio = "friction_ratio = 20";
    let words = [
        "`set_up[1].friction_damper.spring.friction_ratio` = 20",
        "0.9 of spring.largest_force_n",
        "write friction_ratio = 6.8",
    ];
    refused(&edited(SPRING, "friction_ratio = 0.6", ratio), ratio, &words);
    let fits = edited(SPRING, "friction_ratio = 0.6", "friction_ratio = 6.8");
    damprig(&folder_with(&fits)).args(["run", "test.toml", "--dry-run"]).assert().success();
}

#[test]
fn a_spring_too_soft_for_a_touch_off_or_too_stiff_for_a_step_is_refused() {
    for stiffness in ["stiffness_n_per_m = 5.0", "stiffness_n_per_m = 1e5"] {
        let campaign = edited(SPRING, "stiffness_n_per_m = 500.0", stiffness);
        refused(&campaign, stiffness, &["friction_damper.spring.stiffness_n_per_m", "the controller refuses"]);
    }
}

#[test]
fn strong_damping_is_not_blamed_on_the_stiffness() {
    let damping = "damping_ratio = 20";
    let words = ["`structure.damping_ratio` = 20", "low enough for a twin (damping over mass"];
    refused(&edited(SINE, "damping_ratio = 0.0038", damping), damping, &words);
    let damping = "damping_ratio = 1e4";
    let words = ["`structure.damping_ratio` = 1e4", "damping over mass × sample interval"];
    refused(&edited(SINE, "damping_ratio = 0.0038", damping), damping, &words);
}

#[test]
fn an_amplitude_that_no_sensor_sees_is_refused() {
    let small = edited(SINE, "base_amplitude_m = 0.0004", "base_amplitude_m = 1e-6");
    refused(&small, "1e-6\n", &["`base_amplitude_m` is too small", "the sensors resolve 1.0e-5 m"]);
    let none = edited(SINE, "base_amplitude_m = 0.0004", "base_amplitude_m = 1e-46");
    refused(&none, "1e-46", &["`set_up[1].base_amplitude_m` = 1e-46", "0 or at least 1e-18 m in magnitude"]);
    let ideal = edited(SINE, "sensor_resolution_m = 1e-5", "sensor_resolution_m = 0.0");
    let tiny = edited(&ideal, "base_amplitude_m = 0.0004", "base_amplitude_m = 1e-12");
    refused(&tiny, "1e-12", &["must be 1.0e-9 m or more"]);
}

#[test]
fn a_base_limit_below_the_amplitude_and_a_rest_level_below_the_noise_are_refused() {
    let limited = edited(SINE, "base_limit_m = 0.07", "base_limit_m = 0.001");
    refused(
        &limited,
        "0.0015",
        &["set-up \"hybrid\" would leave the displacement limit of the base", "write base_amplitude_m"],
    );
    let level = "rest_level_m = 1e-5";
    refused(
        &edited(SINE, "rest_level_m = 1e-4", level),
        "1e-5\nsteady",
        &["never comes to rest", "must be above 2.0e-5 m"],
    );
}

#[test]
fn a_shaker_calibrated_far_from_the_drive_is_refused_and_a_little_off_is_a_warning() {
    let far = "calibrated_at_hz = 20";
    let words = ["moves 11 times as far as demanded at 2.4 Hz", "the rig stops when the base moves 10 times"];
    refused(&edited(SHAKER, "calibrated_at_hz = 2.5", far), far, &words);
    let little = folder_with(&edited(SHAKER, "calibrated_at_hz = 2.5", "calibrated_at_hz = 5"));
    damprig(&little)
        .args(["run", "test.toml", "--dry-run"])
        .assert()
        .success()
        .stderr(contains("warning: set-up \"spid\": calibrated at 5 Hz"));
}

#[test]
fn impacts_far_beyond_the_wall_force_are_refused_and_slightly_beyond_are_a_warning() {
    let heavy = edited(SINE, "mass_kg = 1.6", "mass_kg = 1000");
    let words =
        ["set-up \"hybrid\" would reach the limit of the force on a wall", "limit 400 N", "a particle of 100 kg"];
    refused(&heavy, "base_amplitude_m = 0.0015", &words);
    let near = folder_with(&edited(SINE, "wall_force_limit_n = 400", "wall_force_limit_n = 30"));
    damprig(&near).args(["run", "test.toml", "--dry-run"]).assert().success().stderr(
        contains("would reach the limit of the force on a wall").and(contains("limit 30 N; the rig stops there")),
    );
}

#[test]
fn sensors_as_coarse_as_their_range_are_refused() {
    let coarse = edited(SINE, "sensor_resolution_m = 1e-5", "sensor_resolution_m = 0.05");
    let release = "kind = \"free_vibration\"\nstart_m = 0.03\nmeasure_s = 2.0\n[telemetry]";
    let (head, rest) = coarse.split_once("kind = \"stepped_sine\"").unwrap();
    let folder = folder_with(&format!("{head}{release}{}", rest.split_once("[telemetry]").unwrap().1));
    std::fs::write(folder.path().join("board.toml"), "[safety]\nresolution_m = 0.06\n").unwrap();
    damprig(&folder)
        .args(["run", "test.toml", "--dry-run", "--rig", "virtual:board.toml"])
        .assert()
        .code(2)
        .stderr(contains("`rig.sensor_resolution_m` = 0.05").and(contains("at most a tenth of sensors.range_m")));
}

#[test]
fn signals_are_checked_before_the_run() {
    for (signals, words) in [
        ("signals = [\"x\", \"x\"]", "is named twice"),
        ("signals = [\"x\", \"drve\"]", "did you mean \"drive\"?"),
        (
            "signals = [\"x\", \"z\", \"drive\", \"frequency\", \"a\", \"b\", \"c\", \"d\", \"e\", \"f\", \"g\", \"h\", \"i\", \"j\", \"k\", \"l\", \"m\"]",
            "a device sends at most 16",
        ),
    ] {
        refused(&edited(SINE, "signals = [\"x\", \"z\", \"twin_residual\"]", signals), signals, &[words]);
    }
}

#[test]
fn the_dry_run_reads_the_settings_of_the_rig_and_changes_nothing_on_it() {
    let rig = Served::start(|_: &FromDevice| Fate::Pass);
    let folder = folder_with(SPRING);
    damprig(&folder)
        .args(["run", "test.toml", "--dry-run", "--rig", &rig.rig])
        .assert()
        .success()
        .stdout(contains(format!("Checked with the settings of test at {}", rig.rig)));
    let asked: Vec<Request> = rig
        .received()
        .into_iter()
        .map(|message| match message {
            ToDevice::Request(request) => request.request,
            ToDevice::Grant { .. } => panic!("time passed on the rig"),
        })
        .collect();
    let reads = |ask: &Request| {
        matches!(
            ask,
            Request::Identify | Request::Describe | Request::Signals { .. } | Request::Settings | Request::Status
        )
    };
    assert!(!asked.is_empty() && asked.iter().all(reads), "{asked:?}");
}

#[test]
fn the_dry_run_says_whose_settings_it_used_and_uses_those_of_a_file() {
    let folder = folder_with(SPRING);
    let dry = ["run", "test.toml", "--dry-run"];
    damprig(&folder).args(dry).assert().success().stdout(contains("with the settings of a board as delivered"));
    std::fs::write(folder.path().join("board.toml"), "[spring]\nlargest_force_n = 4.0\ntouch_span_n = 0.5\n").unwrap();
    damprig(&folder)
        .args(dry)
        .args(["--rig", "virtual:board.toml"])
        .assert()
        .success()
        .stdout(contains("Checked with the settings of virtual at virtual:board.toml (from board.toml)."));
    std::fs::write(folder.path().join("board.toml"), "[spring]\nlargest_force_n = 1.2\ntouch_span_n = 0.1\n").unwrap();
    damprig(&folder)
        .args(dry)
        .args(["--rig", "virtual:board.toml"])
        .assert()
        .code(2)
        .stderr(contains("largest_force_n"));
}

#[test]
fn a_dwell_of_days_is_estimated_first_and_predicted_in_part() {
    let long = edited(SINE, "dwell_s = 2.6", "dwell_s = 1e6");
    let folder = folder_with(&edited(&long, "longest_dwell_s = 6", "longest_dwell_s = 1e6"));
    let begun = Instant::now();
    let output = damprig(&folder).args(["run", "test.toml", "--dry-run"]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{output:?}");
    let lines: Vec<&str> = told.lines().take(2).collect();
    assert!(lines[0].starts_with("Settings of virtual: as delivered: none were ever saved; |x| up to "), "{told}");
    assert_eq!(lines[1], "Campaign sine (test.toml): 4 points, about 46 days of rig time");
    let warned = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(warned.contains("long experiments are predicted in part only"), "{warned}");
    // Two seconds on a quiet machine; the whole would take hours.
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
}
