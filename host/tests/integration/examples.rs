//! `damprig examples`, and commands that are given the name of a shipped example in a folder without that file.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{damprig, folder_with};

/// Exit code, standard output and standard error.
fn answer(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = damprig(folder).args(arguments).output().expect("the command");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// Standard output and standard error of a command that must succeed.
fn done(folder: &TempDir, arguments: &[&str]) -> (String, String) {
    let (code, out, error) = answer(folder, arguments);
    assert_eq!(code, Some(0), "{arguments:?}: {error}");
    (out, error)
}

fn shipped(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(path).expect("a shipped file")
}

fn empty() -> TempDir {
    TempDir::new().expect("a temporary folder")
}

fn files(folder: &TempDir) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.path().to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(folder.path()).expect("inside").display().to_string());
            }
        }
    }
    found
}

#[test]
fn every_listed_example_has_a_description_and_is_copied_by_its_name() {
    let (out, _) = done(&empty(), &["examples", "--json"]);
    let all: Vec<Value> = serde_json::from_str(&out).expect("JSON");
    assert!(all.len() > 20, "{}", all.len());
    let (text, _) = done(&empty(), &["examples"]);
    let names: BTreeSet<&str> = all.iter().map(|example| example["name"].as_str().expect("a name")).collect();
    assert_eq!(names.len(), all.len(), "a name twice");
    for example in &all {
        let name = example["name"].as_str().expect("a name");
        assert!(example["description"].as_str().is_some_and(|text| text.len() > 15), "{example}");
        assert!(text.lines().any(|line| line.split_whitespace().next() == Some(name)), "{name} in\n{text}");
        let folder = empty();
        let (out, _) = done(&folder, &["examples", name, "--json"]);
        let copied: Value = serde_json::from_str(&out).expect("JSON");
        let listed: BTreeSet<String> = serde_json::from_value(copied["copied"].clone()).expect("names");
        assert_eq!(listed, files(&folder), "{name}");
    }
}

#[test]
fn every_copy_is_accepted_by_its_command_with_the_files_that_it_names() {
    let (out, _) = done(&empty(), &["examples", "--json"]);
    let all: Vec<Value> = serde_json::from_str(&out).expect("JSON");
    for example in all {
        let (name, kind) = (example["name"].as_str().expect("a name"), example["kind"].as_str().expect("a kind"));
        // The others have no dry run; the tests below use them.
        if !matches!(kind, "campaign" | "study" | "optimisation") {
            continue;
        }
        let folder = empty();
        let (out, _) = done(&folder, &["examples", name, "--json"]);
        let copied: Value = serde_json::from_str(&out).expect("JSON");
        let next = copied["next"].as_str().expect("a command");
        let words: Vec<&str> = next.split_whitespace().skip(1).chain(["--dry-run"]).collect();
        let (_, error) = done(&folder, &words);
        assert!(!error.contains("Shipped"), "{name} was not copied: {error}");
    }
}

#[test]
fn a_campaign_is_copied_whole_and_says_the_next_command() {
    let folder = empty();
    let (out, _) = done(&folder, &["examples", "hybrid"]);
    assert_eq!(
        std::fs::read_to_string(folder.path().join("hybrid.toml")).expect("a copy"),
        shipped("campaigns/hybrid.toml")
    );
    assert!(out.contains("Next: damprig run hybrid.toml") && out.contains("`damprig examples cases/hybrid`"), "{out}");
    let (code, _, error) = answer(&folder, &["examples", "cases/hybrid"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("hybrid.toml: it exists") && error.contains("nothing was written"), "{error}");
    assert_eq!(
        std::fs::read_to_string(folder.path().join("hybrid.toml")).expect("a copy"),
        shipped("campaigns/hybrid.toml")
    );
}

#[test]
fn a_changed_copy_is_replaced_only_by_force() {
    let folder = empty();
    std::fs::write(folder.path().join("hybrid.toml"), "mine").expect("a file");
    assert_eq!(answer(&folder, &["examples", "hybrid"]).0, Some(2));
    done(&folder, &["examples", "hybrid", "--force"]);
    let copy = std::fs::read_to_string(folder.path().join("hybrid.toml")).expect("a copy");
    assert_eq!(copy, shipped("campaigns/hybrid.toml"));
}

#[test]
fn a_study_is_copied_with_its_case_and_its_continuation() {
    let folder = empty();
    done(&folder, &["examples", "clearance-and-restitution"]);
    let expected = ["cases/spid.toml", "clearance-and-restitution.toml", "continuations/grazing-curve.toml"];
    assert_eq!(files(&folder), expected.map(String::from).into());
    // Another study of the same case takes the copy that is there.
    let (out, _) = done(&folder, &["examples", "single-particle"]);
    assert!(out.contains("Copied single-particle.toml\n"), "{out}");
    // Not a case of the same name that was changed.
    std::fs::write(folder.path().join("cases/spid.toml"), "mine").expect("a file");
    let (code, _, error) = answer(&folder, &["examples", "spid-band"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("cases/spid.toml: it exists"), "{error}");
    assert!(!folder.path().join("spid-band.toml").exists());
}

#[test]
fn a_name_without_a_file_simulates_the_shipped_case_as_its_copy() {
    for name in ["spid", "spid.toml", "cases/spid"] {
        let (out, error) = done(&empty(), &["simulate", name, "--json"]);
        assert!(error.starts_with("Shipped example cases/spid.toml; `damprig examples spid`"), "{error}");
        let folder = empty();
        done(&folder, &["examples", "spid"]);
        let (of_copy, error) = done(&folder, &["simulate", "spid.toml", "--json"]);
        assert_eq!((out, error), (of_copy, String::new()));
    }
}

#[test]
fn the_record_beside_a_shipped_case_is_found_and_copied() {
    let folder = empty();
    let (out, error) = done(&folder, &["simulate", "record"]);
    assert!(error.starts_with("Shipped example cases/record.toml"), "{error}");
    done(&folder, &["examples", "record"]);
    assert_eq!(files(&folder), ["record.toml", "shake.csv"].map(String::from).into());
    let (of_copy, _) = done(&folder, &["simulate", "record.toml"]);
    assert_eq!(out, of_copy);
}

#[test]
fn a_shipped_campaign_with_a_record_runs_and_keeps_the_record() {
    let folder = empty();
    let (_, error) = done(&folder, &["run", "transients", "--out", "run"]);
    assert!(error.starts_with("Shipped example campaigns/transients.toml"), "{error}");
    let kept = std::fs::read_dir(folder.path().join("run/records")).expect("the records").flatten();
    let kept: Vec<String> = kept.filter_map(|entry| std::fs::read_to_string(entry.path()).ok()).collect();
    assert!(kept.contains(&shipped("campaigns/records/synthetic.csv")));
    done(&folder, &["runs", "verify", "run"]);
}

#[test]
fn a_shipped_optimisation_study_and_continuation_find_their_cases() {
    let folder = empty();
    done(&folder, &["optimise", "hybrid-band", "--dry-run"]);
    done(&folder, &["study", "run", "clearance-and-restitution", "--dry-run"]);
    let (shipped, _) = done(&folder, &["continue", "clearance", "--json"]);
    done(&folder, &["examples", "clearance"]);
    let (copied, error) = done(&folder, &["continue", "clearance.toml", "--json"]);
    assert_eq!((shipped, error.as_str()), (copied, ""));
}

#[test]
fn a_file_of_the_same_name_comes_before_the_example() {
    let folder = empty();
    std::fs::write(folder.path().join("spid"), shipped("cases/tmd.toml")).expect("a file");
    let (out, error) = done(&folder, &["simulate", "spid"]);
    assert!(error.is_empty(), "{error}");
    assert!(out.contains("TMD") || out.contains("tuned mass"), "{out}");
}

#[test]
fn a_name_that_is_neither_file_nor_example_is_answered_with_both() {
    let folder = folder_with("");
    let (code, _, error) = answer(&folder, &["run", "hybird"]);
    assert_eq!(code, Some(2));
    for part in ["cannot read hybird: ", "no shipped campaign", "did you mean hybrid?", "`damprig examples`"] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
    let (code, _, error) = answer(&folder, &["run", "tset.toml"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("did you mean ./test.toml?") && error.contains("no shipped campaign"), "{error}");
    let (code, _, error) = answer(&folder, &["run", "spid"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("there is a case of this name: `damprig simulate spid`"), "{error}");
    let (code, _, error) = answer(&folder, &["examples", "hybird"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("hybird: no shipped file has this name; did you mean hybrid?"), "{error}");
    assert_eq!(files(&folder), ["test.toml".to_string()].into());
}

#[test]
fn a_quiet_run_of_an_example_says_only_its_folder() {
    let folder = empty();
    let (_, error) = done(&folder, &["run", "short", "--quiet", "--out", "run"]);
    assert!(!error.contains("Shipped"), "{error}");
}
