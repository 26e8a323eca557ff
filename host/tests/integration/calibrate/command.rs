//! The command with files: readings taken by other means, what is written, what is refused.

use crate::common::{damprig, folder_with, short};
use tempfile::TempDir;

fn run(folder: &TempDir, arguments: &[&str]) -> (i32, String, String) {
    let output = damprig(folder).args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

fn with(name: &str, text: &str) -> TempDir {
    let folder = folder_with(&short());
    std::fs::write(folder.path().join(name), text).unwrap();
    folder
}

/// 0.98 of the reference and 4 mm more, with a scatter of a few µm.
const X: &str =
    "reference_mm,reading_mm\n-60,-54.803\n-40,-35.198\n-20,-15.601\n0,4.004\n20,23.598\n40,43.199\n60,62.801\n";

#[test]
fn readings_of_other_means_give_a_file_that_a_board_imports_and_runs_with() {
    let folder = with("x.csv", X);
    let calibrate =
        ["calibrate", "x", "--readings", "x.csv", "--date", "2020-05-01", "--valid-days", "90", "--out", "x.toml"];
    let (code, out, err) = run(&folder, &calibrate);
    assert_eq!(code, 0, "{err}");
    for words in ["calibration.x.metres_per_count", "2.4420024e-6", "they differ", "linearity", "is lowered from 0.078"]
    {
        assert!(out.contains(words), "no {words:?} in:\n{out}");
    }
    let (code, _, err) = run(&folder, &calibrate);
    assert!(code == 2 && err.contains("--force"), "{err}");
    let (code, out, err) = run(&folder, &["settings", "import", "x.toml"]);
    assert!(code == 0 && out.contains("calibration.x.zero_counts: 32760.0 -> "), "{out}{err}");
    // The fragment is also the settings of a virtual board; its record has expired.
    let (code, out, err) = run(&folder, &["run", "test.toml", "--rig", "virtual:x.toml", "--dry-run"]);
    assert!(code == 0 && err.matches("calibration expired: x (").count() == 1, "{out}{err}");
    let (code, _, err) = run(&folder, &["run", "test.toml", "--rig", "virtual:x.toml", "--out", "run"]);
    assert!(code == 0 && err.contains("calibration expired: x ("), "{err}");
    let manifest = crate::common::manifest(&folder.path().join("run"));
    assert_eq!(manifest["device"]["settings"]["calibrated"]["x"]["date_days"], 18_383.0);
    let page = std::fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    assert!(page.contains("calibration expired: x ("));
    // Sensors that are simulated as they are set have no record, and nothing is said of them.
    let (_, _, err) = run(&folder, &["run", "test.toml", "--dry-run"]);
    assert!(!err.contains("calibrat"), "{err}");
}

#[test]
fn the_old_scale_is_that_of_the_settings_given() {
    let folder = with("counts.csv", "reference_mm,reading_counts\n-40,16000\n-20,24000\n0,32001\n20,40000\n40,48000\n");
    let gain = |more: &[&str]| {
        let arguments = [&["calibrate", "z", "--readings", "counts.csv", "--json"], more].concat();
        let (code, out, err) = run(&folder, &arguments);
        assert_eq!(code, 0, "{err}");
        let result: serde_json::Value = serde_json::from_str(&out).unwrap();
        (result["estimates"][0]["value"].as_f64().unwrap(), result["gain_over_old"].as_f64().unwrap())
    };
    let (value, over_old) = gain(&[]);
    assert!((value / 2.5e-6 - 1.0).abs() < 1e-4 && (over_old - 2.5 / 2.442).abs() < 1e-3, "{value} {over_old}");
    std::fs::write(folder.path().join("board.toml"), "calibration.z.metres_per_count = 2.5e-6\n").unwrap();
    let (value, over_old) = gain(&["--settings", "board.toml"]);
    assert!((value / 2.5e-6 - 1.0).abs() < 1e-4 && (over_old - 1.0).abs() < 1e-4, "{value} {over_old}");
}

#[test]
fn what_is_wrong_is_said_with_what_to_do() {
    let folder = with("x.csv", X);
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("metres.csv", X.replace("reference_mm", "reference_m"));
    write("few.csv", X.lines().take(4).collect::<Vec<_>>().join("\n"));
    write("reversed.csv", X.lines().enumerate().map(reversed).collect());
    write("outlier.csv", X.replace("20,23.598", "20,24.598"));
    write("typed.csv", X.replace("reading_mm", "reading_um"));
    for (arguments, words) in [
        (&["calibrate", "y"][..], &["must be one of x, z, match"][..]),
        (&["calibrate", "x", "--readings", "metres.csv"], &["line 2: reference_m = -60", "check the unit"]),
        (&["calibrate", "x", "--readings", "few.csv"], &["too few points for x: 3"]),
        (&["calibrate", "x", "--readings", "typed.csv"], &["in mm where m is meant"]),
        (&["calibrate", "x", "--readings", "reversed.csv"], &["reversed sign", "--reversed"]),
        (&["calibrate", "x", "--readings", "absent.csv"], &["absent.csv"]),
        (&["calibrate", "x", "--rig", "virtual"], &["simulated", "--rehearse"]),
        (&["calibrate", "x", "--rehearse", "1", "--at", "20,40,60,0"], &["--at 20", "write 20mm"]),
        (&["calibrate", "x", "--rehearse", "1", "--at", "20mm,40mm"], &["--at: 2 references", "at least 4"]),
        (&["calibrate", "x", "--rehearse", "1", "--rig", "serial:/dev/x"], &["--rehearse: it needs --rig virtual"]),
        (&["calibrate", "drive", "--rehearse", "1", "--at", "1mm"], &["--at: drive has no references"]),
    ] {
        let (code, out, err) = run(&folder, arguments);
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}: {err}");
        for word in words {
            assert!(err.contains(word), "{arguments:?}: no {word:?} in:\n{err}");
        }
    }
    let (code, out, _) = run(&folder, &["calibrate", "x", "--readings", "outlier.csv"]);
    assert!(code == 0 && out.contains("outlier: point 5 (+20.000 mm)"), "{out}");
    let save = ["calibrate", "x", "--readings", "outlier.csv", "--rig", "virtual", "--save"];
    let (code, out, err) = run(&folder, &save);
    assert!(code == 2 && out.contains("outlier: point 5") && err.contains("not saved: point 5"), "{out}{err}");
    let (code, _, err) = run(&folder, &[&save[..], &["--accept-outliers"]].concat());
    assert!(code == 0 && err.contains("saved on virtual"), "{err}");
}

/// A row with the reference's sign reversed.
fn reversed((place, line): (usize, &str)) -> String {
    if place == 0 {
        return format!("{line}\n");
    }
    let (reference, reading) = line.split_once(',').unwrap();
    format!("{},{reading}\n", -reference.parse::<f64>().unwrap())
}

/// Weights up and down on a sensor whose reading lags by 0.05 N on the way down.
#[test]
fn hysteresis_of_weights_is_shown() {
    let rows = "reference_n,reading_n\n0,0.01\n10,9.9\n20,19.79\n40,39.6\n20,19.84\n10,9.95\n0,0.06\n";
    let folder = with("spring.csv", rows);
    let (code, out, err) = run(&folder, &["calibrate", "spring", "--readings", "spring.csv"]);
    assert!(code == 0 && out.contains("hysteresis: 0.0500 ± 0.00"), "{out}{err}");
}

#[test]
fn a_rehearsal_keeps_its_readings_and_shows_the_question_of_every_point() {
    let folder = with("x.csv", X);
    let (code, out, err) = run(&folder, &["calibrate", "x", "--rehearse", "7", "--measure-s", "0.2", "--save"]);
    assert_eq!(code, 0, "{err}");
    assert!(err.contains("[7/7] Put the target of x at +60.000 mm"), "{err}");
    assert!(out.contains("Checked with the new settings: 60.00000 mm reads"), "{out}");
    let kept = std::fs::read_dir(folder.path()).unwrap().filter_map(Result::ok);
    let kept = kept.filter(|e| e.file_name().to_string_lossy().starts_with("calibrate-x-")).count();
    assert_eq!(kept, 1);
}
