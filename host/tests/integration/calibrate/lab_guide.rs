//! docs/LAB_GUIDE.md, section Calibration: its commands are run in order, as rehearsals on the virtual rig.

use std::path::Path;

use crate::common::{blocks, damprig, folder_with};

#[test]
fn every_command_of_the_calibration_works_on_the_virtual_rig() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/LAB_GUIDE.md");
    let guide = std::fs::read_to_string(guide).unwrap();
    let section = guide.split("\n## Calibration\n").nth(1).and_then(|rest| rest.split("\n## ").next()).unwrap();
    let folder = folder_with("");
    let [table] = blocks(section, "csv")[..] else { panic!("one table of readings") };
    std::fs::write(folder.path().join("by-hand.csv"), table).unwrap();
    let commands: Vec<&str> = blocks(section, "sh").into_iter().flat_map(str::lines).collect();
    let mut channels = Vec::new();
    for line in &commands {
        let command = line.split('#').next().unwrap_or_default().trim();
        let is_rehearsed = command.starts_with("damprig calibrate") && command.contains("--rig auto");
        let command = command.replace("--rig auto", if is_rehearsed { "--rehearse 1" } else { "--rig virtual" });
        let words: Vec<&str> = command.split(' ').collect();
        assert_eq!(words[0], "damprig", "{line}");
        damprig(&folder).args(&words[1..]).assert().success();
        channels.extend(is_rehearsed.then(|| words[2].to_string()));
    }
    let all = damprig::calibrate::Channel::ALL.map(|channel| channel.name().to_string());
    assert_eq!(channels, all, "a channel is missing in the guide");
    // What was written is what a board imports.
    for channel in all {
        let file = format!("{channel}.toml");
        let imported = damprig(&folder).args(["settings", "import", &file]).assert().success();
        let told = String::from_utf8_lossy(&imported.get_output().stdout).into_owned();
        assert!(told.contains(&format!("calibrated.{}.date_days: 0.0 -> ", channel.replace('-', "_"))), "{told}");
    }
}
