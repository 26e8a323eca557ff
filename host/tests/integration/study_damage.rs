//! Every file of a study is checked: a changed bit, other columns or points, and files of an older version.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::Arc;

use crate::common::damprig;
use crate::study::folder;
use crate::study_work::{short_study, table, undisturbed};
use arrow_array::{Array, ArrayRef, Float32Array, Float64Array, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use damprig::run_folder::read::parquet_file;
use damprig::study::Study;
use damprig::study::data_set::DataSet;
use damprig::study::inspect;
use damprig::study::store::Store;
use parquet::arrow::ArrowWriter;
use tempfile::TempDir;

fn study(folder: &TempDir, action: &str, out: &str) -> Output {
    damprig(folder).args(["study", action, "study.toml", "--out", out]).output().unwrap()
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn succeeds(output: &Output) -> String {
    assert!(output.status.success(), "{}", said(output));
    said(output)
}

fn fails(output: &Output, words: &[&str]) {
    let said = said(output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    for word in words {
        assert!(said.contains(word), "no {word:?} in:\n{said}");
    }
}

/// All files of a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found.sort();
    found
}

/// A complete study in `alone`.
fn complete() -> TempDir {
    let folder = folder(&short_study());
    undisturbed(&folder);
    folder
}

/// Whether a look at all files finds something wrong.
fn is_noticed(study: &Study, out: &Path) -> bool {
    let opened = DataSet::existing(study, Store::at(out).unwrap());
    opened.is_err()
        || opened.unwrap().is_none_or(|data_set| {
            inspect::verify(study, &data_set, |_| ()).is_ok_and(|verdict| verdict.wrong_files() > 0)
        })
}

#[test]
fn a_flipped_bit_in_any_file_of_a_study_is_noticed() {
    let folder = complete();
    let out = folder.path().join("alone");
    let (study, files) = (Study::read(&folder.path().join("study.toml")).unwrap(), files(&out));
    let names: Vec<String> = files.iter().map(|file| file.strip_prefix(&out).unwrap().display().to_string()).collect();
    for name in ["SHA256SUMS", "parts/00000005.parquet", "study.html", "study.json", "table.parquet", "x_over_z.svg"] {
        assert!(names.iter().any(|there| there == name), "{names:?}");
    }
    assert!(!is_noticed(&study, &out), "an unchanged study is right");
    let mut random = fastrand::Rng::with_seed(11);
    for flip in 0..300 {
        // Each file in turn: the small ones too.
        let file = &files[flip % files.len()];
        let whole = fs::read(file).unwrap();
        let mut bytes = whole.clone();
        let (place, bit) = (random.usize(..bytes.len()), random.u32(..8));
        bytes[place] ^= 1 << bit;
        fs::write(file, &bytes).unwrap();
        assert!(is_noticed(&study, &out), "bit {bit} of byte {place} of {}", file.display());
        fs::write(file, &whole).unwrap();
    }
    assert!(!is_noticed(&study, &out));
}

#[test]
fn a_changed_file_is_named_with_what_to_do_by_every_command_that_needs_it() {
    let folder = complete();
    let out = folder.path().join("alone");
    let flip = |name: &str| {
        let mut bytes = fs::read(out.join(name)).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(out.join(name), bytes).unwrap();
    };
    flip("x_over_z.svg");
    fails(&study(&folder, "verify", "alone"), &["x_over_z.svg: changed since it was written", "study merge"]);
    flip("table.parquet");
    fails(
        &study(&folder, "verify", "alone"),
        &["table.parquet: changed since it was written", "missing files", ": 2;"],
    );
    let expected = {
        flip("table.parquet");
        table(&folder, "alone")
    };
    flip("table.parquet");
    succeeds(&study(&folder, "merge", "alone"));
    assert_eq!(table(&folder, "alone"), expected);
    let right = succeeds(&study(&folder, "verify", "alone"));
    assert!(right.contains("6 of 6 parts are right") && right.contains("6 files are as they were written"), "{right}");

    flip("parts/00000004.parquet");
    for command in ["status", "verify", "merge", "run"] {
        fails(&study(&folder, command, "alone"), &["00000004.parquet: ", "remove ", "computed again"]);
    }
    fs::remove_file(out.join("parts/00000004.parquet")).unwrap();
    succeeds(&study(&folder, "run", "alone"));
    assert_eq!(table(&folder, "alone"), expected);

    flip("study.json");
    for command in ["status", "verify", "merge", "run"] {
        fails(&study(&folder, command, "alone"), &["study.json is damaged", "remove it", "goes on with the parts"]);
    }
    fs::remove_file(out.join("study.json")).unwrap();
    let part = fs::metadata(out.join("parts/00000000.parquet")).unwrap().modified().unwrap();
    succeeds(&study(&folder, "run", "alone"));
    assert_eq!(fs::metadata(out.join("parts/00000000.parquet")).unwrap().modified().unwrap(), part, "it is kept");
    succeeds(&study(&folder, "verify", "alone"));
}

#[test]
fn a_missing_file_an_appended_byte_and_the_table_of_another_study_fail_the_check() {
    let folder = complete();
    let out = folder.path().join("alone");
    let verify = || study(&folder, "verify", "alone");
    for (name, words) in [
        ("parts/00000003.parquet", "missing parts: 3"),
        ("SHA256SUMS", "SHA256SUMS: missing"),
        ("table.parquet", "table.parquet: missing"),
        ("x_over_z.svg", "x_over_z.svg: missing"),
    ] {
        let whole = fs::read(out.join(name)).unwrap();
        fs::remove_file(out.join(name)).unwrap();
        fails(&verify(), &[words, "damprig study ", ": 1; nothing was changed"]);
        fs::write(out.join(name), whole).unwrap();
    }
    for (name, words) in [("study.json", "study.json is damaged"), ("parts/00000003.parquet", "00000003.parquet: ")] {
        let whole = fs::read(out.join(name)).unwrap();
        fs::write(out.join(name), [&whole[..], b"\n"].concat()).unwrap();
        fails(&verify(), &[words]);
        fs::write(out.join(name), whole).unwrap();
    }
    succeeds(&verify());

    let other = self::folder(&short_study().replace("x_over_z", "max_x_over_z"));
    undisturbed(&other);
    let (own, table) = (out.join("table.parquet"), fs::read(other.path().join("alone/table.parquet")).unwrap());
    let digest = |bytes: &[u8]| damprig::run_folder::checksum::of_bytes(bytes);
    let sums = fs::read_to_string(out.join("SHA256SUMS")).unwrap();
    fs::write(out.join("SHA256SUMS"), sums.replace(&digest(&fs::read(&own).unwrap()), &digest(&table))).unwrap();
    fs::write(&own, table).unwrap();
    fails(&verify(), &["table.parquet: belongs to another study", "study merge", ": 1; nothing was changed"]);
    succeeds(&study(&folder, "merge", "alone"));
    succeeds(&verify());
}

/// A part or a table as an older version wrote it, or another program, changed by `change`.
fn rewrite(path: &Path, change: impl Fn(Vec<Field>, Vec<ArrayRef>) -> (Vec<Field>, Vec<ArrayRef>)) {
    let content = parquet_file::content("part", fs::read(path).unwrap().into()).unwrap();
    let (batch, mut metadata) = (&content.batches[0], content.metadata);
    metadata.remove("damprig.sha256").expect("a new part says that it has a digest");
    let fields = batch.schema().fields().iter().map(|field| field.as_ref().clone()).collect();
    let (fields, columns) = change(fields, batch.columns().to_vec());
    let schema = Arc::new(Schema::new_with_metadata(fields, metadata));
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, schema.clone(), None).unwrap();
    writer.write(&RecordBatch::try_new(schema, columns).unwrap()).unwrap();
    writer.close().unwrap();
    fs::write(path, bytes).unwrap();
}

#[test]
fn other_columns_or_points_in_a_part_are_named_with_its_file() {
    let folder = complete();
    let path = folder.path().join("alone/parts/00000001.parquet");
    let whole = fs::read(&path).unwrap();
    type Change = fn(Vec<Field>, Vec<ArrayRef>) -> (Vec<Field>, Vec<ArrayRef>);
    let changes: [(Change, &str); 6] = [
        (
            |mut fields, columns| {
                fields[2] = fields[2].clone().with_name("x_over_y");
                (fields, columns)
            },
            "its column 3 is x_over_y, and that of the study x_over_z",
        ),
        (|fields, columns| (fields[..4].to_vec(), columns[..4].to_vec()), "has no column unresolved"),
        (
            |mut fields, mut columns| {
                fields.push(fields[2].clone().with_name("more"));
                columns.push(columns[2].clone());
                (fields, columns)
            },
            "its column more is none of the study",
        ),
        (
            |mut fields, mut columns| {
                fields[3] = fields[3].clone().with_data_type(DataType::Float32);
                columns[3] = Arc::new(Float32Array::from(vec![1.0; columns[3].len()]));
                (fields, columns)
            },
            "its column rms_x_m has the type Float32, and that of the study Float64",
        ),
        (
            |mut fields, columns| {
                let metadata = [("unit".to_string(), "mm".to_string())];
                fields[3].set_metadata(metadata.into_iter().collect::<std::collections::HashMap<_, _>>());
                (fields, columns)
            },
            "its column rms_x_m has the unit \"mm\", and that of the study \"m\"",
        ),
        (
            |fields, mut columns| {
                columns[1] = Arc::new(Float64Array::from(vec![7.0, 8.5]));
                (fields, columns)
            },
            "row 3 has particle.clearance_ratio = 8.5, and the study 8.0",
        ),
    ];
    for (change, words) in changes {
        rewrite(&path, change);
        for command in ["verify", "merge", "run"] {
            fails(&study(&folder, command, "alone"), &["00000001.parquet: ", words, "remove "]);
        }
        fs::write(&path, &whole).unwrap();
    }
    succeeds(&study(&folder, "verify", "alone"));
}

#[test]
fn a_study_of_an_older_version_opens_and_says_that_it_has_no_digests() {
    let folder = complete();
    let out = folder.path().join("alone");
    for part in 0..6 {
        rewrite(&out.join(format!("parts/{part:08}.parquet")), |fields, columns| (fields, columns));
    }
    let manifest = fs::read_to_string(out.join("study.json")).unwrap();
    let mut manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    manifest.as_object_mut().unwrap().remove("sha256").expect("a digest");
    fs::write(out.join("study.json"), manifest.to_string()).unwrap();
    rewrite(&out.join("table.parquet"), |fields, columns| (fields, columns));
    fs::remove_file(out.join("SHA256SUMS")).unwrap();
    let no_digest = "parts have no digest; written by an older version";
    let verified = succeeds(&study(&folder, "verify", "alone"));
    assert!(verified.contains(&format!("6 {no_digest}")) && verified.contains("6 of 6 parts are right"), "{verified}");
    assert!(verified.contains("there is no SHA256SUMS"), "{verified}");
    // The part that is computed now has one.
    fs::remove_file(out.join("parts/00000002.parquet")).unwrap();
    for command in ["run", "status", "merge", "verify"] {
        let said = succeeds(&study(&folder, command, "alone"));
        assert!(said.contains(&format!("5 {no_digest}")), "{command}: {said}");
    }
}
