//! Set-up files: written by `damprig identify`, read by campaigns and cases, kept with the run.

use std::path::Path;

use damprig::input::Source;
use damprig::simulation::Case;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{damprig, folder_with, manifest};

const RELEASE: &str = r#"name = "release"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.0038
[[set_up]]
name = "bare"
base_amplitude_m = 0.003
[[experiment]]
name = "release"
kind = "free_vibration"
start_m = 0.035
measure_s = 8
[telemetry]
rate_hz = 1000
signals = ["x", "z"]
"#;

/// A campaign that takes the structure from a set-up file, with its own keys of the structure.
fn campaign(structure: &str) -> String {
    format!(
        "name = \"next\"\nset_up_file = \"identified.toml\"\n[structure]\n{structure}\n[[set_up]]\nname = \"bare\"\n\
         base_amplitude_m = 5e-5\n[[experiment]]\nkind = \"stepped_sine\"\nfrequencies_hz = [2.4]\n\
         start = \"from_rest\"\ndwell_s = 4\n"
    )
}

fn write(folder: &TempDir, name: &str, text: &str) {
    std::fs::write(folder.path().join(name), text).unwrap();
}

fn natural_frequency_hz(run: &Path) -> f64 {
    manifest(run)["set_ups"][0]["natural_frequency_hz"].as_f64().unwrap()
}

#[test]
fn a_run_is_identified_and_the_next_campaign_uses_the_values() {
    let folder = folder_with(RELEASE);
    damprig(&folder).args(["run", "test.toml", "--out", "first"]).assert().success();
    damprig(&folder)
        .args(["identify", "decay", "first", "--viscous", "--out", "identified.toml"])
        .assert()
        .success()
        .stdout(contains("natural frequency").and(contains("95 % interval")).and(contains("set-up \"bare\"")));
    let file = std::fs::read_to_string(folder.path().join("identified.toml")).unwrap();
    let values: toml::Table = file.parse().unwrap();
    let identified = values["structure"]["natural_frequency_hz"].as_float().unwrap();
    assert!((identified - 2.5).abs() < 1e-4 && identified != 2.5, "{file}");
    write(&folder, "next.toml", &campaign("mass_kg = 1.6"));
    damprig(&folder).args(["run", "next.toml", "--out", "second"]).assert().success();
    let run = folder.path().join("second");
    assert!((natural_frequency_hz(&run) - identified).abs() < 1e-12);
    let origin = &manifest(&run)["set_up_file"];
    assert_eq!(origin["file"], "identified.toml");
    let entries = origin["identified"].as_array().unwrap();
    assert_eq!(entries[0]["key"], "structure.natural_frequency_hz");
    assert!(entries[0]["standard_uncertainty"].as_f64().unwrap() > 0.0);
    assert!(entries[0]["taken_from"].as_str().unwrap().contains("first"), "{origin}");
    // The run has a copy, so it is complete without the original.
    std::fs::remove_file(folder.path().join("identified.toml")).unwrap();
    damprig(&folder).args(["runs", "verify", "second"]).assert().success();
    damprig(&folder).args(["runs", "report", "second", "--force"]).assert().success();
    write(&folder, "second/records/set_up-identified.toml", "[structure]\ndamping_ratio = 0.5\n");
    damprig(&folder).args(["runs", "verify", "second"]).assert().failure();
}

#[test]
fn a_key_of_the_campaign_or_the_case_overrides_the_value_of_the_file() {
    let folder = TempDir::new().unwrap();
    write(&folder, "identified.toml", "[structure]\nnatural_frequency_hz = 2.47\ndamping_ratio = 0.004\n");
    let dry = |text: &str| {
        let source = Source::new(folder.path().join("next.toml").display().to_string(), text);
        damprig::campaign::Campaign::parse(source).unwrap().set_ups[0].model().structure
    };
    let both = dry(&campaign("mass_kg = 1.6"));
    assert!((both.angular_frequency_rad_per_s() / std::f64::consts::TAU - 2.47).abs() < 1e-12);
    // Another spelling of the same quantity.
    assert_eq!(dry(&campaign("mass_kg = 1.6\nstiffness_n_per_m = 400")).stiffness_n_per_m, 400.0);
    let own =
        campaign("mass_kg = 1.6").replace("base_amplitude_m", "structure = { damping_ratio = 0.01 }\nbase_amplitude_m");
    let damping = |structure: damprig_core::model::Structure| structure.damping_n_s_per_m;
    assert!((damping(dry(&own)) / damping(both) - 0.01 / 0.004).abs() < 1e-12);
    let case = |structure: &str| {
        let text = format!(
            "set_up_file = \"identified.toml\"\nstructure = {{ {structure} }}\nbase = {{ kind = \"sine\", amplitude_m = 1e-3, \
             frequency_hz = 2 }}\nrun = {{ duration_s = 1 }}\n"
        );
        let source = Source::new(folder.path().join("case.toml").display().to_string(), text);
        Case::parse(&source, "case").unwrap().set_up.structure
    };
    assert_eq!(case("mass_kg = 1.6"), both);
    assert_eq!(case("mass_kg = 1.6, stiffness_n_per_m = 400").stiffness_n_per_m, 400.0);
}

#[test]
fn a_problem_of_the_set_up_file_is_shown_in_that_file() {
    let folder = TempDir::new().unwrap();
    let message = |file: &str| {
        write(&folder, "identified.toml", file);
        write(&folder, "next.toml", &campaign("mass_kg = 1.6"));
        let output =
            damprig(&folder).args(["run", "next.toml", "--dry-run"]).assert().code(2).get_output().stderr.clone();
        String::from_utf8(output).unwrap()
    };
    let wrong = message("# made\n[structure]\nnatural_frequency_hz = 2.5\ndamping_ratio = -1\n");
    assert!(wrong.contains("identified.toml:4:17") && wrong.contains("`structure.damping_ratio` = -1"), "{wrong}");
    assert_eq!(wrong.matches("error:").count(), 1, "{wrong}");
    let misspelt = message("[structure]\nnatural_frequency_hz = 2.5\ndamping = 0.004\n");
    assert!(misspelt.contains("identified.toml:3:1") && misspelt.contains("unknown key"), "{misspelt}");
    let unused =
        message("[structure]\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.004\n[particle]\nmass_ratio = -1\n");
    assert!(unused.contains("identified.toml:5:14"), "{unused}");
    let broken = message("[structure\n");
    assert!(broken.contains("identified.toml:1") && broken.contains("not TOML"), "{broken}");
    std::fs::remove_file(folder.path().join("identified.toml")).unwrap();
    let output = damprig(&folder).args(["run", "next.toml", "--dry-run"]).assert().code(2).get_output().stderr.clone();
    let absent = String::from_utf8(output).unwrap();
    assert!(absent.contains("next.toml:2") && absent.contains("identified.toml"), "{absent}");
}

#[test]
fn values_are_added_to_a_file_only_when_asked() {
    let folder = TempDir::new().unwrap();
    let x = |t: f64| 0.035 * (-0.15 * t).exp() * (15.7 * t).cos();
    let rows: Vec<String> = (0..1600).map(|n| f64::from(n) / 200.0).map(|t| format!("{t},{}", x(t))).collect();
    write(&folder, "record.csv", &format!("t_s,x_m\n{}\n", rows.join("\n")));
    write(&folder, "identified.toml", "[structure]\ndamping_ratio = 0.5\n[particle]\nfriction_coefficient = 0.1\n");
    let identify = |more: &[&str]| {
        let all = [&["identify", "decay", "record.csv", "--out", "identified.toml"], more].concat();
        damprig(&folder).args(all).assert()
    };
    identify(&[]).code(2).stderr(contains("--update").and(contains("--force")));
    // Before the record is read.
    let absent = ["identify", "decay", "absent.csv", "--out", "identified.toml"];
    damprig(&folder).args(absent).assert().code(2).stderr(contains("identified.toml exists"));
    identify(&["--update"]).success();
    let file = std::fs::read_to_string(folder.path().join("identified.toml")).unwrap();
    let values: toml::Table = file.parse().unwrap();
    assert!((values["structure"]["damping_ratio"].as_float().unwrap() - 0.15 / 15.7).abs() < 1e-4, "{file}");
    assert_eq!(values["particle"]["friction_coefficient"].as_float(), Some(0.1));
    assert_eq!(values["identified"].as_array().unwrap().len(), 2);
    identify(&["--update"]).success();
    let again: toml::Table = std::fs::read_to_string(folder.path().join("identified.toml")).unwrap().parse().unwrap();
    assert_eq!(again["identified"].as_array().unwrap().len(), 2);
    identify(&["--force"]).success();
    let replaced = std::fs::read_to_string(folder.path().join("identified.toml")).unwrap();
    assert!(!replaced.contains("[particle]"), "{replaced}");
}
