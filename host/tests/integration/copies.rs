//! The copies of motion records in a run folder: each experiment is resumed and compared with its own, whatever the files are called,
//! in runs of today and of earlier versions.

use std::path::Path;

use damprig::run_folder::journal;
use damprig::run_folder::schema::journal_state::JournalState;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{damprig, folder_with, older_run, two_records};

const HEAD: &str = "name = \"two-records\"\n[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.02\n[[set_up]]\nname = \
                    \"bare\"\nbase_amplitude_m = 0.001\n";

const TELEMETRY: &str = "\n[telemetry]\nrate_hz = 1000\nsignals = [\"x\", \"z\"]\n";

const NOISE: &str = "\n[[experiment]]\nname = \"hiss\"\nkind = \"playback\"\nrepeats = 2\ntarget_peak_m = 0.002\nnoise = { seed = 7, from_hz = \
                     0.5, to_hz = 10, duration_s = 3 }\n";

pub(crate) fn folder(before: &str) -> TempDir {
    let folder = folder_with("");
    let records = two_records(folder.path(), &["bare"]);
    std::fs::write(folder.path().join("test.toml"), [HEAD, before, &records, TELEMETRY].concat()).unwrap();
    folder
}

fn state(run: &Path) -> JournalState {
    JournalState::of(&journal::read(run).unwrap().entries)
}

/// Experiment and largest |x| of each record, m.
fn peaks(run: &Path) -> Vec<(String, f32)> {
    state(run).transients().iter().map(|row| (row.experiment.clone(), row.max_abs_x_m)).collect()
}

/// Makes a complete run look as if it had been killed before its last record was measured.
fn cut_before_the_last_record(run: &Path) {
    let text = std::fs::read_to_string(run.join("journal.jsonl")).unwrap();
    let last = text.lines().position(|line| line.contains("\"entry\":\"segment\"") && line.contains("\"b\"")).unwrap();
    let kept: Vec<&str> = text.lines().take(last).filter(|line| !line.contains("\"entry\":\"sealed\"")).collect();
    std::fs::write(run.join("journal.jsonl"), kept.join("\n") + "\n").unwrap();
    for file in ["manifest.json", "transients.parquet", "samples.parquet"] {
        let _ = std::fs::remove_file(run.join(file));
    }
}

#[test]
fn each_playback_is_resumed_and_compared_with_its_own_record() {
    for before in ["", NOISE] {
        let folder = folder(before);
        damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
        let run = folder.path().join("out");
        let whole = peaks(&run);
        assert!(whole.len() == 3 + 2 * usize::from(!before.is_empty()), "{whole:?}");
        // The copies are all that is left.
        for original in ["a", "b"] {
            std::fs::remove_dir_all(folder.path().join(original)).unwrap();
        }
        let compared = damprig(&folder).args(["compare", "out", "--json"]).assert().success();
        let compared = String::from_utf8_lossy(&compared.get_output().stdout).into_owned();
        let verdicts = |word: &str| compared.matches(&format!("\"verdict\":\"{word}\"")).count();
        // At least three quantities of each playback.
        assert!(verdicts("agrees") >= 3 * whole.len() && verdicts("differs") == 0, "{compared}");
        damprig(&folder).args(["runs", "report", "out", "--force"]).assert().success();
        cut_before_the_last_record(&run);
        let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
        answer.stdout(contains("\"b\"").or(contains("points")));
        assert_eq!(peaks(&run), whole, "with {before:?} first");
        let begin = state(&run).begun[0].clone();
        let numbers: Vec<(String, Option<usize>)> =
            begin.records.iter().map(|copy| (copy.file.name.to_string(), copy.experiment)).collect();
        let expected: &[(&str, usize)] = if before.is_empty() {
            &[("records/1-quake.csv", 1), ("records/2-quake.csv", 2)]
        } else {
            &[("records/1-noise.csv", 1), ("records/2-quake.csv", 2), ("records/3-quake.csv", 3)]
        };
        assert_eq!(numbers, expected.iter().map(|(name, n)| (name.to_string(), Some(*n))).collect::<Vec<_>>());
    }
}

#[test]
fn a_copy_that_is_missing_or_another_one_is_refused() {
    let folder = folder("");
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let (run, copy) = (folder.path().join("out"), folder.path().join("out/records/2-quake.csv"));
    let own = std::fs::read(&copy).unwrap();
    let other = std::fs::read(run.join("records/1-quake.csv")).unwrap();
    // The originals are there: they are not used in place of a copy.
    let report = |words: &str| {
        let report = damprig(&folder).args(["runs", "report", "out", "--force"]).assert().code(1);
        report.stderr(contains(words));
    };
    for (change, words) in [(None, "records/2-quake.csv: cannot read it"), (Some(&other), "records/2-quake.csv: ")] {
        match change {
            None => std::fs::remove_file(&copy).unwrap(),
            Some(bytes) => std::fs::write(&copy, bytes).unwrap(),
        }
        damprig(&folder).args(["compare", "out"]).assert().code(1).stderr(contains(words));
        damprig(&folder).args(["runs", "verify", "out"]).assert().code(1).stdout(contains(words));
        report(words);
    }
    std::fs::write(&copy, own).unwrap();
    damprig(&folder).args(["compare", "out"]).assert().success();
    cut_before_the_last_record(&run);
    std::fs::write(&copy, other).unwrap();
    damprig(&folder).args(["run", "--resume", "out"]).assert().code(2).stderr(contains("records/2-quake.csv"));
}

#[test]
fn a_campaign_beside_files_named_as_copies_plays_its_own_files() {
    let folder = folder("");
    let copies = folder.path().join("records");
    std::fs::create_dir(&copies).unwrap();
    std::fs::copy(folder.path().join("b/quake.csv"), copies.join("1-quake.csv")).unwrap();
    std::fs::write(copies.join("set_up-own.toml"), "[structure]\ndamping_ratio = 0.5\n").unwrap();
    std::fs::write(folder.path().join("own.toml"), "[structure]\ndamping_ratio = 0.03\n").unwrap();
    let text = std::fs::read_to_string(folder.path().join("test.toml")).unwrap();
    let text = format!("set_up_file = \"own.toml\"\n{}", text.replace("damping_ratio = 0.02\n", ""));
    std::fs::write(folder.path().join("test.toml"), text).unwrap();
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let of = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(of("out/records/1-quake.csv"), of("a/quake.csv"));
    assert_eq!(of("out/records/set_up-own.toml"), of("own.toml"));
}

/// The campaign of a run folder is run again: with the copies, not with files that have the names of the originals.
#[test]
fn the_campaign_of_a_run_folder_is_run_again_with_its_copies() {
    let folder = folder("");
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    for original in ["a", "b"] {
        std::fs::remove_dir_all(folder.path().join(original)).unwrap();
    }
    damprig(&folder).args(["run", "out/campaign.toml", "--out", "again"]).assert().success();
    assert_eq!(peaks(&folder.path().join("again")), peaks(&folder.path().join("out")));
    damprig(&folder).args(["compare", "again"]).assert().success();
}

// In the older runs `a` was played twice and `b`; they were killed before `b` was measured (`killed`), and resumed by the version of then with
// the record of `a` in its place (`resumed`).

#[test]
fn an_older_run_is_resumed_compared_and_reported_with_its_own_records() {
    let folder = folder("");
    let text = std::fs::read_to_string(folder.path().join("test.toml")).unwrap();
    std::fs::write(folder.path().join("test.toml"), text.replace("rate_hz = 1000", "rate_hz = 100")).unwrap();
    damprig(&folder).args(["run", "test.toml", "--out", "whole"]).assert().success();
    let whole = peaks(&folder.path().join("whole"));
    let run = older_run(&folder, "killed");
    // The device is described by the version that measures.
    let now = state(&folder.path().join("whole")).begun[0].device.clone();
    let path = run.join("journal.jsonl");
    let lines = std::fs::read_to_string(&path).unwrap();
    let mut begin: serde_json::Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
    begin["device"] = serde_json::to_value(&now).unwrap();
    let rest: String = lines.lines().skip(1).map(|line| format!("{line}\n")).collect();
    std::fs::write(&path, format!("{begin}\n{rest}")).unwrap();
    damprig(&folder).args(["runs", "verify", "killed"]).assert().code(1).stdout(contains("damaged").not());
    damprig(&folder).args(["compare", "killed"]).assert().success();
    damprig(&folder).args(["run", "--resume", "killed"]).assert().success().stdout(contains("3 of 3 points"));
    let resumed = peaks(&run);
    assert_eq!(resumed.iter().map(|peak| &peak.0).collect::<Vec<_>>(), ["a 1 of 2", "a 2 of 2", "b"]);
    assert_eq!(resumed[2], whole[2], "b has its own record");
    damprig(&folder).args(["compare", "killed"]).assert().success();
    damprig(&folder).args(["runs", "report", "killed", "--force"]).assert().success();
    damprig(&folder).args(["runs", "verify", "killed"]).assert().success();
    // Resumed again by this version: the copies keep the numbers of their experiments.
    let numbers: Vec<_> = state(&run).begun[1].records.iter().map(|copy| copy.experiment).collect();
    assert_eq!(numbers, [Some(1), None, Some(2)]);
}

#[test]
fn an_older_run_that_may_have_played_another_record_is_not_compared() {
    let folder = folder("");
    let run = older_run(&folder, "resumed");
    let peaks = peaks(&run);
    assert!(
        (peaks[2].1 / peaks[0].1 - 0.5).abs() < 1e-3,
        "b was played with the record of a, at half its peak: {peaks:?}"
    );
    let words =
        "records/3-quake.csv or records/2-quake.csv: an earlier version resumed the run and may have played either";
    damprig(&folder).args(["compare", "resumed"]).assert().code(1).stderr(contains(words));
    damprig(&folder).args(["runs", "verify", "resumed"]).assert().code(1).stdout(contains(words));
    damprig(&folder).args(["runs", "show", "resumed"]).assert().success();
    damprig(&folder).args(["runs", "export", "resumed", "--format", "csv", "--out", "t.csv"]).assert().success();
}

/// A run that was killed before the beginning of its journal was written has its copies; their names tell how they are numbered.
#[test]
fn a_run_without_the_beginning_of_its_journal_has_its_copies_or_is_refused() {
    let folder = folder("");
    damprig(&folder).args(["run", "test.toml", "--out", "whole"]).assert().success();
    let copies = |folder: &TempDir, run: &str, names: &[(&str, &str)]| {
        std::fs::create_dir_all(folder.path().join(run).join("records")).unwrap();
        std::fs::copy(folder.path().join("test.toml"), folder.path().join(run).join("campaign.toml")).unwrap();
        for (original, copy) in names {
            let to = folder.path().join(run).join("records").join(copy);
            std::fs::copy(folder.path().join(original).join("quake.csv"), to).unwrap();
        }
    };
    copies(&folder, "today", &[("a", "1-quake.csv"), ("b", "2-quake.csv")]);
    copies(&folder, "earlier", &[("a", "1-quake.csv"), ("a", "2-quake.csv"), ("b", "3-quake.csv")]);
    copies(&folder, "neither", &[("a", "1-quake.csv"), ("b", "3-quake.csv")]);
    for run in ["today", "earlier"] {
        damprig(&folder).args(["run", "--resume", run]).assert().success();
        assert_eq!(peaks(&folder.path().join(run)), peaks(&folder.path().join("whole")), "{run}");
        damprig(&folder).args(["compare", run]).assert().success();
    }
    let words = "neither/records does not have the copies of the records that the campaign plays and no others";
    damprig(&folder).args(["run", "--resume", "neither"]).assert().code(2).stderr(contains(words));
}
