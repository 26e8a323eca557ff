//! The folder of a run that was killed, with a file that was changed since: `damprig runs verify` names the file, and `--resume` never
//! passes it off as sound. Without a C compiler these tests are skipped.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};

use damprig::run_folder::journal;
use damprig::run_folder::read::verify::{Finding, verify};
use damprig::run_folder::schema::journal_state::JournalState;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{damprig, folder_with, short};
use crate::file_faults::preload;
use crate::kills::killed;
use crate::resume::measured;

/// One set-up with a particle, so that there are impacts; two points and a release.
fn campaign() -> String {
    let release = "\n[[experiment]]\nname = \"release\"\nkind = \"free_vibration\"\nstart_m = 0.035\nmeasure_s = 4.0\nset_ups = [\"hybrid\"]\n";
    let two = "frequencies_hz = [2.4, 2.5]\nset_ups = [\"hybrid\"]";
    short().replace("frequencies_hz = [2.4, 2.5, 2.6]", two).replace("rate_hz = 100", "rate_hz = 1000") + release
}

/// A run that was killed after the entry of this kind and number; `None` without a C compiler.
fn killed_after(campaign: &str, kind: &str, at: u32) -> Option<(TempDir, PathBuf)> {
    let library = preload()?;
    let folder = folder_with(campaign);
    assert!(killed(&folder, &library, kind, at, None));
    let run = folder.path().join("out");
    Some((folder, run))
}

fn wrong(run: &Path) -> String {
    let found = verify(run).unwrap().into_iter();
    found.filter_map(|one| if let Finding::Wrong(text) = one { Some(text + "\n") } else { None }).collect()
}

fn state(run: &Path) -> JournalState {
    JournalState::of(&journal::read(run).unwrap().entries)
}

fn flip(path: &Path) {
    let mut bytes = std::fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(path, bytes).unwrap();
}

fn append(path: &Path, more: &str) {
    let bytes = [std::fs::read(path).unwrap(), more.as_bytes().to_vec()].concat();
    std::fs::write(path, bytes).unwrap();
}

/// The open part of a run that was killed after a result.
fn open_part(run: &Path) -> PathBuf {
    let entries = std::fs::read_dir(run).unwrap().map(|entry| entry.unwrap().path());
    let mut open = entries.filter(|path| path.to_string_lossy().ends_with(".open.arrows"));
    open.next().expect("an open part")
}

fn is_named(run: &Path, name: &str) -> bool {
    wrong(run).lines().any(|line| line.starts_with(name))
}

fn resumes(folder: &TempDir) -> String {
    let output = damprig(folder).args(["run", "--resume", "out"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn joined_samples_that_change_before_the_manifest_is_written_are_found_and_refused() {
    let Some((folder, run)) = killed_after(&campaign(), "joined", 1) else { return };
    assert!(!wrong(&run).contains("parquet"), "{}", wrong(&run));
    for name in
        ["samples.parquet", "impacts.parquet", "results.parquet", "transients.parquet", "samples.parts/000001.parquet"]
    {
        let own = std::fs::read(run.join(name)).unwrap();
        flip(&run.join(name));
        assert!(is_named(&run, name), "{name}: {}", wrong(&run));
        if name == "samples.parquet" {
            let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(2);
            answer.stderr(
                contains("samples.parquet: changed since it was recorded").and(contains("nothing was changed")),
            );
        }
        if name != "samples.parts/000001.parquet" {
            std::fs::remove_file(run.join(name)).unwrap();
            assert!(is_named(&run, name), "{name}: {}", wrong(&run));
        }
        std::fs::write(run.join(name), own).unwrap();
    }
    // Tables are made again from the journal.
    let impacts = std::fs::read(run.join("impacts.parquet")).unwrap();
    flip(&run.join("impacts.parquet"));
    resumes(&folder);
    assert!(std::fs::read(run.join("impacts.parquet")).unwrap() == impacts);
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn a_journal_without_the_digest_of_the_joined_samples_is_resumed() {
    let Some((folder, run)) = killed_after(&campaign(), "joined", 1) else { return };
    let text = std::fs::read_to_string(run.join("journal.jsonl")).unwrap();
    let last = text.lines().last().unwrap();
    let mut joined: serde_json::Value = serde_json::from_str(last).unwrap();
    assert!(joined.as_object_mut().unwrap().remove("file").is_some());
    joined.as_object_mut().unwrap().remove("sum");
    let older = text.replace(last, &journal::with_sum(&joined.to_string()));
    std::fs::write(run.join("journal.jsonl"), older).unwrap();
    assert!(!is_named(&run, "samples.parquet") && !is_named(&run, "journal.jsonl"), "{}", wrong(&run));
    resumes(&folder);
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn tables_are_compared_with_the_journal_after_a_sweep_was_repeated_too() {
    let Some(library) = preload() else { return };
    let carried = campaign().replace("start = \"from_rest\"", "start = \"carry_over\"");
    let folder = folder_with(&carried);
    let run = folder.path().join("out");
    assert!(killed(&folder, &library, "result", 1, None));
    assert!(killed(&folder, &library, "joined", 1, None));
    assert_eq!(state(&run).superseded().len(), 1);
    assert!(!is_named(&run, "results.parquet"), "{}", wrong(&run));
    for name in ["results.parquet", "transients.parquet"] {
        let own = std::fs::read(run.join(name)).unwrap();
        flip(&run.join(name));
        assert!(is_named(&run, name), "{name}: {}", wrong(&run));
        std::fs::remove_file(run.join(name)).unwrap();
        assert!(is_named(&run, name), "{name}: {}", wrong(&run));
        let said = damprig(&folder).args(["runs", "verify", "out"]).assert().code(1);
        said.stdout(contains(format!("ok      {name}")).not());
        std::fs::write(run.join(name), own).unwrap();
    }
}

#[test]
fn samples_without_their_checksums_are_kept_aside_and_their_point_is_measured_again() {
    type Change = (&'static str, fn(&Path));
    let changes: [Change; 4] = [
        ("emptied", |sums| std::fs::write(sums, "").unwrap()),
        ("deleted", |sums| std::fs::remove_file(sums).unwrap()),
        ("cut", |sums| {
            let text = std::fs::read(sums).unwrap();
            std::fs::write(sums, &text[..text.len() / 3]).unwrap();
        }),
        ("kept", |_| {}),
    ];
    for (how, change) in changes {
        let Some((folder, run)) = killed_after(&campaign(), "transient", 1) else { return };
        let open = open_part(&run);
        let name = open.file_name().unwrap().to_str().unwrap().to_string();
        flip(&open);
        let bytes = std::fs::read(&open).unwrap();
        change(&open.with_extension("sums"));
        assert!(
            wrong(&run).lines().any(|line| line.starts_with(&name) && line.contains("checksum")),
            "{how}: {}",
            wrong(&run)
        );
        let aside = name.replace("open", "damaged");
        let said = resumes(&folder);
        assert!(said.contains(&format!("warning: {name}")), "{how}: {said}");
        assert!(std::fs::read(run.join(&aside)).unwrap() == bytes, "{how}");
        assert_eq!(state(&run).withdrawn().len(), 1, "{how}: its result has lost samples");
        let verified = damprig(&folder).args(["runs", "verify", "out"]).assert().success();
        verified.stdout(contains(format!("{aside}: ")));
        flip(&run.join(&aside));
        assert!(is_named(&run, &aside), "{how}: {}", wrong(&run));
        damprig(&folder).args(["run", "test.toml", "--out", "whole"]).assert().success();
        assert_eq!(measured(&run), measured(&folder.path().join("whole")), "{how}");
    }
}

#[test]
fn an_open_part_without_its_head_is_kept_aside_when_the_run_is_resumed() {
    let Some((folder, run)) = killed_after(&campaign(), "result", 1) else { return };
    let open = open_part(&run);
    let bytes = std::fs::read(&open).unwrap();
    std::fs::write(&open, &bytes[..100]).unwrap();
    resumes(&folder);
    assert!(!open.exists() && !open.with_extension("sums").exists());
    let aside = open.to_string_lossy().replace("open", "damaged");
    assert_eq!(std::fs::read(aside).unwrap(), &bytes[..100]);
    let verified = damprig(&folder).args(["runs", "verify", "out"]).assert().success();
    verified.stdout(contains(".damaged.arrows: "));
}

#[test]
fn an_open_part_that_is_removed_is_named_before_and_after_the_run_is_resumed() {
    let Some((folder, run)) = killed_after(&campaign(), "transient", 1) else { return };
    let open = open_part(&run);
    let name = open.file_name().unwrap().to_str().unwrap().to_string();
    std::fs::remove_file(&open).unwrap();
    assert!(is_named(&run, &format!("{name}: missing")), "{}", wrong(&run));
    let said = resumes(&folder);
    assert!(said.contains(&format!("warning: {name}: missing")), "{said}");
    assert_eq!((state(&run).withdrawn().len(), state(&run).transients().len()), (1, 1));
    assert!(is_named(&run, &format!("{name}: missing")), "{}", wrong(&run));
}

#[test]
fn the_number_of_a_closed_part_that_was_removed_is_not_used_again() {
    let Some((folder, run)) = killed_after(&campaign(), "sealed", 1) else { return };
    let lost = state(&run).sealed[0].clone();
    std::fs::remove_file(run.join(&lost.file.name)).unwrap();
    let said = resumes(&folder);
    assert!(said.contains(&format!("warning: {}: ", &*lost.file.name)), "{said}");
    assert!(state(&run).sealed.contains(&lost));
    assert!(is_named(&run, &lost.file.name), "{}", wrong(&run));
}

/// An operation on a file, the one of this number, before which the program is killed; whether it was killed.
fn killed_before(folder: &TempDir, library: &Path, operation: &str, at: u32) -> bool {
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    let out = folder.path().join("out");
    command.args(["run", "test.toml", "--out", out.to_str().unwrap()]).current_dir(folder.path());
    command.env("LD_PRELOAD", library).env("FAULT_UNDER", "/out").env("FAULT_OP", operation);
    command.env("FAULT_AT", at.to_string()).env("FAULT_ERRNO", "kill");
    command.output().unwrap().status.code().is_none()
}

#[test]
fn a_folder_of_a_run_that_was_killed_before_its_first_line_is_used_again_or_resumed() {
    let Some(library) = preload() else { return };
    let mut used_again = 0;
    // The journal, the copies of the records and the campaign are the first files; the manifest follows.
    for (operation, most) in [("open", 3), ("rename", 3), ("mkdir", 2), ("sync", 1)] {
        for at in 1..=most {
            let folder = crate::copies::folder("");
            let out = folder.path().join("out");
            assert!(killed_before(&folder, &library, operation, at), "{operation} {at}");
            let resumed = damprig(&folder).args(["run", "--resume", "out"]).output().unwrap();
            if !resumed.status.success() {
                let said = String::from_utf8_lossy(&resumed.stderr).into_owned();
                let is_empty = out.read_dir().map_or(true, |mut entries| entries.next().is_none());
                assert!(is_empty || said.contains("`damprig run CAMPAIGN --out out`"), "{operation} {at}: {said}");
                let again = damprig(&folder).args(["run", "test.toml", "--out", "out"]).output().unwrap();
                let said = String::from_utf8_lossy(&again.stderr).into_owned();
                assert!(again.status.success(), "{operation} {at}: {said}");
                used_again += 1;
            }
            damprig(&folder).args(["runs", "verify", "out"]).assert().success();
        }
    }
    assert!(used_again >= 3, "{used_again}");
}

#[test]
fn a_folder_with_anything_of_a_person_is_not_used_by_a_new_run() {
    let folder = folder_with(&short());
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("journal.jsonl"), "").unwrap();
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    let answer = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().code(2);
    answer.stderr(contains("it is not empty"));
    std::fs::remove_file(out.join("notes.txt")).unwrap();
    std::fs::write(out.join("journal.jsonl"), "mine").unwrap();
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().code(2).stderr(contains("it is not empty"));
}

#[test]
fn bytes_appended_to_campaign_journal_or_open_part_are_found() {
    let Some((folder, run)) = killed_after(&campaign(), "result", 1) else { return };
    let open = open_part(&run);
    let open = open.file_name().unwrap().to_str().unwrap();
    let sums = open.replace("arrows", "sums");
    for (name, more, named) in [
        ("campaign.toml", "\n", "campaign.toml"),
        ("campaign.toml", "# a remark", "campaign.toml"),
        ("journal.jsonl", "\n", "journal.jsonl"),
        ("journal.jsonl", "abc", "journal.jsonl"),
        (open, "\n", open),
        (&sums, "\n", open),
        (&sums, "0", open),
    ] {
        let own = std::fs::read(run.join(name)).unwrap();
        let before = wrong(&run);
        append(&run.join(name), more);
        let now = wrong(&run);
        assert!(now.lines().any(|line| line.starts_with(named) && !before.contains(line)), "{name} {more:?}: {now}");
        std::fs::write(run.join(name), own).unwrap();
    }
    append(&run.join("campaign.toml"), "# a remark\n");
    let said = resumes(&folder);
    assert!(said.contains("warning: campaign.toml: remarks or layout have changed"), "{said}");
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn a_damaged_part_that_is_gone_is_not_said_to_be_in_place() {
    let Some((folder, run)) = killed_after(&campaign(), "sealed", 1) else { return };
    let part = run.join(&state(&run).sealed[0].file.name);
    flip(&part);
    resumes(&folder);
    assert!(wrong(&run).contains("the file was left in place"), "{}", wrong(&run));
    std::fs::remove_file(part).unwrap();
    assert!(wrong(&run).contains("the file is gone"), "{}", wrong(&run));
    assert!(!wrong(&run).contains("left in place"), "{}", wrong(&run));
}
