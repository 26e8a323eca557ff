//! `damprig study`: a table of points that equal single simulations, whatever the threads and interruptions.

use std::path::Path;
use std::process::Output;

use crate::common::{damprig, read_parquet};
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use serde_json::Value;
use tempfile::TempDir;

pub const CASE: &str = "\
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }
particle = { mass_ratio = 0.1, clearance_m = 0.03, wall = { kind = \"restitution\", coefficient = 0.5 } }
run = { duration_s = 8 }
";

const TWO_AXES: &str = "\
case = \"case.toml\"
metrics = [\"x_over_z\", \"max_abs_x_m\", \"rms_x_m\", \"impacts_per_cycle\"]
points_per_part = 4
[[axis]]
key = \"particle.clearance_ratio\"
values = [9, 10, 12]
[[axis]]
key = \"particle.wall.coefficient\"
from = 0.3
to = 0.8
count = 3
";

pub fn folder(study: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("case.toml"), CASE).unwrap();
    std::fs::write(folder.path().join("study.toml"), study).unwrap();
    folder
}

pub fn run(folder: &TempDir, threads: &str, more: &[&str]) -> Output {
    let mut command = damprig(folder);
    command.env("RAYON_NUM_THREADS", threads).args(["study", "run", "study.toml"]).args(more);
    command.output().unwrap()
}

pub fn done(folder: &TempDir) -> RecordBatch {
    let output = run(folder, "2", &["--out", "out"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    table(&folder.path().join("out/table.parquet"))
}

pub fn table(path: &Path) -> RecordBatch {
    let batches = read_parquet(path.to_path_buf());
    arrow_select::concat::concat_batches(&batches[0].schema(), &batches).unwrap()
}

pub fn column(table: &RecordBatch, name: &str) -> Vec<f64> {
    let column = table.column_by_name(name).unwrap_or_else(|| panic!("no {name} in {:?}", table.schema()));
    let values = column.as_primitive::<Float64Type>();
    values.iter().map(|value| value.unwrap_or(f64::NAN)).collect()
}

pub fn simulated(folder: &TempDir, set: &[String]) -> Value {
    let mut command = damprig(folder);
    command.args(["simulate", "case.toml", "--json"]);
    for value in set {
        command.args(["--set", value]);
    }
    serde_json::from_slice(&command.output().unwrap().stdout).expect("JSON")
}

fn refused(study: &str, words: &[&str]) {
    let folder = folder(study);
    let output = run(&folder, "2", &["--out", "out"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{study}\n{told}");
    for word in words {
        assert!(told.contains(word), "no {word:?} in:\n{told}");
    }
    assert!(!folder.path().join("out").exists(), "{study}");
}

/// A particle that never reaches its walls has two multipliers of 1. Those of the structure are e^(−ζωT), T the drive period.
#[test]
fn the_largest_multiplier_of_a_motion_without_impacts_is_that_of_the_structure() {
    let study = "case = \"case.toml\"\nmetrics = [\"largest_multiplier\"]\n[[axis]]\nkey = \"base.frequency_hz\"\nvalues = [1.0, 1.25]\n";
    let folder = folder(study);
    let case = CASE.replace("amplitude_m = 0.003", "amplitude_m = 1e-5").replace("duration_s = 8", "duration_s = 400");
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    let table = done(&folder);
    let found = column(&table, "largest_multiplier");
    for (largest, drive_hz) in found.iter().zip([1.0, 1.25]) {
        let expected = (-0.0038 * std::f64::consts::TAU * 2.5 / drive_hz).exp();
        assert!((largest - expected).abs() < 1e-6, "{found:?} {expected}");
    }
}

/// Compares every row with a single simulation of its point: `alike` gets the value of the table and that of the simulation.
fn every_point(folder: &TempDir, alike: impl Fn(f64, f64) -> bool) {
    let table = done(folder);
    assert_eq!(table.num_rows(), 9);
    let (d, e) = (column(&table, "particle.clearance_ratio"), column(&table, "particle.wall.coefficient"));
    for row in 0..9 {
        let set = [
            format!("particle.clearance_ratio={:?}", d[row]),
            format!("particle.wall.coefficient={:?}", e[row]),
            "run.cycle_s=0.4".into(),
            "run.steady_from_cycle=0".into(),
        ];
        let summary = &simulated(folder, &set)["summary"];
        let single = |key: &str| summary[key].as_f64().unwrap();
        for (name, expected) in [
            ("max_abs_x_m", single("max_abs_x_m")),
            ("rms_x_m", single("rms_x_m")),
            ("x_over_z", single("steady_mean_cycle_max_abs_x_m") / 0.003),
        ] {
            let value = column(&table, name)[row];
            assert!(alike(value, expected), "row {row}, {name}: {value}, {expected}");
        }
        assert_eq!(column(&table, "impacts_per_cycle")[row], single("impact_count") / 20.0);
    }
}

#[test]
fn every_point_equals_a_single_simulation() {
    // With friction in the cavity a point is computed by the engine of `simulate`.
    let folder = folder(TWO_AXES);
    std::fs::write(
        folder.path().join("case.toml"),
        CASE.replace("clearance_m", "friction_coefficient = 0.05, clearance_m"),
    )
    .unwrap();
    every_point(&folder, |value, expected| (value / expected - 1.0).abs() < 4.0 * f64::EPSILON);
}

#[test]
fn a_point_in_a_lane_differs_from_a_single_simulation_by_rounding_alone() {
    // 20 cycles that separate neighbours at most threefold each make 3^20 × 1e-16 of a rounding.
    every_point(&folder(TWO_AXES), |value, expected| (value / expected - 1.0).abs() < 4e-7);
}

#[test]
fn the_table_is_the_same_for_one_thread_and_two_and_after_a_part_was_lost() {
    let folder = folder(TWO_AXES);
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(run(&folder, "1", &["--out", "one"]).status.success());
    assert!(run(&folder, "2", &["--out", "two"]).status.success());
    assert_eq!(bytes("one/table.parquet"), bytes("two/table.parquet"));
    std::fs::remove_file(folder.path().join("two/parts/00000001.parquet")).unwrap();
    std::fs::remove_file(folder.path().join("two/table.parquet")).unwrap();
    assert!(run(&folder, "2", &["--out", "two"]).status.success());
    assert_eq!(bytes("one/table.parquet"), bytes("two/table.parquet"));
}

#[test]
fn the_file_says_what_it_is() {
    let folder = folder(TWO_AXES);
    let _ = done(&folder);
    let metadata = metadata_of(&folder.path().join("out/table.parquet"));
    assert_eq!(metadata["damprig.study"], TWO_AXES);
    assert_eq!(metadata["damprig.case"], CASE);
    assert!(metadata["damprig.version"].starts_with("damprig "));
    let table = table(&folder.path().join("out/table.parquet"));
    let schema = table.schema();
    let field = schema.field_with_name("max_abs_x_m").unwrap();
    assert_eq!(field.metadata().get("unit").map(String::as_str), Some("m"));
}

fn metadata_of(path: &Path) -> std::collections::HashMap<String, String> {
    damprig::run_folder::read::parquet_file::columns(path)
        .expect("it is a Parquet file")
        .schema()
        .metadata()
        .clone()
        .into()
}

#[test]
fn a_band_becomes_its_peak_with_its_place() {
    let band = "[[axis]]\nkey = \"base.frequency_hz\"\nfrom = 2.4\nto = 2.6\ncount = 5\n";
    let metrics = "case = \"case.toml\"\nmetrics = [\"x_over_z\"]\n[record]\ncycles = 30\nsettle_cycles = 10\n";
    let clearance = "[[axis]]\nkey = \"particle.clearance_ratio\"\nvalues = [8, 10]\n";
    let whole = done(&folder(&format!("{metrics}{clearance}{band}")));
    let grid = done(&folder(&format!("{metrics}{clearance}{band}reduce = \"grid_maximum\"\n")));
    let peaks = done(&folder(&format!("{metrics}{clearance}{band}reduce = \"maximum\"\n")));
    let (all, frequency) = (column(&whole, "x_over_z"), column(&whole, "base.frequency_hz"));
    for row in 0..2 {
        let of_row = &all[5 * row..5 * row + 5];
        let most = of_row.iter().copied().fold(0.0, f64::max);
        let at = of_row.iter().position(|value| *value == most).unwrap();
        assert_eq!(column(&grid, "x_over_z")[row], most);
        assert_eq!(column(&grid, "x_over_z_at_frequency_hz")[row], frequency[at]);
        assert!(column(&peaks, "x_over_z")[row] >= most);
    }
}

/// |x|/Z of the bare structure under a moving base, r = Ω/ωn.
fn transmissibility(r: f64, zeta: f64) -> f64 {
    let damping = (2.0 * zeta * r).powi(2);
    ((1.0 + damping) / ((1.0 - r * r).powi(2) + damping)).sqrt()
}

#[test]
fn a_peak_between_the_frequencies_of_a_band_is_that_of_the_closed_form() {
    let folder = folder(
        "case = \"bare.toml\"\nmetrics = [\"x_over_z\", \"max_abs_x_m\"]\n[record]\ncycles = 10\nsettle_cycles = 60\n\
         [[axis]]\nkey = \"structure.damping_ratio\"\nvalues = [0.04, 0.06]\n\
         [[axis]]\nkey = \"base.frequency_ratio\"\nfrom = 0.755\nto = 1.255\ncount = 6\nreduce = \"maximum\"\n",
    );
    let bare = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.04 }\n\
                base = { kind = \"sine\", amplitude_m = 0.003, frequency_ratio = 1 }\nrun = { duration_s = 8 }\n";
    std::fs::write(folder.path().join("bare.toml"), bare).unwrap();
    let table = done(&folder);
    for (row, zeta) in [0.04, 0.06].into_iter().enumerate() {
        let peak = (0..20_000).map(|n| transmissibility(0.9 + 1e-5 * f64::from(n), zeta)).fold(0.0, f64::max);
        // The last frequencies are 0.004 apart, one at most 0.002 from the peak: (0.002/0.04)²/2 = 0.13 %. After 60 cycles e^(−2π·60·0.04) =
        // 3e-7 of the transient is left.
        let [ratio, metres] = ["x_over_z", "max_abs_x_m"].map(|metric| column(&table, metric)[row]);
        assert!((ratio / peak - 1.0).abs() < 1.5e-3, "{ratio} against {peak}");
        assert!((metres / 0.003 / peak - 1.0).abs() < 1.5e-3, "{metres} m against {peak}");
        let at = column(&table, "x_over_z_at_frequency_ratio")[row];
        assert!((transmissibility(at, zeta) / ratio - 1.0).abs() < 1e-5, "{at}");
    }
}

#[test]
fn an_ensemble_has_its_quantiles_over_starts_from_wall_to_wall() {
    let top = "case = \"case.toml\"\nmetrics = [\"rms_x_m\"]\n";
    let axis = "[[axis]]\nkey = \"particle.clearance_ratio\"\nvalues = [9]\n";
    let ensemble = "[ensemble]\nstarts = 3\nquantiles = [0.5]\nover = \"mean\"\n";
    let folder = folder(&format!("{top}{ensemble}{axis}"));
    let table = done(&folder);
    let starts = ["at_negative_wall", "centre", "at_positive_wall"].map(|start| {
        let set = ["particle.clearance_ratio=9".into(), format!("particle.start={start}")];
        simulated(&folder, &set)["summary"]["rms_x_m"].as_f64().unwrap()
    });
    let mut sorted = starts.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.push(starts.iter().sum::<f64>() / 3.0);
    let found = ["rms_x_m_min", "rms_x_m_q50", "rms_x_m_max", "rms_x_m_mean"].map(|name| column(&table, name)[0]);
    assert!(
        found.iter().zip(&sorted).all(|(found, single)| (found / single - 1.0).abs() < 1e-6),
        "{found:?} {sorted:?}"
    );
}

#[test]
fn the_best_point_of_an_ensemble_is_by_what_counts_of_its_starts_and_that_is_the_worst_if_nothing_is_said() {
    let file = |more: &str| {
        format!(
            "case = \"case.toml\"\nmetrics = [\"max_abs_x_m\"]\nrecord = {{ cycles = 15 }}\n[ensemble]\nstarts = 7\n{more}\
             [[axis]]\nkey = \"particle.clearance_ratio\"\nfrom = 5\nto = 20\ncount = 16\n"
        )
    };
    let top = |more: &str| file(more).replace("[ensemble]", "goal = \"maximum\"\n[ensemble]");
    for (study, column_name) in [
        (file(""), "max_abs_x_m_max"),
        (file("over = \"worst\"\n"), "max_abs_x_m_max"),
        (file("over = \"q95\"\n"), "max_abs_x_m_q95"),
        (file("over = \"median\"\nquantiles = [0.1]\n"), "max_abs_x_m_q50"),
        (file("over = \"mean\"\n"), "max_abs_x_m_mean"),
        (top(""), "max_abs_x_m_min"),
        (top("over = \"q95\"\n"), "max_abs_x_m_q05"),
    ] {
        let folder = folder(&study);
        let output = run(&folder, "2", &["--out", "out"]);
        let told = String::from_utf8_lossy(&output.stdout);
        assert!(told.contains(&format!("{column_name}: ")), "no {column_name} in:\n{told}");
        let values = column(&table(&folder.path().join("out/table.parquet")), column_name);
        let is_maximum = study.contains("maximum");
        let best = values.iter().copied().reduce(if is_maximum { f64::max } else { f64::min }).unwrap();
        let shown: f64 =
            told.split(&format!("{column_name}: ")).nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!((shown / best - 1.0).abs() < 1e-5, "{shown} {best}");
    }
}

#[test]
fn a_wrong_study_is_refused_with_what_is_wrong_and_what_to_do() {
    let one = "[[axis]]\nkey = \"particle.clearance_ratio\"\nvalues = [9]\n";
    let top = "case = \"case.toml\"\nmetrics = [\"x_over_z\"]\n";
    let cases: &[(&str, &[&str])] = &[
        (
            "[[axis]]\nkey = \"particle.clearence_m\"\nvalues = [0.01]\n",
            &["unknown key", "study.toml:4:7", "particle.clearence_m", "clearance_m"],
        ),
        (
            "[[axis]]\nkey = \"particle.clearance_m\"\nfrom = 0.02\nto = 0.01\ncount = 3\n",
            &["study.toml:6", "greater than `from` = 0.02", "exchange"],
        ),
        ("[[axis]]\nkey = \"particle.clearance_m\"\nfrom = 0.02\nto = 0.02\ncount = 3\n", &["values = […]"]),
        ("[[axis]]\nkey = \"particle.clearance_m\"\nfrom = 0.01\nto = 0.02\n", &["count", "[sampling]"]),
        ("[[axis]]\nkey = \"particle.clearance_m\"\nvalues = []\n", &["at least one value"]),
        ("[[axis]]\nkey = \"particle.clearance_m\"\n", &["no values"]),
        (
            "[[axis]]\nkey = \"particle.wall.coefficient\"\nvalues = [0.5, 1.5]\n",
            &["study.toml:5:16", "`particle.wall.coefficient` = 1.5", "from 0 to 1"],
        ),
        // The end that is wrong is named, and no value between the ends.
        (
            "[[axis]]\nkey = \"particle.wall.coefficient\"\nfrom = 5e-1\nto = 15e-1\ncount = 8\n",
            &["study.toml:6:6", "`particle.wall.coefficient` = 15e-1", "from 0 to 1"],
        ),
        (
            "[[axis]]\nkey = \"particle.wall.coefficient\"\nfrom = -1\nto = 2\ncount = 8\n",
            &["study.toml:5:8", "`particle.wall.coefficient` = -1", "from 0 to 1"],
        ),
        (
            "[[axis]]\nkey = \"particle.start\"\nwords = [\"at_negative_wall\", \"somewhere\"]\n",
            &["study.toml:5:30", "`particle.start` = \"somewhere\"", "at_positive_wall"],
        ),
        // Between allowed ends a value that is not.
        (
            "[[axis]]\nkey = \"run.cycle_s\"\nvalues = [0.4]\n[[axis]]\nkey = \"run.steady_from_cycle\"\nfrom = 0\nto = 3\ncount = 3\n",
            &["study.toml:7:7", "`run.steady_from_cycle` = 1.5", "whole number", "`count`"],
        ),
        ("", &["`axis` is missing"]),
    ];
    for (axis, words) in cases {
        refused(&format!("{top}{axis}"), words);
    }
    refused(
        &format!("case = \"cas.toml\"\nmetrics = [\"x_over_z\"]\n{one}"),
        &["cas.toml", "did you mean", "case.toml"],
    );
    refused(
        &format!("case = \"case.toml\"\nmetrics = [\"x_over_y\"]\n{one}"),
        &["x_over_y", "did you mean \"x_over_z\""],
    );
    refused(
        &format!("case = \"case.toml\"\nmetrics = [\"peak_contact_force_n\"]\n{one}"),
        &["peak_contact_force_n", "hard wall", "voigt"],
    );
    refused(&format!("{top}objective = \"rms_x_m\"\n{one}"), &["objective", "one of the metrics"]);
    refused(&format!("{top}{one}{one}"), &["two axes"]);
}

#[test]
fn a_study_that_changed_since_its_parts_were_written_is_refused() {
    let folder = folder(TWO_AXES);
    assert!(run(&folder, "2", &["--out", "out"]).status.success());
    for (file, from, to, words) in [
        ("study.toml", "12]", "13]", "the study file has changed"),
        ("case.toml", "0.0038", "0.0039", "the case has changed"),
    ] {
        let path = folder.path().join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace(from, to)).unwrap();
        let output = run(&folder, "2", &["--out", "out"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(words) && told.contains("--out"), "{told}");
        std::fs::write(&path, text).unwrap();
    }
    std::fs::write(folder.path().join("out/parts/00000000.parquet"), b"PAR1").unwrap();
    let told = run(&folder, "2", &["--out", "out"]);
    let told = String::from_utf8_lossy(&told.stderr);
    assert!(told.contains("00000000.parquet") && told.contains("remove"), "{told}");
}

#[test]
fn a_changed_record_is_noticed_whichever_word_names_it_and_the_folder_of_the_study_does_not_matter() {
    let case = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n\
                base = { kind = \"record\", file = \"a.csv\", quantity = \"displacement\", unit = \"mm\" }\n\
                particle = { mass_ratio = 0.1, clearance_m = 0.03, wall = { kind = \"restitution\", coefficient = 0.5 } }\n\
                run = { }\n";
    let study = "case = \"case.toml\"\nmetrics = [\"max_abs_x_m\"]\n[[axis]]\nkey = \"particle.clearance_m\"\nvalues = [0.02, 0.03]\n\
                 [[axis]]\nkey = \"base.file\"\nwords = [\"a.csv\", \"b.csv\"]\n";
    let folder = folder(study);
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    let record = |name: &str, factor: f64| {
        let rows = (0..200).map(|n| format!("{},{}\n", 0.01 * f64::from(n), factor * (0.1 * f64::from(n)).sin()));
        std::fs::write(folder.path().join(name), format!("t,z\n{}", rows.collect::<String>())).unwrap();
    };
    record("a.csv", 1.0);
    record("b.csv", 2.0);
    let table = done(&folder);
    let largest = column(&table, "max_abs_x_m");
    assert!(largest[0] < largest[1] && largest[2] < largest[3], "{largest:?}");
    let path = folder.path().join("study.toml");
    let from_elsewhere = || {
        let mut command = damprig(&TempDir::new().unwrap());
        command.current_dir("/").args(["study", "run"]).arg(&path).arg("--out").arg(folder.path().join("out"));
        command.output().unwrap()
    };
    assert!(from_elsewhere().status.success(), "{:?}", from_elsewhere());
    for (changed, factor) in [("b.csv", 2.0), ("a.csv", 1.0)] {
        record(changed, 1.5 * factor);
        let output = run(&folder, "2", &["--out", "out"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{changed}: {told}");
        assert!(told.contains("a file that the study or the case names has changed"), "{told}");
        record(changed, factor);
    }
    assert!(run(&folder, "2", &["--out", "out"]).status.success());
}

#[test]
fn a_quiet_study_prints_where_its_table_is() {
    let folder = folder(TWO_AXES);
    let output = run(&folder, "2", &["--out", "out", "--quiet"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.starts_with("Table: out/table.parquet (9 rows, "), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
}

#[test]
fn a_dry_run_says_how_much_it_is_and_a_study_of_days_needs_a_word() {
    let small = folder(TWO_AXES);
    let output = run(&small, "2", &["--dry-run"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("9 points") && said.contains("180 cycles"), "{said}");
    assert!(!small.path().join("studies").exists());
    let many = TWO_AXES.replace("values = [9, 10, 12]", "from = 1\nto = 30\ncount = 1000000");
    let large = format!("{many}[record]\ncycles = 1000000000\n");
    refused(&large, &["about", "--long"]);
}
