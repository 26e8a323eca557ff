//! A run folder that someone else has prepared: names that lead out of it, links, changed records.
#![cfg(unix)]

use std::f64::consts::TAU;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use crate::common::{cut_off, damprig, folder_with, manifest, result_rows, short, with_sums};
use damprig::run_folder::journal::JOURNAL;
use predicates::prelude::*;
use predicates::str::contains;

fn journal_text(run: &Path) -> String {
    std::fs::read_to_string(run.join(JOURNAL)).unwrap()
}

/// The first line of the journal that closes a part, without its end.
fn sealed_line(run: &Path) -> String {
    journal_text(run).lines().find(|l| l.contains("\"entry\":\"sealed\"")).unwrap().to_string()
}

#[test]
fn a_journal_cannot_name_a_file_outside_the_folder_or_one_that_is_no_part() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let canary = folder.path().join("canary.parquet");
    std::fs::copy(run.join("samples.parts/000001.parquet"), &canary).unwrap();
    let bytes = std::fs::read(&canary).unwrap();
    let own = journal_text(&run);
    let absolute = canary.to_str().unwrap();
    for name in
        [absolute, "../canary.parquet", "samples.parts/../../canary.parquet", "campaign.toml", "results.parquet"]
    {
        let line = sealed_line(&run);
        let part = "samples.parts/000001.parquet";
        assert!(line.contains(part));
        // A further part of this name, with the checksum of the file.
        let doctored = line.replace(part, name).replace("\"part\":1", "\"part\":77");
        std::fs::write(run.join(JOURNAL), with_sums(&format!("{own}{doctored}\n"))).unwrap();
        let number = own.lines().count() + 1;
        let verify = damprig(&folder).args(["runs", "verify", "out"]).assert().code(1);
        verify.stdout(contains(format!("line {number} is damaged")));
        let copy = folder.path().join("copy");
        assert!(std::process::Command::new("cp").arg("-r").args([&run, &copy]).status().unwrap().success());
        let answer = damprig(&folder).args(["run", "--resume", "copy"]).assert().success();
        answer.stdout(contains(format!("line {number} cannot be read")));
        assert!(std::fs::read(&canary).is_ok_and(|now| now == bytes), "{name}: a file outside the folder was changed");
        assert!(copy.join("campaign.toml").exists() && copy.join("results.parquet").exists(), "{name}");
        std::fs::remove_dir_all(&copy).unwrap();
    }
}

#[test]
fn a_result_that_the_campaign_does_not_have_is_damage() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let own = journal_text(&run);
    let result = own.lines().find(|l| l.contains("\"entry\":\"result\"")).unwrap();
    for (from, to) in [("\"set_up\":\"bare\"", "\"set_up\":\"stranger\""), ("\"point_index\":0", "\"point_index\":99")]
    {
        assert!(result.contains(from), "{result}");
        let doctored = with_sums(&format!("{own}{}\n", result.replace(from, to)));
        std::fs::write(run.join(JOURNAL), &doctored).unwrap();
        let verify = damprig(&folder).args(["runs", "verify", "out"]).assert().code(1);
        verify.stdout(contains("a result that the campaign does not have"));
        let resume = damprig(&folder).args(["run", "--resume", "out"]).assert().code(2);
        resume.stderr(contains("lists results that the campaign does not have"));
        assert_eq!(journal_text(&run), doctored, "nothing is changed");
    }
}

#[test]
fn a_manifest_cannot_name_a_file_outside_the_folder() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let path = folder.path().join("out/manifest.json");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("\"name\": \"journal.jsonl\"", "\"name\": \"../../etc/passwd\"")).unwrap();
    for command in ["show", "verify", "report"] {
        let answer = damprig(&folder).args(["runs", command, "out"]).assert().code(1);
        let output = answer.get_output();
        let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(
            said.contains("\"../../etc/passwd\" is not the name of a file inside the run folder"),
            "{command}: {said}"
        );
    }
}

#[test]
fn links_in_a_run_folder_are_refused_and_a_link_to_it_is_not() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    let target = folder.path().join("target");
    std::fs::write(&target, "mine").unwrap();
    for name in [
        "results.parquet.tmp",
        "manifest.json.tmp",
        "samples.parquet.tmp",
        "impacts.parquet",
        "report.html",
        "figure.svg.tmp",
        "samples-000050.open.arrows",
        "samples.parts/000050.parquet",
        "samples.parts/000050.parquet.tmp",
    ] {
        let link = run.join(name);
        let before = std::fs::read(&link).ok();
        let _ = std::fs::remove_file(&link);
        symlink(&target, &link).unwrap();
        for arguments in [&["run", "--resume", "out"][..], &["runs", "show", "out"]] {
            let answer = damprig(&folder).args(arguments).assert().code(predicate::ne(0));
            answer.stderr(contains(name).and(contains("this is a link")));
        }
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "mine", "{name}");
        std::fs::remove_file(&link).unwrap();
        before.into_iter().for_each(|bytes| std::fs::write(&link, bytes).unwrap());
    }
    // The folder of the parts leads elsewhere: refused before a point is measured.
    let parts = folder.path().join("parts");
    std::fs::rename(run.join("samples.parts"), &parts).unwrap();
    symlink(&parts, run.join("samples.parts")).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(predicate::ne(0));
    answer.stderr(contains("out/samples.parts: this is a link"));
    assert_eq!(result_rows_of_journal(&run), 3);
    std::fs::remove_file(run.join("samples.parts")).unwrap();
    std::fs::rename(&parts, run.join("samples.parts")).unwrap();
    // Another name is no business of the run's, and the whole folder may be reached through a link.
    symlink(&target, run.join("notes")).unwrap();
    let elsewhere = folder.path().join("elsewhere");
    std::fs::rename(&run, &elsewhere).unwrap();
    symlink(&elsewhere, &run).unwrap();
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
    assert_eq!(result_rows(&elsewhere), 6);
}

fn result_rows_of_journal(run: &Path) -> usize {
    journal_text(run).matches("\"entry\":\"result\"").count()
}

#[test]
fn a_changed_manifest_is_found_by_verify() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let path = folder.path().join("out/manifest.json");
    let verify = || damprig(&folder).args(["runs", "verify", "out"]).assert();
    verify().success().stdout(contains("manifest.json: as damprig wrote it"));
    let text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in [
        ("\"bare\"", "\"bear\""),
        ("  \"campaign\"", " \"campaign\""),
        ("\"interruptions\": 0", "\"interruptions\": 1"),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        verify().code(1).stdout(contains("FAILED  manifest.json: changed since damprig wrote it"));
    }
}

/// A campaign that plays a record of its own, and its folder.
fn playback() -> (tempfile::TempDir, PathBuf) {
    let text = short();
    let experiment = text.find("[[experiment]]").unwrap();
    let telemetry = text.find("[telemetry]").unwrap();
    let plays = "[[experiment]]\nname = \"quake\"\nkind = \"playback\"\nfile = \"quake.csv\"\nquantity = \"displacement\"\nunit = \"m\"\ntime_step_s = 0.02\n\n";
    let folder = folder_with(&format!("{}{plays}{}", &text[..experiment], &text[telemetry..]));
    let samples: String = (0..=200).map(|n| format!("{:.6}\n", 1e-3 * (f64::from(n) * TAU / 50.0).sin())).collect();
    std::fs::write(folder.path().join("quake.csv"), samples).unwrap();
    let run = folder.path().join("out");
    (folder, run)
}

#[test]
fn a_record_that_was_changed_after_a_kill_is_not_played() {
    let (folder, run) = playback();
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    // As after a kill before the second set-up.
    let text = journal_text(&run);
    let kept: String =
        text.lines().take_while(|l| !l.contains("\"entry\":\"finished\"")).map(|l| format!("{l}\n")).collect();
    std::fs::write(run.join(JOURNAL), kept).unwrap();
    for file in ["manifest.json", "transients.parquet", "samples.parquet", "impacts.parquet"] {
        let _ = std::fs::remove_file(run.join(file));
    }
    let record = run.join("records/1-quake.csv");
    let own = std::fs::read_to_string(&record).unwrap();
    std::fs::write(&record, own.replace("0.000125", "0.000126")).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(2);
    answer.stderr(contains("records/1-quake.csv: changed since it was recorded (SHA-256 differs)"));
    let verify = damprig(&folder).args(["runs", "verify", "out"]).assert().code(1);
    verify.stdout(contains("FAILED  records/1-quake.csv: changed since it was recorded"));
    std::fs::remove_file(&record).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(2);
    answer.stderr(contains("records/1-quake.csv: cannot read it"));
    std::fs::write(&record, own).unwrap();
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    assert_eq!(manifest(&run)["status"], "complete");
}

#[test]
fn runs_without_rows_points_or_kinds_are_exported_to_every_format() {
    let (folder, run) = playback();
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let text = journal_text(&run);
    let lines: Vec<&str> = text.lines().collect();
    let export = |name: &str| {
        for format in ["mat", "csv", "uff"] {
            let out = format!("{name}.{format}");
            damprig(&folder).args(["runs", "export", "out", "--format", format, "--out", &out]).assert().success();
        }
    };
    export("whole");
    // Only the beginning: 0 points, no samples.
    let mut manifest = manifest(&run);
    manifest["status"] = "running".into();
    std::fs::write(run.join("manifest.json"), manifest.to_string()).unwrap();
    std::fs::write(run.join(JOURNAL), format!("{}\n", lines[0])).unwrap();
    export("rows");
    std::fs::remove_file(run.join("samples.parquet")).unwrap();
    export("none");
    damprig(&folder).args(["runs", "show", "out"]).assert().success();
    damprig(&folder).args(["runs", "report", "out"]).assert().success();
}
