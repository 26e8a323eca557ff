//! Run folders with one thing changed: every value of the journal and of the manifest, every line, every file. Every reader of
//! a run folder gives a result or an error, changes nothing, and never leaves the folder; nor does a program that resumes it.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::common::{Fate, PATIENCE, Served, damprig, folder_with, is_full, is_point, short, with_sums};
use damprig::report::exports::csv::Csv;
use damprig::report::exports::mat::Mat;
use damprig::report::exports::uff::Uff;
use damprig::report::exports::{ExportSelection, Exporter, RunTable};
use damprig::report::page::page;
use damprig::report::terminal;
use damprig::run_folder::RunFolder;
use damprig::run_folder::journal::{JOURNAL, Journal};
use damprig::run_folder::read::parquet_file;
use damprig::run_folder::read::verify::verify;
use damprig::run_folder::write::writer::{RecordLayout, RunWriter};
use damprig::runner::resume::EarlierRun;
use damprig::storage::out_file::OutFile;
use serde_json::{Value, json};
use tempfile::TempDir;

/// Stepped sines and a free vibration of a structure with a particle: every table has rows.
fn campaign() -> String {
    let free = "\n[[experiment]]\nname = \"free\"\nkind = \"free_vibration\"\nstart_m = 0.01\nmeasure_s = 2.0\nset_ups = [\"hybrid\"]\n";
    short().replace("frequencies_hz = [2.4, 2.5, 2.6]", "frequencies_hz = [2.4, 2.5]") + free
}

/// A run that was cut off, and one that is complete.
fn runs(folder: &TempDir) -> [PathBuf; 2] {
    let mut points = 0;
    let rig = Served::again_and_again(move |message| {
        points += usize::from(is_point(message));
        if is_point(message) && points == 3 { Fate::Close } else { Fate::Pass }
    });
    let cut = ["run", "test.toml", "--rig", &rig, "--out", "cut", "--reconnect-s", "0"];
    damprig(folder).args(cut).assert().code(1);
    damprig(folder).args(["run", "test.toml", "--out", "whole"]).assert().success();
    ["cut", "whole"].map(|name| folder.path().join(name))
}

type Files = BTreeMap<PathBuf, Option<Vec<u8>>>;

/// Every file of a folder by its relative path; folders have no content.
fn files(folder: &Path) -> Files {
    fn add(folder: &Path, prefix: &Path, into: &mut Files) {
        for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let name = prefix.join(entry.file_name());
            if entry.file_type().unwrap().is_dir() {
                into.insert(name.clone(), None);
                add(&entry.path(), &name, into);
            } else {
                into.insert(name, Some(std::fs::read(entry.path()).unwrap()));
            }
        }
    }
    let mut all = Files::new();
    add(folder, Path::new(""), &mut all);
    all
}

fn write(folder: &Path, files: &Files) {
    std::fs::create_dir(folder).unwrap();
    for (name, bytes) in files {
        match bytes {
            None => std::fs::create_dir(folder.join(name)).unwrap(),
            Some(bytes) => std::fs::write(folder.join(name), bytes).unwrap(),
        }
    }
}

/// The places of all values in a JSON value.
fn places(value: &Value, place: &str, into: &mut Vec<String>) {
    into.push(place.to_string());
    match value {
        Value::Array(list) => list.iter().enumerate().for_each(|(n, v)| places(v, &format!("{place}/{n}"), into)),
        Value::Object(map) => map.iter().for_each(|(key, v)| places(v, &format!("{place}/{key}"), into)),
        _ => {}
    }
}

fn strange(random: &mut fastrand::Rng, now: &Value) -> Value {
    let all = [
        Value::Null,
        json!(true),
        json!(-1),
        json!(0),
        json!(u32::MAX),
        json!(u64::MAX),
        json!(1u64 << 53),
        json!(1e300),
        json!(-1e300),
        json!(0.5),
        json!("NaN"),
        json!("inf"),
        json!(""),
        json!("../../canary"),
        json!("/etc/passwd"),
        json!("a\u{0}b\u{1b}[31m\n"),
        json!("x".repeat(5000)),
        json!([]),
        json!({}),
        json!([now, now, now]),
    ];
    all[random.usize(..all.len())].clone()
}

fn change_value(random: &mut fastrand::Rng, value: &mut Value) {
    let mut all = Vec::new();
    places(value, "", &mut all);
    let at = &all[random.usize(..all.len())];
    let parent = at.rsplit_once('/').map(|(parent, key)| (parent.to_string(), key.to_string()));
    if random.u8(..5) == 0
        && let Some((parent, key)) = parent
        && let Some(map) = value.pointer_mut(&parent).and_then(Value::as_object_mut)
    {
        map.remove(&key);
        return;
    }
    if let Some(place) = value.pointer_mut(at) {
        *place = strange(random, place);
    }
}

fn change_journal(random: &mut fastrand::Rng, text: &str) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_string).collect();
    let at = random.usize(..lines.len());
    match random.u8(..10) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(at, lines[at].clone()),
        2 => lines.swap(at, random.usize(..text.lines().count())),
        3 => {
            let half = lines[at].len() / 2;
            lines[at] = lines[at].chars().take(half).collect();
        }
        _ => {
            let mut value: Value = serde_json::from_str(&lines[at]).unwrap();
            change_value(random, &mut value);
            lines[at] = value.to_string();
        }
    }
    with_sums(&(lines.join("\n") + "\n"))
}

/// Changes one thing; says what.
fn change(random: &mut fastrand::Rng, files: &mut Files) -> String {
    let text = |files: &Files, name: &str| String::from_utf8(files[Path::new(name)].clone().unwrap()).unwrap();
    match random.u8(..10) {
        0..5 => {
            let changed = change_journal(random, &text(files, JOURNAL));
            files.insert(JOURNAL.into(), Some(changed.clone().into_bytes()));
            format!("journal: {changed}")
        }
        5..8 => {
            let mut value: Value = serde_json::from_str(&text(files, "manifest.json")).unwrap();
            change_value(random, &mut value);
            files.insert("manifest.json".into(), Some(value.to_string().into_bytes()));
            format!("manifest: {value}")
        }
        _ => {
            let names: Vec<PathBuf> =
                files.iter().filter(|(_, bytes)| bytes.is_some()).map(|(n, _)| n.clone()).collect();
            let name = names[random.usize(..names.len())].clone();
            let other = names[random.usize(..names.len())].clone();
            let mut bytes = files[&name].clone().unwrap();
            let kind = random.u8(..7);
            let what = format!("file {}, {kind}, {}", name.display(), other.display());
            match kind {
                0 => drop(files.remove(&name)),
                1 => drop(files.insert(name, Some(vec![]))),
                2 => {
                    bytes.truncate(random.usize(..=bytes.len()));
                    files.insert(name, Some(bytes));
                }
                3 => {
                    for _ in 0..random.usize(1..20).min(bytes.len()) {
                        let at = random.usize(..bytes.len());
                        bytes[at] = random.u8(..);
                    }
                    files.insert(name, Some(bytes));
                }
                4 => drop(files.insert(other, Some(bytes))),
                5 => drop(files.insert(name, None)),
                _ => {
                    const STRANGE: [&str; 6] = [
                        "samples.parts/4294967295.parquet",
                        "samples.parts/+1.parquet",
                        "samples-4294967295.open.arrows",
                        "samples-000002.open.arrows",
                        "samples.parquet",
                        "journal.jsonl.tmp",
                    ];
                    let strange = Path::new(STRANGE[random.usize(..STRANGE.len())]);
                    strange.parent().filter(|p| *p != Path::new("")).map(|p| files.insert(p.into(), None));
                    files.insert(strange.into(), Some(bytes));
                }
            }
            what
        }
    }
}

/// Everything that reads a run folder.
fn read_all(run: &Path, out: &Path) {
    let _ = verify(run);
    if let Ok(run) = RunFolder::open(run) {
        let _ = (run.results(), run.transients(), run.samples().count(), run.bytes());
        let _ = (terminal::campaign::summary(run.manifest()), run.manifest().ending_text(), page(&run));
        let exporters: [&dyn Exporter; 3] = [&Csv, &Mat, &Uff];
        for exporter in exporters {
            for table in [RunTable::Samples, RunTable::Results, RunTable::Transients] {
                if exporter.cannot_hold(table).is_some() {
                    continue;
                }
                let part = ExportSelection {
                    tables: vec![table],
                    set_up: None,
                    from_s: 0.0,
                    to_s: f64::INFINITY,
                    samples_read: Arc::default(),
                };
                let file = OutFile { path: out.join("export"), force: true };
                let _ = exporter.export(&run, &part, &file);
            }
        }
    }
    if let Ok(earlier) = EarlierRun::read(run) {
        let _ = (earlier.intentions(), earlier.is_complete());
        if let Some(begin) = earlier.journal.begun.first() {
            let _ = (earlier.differences(begin), earlier.changed_limits(begin));
        }
    }
}

/// What a program that resumes the run does with the files.
fn resume(run: &Path) {
    let Ok(earlier) = EarlierRun::read(run) else { return };
    let Some(begin) = earlier.journal.begun.first().cloned() else { return };
    let Ok(journal) = Journal::open(run) else { return };
    let layout = RecordLayout {
        signals: begin.signals,
        every_ticks: begin.every_ticks,
        tick_hz: begin.device.tick_hz,
        order: earlier.campaign.in_order(),
        about: Default::default(),
    };
    if let Ok(mut writer) = RunWriter::new(run, journal, layout, earlier.journal) {
        let _ = (writer.close(), writer.join(), writer.unwritten_rows(0));
    }
}

/// The commands that read a folder end with a message.
fn commands_survive(folder: &TempDir, run: &Path, what: &str) {
    let (run, base) = (run.to_str().unwrap(), run.parent().unwrap().to_str().unwrap());
    let resume = ["run", "--resume", run, "--timeout", "2", "--reconnect-s", "0"];
    for arguments in [&["runs", base][..], &["runs", "show", run], &resume] {
        let output = damprig(folder).args(arguments).timeout(PATIENCE).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        let code = output.status.code();
        assert!(matches!(code, Some(0..=2)) && !said.contains("panicked"), "{arguments:?}: {code:?}, {said}\n{what}");
    }
}

/// Number of changed folders: 40, or 4 000 in the full tests, in about half an hour.
fn changes() -> u64 {
    if is_full() { 4_000 } else { 40 }
}

/// Time after which a reader counts as hanging, also on a loaded machine.
const HANG: Duration = Duration::from_secs(120);

#[test]
fn no_change_of_a_run_folder_makes_a_reader_panic_hang_or_leave_it() {
    let folder = folder_with(&campaign());
    let originals = runs(&folder).map(|run| files(&run));
    let scratch = TempDir::new().unwrap();
    let canary = scratch.path().join("canary");
    for n in 0..changes() {
        let mut random = fastrand::Rng::with_seed(n);
        let mut changed = originals[n as usize % 2].clone();
        let what = change(&mut random, &mut changed);
        // A file in a folder that is gone, or under the name of a folder.
        let orphans: Vec<PathBuf> = changed
            .keys()
            .filter(|name| name.parent().is_some_and(|p| p != Path::new("") && !matches!(changed.get(p), Some(None))))
            .cloned()
            .collect();
        orphans.iter().for_each(|name| drop(changed.remove(name)));
        std::fs::write(&canary, "mine").unwrap();
        let (runs, out) = (scratch.path().join("runs"), scratch.path().join("exports"));
        std::fs::create_dir(&runs).unwrap();
        std::fs::create_dir(&out).unwrap();
        let run = runs.join("run");
        write(&run, &changed);
        let begun = Instant::now();
        let read = catch_unwind(AssertUnwindSafe(|| read_all(&run, &out)));
        assert!(read.is_ok(), "change {n} made a reader panic: {what}");
        assert!(files(&run) == changed, "change {n}: a reader changed the folder: {what}");
        if n % 20 == 0 {
            commands_survive(&folder, &run, &format!("change {n}: {what}"));
        }
        let resumed = catch_unwind(AssertUnwindSafe(|| resume(&run)));
        assert!(resumed.is_ok(), "change {n} made the resumption panic: {what}");
        assert!(begun.elapsed() < HANG, "change {n} took {:?}: {what}", begun.elapsed());
        assert_eq!(std::fs::read_to_string(&canary).unwrap(), "mine", "change {n}: {what}");
        let kept = ["campaign.toml", "journal.jsonl"];
        let is_kept = |name: &&str| !changed.contains_key(Path::new(name)) || run.join(name).exists();
        assert!(kept.iter().all(is_kept), "change {n} removed a file: {what}");
        assert_eq!(std::fs::read_dir(&runs).unwrap().count(), 1, "change {n}: {what}");
        std::fs::remove_dir_all(&runs).unwrap();
        std::fs::remove_dir_all(&out).unwrap();
    }
}

/// The crate that reads these files panics on some of them.
#[test]
fn a_table_with_a_changed_byte_is_read_or_refused() {
    let folder = folder_with(&campaign());
    let [_, run] = runs(&folder);
    let table = std::fs::read(run.join("results.parquet")).unwrap();
    let changed = folder.path().join("changed.parquet");
    let mut random = fastrand::Rng::with_seed(3);
    let mut refused = 0;
    for place in (0..table.len()).step_by(13) {
        let mut bytes = table.clone();
        bytes[place] = random.u8(..);
        std::fs::write(&changed, &bytes).unwrap();
        let outcome =
            parquet_file::read(&changed).and_then(|mut batches| batches.try_for_each(|batch| batch.map(drop)));
        refused += u32::from(outcome.is_err());
    }
    assert!(refused > 0);
}
