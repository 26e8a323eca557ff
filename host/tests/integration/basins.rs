//! `damprig study basins`: which motion each start of a grid ends on.

use std::f64::consts::TAU;
use std::process::Output;

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt32Type};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::{Cavity, Initial, Particle, SetUp, Structure, Wall};
use tempfile::TempDir;

use crate::common::{damprig, read_parquet};

const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
const RUN: &str = "run = { duration_s = 8 }\n";
const AXES: [&str; 4] = ["--axis", "initial.x_m=-0.04:0.05:7", "--axis", "initial.v_m_per_s=-0.7:0.5:5"];

fn run(case: &str, arguments: &[&str]) -> (TempDir, Output) {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    let output = damprig(&folder).args(["study", "basins", "case.toml"]).args(arguments).output().unwrap();
    (folder, output)
}

/// The starts, the attractors, and what the command says.
fn found(case: &str, arguments: &[&str]) -> (RecordBatch, Option<RecordBatch>, String) {
    let (folder, output) = run(case, arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let own = |name: &str| folder.path().join("basins").join(name);
    assert!(own("basins.png").is_file() && own("basins.svg").is_file());
    let table = |name: &str| read_parquet(own(name)).pop();
    (
        table("basins.parquet").expect("it has starts"),
        table("attractors.parquet"),
        String::from_utf8_lossy(&output.stdout).into_owned(),
    )
}

fn column(table: &RecordBatch, name: &str) -> Vec<f64> {
    table.column_by_name(name).expect("it has the column").as_primitive::<Float64Type>().values().to_vec()
}

fn counts(table: &RecordBatch, name: &str) -> Vec<u32> {
    table.column_by_name(name).expect("it has the column").as_primitive::<UInt32Type>().values().to_vec()
}

#[test]
fn every_start_of_a_linear_structure_ends_on_its_one_steady_motion() {
    let base = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.2 }\n";
    let case = format!("{STRUCTURE}{base}{RUN}");
    let (starts, attractors, said) = found(&case, &AXES);
    let attractors = attractors.expect("one");
    assert_eq!(counts(&starts, "attractor"), vec![1; 35]);
    assert!(said.contains("Attractor 1: 100 % of the starts; repeats every cycle, no impact"), "{said}");
    // |x/z| = |1 + 2iζr| / |1 − r² + 2iζr|, and x at phase 0 is Z times the imaginary part.
    let (r, zeta) = (2.2 / 2.5, 0.0038);
    let (a, b) = (1.0 - r * r, 2.0 * zeta * r);
    let amplitude = 0.003 * 1.0_f64.hypot(b) / a.hypot(b);
    let x = 0.003 * (a * b - b) / (a * a + b * b);
    // The transient that is left: it repeats within 1e-7 of the motion, and falls by 2 % in a cycle.
    let left = 1e-5 * amplitude;
    assert!((column(&attractors, "max_abs_x_m")[0] - amplitude).abs() < left);
    assert!((column(&attractors, "x_m")[0] - x).abs() < left);
    assert!(column(&starts, "x_m").iter().all(|end| (end - x).abs() < left));
}

/// At 2.2 Hz the motion with two impacts in a cycle and that without any are both stable.
#[test]
fn each_start_ends_where_a_long_simulation_from_it_ends() {
    let base = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.2 }\n";
    let particle = "particle = { mass_ratio = 0.1, clearance_m = 0.03, friction_coefficient = 0.05, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";
    let (starts, attractors, _) = found(&format!("{STRUCTURE}{base}{particle}{RUN}"), &AXES);
    let attractors = attractors.expect("two");
    let number = counts(&starts, "attractor");
    assert_eq!((attractors.num_rows(), counts(&attractors, "impacts")), (2, vec![2, 0]));
    let set_up = SetUp {
        particle: Some(Particle {
            mass_kg: 0.16,
            clearance_m: 0.03,
            friction_coefficient: 0.05,
            wall: Wall::Restitution { coefficient: 0.5 },
            cavity: Cavity::default(),
        }),
        ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038))
    };
    let turning = TAU * 2.2;
    let sine = Excitation::Sine { amplitude_m: 0.003, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
    let (x, v) = (column(&starts, "initial.x_m"), column(&starts, "initial.v_m_per_s"));
    let states = ["x_m", "v_m_per_s", "y_minus_x_m", "u_minus_v_m_per_s"].map(|name| column(&attractors, name));
    for n in 0..x.len() {
        let initial = Initial { x_m: x[n], v_m_per_s: v[n], y_m: x[n], u_m_per_s: v[n] };
        let mut motion = Exact::new(&set_up, &sine, &initial).expect("physical");
        motion.run(3000.0 * TAU / turning, &mut ());
        let end = motion.state();
        let place = number[n] as usize - 1;
        let off = [end.x_m, end.v_m_per_s, end.offset_m, end.slide_m_per_s];
        // Without impacts the particle may be anywhere.
        let compared = if place == 0 { 4 } else { 2 };
        for m in 0..compared {
            assert!((off[m] - states[m][place]).abs() < 1e-5, "start {n}: {off:?} is not attractor {}", place + 1);
        }
    }
}

#[test]
fn a_structure_that_its_friction_damper_holds_has_one_attractor_wherever_it_stands() {
    let base = "base = { kind = \"sine\", amplitude_m = 0.0001, frequency_hz = 2.2 }\n";
    let damper = "friction_damper = { force_n = 4 }\n";
    let axes = ["--axis", "initial.x_m=-0.005:0.005:5", "--axis", "initial.v_m_per_s=-0.05:0.05:3"];
    let (starts, attractors, _) = found(&format!("{STRUCTURE}{base}{damper}{RUN}"), &axes);
    assert_eq!(counts(&starts, "attractor"), vec![1; 15]);
    assert_eq!(attractors.map(|table| table.num_rows()), Some(1));
    let ends = column(&starts, "x_m");
    assert!(ends.iter().any(|x| (x - ends[0]).abs() > 1e-3), "they stand at one place: {ends:?}");
}

#[test]
fn a_particle_that_passes_its_soft_wall_is_told_and_has_no_attractor() {
    let base = "base = { kind = \"sine\", amplitude_m = 0.03, frequency_hz = 2.5 }\n";
    let particle = "particle = { mass_ratio = 0.1, clearance_m = 0.03, wall = { kind = \"voigt\", material = \"pu_foam\", law = \"contact\", release = \"zero_force\" } }\n";
    let case = format!("{STRUCTURE}{base}{particle}{RUN}");
    let axes = ["--axis", "initial.x_m=-0.05:0.05:5", "--axis", "initial.v_m_per_s=-0.8:0.8:3", "--cycles", "400"];
    let (starts, _, said) = found(&case, &axes);
    let beyond = column(&starts, "y_minus_x_m").iter().map(|offset| offset.abs()).collect::<Vec<f64>>();
    let number = counts(&starts, "attractor");
    assert!(beyond.iter().any(|m| *m > 0.09), "none passes: {beyond:?}");
    assert!((0..15).all(|n| beyond[n] < 0.09 || number[n] == 0), "{beyond:?} {number:?}");
    assert!(said.contains("the particle passes its soft wall"), "{said}");
    let first = beyond.iter().position(|m| *m > 0.09).expect("one passes");
    let [x_m, v_m_per_s] = ["initial.x_m", "initial.v_m_per_s"].map(|name| column(&starts, name)[first]);
    let from_there = format!("initial = {{ x_m = {x_m}, v_m_per_s = {v_m_per_s} }}\nrun = {{ duration_s = 170 }}\n");
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("case.toml"), case.replace(RUN, &from_there)).unwrap();
    let output = damprig(&folder).args(["simulate", "case.toml"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("passed the wall") && said.contains("beyond its wall"), "{said}");
}

/// At ζ = 0.0003 and resonance a transient falls by 0.2 % in a cycle: states repeat within a thousandth long before the motion has settled.
#[test]
fn a_motion_that_settles_slowly_has_no_attractor_before_it_has_settled() {
    let structure = STRUCTURE.replace("0.0038", "0.0003");
    let base = "base = { kind = \"sine\", amplitude_m = 0.0001, frequency_hz = 2.5 }\n";
    let case = format!("{structure}{base}{RUN}");
    let axes = ["--axis", "initial.x_m=-0.3:0.3:3", "--axis", "initial.v_m_per_s=-5:5:3"];
    let (starts, attractors, _) = found(&case, &axes);
    assert!(counts(&starts, "attractor").iter().all(|number| *number == 0) && attractors.is_none());
    let (starts, attractors, _) = found(&case, &[&axes[..], &["--cycles", "20000"]].concat());
    assert_eq!(counts(&starts, "attractor"), vec![1; 9]);
    let zeta = 0.0003_f64;
    let amplitude = 0.0001 * 1.0_f64.hypot(2.0 * zeta) / (2.0 * zeta);
    assert!((column(&attractors.expect("one"), "max_abs_x_m")[0] / amplitude - 1.0).abs() < 2e-4);
}

/// Some starts end where the friction damper just holds, so that roundings make it slip.
#[test]
fn a_structure_at_the_limit_of_its_friction_damper_is_held_too() {
    let base = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.3 }\n";
    let damper = "friction_damper = { force_n = 4 }\n";
    let axes = ["--axis", "initial.x_m=-0.04:0.04:9", "--axis", "initial.v_m_per_s=-0.6:0.6:5"];
    let (starts, attractors, _) = found(&format!("{STRUCTURE}{base}{damper}{RUN}"), &axes);
    assert_eq!((counts(&starts, "attractor"), attractors.map(|table| table.num_rows())), (vec![1; 45], Some(1)));
    assert!(column(&starts, "x_m").iter().any(|x| x.abs() > 0.007), "no start ends at the limit");
}

/// In a narrow cavity with weak walls the particle presses by more than the width of the cavity.
#[test]
fn a_particle_that_presses_deep_has_not_passed_its_wall() {
    let base = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\n";
    for release in ["zero_penetration", "zero_force"] {
        let wall =
            format!("{{ kind = \"voigt\", stiffness_n_per_m = 60, damping_n_s_per_m = 1, release = \"{release}\" }}");
        let particle = format!("particle = {{ mass_ratio = 0.1, clearance_m = 0.0005, wall = {wall} }}\n");
        let (starts, _, said) = found(&format!("{STRUCTURE}{base}{particle}{RUN}"), &AXES);
        assert!(column(&starts, "y_minus_x_m").iter().all(|offset| offset.abs() > 0.001), "it does not press deep");
        assert!(counts(&starts, "attractor") == vec![1; 35] && !said.contains("passes"), "{said}");
    }
}

#[test]
fn wrong_axes_are_refused_before_anything_is_written() {
    let base = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.2 }\n";
    let case = format!("{STRUCTURE}{base}{RUN}");
    let x = "initial.x_m=-0.01:0.01:3";
    for (axes, words) in [
        (vec![x], "--axis is given 1 times: a map has two axes"),
        (vec![x, x], "both axes have the key `initial.x_m`"),
        (vec![x, "base.frequency_hz=2:3:3"], "`base.frequency_hz` is no start"),
        (vec![x, "initial.z_m=2:3:3"], "`initial.z_m` is no start"),
        (vec!["initial.x_m=-1:1:2000", "initial.v_m_per_s=-1:1:2000"], "4000000 starts are too many"),
    ] {
        let arguments: Vec<&str> = axes.into_iter().flat_map(|axis| ["--axis", axis]).collect();
        let (folder, output) = run(&case, &arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains(words), "{said}");
        assert!(!folder.path().join("basins").exists());
    }
}
