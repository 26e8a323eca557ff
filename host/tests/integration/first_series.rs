//! docs/FIRST_SERIES.md: its files are written and its commands are run in order, on the virtual rig.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use crate::common::{blocks, damprig, folder_with};
use tempfile::TempDir;

/// A monitor that says where its page is until it is stopped.
fn starts(folder: &TempDir, arguments: &[&str]) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    let mut monitor = command.args(arguments).current_dir(folder.path()).stderr(Stdio::piped()).spawn().unwrap();
    let told =
        BufReader::new(monitor.stderr.take().unwrap()).lines().map_while(Result::ok).any(|l| l.contains("http://"));
    monitor.kill().unwrap();
    monitor.wait().unwrap();
    assert!(told, "{arguments:?} tells no address");
}

#[test]
fn every_command_of_the_first_series_works_on_the_virtual_rig() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/FIRST_SERIES.md");
    let guide = std::fs::read_to_string(guide).unwrap();
    let folder = folder_with("");
    for file in blocks(&guide, "toml") {
        let name = file.lines().next().and_then(|line| line.strip_prefix("# ")).expect("the file's name");
        std::fs::write(folder.path().join(name), file).unwrap();
    }
    let commands: Vec<&str> = blocks(&guide, "sh").into_iter().flat_map(str::lines).collect();
    assert!(commands.len() > 8, "{commands:?}");
    for line in commands {
        let command = line.split('#').next().unwrap_or_default().trim().replace("--rig auto", "--rig virtual");
        let words: Vec<&str> = command.split(' ').collect();
        assert_eq!(words[0], "damprig", "{line}");
        match words[1] {
            // It needs a debug probe.
            "flash" => {}
            "monitor" => starts(&folder, &words[1..]),
            _ => drop(damprig(&folder).args(&words[1..]).assert().success()),
        }
    }
    // The structure was identified within what the text promises, from the sensors of the virtual rig.
    let identified: toml::Table =
        std::fs::read_to_string(folder.path().join("identified.toml")).unwrap().parse().unwrap();
    let structure = &identified["structure"];
    let [frequency, damping] = ["natural_frequency_hz", "damping_ratio"].map(|key| structure[key].as_float().unwrap());
    assert!((frequency - 2.5).abs() < 1e-4 && (damping - 0.004).abs() < 1e-5, "{structure}");
}
