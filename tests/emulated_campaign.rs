//! A campaign through the real command: on the emulated board it records what the virtual rig records, to the bit.

use std::path::Path;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, Float64Type};
use arrow_array::{ArrayRef, RecordBatch};
use damprig_tests::support::command::{damprig, table, told};
use damprig_tests::support::emulator::Emulator;
use damprig_tests::support::images::{find, project};
use tempfile::TempDir;

/// Runs the short campaign on `rig` into `folder`.
fn run(rig: &str, folder: &Path) {
    let campaign = project().join("host/campaigns/short.toml");
    let output = damprig().arg("run").arg(campaign).args(["--rig", rig, "--out"]).arg(folder).output().unwrap();
    assert!(output.status.success(), "--rig {rig}: {}", told(&output));
}

/// The column's values with floating-point numbers as their bits.
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

/// Every column of both tables, bit for bit; the number of rows.
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
fn a_campaign_gives_the_same_results_and_samples_on_the_emulated_board_twice() {
    let Some(image) = find("mps2-an386") else { return };
    let folder = TempDir::new().unwrap();
    let folder = |name: &str| folder.path().join(name);
    run("virtual:f32", &folder("virtual"));
    for name in ["emulated", "again"] {
        let emulator = Emulator::start(&image);
        run(&emulator.address(), &folder(name));
        let results = assert_same_table("results.parquet", &folder("virtual"), &folder(name));
        let samples = assert_same_table("samples.parquet", &folder("virtual"), &folder(name));
        println!("{name}: {results} results and {samples} samples are the same");
        assert!(results == 6 && samples > 1000, "the campaign recorded {results} results, {samples} samples");
    }
}

#[test]
fn double_precision_gives_other_bits() {
    // So the comparison above can fail.
    let folder = TempDir::new().unwrap();
    let (single, double) = (folder.path().join("single"), folder.path().join("double"));
    run("virtual:f32", &single);
    run("virtual", &double);
    let (single, double) = (table(&single.join("samples.parquet")), table(&double.join("samples.parquet")));
    let x =
        |batches: &[RecordBatch]| bits(batches[0].column_by_name("x").or(batches[0].column_by_name("x_m")).unwrap());
    assert_ne!(x(&single), x(&double));
}
