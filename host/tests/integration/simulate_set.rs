//! `damprig simulate --set`, ratios of the field, and several cases at once.

use crate::common::damprig;
use serde_json::Value;
use tempfile::TempDir;

const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
const BASE: &str = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\n";
const PARTICLE: &str =
    "particle = { mass_ratio = 0.1, clearance_m = 0.03, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";
const RUN: &str = "run = { duration_s = 8 }\n";

fn folder(files: &[(&str, String)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn answers(folder: &TempDir, arguments: &[&str]) -> Vec<Value> {
    let output = damprig(folder).args(["simulate", "--json"]).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

fn refusal(folder: &TempDir, arguments: &[&str]) -> String {
    let output = damprig(folder).arg("simulate").args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_value_that_is_set_gives_the_result_of_a_file_with_that_value() {
    let case = format!("{STRUCTURE}{BASE}{PARTICLE}{RUN}");
    let written =
        case.replace("coefficient = 0.5", "coefficient = 0.8").replace("clearance_m = 0.03", "clearance_ratio = 12");
    let folder = folder(&[("case.toml", case), ("written.toml", written)]);
    let set = ["case.toml", "--set", "particle.wall.coefficient=0.8", "--set", "particle.clearance_ratio=12"];
    let [set, written] = [&answers(&folder, &set)[0], &answers(&folder, &["written.toml"])[0]];
    assert_eq!(set["impacts"], written["impacts"]);
    assert_eq!(set["summary"], written["summary"]);
    assert_eq!(set["case"]["set_up"], written["case"]["set_up"]);
    assert!(set["case"]["set"].as_str().unwrap().contains("clearance_ratio = 12"));
}

#[test]
fn ratios_refer_to_what_the_field_refers_them_to() {
    let free = "initial = { x_m = -0.035 }\n";
    let force = "force = { kind = \"sine\", amplitude_n = 1.0, frequency_ratio = 0.9 }\n";
    let particle = PARTICLE.replace("clearance_m = 0.03", "clearance_ratio = 2");
    let damper = "friction_damper = { friction_ratio = 0.5 }\n";
    let folder = folder(&[
        ("free.toml", format!("{STRUCTURE}{free}{particle}{damper}{RUN}")),
        ("force.toml", format!("{STRUCTURE}{force}{particle}{damper}{RUN}")),
        (
            "base.toml",
            format!(
                "{STRUCTURE}{}{particle}{damper}{RUN}",
                BASE.replace("frequency_hz = 2.5", "frequency_ratio = 1.1")
            ),
        ),
    ]);
    let all = answers(&folder, &["free.toml", "force.toml", "base.toml"]);
    let k = 1.6 * (2.5 * std::f64::consts::TAU).powi(2);
    for (answer, reference_m, cycle_s) in
        [(&all[0], 0.035, 0.4), (&all[1], 1.0 / k, 0.4 / 0.9), (&all[2], 0.003, 0.4 / 1.1)]
    {
        let near = |value: &Value, expected: f64| (value.as_f64().unwrap() / expected - 1.0).abs() < 1e-12;
        let set_up = &answer["case"]["set_up"];
        assert!(near(&set_up["particle"]["clearance_m"], 2.0 * reference_m), "{answer}");
        assert!(near(&set_up["friction_damper"]["force_n"], 0.5 * k * reference_m), "{answer}");
        assert!(near(&answer["case"]["cycle_s"], cycle_s) && near(&answer["case"]["reference"][0], reference_m));
    }
}

#[test]
fn a_wrong_value_is_refused_with_the_flag_the_key_and_what_is_allowed() {
    let folder = folder(&[("case.toml", format!("{STRUCTURE}{BASE}{PARTICLE}{RUN}"))]);
    for (set, words) in [
        ("particle.wall.coefficient=1.5", ["--set:1", "particle.wall.coefficient", "from 0 to 1"]),
        ("particle.clearence_m=0.02", ["particle.clearence_m", "unknown key", "clearance_m"]),
        ("particle.wall=steel", ["particle.wall", "--set:1", "must be a table"]),
        ("tmd.mass_ratio=0.1", ["tmd", "particle", "--set:1"]),
    ] {
        let told = refusal(&folder, &["case.toml", "--set", set]);
        assert!(words.iter().all(|word| told.contains(word)), "{set}\n{told}");
    }
    let both = ["case.toml", "--set", "particle.clearance_m=0.02", "--set", "particle.clearance_ratio=5"];
    let told = refusal(&folder, &both);
    assert!(told.contains("clearance_m") && told.contains("are both set"), "{told}");
    let told = refusal(&folder, &["case.toml", "case.toml", "--plot", "x.svg"]);
    assert!(told.contains("--plot") && told.contains("second"), "{told}");
}

#[test]
fn the_json_has_what_the_text_prints() {
    let folder = folder(&[("case.toml", format!("{STRUCTURE}{BASE}{PARTICLE}{}", RUN.replace('8', "20")))]);
    let answer = &answers(&folder, &["case.toml"])[0];
    assert_eq!(answer["case"]["name"], "case");
    assert_eq!(answer["case"]["reference"][1], "Z");
    assert!(answer["last_cycles"]["mean_cycle_max_m"].as_f64().unwrap() > 0.0);
    assert!(answer["last_cycles"]["impacts_per_cycle"].as_f64().unwrap() > 0.0);
}
