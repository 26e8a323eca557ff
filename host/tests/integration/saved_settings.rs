//! What a board has saved: a drive that it does not act on is refused, any firmware's can be kept in a file and given back.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::process::Stdio;
use std::sync::Arc;

use crate::common::real_board::{Memory, board_with_memory, real_board};
use crate::common::{Fate, PATIENCE, Served, damprig, folder_with, manifest, short};
use assert_cmd::assert::Assert;
use damprig::client::backup::Backup;
use damprig_core::settings::{Settings, Source};
use damprig_device::settings_record::encode;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

/// One point on the bare structure, without waiting for rest.
fn campaign() -> String {
    short()
        .replace("frequencies_hz = [2.4, 2.5, 2.6]", "frequencies_hz = [2.5]\nset_ups = [\"bare\"]")
        .replace("start = \"from_rest\"", "start = \"carry_over\"")
}

fn of(folder: &TempDir, rig: &str, arguments: &[&str]) -> Assert {
    damprig(folder).args(arguments).args(["--rig", rig]).assert()
}

fn out(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).unwrap()
}

/// The limit that the lab has saved.
fn lab() -> Settings {
    let mut settings = Settings::default();
    settings.safety.limits.structure_m = 0.02;
    settings.calibration.x.zero_counts = 32_700.5;
    settings
}

/// A record of the last layout with the lab's settings.
fn last_layout() -> Vec<u8> {
    bytes(include_str!("../../../shared/device/tests/integration/layouts/last.hex"))
}

fn bytes(hexadecimal: &str) -> Vec<u8> {
    let text = hexadecimal.trim();
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect()
}

/// A board with protocol version 5 and the lab's limit, by frames that this firmware took and sent: its identity to the first
/// request, and its settings.
fn version_5() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let rig = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let [identity, request, reply] = [
            include_str!("version_5/identity.hex"),
            include_str!("version_5/request.hex"),
            include_str!("version_5/reply.hex"),
        ]
        .map(bytes);
        for stream in listener.incoming() {
            let (mut stream, mut frame, mut byte) = (stream.unwrap(), Vec::new(), [0]);
            while stream.read_exact(&mut byte).is_ok() {
                frame.push(byte[0]);
                if byte[0] != 0 {
                    continue;
                }
                // Identify, number 1: the bytes are those of the protocol's documentation but for the number.
                let answer = match &frame[..] {
                    [1, 2, 1, ..] => &identity[..],
                    other if *other == request => &reply[..],
                    _ => &[],
                };
                stream.write_all(answer).unwrap();
                frame.clear();
            }
        }
    });
    rig
}

/// The lab's record with another layout hash, and its checksum.
fn of_another_layout() -> Vec<u8> {
    let mut record = encode(3, &lab()).unwrap().to_vec();
    record[0] ^= 1;
    let end = 16 + u32::from_le_bytes(record[12..16].try_into().unwrap()) as usize;
    let checksum = damprig_protocol::upload::checksum(0, &record[..end]);
    record[end..end + 4].copy_from_slice(&checksum.to_le_bytes());
    record
}

#[test]
fn a_drive_on_damaged_settings_or_those_of_another_layout_needs_an_explicit_flag() {
    for (memory, words) in [
        (Memory::garbage(), "the stored settings are damaged"),
        (Memory::with(&of_another_layout()), "have a layout that this firmware does not know"),
    ] {
        let folder = folder_with(&campaign());
        let rig = board_with_memory(memory, false);
        let run = ["run", "test.toml", "--yes", "--out", "out"];
        let refused = of(&folder, &rig, &run).code(2);
        let first = out(&refused).lines().next().unwrap_or_default().to_string();
        assert!(first.contains(words) && first.contains("|x| up to 78 mm"), "{first}");
        refused
            .stderr(contains("--accept-settings").and(contains("settings restore")).and(contains("Nothing has moved")));
        assert!(!folder.path().join("out").exists());
        let dry = ["run", "test.toml", "--dry-run"];
        of(&folder, &rig, &dry).code(2).stderr(contains("--accept-settings"));
        of(&folder, &rig, &["calibrate", "drive"]).code(2).stderr(contains("this calibration is refused"));
        let set = ["settings", "set", "impacts.threshold_n=3"];
        of(&folder, &rig, &[&set[..], &["--save"]].concat()).code(2).stderr(contains("--accept-settings"));
        // Set without a save: what was saved does not act all the same.
        of(&folder, &rig, &set).success();
        of(&folder, &rig, &run).code(2).stderr(contains("--accept-settings"));
        of(&folder, &rig, &[&run[..], &["--accept-settings"]].concat()).success();
        let device = &manifest(&folder.path().join("out"))["device"];
        assert!(device["settings"]["source"].as_str().unwrap().contains(words), "{device}");
        let warnings = device["warnings"].to_string();
        assert!(warnings.contains("accepted for this run (--accept-settings)"), "{warnings}");
        // The consent was that run's alone.
        of(&folder, &rig, &["run", "test.toml", "--yes", "--out", "again"]).code(2);
        std::fs::write(folder.path().join("lab.toml"), damprig::settings::to_toml(&lab(), "")).unwrap();
        of(&folder, &rig, &["settings", "import", "lab.toml", "--save"]).success();
        let run = of(&folder, &rig, &["run", "test.toml", "--yes", "--out", "again"]).success();
        let first = out(&run).lines().next().unwrap().to_string();
        assert!(first.contains("stored; |x| up to 20 mm"), "{first}");
    }
}

#[test]
fn devices_and_monitor_say_in_their_first_line_which_settings_act() {
    let folder = folder_with("");
    let rig = board_with_memory(Memory::garbage(), false);
    let told = out(&of(&folder, &rig, &["devices"]).success());
    assert!(told.contains("settings as delivered or set since: the stored settings are damaged"), "{told}");
    let rig = board_with_memory(Memory::with(&encode(0, &lab()).unwrap()), false);
    let told = out(&of(&folder, &rig, &["devices"]).success());
    assert!(told.contains("settings stored; |x| up to 20 mm, |z| up to 78 mm, wall force up to 450 N"), "{told}");
    std::fs::write(folder.path().join("lab.toml"), damprig::settings::to_toml(&lab(), "")).unwrap();
    let told = out(&of(&folder, "virtual:lab.toml", &["devices"]).success());
    assert!(told.contains("settings from lab.toml; |x| up to 20 mm"), "{told}");
    let arguments = ["monitor", "--rig", &rig, "--listen", "127.0.0.1:0"];
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    let mut monitor = command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut first = String::new();
    BufReader::new(monitor.stdout.take().unwrap()).read_line(&mut first).unwrap();
    monitor.kill().unwrap();
    monitor.wait().unwrap();
    assert_eq!(first, "Settings of real: stored; |x| up to 20 mm, |z| up to 78 mm, wall force up to 450 N\n");
}

/// The reset of a board loses what is not saved, so a backup is of what is saved.
#[test]
fn saved_settings_of_a_firmware_with_another_protocol_are_kept_and_given_back() {
    let folder = folder_with("");
    let before = board_with_memory(Memory::with(&encode(7, &lab()).unwrap()), true);
    of(&folder, &before, &["settings", "export", "kept.toml"]).code(1).stderr(contains("has another protocol"));
    let told = out(&of(&folder, &before, &["settings", "backup", "kept.toml"]).success());
    assert!(told.contains("stored") && told.contains("written to kept.toml"), "{told}");
    let text = std::fs::read_to_string(folder.path().join("kept.toml")).unwrap();
    assert!(text.contains("schema abababababababab") && text.contains("# structure_m = 0.02"), "{text}");
    let after = board_with_memory(Memory::garbage(), false);
    let told = out(&of(&folder, &after, &["settings", "restore", "kept.toml"]).success());
    assert!(told.contains("restored, saved and verified") && told.contains("stored; |x| up to 20 mm"), "{told}");
    let told = out(&of(&folder, &after, &["settings", "restore", "kept.toml"]).success());
    assert!(told.contains("the board has these settings already"), "{told}");
}

/// `damprig flash` asks this before it writes: the reset afterwards loses what is not saved.
#[test]
fn a_firmware_is_not_replaced_while_the_settings_in_use_are_not_saved() {
    let folder = folder_with("");
    let rig = board_with_memory(Memory::with(&encode(0, &lab()).unwrap()), false);
    let before_update = || Backup::before_update(&rig.parse().unwrap(), PATIENCE);
    assert_eq!(before_update().unwrap().settings(), (lab(), Source::Stored));
    of(&folder, &rig, &["settings", "set", "impacts.threshold_n=3"]).success();
    let refused = before_update().unwrap_err();
    assert!(refused.contains("not saved") && refused.contains("damprig settings save"), "{refused}");
    of(&folder, &rig, &["settings", "save"]).success();
    assert!(before_update().is_ok());
}

#[test]
fn settings_of_the_last_layout_act_and_are_restored_in_this_one() {
    let folder = folder_with("");
    let before = board_with_memory(Memory::with(&last_layout()), false);
    let shown = out(&of(&folder, &before, &["settings", "show"]).success());
    assert!(shown.contains("stored by a firmware with the layout before"), "{shown}");
    assert!(shown.contains("structure_m = 0.02") && shown.contains("zero_counts = 32700.5"), "{shown}");
    of(&folder, &before, &["settings", "backup", "kept.toml"]).success();
    let after = board_with_memory(Memory::blank(), false);
    of(&folder, &after, &["settings", "restore", "kept.toml"])
        .success()
        .stdout(contains("restored, saved and verified"));
    let shown = out(&of(&folder, &after, &["settings", "show"]).success());
    assert!(shown.contains("(stored)") && shown.contains("structure_m = 0.02"), "{shown}");
}

#[test]
fn settings_of_a_firmware_from_before_backups_are_kept_and_given_back() {
    let folder = folder_with("");
    let rig = version_5();
    of(&folder, &rig, &["settings", "show"]).code(1).stderr(contains("device version 5"));
    let told = out(&of(&folder, &rig, &["settings", "backup", "kept.toml"]).success());
    assert!(told.starts_with("Settings of nucleo-g474re, firmware 0.1.0: stored\n"), "{told}");
    let after = board_with_memory(Memory::blank(), false);
    of(&folder, &after, &["settings", "restore", "kept.toml"]).success().stdout(contains("stored; |x| up to 20 mm"));
    let shown = out(&of(&folder, &after, &["settings", "show"]).success());
    assert!(shown.contains("date_days = 20574.0   # 2026-05-01"), "{shown}");
}

#[test]
fn a_backup_without_readable_settings_is_written_and_not_restored() {
    let folder = folder_with("");
    let rig = board_with_memory(Memory::with(&of_another_layout()), true);
    of(&folder, &rig, &["settings", "backup", "kept.toml"]).success().stdout(contains("(layout "));
    let other = board_with_memory(Memory::blank(), false);
    of(&folder, &other, &["settings", "restore", "kept.toml"])
        .code(2)
        .stderr(contains("kept.toml").and(contains("(layout ")));
    std::fs::write(folder.path().join("wrong.toml"), "[backup]\nboard = 3\n").unwrap();
    let refused = of(&folder, &other, &["settings", "restore", "wrong.toml"]).code(2);
    refused.stderr(contains("wrong.toml").and(contains("not a backup")).and(contains("damprig settings backup")));
    let none = of(&folder, &real_board(&Arc::default()), &["settings", "backup", "none.toml"]).code(1);
    none.stderr(contains("no settings memory").and(contains("DBANK")).and(contains("flash").not()));
    assert!(!folder.path().join("none.toml").exists());
}

#[test]
fn a_backup_is_practised_on_virtual_and_simulated_boards() {
    let folder = folder_with("");
    std::fs::write(folder.path().join("lab.toml"), damprig::settings::to_toml(&lab(), "")).unwrap();
    for (at, rig) in ["virtual:lab.toml", "virtual:realtime,lab.toml"].into_iter().enumerate() {
        let kept = format!("kept-{at}.toml");
        of(&folder, rig, &["settings", "backup", &kept]).success().stdout(contains("stored"));
        let board = Served::again_and_again(|_| Fate::Pass);
        let restored = of(&folder, &board, &["settings", "restore", &kept]).success();
        restored.stdout(contains("restored, saved and verified").and(contains("stored; |x| up to 20 mm")));
        of(&folder, &board, &["settings", "backup", &format!("again-{at}.toml")]).success();
        let again = Backup::read(&folder.path().join(format!("again-{at}.toml"))).unwrap();
        assert_eq!(again.settings(), (lab(), Source::Stored));
    }
    of(&folder, "virtual", &["settings", "backup", "blank.toml"]).success().stdout(contains("none were ever saved"));
}

/// One message, before the board is asked for anything.
#[test]
fn a_backup_with_nothing_to_restore_is_refused_once_with_what_is_wrong() {
    let folder = folder_with("");
    for (name, memory, words) in [
        ("blank.toml", Memory::blank(), "none were ever saved on that board"),
        ("damaged.toml", Memory::garbage(), "its records are damaged"),
        ("other.toml", Memory::with(&of_another_layout()), "restore them with the damprig of the firmware 0.0.0"),
    ] {
        of(&folder, &board_with_memory(memory, false), &["settings", "backup", name]).success();
        // There is no such board: it is not needed.
        let refused = of(&folder, "tcp:127.0.0.1:1", &["settings", "restore", name]).code(2).stdout("");
        let told = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
        assert_eq!(told.matches(words).count(), 1, "{told}");
        assert!(told.starts_with(&format!("error: {name}: the backup has no settings to restore")), "{told}");
        assert!(!told.contains("note:"), "{told}");
        for arguments in
            [&["settings", "import", name, "--rig", "virtual"][..], &["devices", "--rig", &format!("virtual:{name}")]]
        {
            let refused = damprig(&folder).args(arguments).assert().code(2);
            refused.stderr(contains("this is a backup").and(contains(format!("damprig settings restore {name}"))));
        }
    }
}

#[test]
fn settings_from_a_file_are_named_alike_by_every_command_and_an_import_of_the_same_changes_nothing() {
    let folder = folder_with("");
    std::fs::write(folder.path().join("lab.toml"), damprig::settings::to_toml(&lab(), "")).unwrap();
    for arguments in [&["settings", "show"][..], &["settings", "save"], &["devices"]] {
        let told = out(&of(&folder, "virtual:lab.toml", arguments).success());
        assert!(told.contains("from lab.toml") && !told.contains("stored"), "{told}");
    }
    of(&folder, "virtual:lab.toml", &["settings", "export", "again.toml"]).success();
    let exported = std::fs::read_to_string(folder.path().join("again.toml")).unwrap();
    assert!(exported.lines().next().unwrap().ends_with("(from lab.toml)"), "{exported}");
    let board = board_with_memory(Memory::with(&encode(0, &lab()).unwrap()), false);
    let told = out(&of(&folder, &board, &["settings", "import", "lab.toml"]).success());
    assert_eq!(told, "nothing changed: no setting differs from those in use\n");
    assert!(
        out(&of(&folder, &board, &["settings", "show"]).success()).contains("(stored)"),
        "they are stored as before"
    );
}
