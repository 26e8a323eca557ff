//! `damprig settings` with a simulated board that keeps running between the commands.

use crate::common::{Fate, Served, damprig, folder_with, manifest, short};
use assert_cmd::assert::Assert;
use tempfile::TempDir;

struct Board {
    rig: String,
    folder: TempDir,
}

impl Board {
    fn new() -> Self {
        Self { rig: Served::again_and_again(|_| Fate::Pass), folder: folder_with(&short()) }
    }

    fn settings(&self, arguments: &[&str]) -> Assert {
        damprig(&self.folder).arg("settings").args(arguments).args(["--rig", &self.rig]).assert()
    }

    fn shown(&self) -> String {
        out(self.settings(&["show"]).success())
    }
}

fn out(assert: Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).unwrap()
}

fn err(assert: Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).unwrap()
}

#[test]
fn a_changed_setting_acts_at_once_and_is_reported_as_unsaved() {
    let board = Board::new();
    assert!(board.shown().contains("as delivered"), "{}", board.shown());
    let told = out(board.settings(&["set", "spring.step_m=4e-6", "safety.wall_force_n=300"]).success());
    assert!(told.contains("spring.step_m: 5e-6 -> 4e-6") && told.contains("unless they are saved"), "{told}");
    let shown = board.shown();
    assert!(shown.contains("step_m = 4e-6") && shown.contains("changed, not stored"), "{shown}");
    let told = out(board.settings(&["save"]).success());
    assert!(
        told.starts_with("Settings of test: changed, not stored; ")
            && told.ends_with("wall force up to 300 N\nsaved\n")
    );
    assert!(board.shown().contains("(stored)"));
}

#[test]
fn an_exported_file_is_imported_by_another_board() {
    let (one, other) = (Board::new(), Board::new());
    one.settings(&[
        "set",
        "calibration.x.zero_counts=32000.5",
        "safety.limits.structure_m=0.07",
        "impacts.threshold_n=3",
    ])
    .success();
    one.settings(&["export", "rig.toml"]).success();
    let again = err(one.settings(&["export", "rig.toml"]).code(2));
    assert!(again.contains("rig.toml") && again.contains("move it away"), "{again}");
    let file = one.folder.path().join("rig.toml");
    let told = out(other.settings(&["import", file.to_str().unwrap(), "--save"]).success());
    assert!(told.contains("calibration.x.zero_counts: 32760.0 -> 32000.5") && told.contains("saved"), "{told}");
    let body = |text: String| text.lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join("\n");
    assert_eq!(body(other.shown()), body(one.shown()));
}

/// The laser's zero is off by 2 mm, so 78 mm on that side is at the rail.
#[test]
fn a_limit_outside_the_calibrated_sensor_range_is_refused() {
    let board = Board::new();
    let refused = err(board.settings(&["set", "calibration.x.zero_counts=32000.5"]).code(2));
    assert!(refused.contains("structure_m` = 0.078") && refused.contains("inside the usable span"), "{refused}");
    board.settings(&["set", "calibration.x.zero_counts=32000.5", "safety.limits.structure_m=0.076"]).success();
}

#[test]
fn wrong_settings_are_refused_with_what_is_allowed_and_change_nothing() {
    let board = Board::new();
    for (arguments, words) in [
        (&["set", "step_m=1e-6"][..], &["no setting `step_m`", "`spring.step_m`"][..]),
        (&["set", "spring.stepm=1e-6"], &["no setting `spring.stepm`", "`spring.step_m`"]),
        (&["set", "spring.step_m"], &["KEY=VALUE"]),
        (&["set", "spring.step_m=fast"], &["`spring.step_m` = fast", "a finite number"]),
        (&["set", "spring.step_m=-1"], &["`spring.step_m` = -1", "greater than 0"]),
        (&["set", "safety.limits.structure_m=0"], &["structure_m` = 0", "must be"]),
        (&["set", "impacts.ringing=2"], &["`impacts.ringing` = 2", "from 0 to 1"]),
        (&["import", "nowhere.toml"], &["nowhere.toml"]),
    ] {
        let told = err(board.settings(arguments).code(2));
        for word in words {
            assert!(told.contains(word), "{arguments:?}: no {word:?} in:\n{told}");
        }
    }
    std::fs::write(board.folder.path().join("wrong.toml"), "[spring]\nstep_mm = 1\n").unwrap();
    let told = err(board.settings(&["import", "wrong.toml"]).code(2));
    for word in ["wrong.toml:2", "unknown key `spring.step_mm`", "write `step_m = 0.001`"] {
        assert!(told.contains(word), "no {word:?} in:\n{told}");
    }
    assert!(board.shown().contains("as delivered"));
}

#[test]
fn the_settings_of_the_board_are_in_the_runs_manifest() {
    let board = Board::new();
    board.settings(&["set", "spring.step_m=4e-6"]).success();
    let run = ["run", "test.toml", "--out", "run", "--rig", &board.rig];
    damprig(&board.folder).args(run).assert().success();
    let device = &manifest(&board.folder.path().join("run"))["device"];
    assert_eq!(device["settings"]["source"], "changed, not stored");
    assert_eq!(device["settings"]["spring"]["step_m"], 4e-6);
    assert!(board.shown().contains("step_m = 4e-6"), "a run changed the settings");
}
