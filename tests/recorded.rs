//! The shipped campaigns and cases reproduce the recorded numbers, bit for bit, on both virtual rigs; the longest campaigns, and long ones on
//! `virtual:f32`, only if `DAMPRIG_FULL` is set.
//!
//! `recorded.toml` contains a digest of each column of each table, of each export, and of each part of a simulation's
//! answer. After an intended change of numbers, record them again with
//! `DAMPRIG_RECORD=1 cargo test -p damprig-tests recorded`; the diff of that file lists the changes.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, Float64Type, Int32Type, UInt32Type, UInt64Type};
use arrow_array::{Array, ArrayRef, DictionaryArray};
use damprig_tests::support::command::{damprig, table, told};
use damprig_tests::support::images::project;
use sha2::{Digest, Sha256};

use crate::emulated_campaign::{LONG, TOO_LONG, WITH_PLANT};

const TABLES: [&str; 4] = ["results", "samples", "impacts", "transients"];
const EXPORTS: [&str; 3] = ["csv", "mat", "uff"];
/// Length of the text before the data of a MAT file; it contains the date.
const MAT_TEXT_BYTES: usize = 116;

/// Digests by the name of their content.
type Digests = BTreeMap<String, String>;

fn short(hash: Sha256) -> String {
    hash.finalize().iter().take(6).map(|byte| format!("{byte:02x}")).collect()
}

fn of_bytes(bytes: &[u8]) -> String {
    short(Sha256::new_with_prefix(bytes))
}

fn push(hash: &mut Sha256, column: &ArrayRef) {
    for row in 0..column.len() {
        hash.update([u8::from(column.is_null(row))]);
        if let Some(values) = column.as_primitive_opt::<Float64Type>() {
            hash.update(values.value(row).to_bits().to_le_bytes());
        } else if let Some(values) = column.as_primitive_opt::<Float32Type>() {
            hash.update(values.value(row).to_bits().to_le_bytes());
        } else if let Some(values) = column.as_primitive_opt::<UInt64Type>() {
            hash.update(values.value(row).to_le_bytes());
        } else if let Some(values) = column.as_primitive_opt::<UInt32Type>() {
            hash.update(values.value(row).to_le_bytes());
        } else if let Some(values) = column.as_primitive_opt::<Int32Type>() {
            hash.update(values.value(row).to_le_bytes());
        } else if let Some(values) = column.as_boolean_opt() {
            hash.update([u8::from(values.value(row))]);
        } else if let Some(values) = column.as_string_opt::<i32>() {
            hash.update(values.value(row));
        } else {
            let values: &DictionaryArray<Int32Type> = column.as_dictionary();
            let texts = values.values().as_string::<i32>();
            hash.update(texts.value(values.keys().value(row) as usize));
        }
    }
}

/// Number of rows, and the digest of each column.
fn of_table(batches: &[RecordBatch]) -> String {
    let Some(first) = batches.first() else { return "no rows".into() };
    let rows: usize = batches.iter().map(RecordBatch::num_rows).sum();
    let mut line = format!("{rows} rows");
    for field in first.schema().fields() {
        let mut hash = Sha256::new();
        for batch in batches {
            push(&mut hash, batch.column_by_name(field.name()).expect("every batch has the same columns"));
        }
        line += &format!(" {}={}", field.name(), short(hash));
    }
    line
}

/// The digest of an export, without the initial text of a MAT file, which contains the export date.
fn of_export(path: &Path) -> String {
    let bytes = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let is_mat = path.extension().is_some_and(|extension| extension == "mat");
    of_bytes(&bytes[if is_mat { MAT_TEXT_BYTES } else { 0 }..])
}

/// Sets fixed values for start, program and protocol in a run's manifest, because the exports repeat them.
fn settle_manifest(run: &Path) {
    let path = run.join("manifest.json");
    let mut manifest: serde_json::Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    manifest["started"] = "2026-01-01T00:00:00+00:00[Etc/UTC]".into();
    manifest["damprig"] = "damprig".into();
    manifest["device"]["protocol_schema"] = "0".into();
    fs::write(&path, manifest.to_string()).unwrap();
}

fn files_in(folder: &str, extension: &str) -> Vec<PathBuf> {
    let folder = project().join(folder);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let paths = entries.map(|entry| entry.expect("a readable folder").path());
    let mut files: Vec<_> = paths.filter(|path| path.extension().is_some_and(|e| e == extension)).collect();
    files.sort();
    assert!(!files.is_empty(), "no {extension} files in {}", folder.display());
    files
}

fn stem(path: &Path) -> String {
    path.file_stem().expect("a file has a name").to_string_lossy().into_owned()
}

/// Whether a run, named by its campaign and rig, takes too long for every run of the tests, or the rig refuses it.
fn is_left_out(name: &str) -> bool {
    let is_full = ["DAMPRIG_FULL", "DAMPRIG_RECORD"].iter().any(|name| std::env::var_os(name).is_some());
    let is_one_of = |names: &[&str], rig| names.iter().any(|long| name.starts_with(&format!("{long}/{rig}")));
    let is_long = is_one_of(&TOO_LONG, "") || is_one_of(&LONG, "virtual:f32") || is_one_of(&WITH_PLANT, "");
    (is_long && !is_full) || is_one_of(&WITH_PLANT, "virtual:f32")
}

fn run_campaigns(digests: &mut Digests) {
    let scratch = tempfile::tempdir().unwrap();
    for campaign in files_in("host/campaigns", "toml") {
        for rig in ["virtual", "virtual:f32"] {
            let name = format!("{}/{rig}", stem(&campaign));
            if is_left_out(&name) {
                continue;
            }
            let run = scratch.path().join(name.replace([':', '/'], "-"));
            let output = damprig().arg("run").arg(&campaign).args(["--rig", rig, "--out"]).arg(&run).output();
            let output = output.expect("the command starts");
            assert!(output.status.success(), "{name}: {}", told(&output));
            for what in TABLES {
                let file = run.join(format!("{what}.parquet"));
                if file.is_file() {
                    digests.insert(format!("{name}/{what}"), of_table(&table(&file)));
                }
            }
            settle_manifest(&run);
            for format in EXPORTS {
                let file = scratch.path().join(format!("export.{format}"));
                let mut export = damprig();
                export.args(["runs", "export", "--format", format]).arg(&run).arg("--out").arg(&file);
                let output = export.output().expect("the command starts");
                assert!(output.status.success(), "{name}, {format}: {}", told(&output));
                digests.insert(format!("{name}/export.{format}"), of_export(&file));
                fs::remove_file(&file).unwrap();
            }
        }
    }
}

/// Digests each part of an answer separately, so that a new part does not change the other digests.
fn simulate(digests: &mut Digests) {
    let scratch = tempfile::tempdir().unwrap();
    for file in files_in("host/cases", "toml").into_iter().chain(files_in("tests/cases", "json")) {
        let mut case = file.clone();
        if file.extension().is_some_and(|extension| extension == "json") {
            let golden: serde_json::Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
            case = scratch.path().join("case.json");
            fs::write(&case, golden["case"].to_string()).unwrap();
        }
        let output = damprig().arg("simulate").arg(&case).arg("--json").output().expect("the command starts");
        assert!(output.status.success(), "{}: {}", file.display(), told(&output));
        let answer: serde_json::Value = serde_json::from_slice(&output.stdout).expect("--json answers in JSON");
        let parts = answer.as_object().expect("an object").iter();
        let line: Vec<_> =
            parts.map(|(key, value)| format!("{key}={}", of_bytes(value.to_string().as_bytes()))).collect();
        digests.insert(format!("simulate/{}", stem(&file)), line.join(" "));
    }
}

#[test]
fn the_shipped_campaigns_and_cases_give_the_recorded_numbers() {
    let mut digests = Digests::new();
    run_campaigns(&mut digests);
    simulate(&mut digests);
    let path = project().join("tests/recorded.toml");
    if std::env::var_os("DAMPRIG_RECORD").is_some() {
        fs::write(&path, toml::to_string(&digests).unwrap()).unwrap();
        return;
    }
    let mut recorded: Digests = toml::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    recorded.retain(|name, _| !is_left_out(name));
    let names = recorded.keys().chain(digests.keys().filter(|name| !recorded.contains_key(*name)));
    let mut changes = vec![];
    for name in names {
        match (recorded.get(name), digests.get(name)) {
            (Some(old), Some(new)) if old == new => {}
            (Some(old), Some(new)) => {
                let old: Vec<_> = old.split(' ').collect();
                let changed: Vec<_> = new.split(' ').filter(|part| !old.contains(part)).collect();
                changes.push(format!("{name}: now {}", changed.join(" ")));
            }
            (None, new) => changes.push(format!("{name}: is new: {}", new.map_or("", String::as_str))),
            (_, None) => changes.push(format!("{name}: is missing")),
        }
    }
    assert!(
        changes.is_empty(),
        "numbers differ from tests/recorded.toml; if that is intended, record them again (see the file header):\n{}",
        changes.join("\n")
    );
}
