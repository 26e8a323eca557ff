//! `damprig study bifurcation`: sampled cycles over a swept key, up and down.

use std::process::Output;

use crate::common::{damprig, read_parquet};
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use tempfile::TempDir;

const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.05 }\n";
const BASE: &str = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\n";
const PARTICLE: &str =
    "particle = { mass_ratio = 0.1, clearance_m = 0.03, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";
const RUN: &str = "run = { duration_s = 8 }\n";

fn run(case: &str, arguments: &[&str]) -> (TempDir, Output) {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    let output = damprig(&folder).args(["study", "bifurcation", "case.toml"]).args(arguments).output().unwrap();
    (folder, output)
}

fn table(case: &str, arguments: &[&str]) -> RecordBatch {
    let (folder, output) = run(case, arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(folder.path().join("bifurcation/bifurcation.png").is_file());
    read_parquet(folder.path().join("bifurcation/bifurcation.parquet")).remove(0)
}

fn column(table: &RecordBatch, name: &str) -> Vec<f64> {
    table.column_by_name(name).expect("it has the column").as_primitive::<Float64Type>().values().to_vec()
}

#[test]
fn a_linear_structure_has_its_closed_form_at_every_frequency() {
    let case = format!("{STRUCTURE}{BASE}{RUN}");
    let axis = ["--axis", "base.frequency_hz=2:3:5", "--settle-cycles", "100", "--cycles", "3"];
    let table = table(&case, &axis);
    assert_eq!(table.num_rows(), 2 * 5 * 3);
    for ((f, x), most) in
        column(&table, "base.frequency_hz").iter().zip(column(&table, "x_m")).zip(column(&table, "cycle_max_m"))
    {
        // x/z = (1 + 2iζr)/(1 − r² + 2iζr), z = Z sin Ωt: x at phase 0 is Z times the imaginary part.
        let (r, zeta) = (f / 2.5, 0.05);
        let (a, b) = (1.0 - r * r, 2.0 * zeta * r);
        let (re, im) = ((a + b * b) / (a * a + b * b), (a * b - b) / (a * a + b * b));
        // After a hundred cycles the transient has fallen by e^(−2π ζ 100/r).
        let left = 0.2 * (-std::f64::consts::TAU * zeta * 100.0 / r).exp() + 1e-12;
        assert!((x - 0.003 * im).abs() < left, "{f}: {x}");
        assert!((most - 0.003 * re.hypot(im)).abs() < left, "{f}: {most}");
    }
}

#[test]
fn a_periodic_motion_has_one_point_and_is_the_same_up_and_down() {
    let case = format!("{STRUCTURE}{BASE}{PARTICLE}{RUN}");
    let axis = ["--axis", "particle.clearance_ratio=9:10:3", "--settle-cycles", "400", "--section", "9.4"];
    let (folder, output) = run(&case, &axis);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let drawn = |name: &str| std::fs::read_to_string(folder.path().join("bifurcation").join(name)).unwrap();
    let (diagram, section) = (drawn("bifurcation.svg"), drawn("section.svg"));
    assert!(diagram.contains(">d/Z</text>") && diagram.contains("60 at each value of d/Z after 400 to settle"));
    assert!(section.contains(">d/Z = 9.5</text>") && !diagram.contains("clearance_ratio"));
    let table = read_parquet(folder.path().join("bifurcation/bifurcation.parquet")).remove(0);
    let (value, x) = (column(&table, "particle.clearance_ratio"), column(&table, "x_m"));
    for wanted in [9.0, 9.5, 10.0] {
        let there: Vec<f64> = (0..x.len()).filter(|n| value[*n] == wanted).map(|n| x[n]).collect();
        assert_eq!(there.len(), 120);
        assert!(there.iter().all(|x| (x / there[0] - 1.0).abs() < 1e-9), "{wanted}: {there:?}");
    }
}

/// A value begins with the last state of the one before: a particle that presses into a soft wall goes on pressing.
#[test]
fn a_particle_that_presses_into_a_soft_wall_at_the_section_is_followed_from_value_to_value() {
    let particle =
        "particle = { mass_ratio = 0.1, clearance_m = 0.01, wall = { kind = \"voigt\", stiffness_n_per_m = 400,
        damping_n_s_per_m = 6, release = \"zero_force\" } }\n";
    let case = format!("{STRUCTURE}{particle}{BASE}{RUN}").replace("\n        ", " ").replace("0.05", "0.01");
    let axis = ["--axis", "base.frequency_hz=2.1:2.14:3", "--settle-cycles", "600", "--cycles", "2"];
    let table = table(&case, &axis);
    let (value, offset) = (column(&table, "base.frequency_hz"), column(&table, "y_minus_x_m"));
    assert!(offset.iter().all(|o| o.abs() > 0.010), "no particle presses: {offset:?}");
    for wanted in [2.1, 2.12, 2.14] {
        let there: Vec<f64> =
            (0..value.len()).filter(|n| (value[*n] - wanted).abs() < 1e-9).map(|n| offset[n]).collect();
        assert!(there.len() == 4 && there.iter().all(|o| (o / there[0] - 1.0).abs() < 1e-9), "{wanted}: {there:?}");
    }
}

#[test]
fn a_wrong_axis_is_refused_before_anything_is_written() {
    let case = format!("{STRUCTURE}{BASE}{PARTICLE}{RUN}");
    let fixed = format!("{STRUCTURE}{PARTICLE}{RUN}");
    for (case, axis, words) in [
        (&case, "particle.clearance_ratio=10:9:3", ["greater than the first", "the last value 9"]),
        (&case, "particle.clearance_ratio=10:12", ["FROM:TO:COUNT", "particle.clearance_ratio=10:16:301"]),
        (&case, "particle.wall.coefficient=0.5:1.5:3", ["--axis and --set", "from 0 to 1"]),
        (&case, "particle.clearence=1:2:3", ["unknown key", "clearance"]),
        (&fixed, "particle.wall.coefficient=0.5:0.6:3", ["needs a sine", "base = {"]),
    ] {
        let (folder, output) = run(case, &["--axis", axis]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{axis}\n{told}");
        assert!(words.iter().all(|word| told.contains(word)), "{axis}\n{told}");
        assert!(!folder.path().join("bifurcation").exists());
    }
}
