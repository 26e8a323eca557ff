//! Runs campaigns with the `damprig` command: the emulated board records the same bits as the virtual rig.

use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, Float64Type};
use arrow_array::{ArrayRef, RecordBatch};
use damprig_tests::support::command::{damprig, table, told};
use damprig_tests::support::emulator::Emulator;
use damprig_tests::support::images::{find, project};
use tempfile::TempDir;

/// Shipped campaigns that take long on the emulator: only in `tests/run --full`.
pub const LONG: [&str; 2] = ["closed-loop", "dampers"];

/// Campaigns of two hours of rig time and more: never on the emulator. The others have their set-ups, and [`one_sheet`] a part of
/// `hidden-branch`.
pub const TOO_LONG: [&str; 4] = ["hybrid", "hidden-branch", "resonance", "source-document"];

/// Campaigns with a `[plant]`, which only the virtual rig in double precision moves: never on the emulator.
pub const WITH_PLANT: [&str; 1] = ["frame-rig"];

const TABLES: [&str; 4] = ["results.parquet", "samples.parquet", "impacts.parquet", "transients.parquet"];

/// Longest silence of the emulator on a busy machine, s.
const PATIENCE_S: &str = "120";

/// Runs the campaign on `rig` with its results in `folder`.
fn run(campaign: &Path, rig: &str, folder: &Path) {
    let arguments = ["--rig", rig, "--timeout", PATIENCE_S, "--out"];
    let output = damprig().arg("run").arg(campaign).args(arguments).arg(folder).output().unwrap();
    assert!(output.status.success(), "--rig {rig}: {}", told(&output));
}

fn campaign(name: &str) -> PathBuf {
    project().join(format!("host/campaigns/{name}.toml"))
}

/// Names of the shipped campaigns; the long ones only if `DAMPRIG_FULL` is set.
fn campaigns() -> Vec<String> {
    let is_full = std::env::var_os("DAMPRIG_FULL").is_some();
    let paths = std::fs::read_dir(project().join("host/campaigns")).unwrap().map(|entry| entry.unwrap().path());
    let files = paths.filter(|path| path.extension().is_some_and(|extension| extension == "toml"));
    let names = files.map(|path| path.file_stem().unwrap().to_string_lossy().into_owned());
    let names = names.filter(|name| !TOO_LONG.contains(&name.as_str()) && !WITH_PLANT.contains(&name.as_str()));
    println!("skipped, because they take too long on the emulator: {}", TOO_LONG.join(", "));
    names.filter(|name| is_full || !LONG.contains(&name.as_str())).collect()
}

/// A text of a campaign with other lines in place of those of these keys, as a file of this name.
fn changed(text: &str, lines: &[(&str, &str)], folder: &Path, name: &str) -> (String, PathBuf) {
    let own =
        |line: &'_ str| line.split_once(" = ").and_then(|(key, _)| lines.iter().find(|(changed, _)| *changed == key));
    let text: Vec<&str> = text.lines().map(|line| own(line).map_or(line, |(_, other)| *other)).collect();
    let file = folder.join(format!("{name}.toml"));
    std::fs::write(&file, text.join("\n")).unwrap();
    (name.into(), file)
}

/// Two points of `resonance` on its hybrid: a resonance that the controller follows.
fn two_resonances(folder: &Path) -> (String, PathBuf) {
    let text = std::fs::read_to_string(campaign("resonance")).unwrap();
    let amplitudes = "x_amplitudes_m = [0.005, 0.006]\nset_ups = [\"hybrid\"]";
    changed(&text, &[("x_amplitudes_m", amplitudes), ("steady", "")], folder, "two-resonances")
}

/// The first sheet of `hidden-branch` at two frequencies: a response that the controller keeps.
fn one_sheet(folder: &Path) -> (String, PathBuf) {
    let text = std::fs::read_to_string(campaign("hidden-branch")).unwrap();
    let (sheets, _) = text.split_once("[[experiment]]\nname = \"up\"").expect("sweeps after the sheets");
    let lines = [("x_amplitudes_m", "x_amplitudes_m = [0.0031]"), ("frequencies_hz", "frequencies_hz = [3.1, 3.12]")];
    changed(sheets, &lines, folder, "one-sheet")
}

/// The values of a column, with floating-point numbers as their bits.
fn bits(column: &ArrayRef) -> String {
    if let Some(values) = column.as_primitive_opt::<Float32Type>() {
        format!("{:?}", values.iter().map(|value| value.map(f32::to_bits)).collect::<Vec<_>>())
    } else if let Some(values) = column.as_primitive_opt::<Float64Type>() {
        format!("{:?}", values.iter().map(|value| value.map(f64::to_bits)).collect::<Vec<_>>())
    } else {
        format!("{column:?}")
    }
}

fn rows(batches: &[RecordBatch]) -> usize {
    batches.iter().map(RecordBatch::num_rows).sum()
}

/// Asserts that every column of both tables is equal, bit for bit. Returns the number of rows.
fn assert_same_table(name: &str, here: &Path, there: &Path) -> usize {
    let (ours, theirs) = (table(&here.join(name)), table(&there.join(name)));
    assert_eq!(rows(&ours), rows(&theirs), "{name}: rows");
    for (ours, theirs) in ours.iter().zip(&theirs) {
        assert_eq!(ours.schema().fields(), theirs.schema().fields(), "{name}: columns");
        for (n, field) in ours.schema().fields().iter().enumerate() {
            assert!(bits(ours.column(n)) == bits(theirs.column(n)), "{name}: {} differs", field.name());
        }
    }
    rows(&ours)
}

#[test]
fn the_shipped_campaigns_give_the_same_tables_on_the_emulated_board() {
    let Some(image) = find("mps2-an386") else { return };
    let folder = TempDir::new().unwrap();
    let mut files: Vec<(String, PathBuf)> =
        campaigns().into_iter().map(|name| (name.clone(), campaign(&name))).collect();
    assert!(files.len() >= 4, "too few campaigns: {files:?}");
    files.extend([one_sheet(folder.path()), two_resonances(folder.path())]);
    for (name, file) in &files {
        let (here, there) = (folder.path().join(name), folder.path().join(format!("{name}-emulated")));
        run(file, "virtual:f32", &here);
        run(file, &Emulator::start(&image).address(), &there);
        let mut compared = 0;
        for table in TABLES {
            assert_eq!(
                here.join(table).is_file(),
                there.join(table).is_file(),
                "{name}: {table} exists for only one of the rigs"
            );
            if here.join(table).is_file() {
                let rows = assert_same_table(table, &here, &there);
                println!("{name}: {rows} rows of {table} are the same");
                compared += rows;
            }
        }
        assert!(compared > 1000, "{name}: only {compared} rows were compared");
    }
}

#[test]
fn a_repeated_campaign_on_the_emulated_board_gives_the_same_bits() {
    let Some(image) = find("mps2-an386") else { return };
    let folder = TempDir::new().unwrap();
    let folder = |name: &str| folder.path().join(name);
    for name in ["once", "again"] {
        run(&campaign("tuned"), &Emulator::start(&image).address(), &folder(name));
    }
    for table in ["results.parquet", "samples.parquet", "impacts.parquet"] {
        assert!(assert_same_table(table, &folder("once"), &folder("again")) > 0);
    }
}

#[test]
fn double_precision_gives_other_bits() {
    // Shows that the comparison above can fail.
    let folder = TempDir::new().unwrap();
    let (single, double) = (folder.path().join("single"), folder.path().join("double"));
    run(&campaign("short"), "virtual:f32", &single);
    run(&campaign("short"), "virtual", &double);
    let (single, double) = (table(&single.join("samples.parquet")), table(&double.join("samples.parquet")));
    let x = |batches: &[RecordBatch]| bits(batches[0].column_by_name("x_m").unwrap());
    assert_ne!(x(&single), x(&double));
}
