//! Values outside their usual range are used, with a warning that names file, line, key, value and range; the dry run prints
//! every parameter of every set-up.

use crate::common::{damprig, folder_with, short};
use assert_cmd::assert::Assert;
use damprig::campaign::Campaign;
use damprig::input::Source;
use damprig::input::key::{Range, Table};
use predicates::prelude::*;
use predicates::str::{contains, is_empty};

fn dry_run(campaign: &str) -> Assert {
    damprig(&folder_with(campaign)).args(["run", "test.toml", "--dry-run"]).assert()
}

#[test]
fn a_damping_ratio_of_a_half_is_used_with_a_warning_that_says_where_and_what_is_usual() {
    let said = dry_run(&short().replace("damping_ratio = 0.0038", "damping_ratio = 0.5")).success();
    let line = 1 + short().lines().position(|line| line.contains("damping_ratio")).unwrap();
    said.stderr(
        contains("warning: `structure.damping_ratio` = 0.5 is unusual")
            .and(contains(format!("test.toml:{line}:")))
            .and(contains("usually from 0 to 0.05"))
            // One value that two set-ups inherit is one warning.
            .and(contains("is unusual").count(1)),
    );
}

#[test]
fn usual_values_give_no_warning() {
    dry_run(&short()).success().stderr(is_empty());
}

#[test]
fn a_value_is_compared_in_the_quantity_that_it_means() {
    let by_damping = short().replace("damping_ratio = 0.0038", "damping_n_s_per_m = 25");
    dry_run(&by_damping)
        .success()
        .stderr(contains("`structure.damping_n_s_per_m` means an unusual damping_ratio = 0.49"));
    let by_stiffness = short()
        .replace("natural_frequency_hz = 2.50", "stiffness_n_per_m = 0.4")
        .replace("damping_ratio = 0.0038", "damping_ratio = 0.01");
    dry_run(&by_stiffness)
        .stderr(contains("`structure.stiffness_n_per_m` means an unusual natural_frequency_hz = 0.079577"));
    let by_clearance = short().replace("clearance_ratio = 5", "clearance_m = 0.4");
    dry_run(&by_clearance).success().stderr(contains("means an unusual clearance_ratio = 266.667"));
}

#[test]
fn warnings_of_a_case_do_not_change_its_answer_or_its_exit_code() {
    let case = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.5 }\n\
                base = { kind = \"sine\", amplitude_m = 3, frequency_hz = 2.5 }\nrun = { duration_s = 2 }\n";
    let folder = folder_with(case);
    let said = damprig(&folder).args(["simulate", "test.toml", "--json"]).assert().success();
    said.stderr(
        contains("`structure.damping_ratio` = 0.5 is unusual")
            .and(contains("`base.amplitude_m` = 3 is unusual"))
            .and(contains("test.toml:2:")),
    )
    .stdout(predicate::str::starts_with("{"));
}

#[test]
fn unusual_times_frequencies_and_displacements_of_experiments_are_warned_of() {
    for (usual, unusual, key) in [
        ("dwell_s = 4.0", "dwell_s = 4000.0", "experiment[1].dwell_s"),
        ("[2.4, 2.5, 2.6]", "[2.4, 2.5, 40]", "experiment[1].frequencies_hz"),
        ("sensor_noise_rms_m = 5e-6", "sensor_noise_rms_m = 5e-4", "rig.sensor_noise_rms_m"),
    ] {
        assert!(short().contains(usual), "{usual}");
        dry_run(&short().replace(usual, unusual)).stderr(contains(format!("`{key}` = ")).and(contains("is unusual")));
    }
}

/// The usual range of every key lies within what is allowed, so a usual value is never refused.
#[test]
fn usual_ranges_lie_within_the_allowed_ones() {
    let tables: [&[Table]; 4] =
        [damprig::setup::TABLES, damprig::structure::TABLES, damprig::simulation::TABLES, damprig::campaign::TABLES];
    let mut ranges = 0;
    for key in tables.concat().iter().flat_map(|table| table.quantities).flat_map(|quantity| quantity.keys) {
        let Some((least, most)) = key.usual else { continue };
        let Some(range) = key.kind.range() else { panic!("{} is no number", key.name) };
        assert!(least < most, "{}", key.name);
        // 0 is outside the range of a positive number, and a usual bound of others.
        let between = 0.4 * least + 0.6 * most;
        let between = if matches!(range, Range::Whole(..)) { between.round() } else { between };
        for value in [least, most, between] {
            assert_eq!(range.refusal(value), None, "{} = {value}", key.name);
            assert!(!key.is_unusual(value));
        }
        assert!(key.is_unusual(least - 1.0) && key.is_unusual(2.0 * most + 1.0), "{}", key.name);
        ranges += 1;
    }
    assert!(ranges > 50, "{ranges}");
}

#[test]
fn shipped_campaigns_and_cases_have_usual_values_only() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    for folder in ["campaigns", "cases"] {
        for file in std::fs::read_dir(root.join(folder)).unwrap().flatten().map(|entry| entry.path()) {
            if file.extension().is_none_or(|extension| extension != "toml") {
                continue;
            }
            let warnings = if folder == "cases" {
                damprig::simulation::Case::read_with_warnings(&file).unwrap().1
            } else {
                Campaign::parse(Source::read(&file).unwrap()).unwrap().source.warnings()
            };
            assert!(warnings.is_empty(), "{}: {warnings:?}", file.display());
        }
    }
}

#[test]
fn the_dry_run_prints_every_parameter_with_its_unit_and_what_follows_from_them() {
    let said = dry_run(&short()).success();
    let printed = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    let row = |name: &str| {
        let line = printed.lines().find(|line| line.contains(name)).unwrap_or_else(|| panic!("no {name}: {printed}"));
        let cells: Vec<String> = line.split(['│', '┆']).map(|cell| cell.trim().to_string()).collect();
        cells[2..4].to_vec()
    };
    let (mass, natural, zeta, z) = (1.6, 2.5 * std::f64::consts::TAU, 0.0038, 0.0015);
    let stiffness = mass * natural * natural;
    let is = |name: &str, expected: f64| {
        let shown: f64 = row(name)[1].parse().unwrap();
        assert!((shown / expected - 1.0).abs() < 1e-4, "{name}: {shown} {expected}");
    };
    is("Z, base amplitude (mm)", 1.5);
    is("M, mass (kg)", mass);
    is("k, stiffness (N/m)", stiffness);
    is("c, damping (N·s/m)", 2.0 * zeta * mass * natural);
    is("time constant 2M/c (s)", 1.0 / (zeta * natural));
    is("m/M, mass ratio", 0.1);
    is("d, clearance (mm)", 5.0 * z * 1e3);
    is("d/Z, clearance ratio", 5.0);
    is("e, restitution", 0.47);
    is("F, friction force (N)", 0.4 * stiffness * z);
    assert_eq!(row("e, restitution")[0], "–");
}
