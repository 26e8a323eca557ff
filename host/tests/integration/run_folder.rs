//! Resuming in a run folder that was changed meanwhile: ambiguous files are refused, and no file that the journal does not
//! list is joined, overwritten or removed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::common::{PATIENCE, cut_off, damprig, manifest, result_rows, sample_rows, short};
use damprig::run_folder::RunFolder;
use damprig::run_folder::journal::{self, JOURNAL, Journal};
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::write::OutputFolder;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

/// Every file of a folder with its content.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
        if entry.is_dir() {
            all.extend(contents(&entry));
        } else {
            let bytes = std::fs::read(&entry).unwrap();
            all.insert(entry, bytes);
        }
    }
    all
}

/// Resuming must be refused with these words and must change nothing.
fn refuses(folder: &TempDir, words: &[&str]) {
    let run = folder.path().join("out");
    let before = contents(&run);
    let mut answer = damprig(folder).args(["run", "--resume", "out"]).assert().code(2);
    for word in words {
        answer = answer.stderr(contains(*word));
    }
    assert!(contents(&run) == before, "a refusal changed the folder");
}

fn journal_lines(run: &Path) -> Vec<String> {
    std::fs::read_to_string(run.join(JOURNAL)).unwrap().lines().map(|l| format!("{l}\n")).collect()
}

fn write_journal(run: &Path, lines: &[String]) {
    std::fs::write(run.join(JOURNAL), lines.concat()).unwrap();
}

/// Changes the manifest to that of a killed run.
fn as_if_killed(run: &Path) {
    let mut value = manifest(run);
    value["status"] = "running".into();
    value["points_taken"] = 0.into();
    value["files"] = serde_json::json!([]);
    std::fs::write(run.join("manifest.json"), value.to_string()).unwrap();
}

#[test]
fn a_journal_that_was_emptied_or_cut_is_refused_and_nothing_is_overwritten() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let lines = journal_lines(&run);
    let to_do = "keep this folder and start a new run";
    write_journal(&run, &[]);
    refuses(&folder, &["manifest.json: 3 points taken", to_do]);
    as_if_killed(&run);
    refuses(&folder, &["samples.parts/000001.parquet", "results.parquet: 3 of its 3 points", to_do]);
    let half = lines.iter().position(|l| l.contains("\"entry\":\"result\"")).unwrap() + 1;
    write_journal(&run, &lines[..half]);
    refuses(&folder, &["results.parquet: 2 of its 3 points", "(1 points)"]);
    std::fs::remove_file(run.join("results.parquet")).unwrap();
    refuses(&folder, &["samples.parts/000003.parquet: a part of the samples"]);
    std::fs::remove_file(run.join("manifest.json")).unwrap();
    std::fs::remove_dir_all(run.join("samples.parts")).unwrap();
    std::fs::remove_file(run.join(JOURNAL)).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out", "--rig", "virtual"]).assert().success();
    answer.stdout(contains("0 of 6 points are kept"));
}

#[test]
fn files_of_another_run_are_not_joined_overwritten_or_removed() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let part = run.join("samples.parts/000001.parquet");
    let stranger = run.join("samples.parts/000099.parquet");
    std::fs::copy(&part, &stranger).unwrap();
    refuses(&folder, &["samples.parts/000099.parquet: a part of the samples", "move them elsewhere"]);
    std::fs::rename(&stranger, run.join("samples.parquet")).unwrap();
    refuses(&folder, &["samples.parquet: samples of a complete run"]);
    std::fs::remove_file(run.join("samples.parquet")).unwrap();
    let unreadable = run.join("samples-000099.open.arrows");
    std::fs::write(&unreadable, "no stream").unwrap();
    let beside = run.join("samples.parts/notes.txt");
    std::fs::write(&beside, "mine").unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    answer.stdout(
        contains("warning: samples-000099.open.arrows: ").and(contains("the first 0 of its 9 bytes are sound")),
    );
    assert_eq!(std::fs::read(run.join("samples-000099.damaged.arrows")).unwrap(), b"no stream");
    assert_eq!(std::fs::read(&beside).unwrap(), b"mine");
    assert_eq!((result_rows(&run), part.exists()), (6, false));
}

#[test]
fn a_run_killed_between_joining_and_its_journal_line_keeps_a_file_of_another_run() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let parts = folder.path().join("parts");
    std::fs::create_dir(&parts).unwrap();
    // The run is completed and joined; then the parts are restored and the journal's last lines removed.
    let kept = contents(&run.join("samples.parts"));
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    let rows = sample_rows(&run);
    let taken = JournalState::of(&journal::read(&run).unwrap().entries);
    let lines = journal_lines(&run);
    let joined = lines.iter().position(|l| l.contains("\"entry\":\"joined\"")).unwrap();
    let known: Vec<String> = lines[..joined]
        .iter()
        .filter(|l| {
            !l.contains("\"entry\":\"sealed\"")
                || kept.keys().any(|p| l.contains(p.file_name().unwrap().to_str().unwrap()))
        })
        .cloned()
        .collect();
    assert!(taken.sealed.len() > kept.len());
    write_journal(&run, &known);
    std::fs::create_dir(run.join("samples.parts")).unwrap();
    kept.iter().for_each(|(path, bytes)| std::fs::write(path, bytes).unwrap());
    as_if_killed(&run);
    // The parts have fewer rows than the existing file, so it is of another run.
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(1);
    answer.stderr(contains("differs from the joined samples.parts"));
    assert_eq!(sample_rows(&run), rows, "the file was overwritten");
    // Without that file the parts are joined; after a second kill at the same place the file is the run's own.
    std::fs::remove_file(run.join("samples.parquet")).unwrap();
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    let own = std::fs::read(run.join("samples.parquet")).unwrap();
    write_journal(&run, &known);
    std::fs::create_dir(run.join("samples.parts")).unwrap();
    kept.iter().for_each(|(path, bytes)| std::fs::write(path, bytes).unwrap());
    as_if_killed(&run);
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    assert_eq!(std::fs::read(run.join("samples.parquet")).unwrap(), own);
    assert!(!run.join("samples.parts").exists());
}

#[test]
fn a_manifest_of_a_later_format_or_of_another_run_is_refused() {
    let (folder, _) = cut_off(&short());
    let path = folder.path().join("out/manifest.json");
    let own = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, own.replace("\"format\": 1", "\"format\": 99")).unwrap();
    refuses(&folder, &["the run has format 99", "nothing was changed"]);
    let mut other: serde_json::Value = serde_json::from_str(&own).unwrap();
    other["started"] = "2020-01-01T00:00:00+00:00[UTC]".into();
    std::fs::write(&path, other.to_string()).unwrap();
    refuses(&folder, &["is of another run", "2020-01-01T00:00:00"]);
    std::fs::write(&path, own.replace("\"campaign\": \"", "\"campaign\": \"other-")).unwrap();
    refuses(&folder, &["is of another run: its campaign is \"other-"]);
}

#[test]
fn a_folder_and_a_campaign_together_are_refused_with_the_correct_usage() {
    let folder = crate::common::folder_with(&short());
    let answer = damprig(&folder).args(["run", "--resume", "out", "test.toml"]).assert().code(2);
    let right = contains("damprig run [OPTIONS] --resume <FOLDER>\n");
    answer.stderr(right.and(contains("--resume <FOLDER> [CAMPAIGN.toml]").not()));
}

#[test]
fn a_line_torn_by_a_kill_is_not_damage_once_the_run_is_complete() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let mut lines = journal_lines(&run);
    // Killed while the last line was written.
    let last = lines.last_mut().unwrap();
    assert!(last.contains("\"entry\":\"ended\""));
    last.truncate(last.len() / 2);
    write_journal(&run, &lines);
    as_if_killed(&run);
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    let answer = damprig(&folder).args(["runs", "verify", "out"]).assert().success();
    answer.stdout(contains(format!("line {} was cut off by a kill", lines.len())).and(contains("warning:").not()));
}

#[test]
fn the_other_parts_are_exported_beside_a_damaged_one_and_a_changed_campaign_is_named() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let all = sample_rows(&run) as u64;
    let sealed = &JournalState::of(&journal::read(&run).unwrap().entries).sealed[0];
    std::fs::write(run.join(&sealed.file.name), "cut").unwrap();
    let arguments = ["runs", "export", "out", "--format", "csv", "--out", "rest.csv"];
    let answer = damprig(&folder).args(arguments).assert().code(1);
    answer.stdout(contains(format!("{} rows of samples", all - sealed.rows))).stderr(contains("000001.parquet"));
    let changed = short().replace("noise_seed = 7", "noise_seed = 8");
    std::fs::write(run.join("campaign.toml"), changed).unwrap();
    let answer = damprig(&folder).args(["runs", "verify", "out"]).assert().code(1);
    answer.stdout(contains("rig.noise_seed: 7 when it was started, 8 now"));
}

#[test]
fn two_programs_cannot_record_into_one_folder() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    // A torn line would show an attempt to append.
    let text = std::fs::read_to_string(run.join(JOURNAL)).unwrap();
    std::fs::write(run.join(JOURNAL), &text[..text.len() - 9]).unwrap();
    let before = contents(&run);
    let other = Journal::open(&run).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(1);
    answer.stderr(contains("another damprig is recording into this folder"));
    assert!(contents(&run) == before);
    drop(other);
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    // Both have found the folder empty; only the first to claim it gets it.
    let new = folder.path().join("new");
    let (first, second) = (OutputFolder::create_at(&new).unwrap(), OutputFolder::create_at(&new).unwrap());
    let journal = first.claim().unwrap();
    first.write_campaign("name = \"first\"").unwrap();
    assert!(second.claim().unwrap_err().to_string().contains("another damprig is recording"));
    drop(journal);
    assert!(second.claim().unwrap_err().to_string().contains("another damprig has just started"));
}

#[cfg(unix)]
#[test]
fn links_and_pipes_in_a_run_folder_do_not_block() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    for name in ["again", "once-more"] {
        std::os::unix::fs::symlink(".", run.join(name)).unwrap();
    }
    damprig(&folder).args(["runs", "."]).assert().success().stdout(contains("3/6"));
    // A copy of the folder made with hard links would change too.
    std::fs::hard_link(run.join(JOURNAL), folder.path().join("copy")).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(1);
    answer.stderr(contains("2 names (hard links)").and(contains("cp out/journal.jsonl")));
    std::fs::remove_file(folder.path().join("copy")).unwrap();
    let part = run.join("samples.parts/000001.parquet");
    std::fs::remove_file(&part).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(&part).status().unwrap().success());
    let verify = damprig(&folder).args(["runs", "verify", "out"]).timeout(PATIENCE).assert().code(1);
    verify.stdout(contains("000001.parquet: cannot read it: this is a pipe, not a regular file"));
    let export = ["runs", "export", "out", "--format", "csv"];
    damprig(&folder)
        .args(export)
        .timeout(PATIENCE)
        .assert()
        .code(1)
        .stderr(contains("this is a pipe, not a regular file"));
    damprig(&folder).args(["run", "--resume", "out"]).timeout(PATIENCE).assert().success();
}

#[test]
fn a_manifest_reads_back_as_written() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let text = serde_json::to_string(RunFolder::open(&run).unwrap().manifest()).unwrap();
    assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), manifest(&run));
}

#[test]
fn the_manifest_of_an_early_run_is_readable() {
    let folder = tempfile::tempdir().unwrap();
    // The keys that the first runs had, with settings and a model of another layout.
    let text = r#"{"campaign": "hybrid", "status": "complete", "started": "2026-01-02T03:04:05+01:00[Europe/Berlin]",
        "damprig": "damprig 0.0.1", "device": {"link": "virtual", "board": "virtual", "firmware": "0.0.1",
        "tick_hz": 1000.0, "settings": {"step": 5}}, "points_planned": 3, "points_taken": 3, "sample_rows": 0,
        "telemetry_rate_hz": 100.0, "signals": [{"name": "x_m", "unit": "m"}],
        "set_ups": [{"name": "bare", "model": {"mass": 1}}]}"#;
    std::fs::write(folder.path().join("manifest.json"), text).unwrap();
    let run = RunFolder::open(folder.path()).unwrap();
    let manifest = run.manifest();
    assert_eq!((manifest.format, manifest.is_complete(), manifest.every_ticks()), (1, true, Some(10)));
    assert!(manifest.device.as_ref().unwrap().settings.is_none());
    assert!(manifest.set_ups[0].predicted_max_x_m.is_nan());
}
