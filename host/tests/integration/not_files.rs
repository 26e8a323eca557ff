//! A folder, a pipe or a device in place of a file is refused at once, by name.
#![cfg(unix)]

use std::path::Path;
use std::process::Command as Tool;

use crate::common::{PATIENCE, damprig, folder_with, short};
use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

/// A command that waits forever fails the test.
fn patient(folder: &TempDir, arguments: &[&str]) -> Command {
    let mut command = damprig(folder);
    command.args(arguments).timeout(PATIENCE);
    command
}

fn pipe(path: &Path) {
    assert!(Tool::new("mkfifo").arg(path).status().expect("mkfifo").success());
}

#[test]
fn every_command_refuses_a_pipe_a_folder_or_a_device_as_a_file() {
    let folder = folder_with(&short());
    let at = |name: &str| folder.path().join(name);
    pipe(&at("pipe.toml"));
    std::fs::create_dir(at("folder.toml")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", at("device.toml")).unwrap();
    for (file, kind) in [("pipe.toml", "a pipe"), ("folder.toml", "a folder"), ("device.toml", "a device")] {
        let commands: [&[&str]; 4] =
            [&["run", file], &["run", file, "--dry-run"], &["simulate", file], &["settings", "import", file]];
        for command in commands {
            patient(&folder, command)
                .assert()
                .code(2)
                .stderr(contains(format!("cannot read {file}: this is {kind}, not a regular file")));
        }
    }
}

#[test]
fn a_pipe_as_a_record_is_refused_in_campaigns_and_cases() {
    let folder = folder_with(&short());
    pipe(&folder.path().join("quake.csv"));
    let shipped = |name: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        std::fs::read_to_string(path).expect("a shipped file")
    };
    let case = shipped("cases/record.toml").replace("shake.csv", "quake.csv");
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    let campaign = shipped("campaigns/transients.toml").replace("records/synthetic.csv", "quake.csv");
    std::fs::write(folder.path().join("test.toml"), campaign).unwrap();
    for command in [["simulate", "case.toml"], ["run", "test.toml"]] {
        patient(&folder, &command).assert().code(2).stderr(contains("quake.csv: this is a pipe, not a regular file"));
    }
}

#[test]
fn a_run_folder_as_a_campaign_names_the_campaign_in_it() {
    let folder = folder_with(&short());
    std::fs::create_dir(folder.path().join("out")).unwrap();
    std::fs::write(folder.path().join("out/campaign.toml"), short()).unwrap();
    patient(&folder, &["run", "out", "--dry-run"])
        .assert()
        .code(2)
        .stderr(contains("this is a folder, not a regular file").and(contains("did you mean out/campaign.toml?")));
}

#[test]
fn a_file_that_is_too_large_is_refused_before_reading() {
    let folder = folder_with(&short());
    // A sparse file.
    let file = std::fs::File::create(folder.path().join("large.toml")).unwrap();
    file.set_len(1 << 40).unwrap();
    patient(&folder, &["run", "large.toml"]).assert().code(2).stderr(contains("it holds more than the 256 MiB"));
}
