//! A person at the command: prompts, typing errors, repeated points, Ctrl-C. The board is a simulated one that calls itself real;
//! what its sensor of x reads follows from the number of readings.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use damprig_protocol::{FromDevice, PlantKind, Reply};
use tempfile::TempDir;

use crate::common::{Fate, Served, damprig, folder_with};

/// Gain and zero of the sensor: its reading of a position.
fn reading_m(position_m: f32) -> f32 {
    4e-3 + 0.98 * position_m
}

/// A board whose x reads these positions, mm, one after the other; each reading begins with a status request.
fn board(positions_mm: &'static [f32]) -> String {
    // The rig is brought to idle with one status request.
    let (mut asked, mut latest) = (-1_i32, None);
    Served::again_and_again(move |message| {
        match message {
            FromDevice::Reply { answer: Ok(Reply::Identity(_)), .. } => asked = -1,
            // On a slow machine a request is repeated.
            FromDevice::Reply { seq, answer: Ok(Reply::Status { .. }) } if latest != Some(*seq) => {
                latest = Some(*seq);
                asked += 1;
            }
            _ => {}
        }
        let mut message = message.clone();
        match &mut message {
            FromDevice::Reply { answer: Ok(Reply::Description(description)), .. } => {
                description.plant = PlantKind::Real
            }
            FromDevice::Telemetry(rows) => {
                let place = usize::try_from(asked - 1).unwrap_or(0).min(positions_mm.len() - 1);
                // Neighbouring values differ: a sensor has noise.
                let noise = |n: usize| if n.is_multiple_of(2) { 2e-6 } else { -2e-6 };
                let value = reading_m(positions_mm[place] * 1e-3);
                rows.values.iter_mut().enumerate().for_each(|(n, v)| *v = value + noise(n));
            }
            _ => return Fate::Pass,
        }
        Fate::Replace(Box::new(message))
    })
}

fn calibrate(folder: &TempDir, rig: &str, more: &[&str], typed: &str) -> (i32, String, String) {
    let arguments = ["calibrate", "x", "--measure-s", "0.2", "--keep", "kept.csv", "--rig", rig];
    let output = damprig(folder).args(arguments).args(more).write_stdin(typed).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_typing_error_is_told_and_a_point_is_repeated() {
    let folder = folder_with("");
    // The third reading is taken before the target was moved, and repeated.
    let rig = board(&[-60.0, -40.0, -40.0, -20.0, 0.0, 20.0, 41.0, 60.0]);
    let typed = "\n\n\nr\n\n\n20\n20mm\n41mm\n\n";
    let (code, out, err) = calibrate(&folder, &rig, &["--json"], typed);
    assert_eq!(code, 0, "{err}");
    for words in ["Put the target of x at +20.000 mm, then press Enter", "write 20mm", "readings kept in kept.csv"] {
        assert!(err.contains(words), "no {words:?} in:\n{err}");
    }
    let result: serde_json::Value = serde_json::from_str(&out).unwrap();
    let references: Vec<i64> = result["points"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| (p["reference"].as_f64().unwrap() * 1e3).round() as i64)
        .collect();
    assert_eq!(references, [-60, -40, -20, 0, 20, 41, 60]);
    let change = result["gain_over_old"].as_f64().unwrap();
    // The noise alternates, so its mean is zero; f32 rounds to 4e-9 of 0.06.
    assert!((change - 1.0 / 0.98).abs() < 1e-6, "{change}");
    // The kept file gives the same.
    let again = damprig(&folder).args(["calibrate", "x", "--readings", "kept.csv", "--json"]).output().unwrap();
    let again: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(again["gain_over_old"], result["gain_over_old"]);
}

#[test]
fn only_save_changes_the_board_and_a_point_is_measured_once_more() {
    let folder = folder_with("");
    let rig = board(&[-60.0, -40.0, -20.0, 0.0, 20.0, 40.0, 60.0, 60.0]);
    let shown = || {
        let output = damprig(&folder).args(["settings", "show", "--rig", &rig]).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let before = shown();
    let (code, out, err) = calibrate(&folder, &rig, &["--date", "2026-05-01"], &"\n".repeat(7));
    assert!(code == 0 && out.contains("Nothing on the board has changed"), "{out}{err}");
    assert_eq!(shown(), before);
    std::fs::remove_file(folder.path().join("kept.csv")).unwrap();
    let (code, out, err) = calibrate(&folder, &rig, &["--date", "2026-05-01", "--save"], &"\n".repeat(8));
    assert!(code == 0 && err.contains("saved on"), "{out}{err}");
    assert!(out.contains("Checked with the new settings"), "{out}");
    let after = shown();
    for words in ["(stored)", "date_days = 20574.0   # 2026-05-01", "valid_days = 365.0", "structure_m = 0.0755"] {
        assert!(after.contains(words), "no {words:?} in:\n{after}");
    }
}

#[test]
fn an_outlier_is_measured_again_or_not_saved() {
    let folder = folder_with("");
    let rig = board(&[-60.0, -40.0, -20.01, 3.0, 20.01, 40.01, 60.0, 0.0]);
    let (code, out, err) = calibrate(&folder, &rig, &[], &"\n".repeat(8));
    assert!(code == 0 && err.contains("point 4 (+0.000 mm) lies") && !out.contains("outlier"), "{out}{err}");
    std::fs::remove_file(folder.path().join("kept.csv")).unwrap();
    let rig = board(&[-60.0, -40.0, -20.01, 3.0, 20.01, 40.01, 60.0]);
    let (code, out, err) = calibrate(&folder, &rig, &["--save"], &("\n".repeat(7) + "s\n"));
    assert!(code == 1 && err.contains("not saved: point 4") && err.contains("--accept-outliers"), "{out}{err}");
    assert!(folder.path().join("kept.csv").exists());
}

#[test]
fn a_target_that_never_moved_is_no_calibration_and_its_readings_are_kept() {
    let folder = folder_with("");
    let rig = board(&[10.0]);
    let (code, out, err) = calibrate(&folder, &rig, &[], &"\n".repeat(7));
    assert_eq!((code, out.as_str()), (1, ""), "{err}");
    assert!(err.contains("do not follow the references") && err.contains("--readings kept.csv"), "{err}");
}

#[test]
fn the_end_of_the_answers_leaves_the_board_and_keeps_what_was_taken() {
    let folder = folder_with("");
    let rig = board(&[-60.0, -40.0, -20.0]);
    let (code, _, err) = calibrate(&folder, &rig, &["--save"], "\n\n\n");
    assert!(code == 130 && err.contains("settings of before") && err.contains("kept.csv"), "{err}");
    let kept = std::fs::read_to_string(folder.path().join("kept.csv")).unwrap();
    assert_eq!(kept.lines().count(), 4, "{kept}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_at_a_prompt_leaves_the_board_and_keeps_what_was_taken() {
    let folder = folder_with("");
    let rig = board(&[-60.0, -40.0]);
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    command.args(["calibrate", "x", "--measure-s", "0.2", "--keep", "kept.csv", "--save", "--rig", &rig]);
    let pipes = command.current_dir(folder.path()).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut process = pipes.spawn().unwrap();
    let mut stdin = process.stdin.take().unwrap();
    stdin.write_all(b"\n").unwrap();
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map_while(Result::ok);
    // The first reading is told; the prompt after it has no end of line.
    assert!(lines.any(|line| line.contains("reads -54.8")));
    let pid = process.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let told: String = lines.collect();
    assert_eq!(process.wait().unwrap().code(), Some(130), "{told}");
    assert!(told.contains("settings of before") && told.contains("kept.csv"), "{told}");
    let shown = damprig(&folder).args(["settings", "show", "--rig", &rig]).output().unwrap();
    assert!(String::from_utf8_lossy(&shown.stdout).contains("as delivered"));
}
