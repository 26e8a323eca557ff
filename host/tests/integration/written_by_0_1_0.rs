//! Files that damprig 0.1.0 wrote, in `tests/written_by_0_1_0`, are opened and give the numbers that they gave then.

use std::path::Path;

use damprig::quantity::Quantity;
use damprig::study::table::StudyTable;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{copy_folder, damprig};

/// A copy of the files: commands may write beside them.
fn files() -> TempDir {
    let folder = TempDir::new().unwrap();
    copy_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/written_by_0_1_0"), &folder.path().join("kept"));
    folder
}

/// What a command prints; it must succeed.
fn said(folder: &TempDir, arguments: &[&str]) -> String {
    let output = damprig(folder).current_dir(folder.path().join("kept")).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn has(text: &str, words: &[&str]) {
    for words in words {
        assert!(text.contains(words), "{words:?} in {text}");
    }
}

fn read(folder: &TempDir, name: &str) -> String {
    std::fs::read_to_string(folder.path().join("kept").join(name)).unwrap()
}

fn table(folder: &TempDir, name: &str) -> StudyTable {
    let bytes = std::fs::read(folder.path().join("kept").join(name)).unwrap();
    StudyTable::read(name, bytes.into()).unwrap()
}

#[test]
fn a_run_is_shown_verified_and_reported_with_its_numbers() {
    let folder = files();
    has(&said(&folder, &["runs", "verify", "run"]), &["as damprig wrote it", "8 of 8 files", "883 rows can be read"]);
    let numbers = ["4.217", "3.922", "-1.781", "3.099", "19.998", "4.170", "0.09009", "2.3163", "883 rows"];
    has(&said(&folder, &["runs", "show", "run"]), &numbers);
    said(&folder, &["runs", "report", "run", "--out", "page.html"]);
    has(&read(&folder, "page.html"), &["Hybrid (SPID + FD)", "4.217", "0.09009"]);
}

#[test]
fn the_tables_of_a_run_are_exported_with_the_values_of_then_under_the_present_names() {
    let folder = files();
    for (what, to_s) in [("results", "inf"), ("transients", "inf"), ("impacts", "inf"), ("samples", "0.5")] {
        said(
            &folder,
            &[
                "runs", "export", "run", "--format", "csv", "--what", what, "--to-s", to_s, "--out", "now.csv",
                "--force",
            ],
        );
        let then = read(&folder, &format!("exported/{what}.csv"));
        assert!(then.lines().count() > 1, "{what}");
        let now = read(&folder, "now.csv");
        assert!(then.lines().skip(1).eq(now.lines().skip(1)), "{what}");
        // A name, and the unit in brackets.
        let present = |column: &str| {
            let (name, unit) = column.split_once(' ').unwrap_or((column, ""));
            (Quantity::formerly(name).map_or_else(|| name.to_string(), |own| own.name().to_string()), unit.to_string())
        };
        let head = |text: &str| text.lines().next().unwrap().split(',').map(present).collect::<Vec<_>>();
        assert_eq!(head(&now), head(&then), "{what}");
    }
}

#[test]
fn the_measured_values_of_a_run_are_compared() {
    let folder = files();
    let compared: Value = serde_json::from_str(&said(&folder, &["compare", "run", "--json"])).unwrap();
    let text = compared.to_string();
    // Seven quantities of each point and five of the free vibration.
    assert_eq!(text.matches("\"verdict\":").count() - text.matches("\"verdict\":null").count(), 19, "{text}");
    has(&text, &["4.217", "3.098"]);
}

#[test]
fn a_study_is_verified_and_its_parts_make_the_table_of_then() {
    let folder = files();
    let study = |action: &str, out: &str| said(&folder, &["study", action, "study.toml", "--out", out]);
    has(&study("verify", "study"), &["3 of 3 parts are right", "1 files are as they were written"]);
    has(&study("status", "shards"), &["2 of 3 parts done, 1 missing"]);
    let then = table(&folder, "study/table.parquet");
    std::fs::remove_file(folder.path().join("kept/study/table.parquet")).unwrap();
    has(&study("merge", "study"), &["smallest x_over_z: 2.98456"]);
    let joined = table(&folder, "study/table.parquet");
    let values = |table: &StudyTable| table.columns().iter().map(|name| table.column(name)).collect::<Vec<_>>();
    assert_eq!(values(&joined), values(&then));
    let columns = [
        "row",
        "particle.clearance_ratio",
        "friction_damper.friction_ratio",
        "x_over_z",
        "impacts_per_cycle",
        "unresolved",
    ];
    assert_eq!(joined.columns(), columns);
    assert_eq!(
        joined.column("x_over_z").unwrap(),
        [
            5.5244066362432065,
            2.984560409084385,
            5.137082667955427,
            3.503794506272791,
            4.645103417585735,
            5.825569470364456
        ]
    );
}

#[test]
fn a_share_of_a_study_is_completed() {
    let folder = files();
    has(&said(&folder, &["study", "work", "study.toml", "--out", "shards", "--shard", "2/2"]), &["part 1 of 3"]);
    has(&said(&folder, &["study", "merge", "study.toml", "--out", "shards"]), &["6 rows"]);
    let [now, then] = ["shards", "study"].map(|out| table(&folder, &format!("{out}/table.parquet")));
    assert_eq!(now.columns(), then.columns());
    let kept = |table: &StudyTable| [0, 1, 4, 5].map(|row| table.column("x_over_z").unwrap()[row]);
    assert_eq!(kept(&now), kept(&then), "the rows of the share that was there");
}

#[test]
fn the_tables_of_an_optimisation_have_the_answer() {
    let folder = files();
    let json = |name: &str| serde_json::from_str::<Value>(&read(&folder, name)).unwrap();
    let answer = json("optimum/answer.json");
    assert_eq!(answer["objective"], 4.826149902816391);
    let evaluated = table(&folder, "optimum/evaluations.parquet");
    let least = evaluated.column("max_x_over_z").unwrap().into_iter().fold(f64::INFINITY, f64::min);
    assert_eq!(least, 4.717019504195386);
    assert_eq!((evaluated.rows(), answer["evaluations"].as_u64()), (1908, Some(1908)));
    assert_eq!(evaluated.words("stage").unwrap()[0], "sobol");
    // An optimisation of today, of a shorter record, has the same tables, and every key.
    let shorter = read(&folder, "optimisation.toml").replace("duration_s = 4", "duration_s = 0.4");
    std::fs::write(folder.path().join("kept/shorter.toml"), shorter).unwrap();
    said(&folder, &["optimise", "shorter.toml", "--out", "now"]);
    for name in ["evaluations.parquet", "neighbourhood.parquet"] {
        let [now, then] =
            ["now", "optimum"].map(|folder_name| table(&folder, &format!("{folder_name}/{name}")).columns());
        assert_eq!(now, then, "{name}");
    }
    let now = json("now/answer.json");
    for key in answer.as_object().unwrap().keys() {
        assert!(now.get(key).is_some(), "{key} in {now}");
    }
}

#[test]
fn settings_a_backup_and_a_calibration_are_taken() {
    let folder = files();
    let body = |text: &str| text.lines().skip(1).collect::<Vec<_>>().join("\n");
    let shown = said(&folder, &["settings", "show", "--rig", "virtual:settings.toml"]);
    has(&shown, &["structure_m = 0.06", "half_cycles_ahead = 4.0"]);
    assert_eq!(body(&shown), body(&read(&folder, "settings.toml")));
    has(&said(&folder, &["settings", "restore", "backup.toml"]), &["up to 60 mm", "restored, saved and verified"]);
    said(&folder, &["settings", "import", "calibrated.toml"]);
    let again = said(&folder, &["calibrate", "x", "--readings", "readings.csv"]);
    has(&again, &["2.46469e-6 ± 2e-10", "32782.7 ± 1.3", "0.0117 mm off the line"]);
}

#[test]
fn campaign_case_study_and_optimisation_are_read() {
    let folder = files();
    has(&said(&folder, &["run", "campaign.toml", "--dry-run"]), &["│ hybrid ┆", "release"]);
    has(&said(&folder, &["study", "run", "study.toml", "--dry-run"]), &["6 points"]);
    has(&said(&folder, &["optimise", "optimisation.toml", "--dry-run"]), &["1 variable"]);
    let case: Value = serde_json::from_str(&said(&folder, &["simulate", "case.toml", "--json"])).unwrap();
    assert_eq!(case["case"]["set_up"]["friction_damper"]["force_n"], 0.2368705056261445);
    assert_eq!(case["case"]["duration_s"], 8.0);
}
