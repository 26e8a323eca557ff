//! `damprig study work`, `status`, `verify` and `merge`: several workers, killed at any moment, make the table of one undisturbed run,
//! byte for byte.
//!
//! A few kills in the default run, 100 with `DAMPRIG_FULL`.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use crate::common::{damprig, is_full};
use crate::study::folder;
use arrow_array::RecordBatch;
use damprig::run_folder::sealed_parquet;
use damprig::study::Study;
use damprig::study::data_set::DataSet;
use damprig::study::store::Store;
use tempfile::TempDir;

/// Twelve points in six parts; each part takes some tenths of a second.
pub const STUDY: &str = "\
case = \"case.toml\"
metrics = [\"x_over_z\", \"rms_x_m\"]
points_per_part = 2
[[axis]]
key = \"particle.clearance_ratio\"
from = 5
to = 16
count = 12
[record]
cycles = 20000
";

/// The same with parts of some milliseconds.
pub fn short_study() -> String {
    STUDY.replace("20000", "20")
}

fn study_of(folder: &TempDir) -> Study {
    Study::read(&folder.path().join("study.toml")).unwrap()
}

fn data_set(folder: &TempDir, out: &str) -> DataSet {
    DataSet::open(&study_of(folder), Store::at(&folder.path().join(out)).unwrap()).unwrap()
}

fn study(folder: &TempDir, action: &str, out: &str, more: &[&str]) -> Output {
    let mut command = damprig(folder);
    command.args(["study", action, "study.toml", "--out", out]).args(more).output().unwrap()
}

fn succeeds(output: &Output) -> String {
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}");
    said
}

fn fails(output: &Output, code: i32, words: &[&str]) {
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{said}");
    for word in words {
        assert!(said.contains(word), "no {word:?} in:\n{said}");
    }
}

/// A worker in the background, on one thread.
fn worker(folder: &TempDir, out: &str, which: &[&str]) -> Child {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("damprig"));
    command.current_dir(folder.path()).env("RAYON_NUM_THREADS", "1");
    command.args(["study", "work", "study.toml", "--out", out]).args(which);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// The table of one run without disturbance.
pub fn undisturbed(folder: &TempDir) -> Vec<u8> {
    succeeds(&study(folder, "run", "alone", &[]));
    table(folder, "alone")
}

pub fn table(folder: &TempDir, out: &str) -> Vec<u8> {
    fs::read(folder.path().join(out).join("table.parquet")).unwrap()
}

fn part(folder: &TempDir, out: &str, part: u64) -> std::path::PathBuf {
    folder.path().join(out).join(format!("parts/{part:08}.parquet"))
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn two_workers_for_each_of_two_shares_at_once_make_the_table_of_one_run() {
    let folder = folder(&short_study());
    let expected = undisturbed(&folder);
    let workers: Vec<Child> =
        ["1/2", "2/2", "1/2", "2/2"].iter().map(|shard| worker(&folder, "out", &["--shard", shard])).collect();
    for mut worker in workers {
        assert!(worker.wait().unwrap().success());
    }
    assert!(!folder.path().join("out/table.parquet").exists(), "a worker joins nothing");
    let said = succeeds(&study(&folder, "merge", "out", &[]));
    assert!(said.contains("x_over_z") && said.contains("12 rows"), "{said}");
    assert_eq!(table(&folder, "out"), expected);
    assert_eq!(names(&folder.path().join("out/parts")).len(), 6, "nothing else is left over");
}

#[test]
fn a_share_has_the_parts_of_its_remainder_and_merging_names_the_others() {
    let folder = folder(&short_study());
    let said = succeeds(&study(&folder, "work", "out", &["--shard", "2/4"]));
    assert!(said.contains("part 1 of 6: rows 2 to 3") && said.contains("missing parts of other shares: 4"), "{said}");
    assert_eq!(names(&folder.path().join("out/parts")), ["00000001.parquet", "00000005.parquet"]);
    let merged = study(&folder, "merge", "out", &[]);
    fails(&merged, 1, &["4 of 6 parts", "missing: 0, 2 to 4", "study work"]);
    assert!(!String::from_utf8_lossy(&merged.stderr).contains("full disk"), "merging again would not help");
    assert!(!folder.path().join("out/table.parquet").exists());
    let said = succeeds(&study(&folder, "status", "out", &[]));
    assert!(said.contains("2 of 6 parts done, 4 missing") && said.contains("left"), "{said}");
    let words = ["2 of 6 parts are right", "missing parts: 0, 2 to 4", "study run", "there is no table yet"];
    fails(&study(&folder, "verify", "out", &[]), 1, &words);
}

#[test]
fn workers_killed_at_random_moments_spoil_nothing() {
    let kills = if is_full() { 100 } else { 4 };
    let folder = folder(STUDY);
    let expected = undisturbed(&folder);
    let mut random = fastrand::Rng::with_seed(7);
    let which: [&[&str]; 3] = [&["--shard", "1/2"], &["--shard", "1/1"], &["--shard", "2/2"]];
    for kill in 0..kills {
        let mut workers: Vec<Child> = which.iter().map(|which| worker(&folder, "out", which)).collect();
        for worker in &mut workers {
            // The moment of the kill: nothing is waited for.
            std::thread::sleep(Duration::from_millis(random.u64(0..300)));
            worker.kill().unwrap();
            worker.wait().unwrap();
        }
        let parts = folder.path().join("out/parts");
        if parts.exists() && names(&parts).iter().filter(|name| !name.starts_with('.')).count() == 6 {
            succeeds(&study(&folder, "merge", "out", &[]));
            assert_eq!(table(&folder, "out"), expected, "after {kill} kills");
            fs::remove_dir_all(folder.path().join("out")).unwrap();
        }
    }
    succeeds(&study(&folder, "work", "out", &["--shard", "1/1"]));
    succeeds(&study(&folder, "verify", "out", &[]));
    succeeds(&study(&folder, "merge", "out", &[]));
    assert_eq!(table(&folder, "out"), expected);
}

#[test]
fn a_worker_of_another_version_is_refused_and_writes_nothing() {
    let folder = folder(&short_study());
    succeeds(&study(&folder, "work", "out", &["--shard", "1/2"]));
    let path = folder.path().join("out/study.json");
    let mut manifest: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    manifest["damprig"] = "damprig 9.0.0".into();
    // Without its digest, which only the other version could write.
    manifest.as_object_mut().unwrap().remove("sha256");
    let other = manifest.to_string();
    fs::write(&path, &other).unwrap();
    for (action, more) in [("work", ["--shard", "2/2"].as_slice()), ("status", &[]), ("verify", &[]), ("merge", &[])] {
        fails(&study(&folder, action, "out", more), 2, &["written by damprig 9.", "this is damprig 0.", "--out"]);
    }
    assert_eq!(names(&folder.path().join("out/parts")).len(), 3);
    assert_eq!(fs::read_to_string(&path).unwrap(), other);
}

#[test]
fn a_worker_of_another_build_is_refused_and_so_are_its_parts() {
    let folder = folder(&short_study());
    succeeds(&study(&folder, "work", "out", &["--shard", "1/2"]));
    let path = folder.path().join("out/study.json");
    let mut manifest: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let own = manifest["build"].as_str().expect("a digest").to_string();
    assert!(own.len() == 16 && own == damprig::BUILD, "{own}");
    manifest["build"] = "0123456789abcdef".into();
    manifest.as_object_mut().unwrap().remove("sha256");
    fs::write(&path, manifest.to_string()).unwrap();
    for (action, more) in [("work", ["--shard", "2/2"].as_slice()), ("status", &[]), ("merge", &[])] {
        fails(&study(&folder, action, "out", more), 2, &["another build", "0123456789abcdef", &own, "--out"]);
    }
    // The parts say it too, where the manifest was removed.
    fs::remove_file(&path).unwrap();
    let other = data_set(&folder, "out").part(&study_of(&folder), 0).unwrap().expect("a part").batch;
    let mut about = other.schema().metadata().clone();
    about.insert("damprig.build", "0123456789abcdef");
    let schema = other.schema().as_ref().clone().with_metadata(about);
    let other = RecordBatch::try_new(schema.into(), other.columns().to_vec()).unwrap();
    let bytes = sealed_parquet::bytes(&other).unwrap();
    fs::write(part(&folder, "out", 0), bytes).unwrap();
    fails(&study(&folder, "verify", "out", &[]), 1, &["00000000.parquet", "another build", "0123456789abcdef", &own]);
}

#[test]
fn parts_are_sized_by_the_time_that_their_points_take() {
    let parts = |case: &str, count: usize| {
        let folder = folder(&format!(
            "case = \"case.toml\"\nmetrics = [\"rms_x_m\"]\n[[axis]]\nkey = \"base.frequency_hz\"\nfrom = 2\nto = 3\ncount = {count}\n"
        ));
        fs::write(folder.path().join("case.toml"), case).unwrap();
        let said = succeeds(&study(&folder, "run", "out", &["--dry-run"]));
        let (_, parts) = said.split_once("parts: ").expect("the parts");
        parts.lines().next().unwrap().parse::<u64>().unwrap()
    };
    let spheres = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/cases/many-particles.toml")).unwrap();
    assert!(parts(&spheres, 48) > 16, "each worker of several has points of spheres");
    assert_eq!(parts(crate::study::CASE, 48), 1, "short simulations share a part");
}

#[test]
fn a_half_written_part_and_a_strange_file_are_named_with_what_to_do() {
    let folder = folder(&short_study());
    let expected = undisturbed(&folder);
    succeeds(&study(&folder, "work", "out", &["--shard", "1/1"]));
    let whole = fs::read(part(&folder, "out", 3)).unwrap();
    fs::write(part(&folder, "out", 3), &whole[..whole.len() / 2]).unwrap();
    fs::copy(part(&folder, "out", 0), part(&folder, "out", 1)).unwrap();
    fs::write(folder.path().join("out/parts/notes.txt"), "x").unwrap();
    let words =
        ["00000003.parquet", "cut off", "00000001.parquet: does not have the rows 2 to 3", "notes.txt", "remove"];
    fails(&study(&folder, "verify", "out", &[]), 1, &words);
    fails(&study(&folder, "merge", "out", &[]), 1, &["00000001.parquet", "remove"]);
    assert!(!folder.path().join("out/table.parquet").exists());
    for wrong in [part(&folder, "out", 3), part(&folder, "out", 1), folder.path().join("out/parts/notes.txt")] {
        fs::remove_file(wrong).unwrap();
    }
    succeeds(&study(&folder, "work", "out", &["--shard", "1/1"]));
    succeeds(&study(&folder, "verify", "out", &[]));
    succeeds(&study(&folder, "merge", "out", &[]));
    assert_eq!(table(&folder, "out"), expected);
}

#[test]
fn a_wrong_command_line_is_refused_and_makes_nothing() {
    let folder = folder(&short_study());
    let cases: &[(&str, &[&str], &[&str])] = &[
        ("work", &[], &["--shard"]),
        ("work", &["--shard", "0/4"], &["0/4", "counts from 1", "index + 1"]),
        ("work", &["--shard", "5/4"], &["5/4", "from 1 to n"]),
        ("work", &["--claim"], &["--claim"]),
        ("status", &[], &["has no results of a study", "study work"]),
        ("verify", &[], &["has no results of a study"]),
        ("merge", &[], &["has no results of a study"]),
    ];
    for (action, more, words) in cases {
        fails(&study(&folder, action, "out", more), 2, words);
    }
    assert!(!folder.path().join("out").exists());
    fs::create_dir(folder.path().join("out")).unwrap();
    fs::write(folder.path().join("out/thesis.tex"), "x").unwrap();
    fails(&study(&folder, "work", "out", &["--shard", "1/1"]), 2, &["is not empty and has no study"]);
    fails(&study(&folder, "work", "s3://bucket/a", &["--shard", "1/1"]), 2, &["s3://bucket/a", "give a folder"]);
}

/// Largest memory of `study merge`, bytes, over a synthetic set of so many rows; the table has them all.
#[cfg(target_os = "linux")]
fn memory_of_merging(rows: u64) -> u64 {
    let text =
        short_study().replace("count = 12", "count = 1000").replace("points_per_part = 2", "points_per_part = 50000");
    let other =
        format!("[[axis]]\nkey = \"particle.wall.coefficient\"\nfrom = 0.1\nto = 0.9\ncount = {}\n", rows / 1000);
    let folder = folder(&text.replace("[record]", &format!("{other}[record]")));
    let (study, data_set) = (study_of(&folder), data_set(&folder, "out"));
    let mut random = fastrand::Rng::with_seed(3);
    for part in 0..data_set.manifest().parts() {
        let numbers = data_set.manifest().rows_of(part);
        let values: Vec<Vec<f64>> = numbers.map(|_| vec![random.f64(), random.f64(), 0.0]).collect();
        data_set.write_part(&study, part, &values).unwrap();
    }
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("damprig"));
    command.current_dir(folder.path()).args(["study", "merge", "study.toml", "--out", "out"]).stdout(Stdio::null());
    let mut merge = command.spawn().unwrap();
    let mut peak_kib = 0;
    while merge.try_wait().unwrap().is_none() {
        let status = fs::read_to_string(format!("/proc/{}/status", merge.id())).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        peak_kib = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(peak_kib);
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(merge.wait().unwrap().success());
    assert_eq!(crate::common::rows(folder.path().join("out/table.parquet")) as u64, rows);
    println!("{rows} rows: {peak_kib} KiB");
    1024 * peak_kib
}

#[cfg(target_os = "linux")]
#[test]
fn joining_many_parts_takes_the_memory_of_few() {
    if !is_full() {
        return;
    }
    // 32 bytes for each row: both fill row groups of 32 MiB, and the longer table has 192 MB more.
    let (short, long) = (memory_of_merging(2_000_000), memory_of_merging(8_000_000));
    // Its footer lists more row groups, and the allocator keeps some memory.
    assert!(long < short + (24 << 20), "{short} and {long} bytes");
}

#[test]
fn a_million_points_are_computed_in_shares_and_joined() {
    if !is_full() {
        return;
    }
    let folder = folder(
        "case = \"case.toml\"\nmetrics = [\"max_abs_x_m\"]\nrecord = { cycles = 2 }\n\
         [[axis]]\nkey = \"particle.clearance_ratio\"\nfrom = 8\nto = 16\ncount = 1000\n\
         [[axis]]\nkey = \"particle.wall.coefficient\"\nfrom = 0.2\nto = 0.8\ncount = 1000\n",
    );
    let mut workers: Vec<Child> = ["1/2", "2/2"].map(|shard| worker(&folder, "out", &["--shard", shard])).into();
    workers.iter_mut().for_each(|worker| assert!(worker.wait().unwrap().success()));
    let said = succeeds(&study(&folder, "merge", "out", &[]));
    assert!(said.contains("1000000 rows"), "{said}");
    let table = crate::study::table(&folder.path().join("out/table.parquet"));
    let [values, clearances, coefficients] = ["max_abs_x_m", "particle.clearance_ratio", "particle.wall.coefficient"]
        .map(|name| crate::study::column(&table, name));
    for row in [0, 123_456, 999_999] {
        let set = [
            format!("particle.clearance_ratio={:?}", clearances[row]),
            format!("particle.wall.coefficient={:?}", coefficients[row]),
            "run.duration_s=0.8".into(),
        ];
        let single = crate::study::simulated(&folder, &set)["summary"]["max_abs_x_m"].as_f64().unwrap();
        assert!((values[row] / single - 1.0).abs() < 1e-9, "row {row}: {} and not {single}", values[row]);
    }
}
