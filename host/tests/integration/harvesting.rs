//! Piezoelectric walls: what their loads take, and where they are refused.

use serde_json::Value;

use crate::common::{damprig, folder, refused, short, simulated};

/// A structure that is free from 50 mm, with a particle between two walls of `WALL`.
const FREE: &str = "\
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0 }
initial = { x_m = 0.05 }
run = { duration_s = 10 }
particle = { mass_ratio = 0.1, clearance_m = 0.02, wall = WALL }
";

const WALL: &str = "{ kind = \"piezoelectric\", stiffness_n_per_m = 2e4, coupling_n_per_v = 0.02, capacitance_f = 5e-8, load_ohm = 1e5 }";

fn number(answer: &Value, path: &str) -> f64 {
    answer.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} of {answer}"))
}

#[test]
fn the_loads_take_all_that_a_structure_without_damping_loses() {
    let answer = simulated(&FREE.replace("WALL", WALL), &["--analyse"]);
    let harvested_j = 10.0 * number(&answer, "/summary/harvested_power_w");
    let lost_j = number(&answer, "/analysis/energy/link_damping_j");
    let at_start_j = 0.5 * 1.6 * (std::f64::consts::TAU * 2.5).powi(2) * 0.05 * 0.05;
    assert!(lost_j > 0.1 * at_start_j && lost_j < at_start_j, "{lost_j} of {at_start_j}");
    assert!((harvested_j - lost_j).abs() < 1e-12 * at_start_j, "{harvested_j} {lost_j}");
    let of_damper = number(&answer, "/impact_dampers/0/harvested_power_w");
    assert_eq!(of_damper, number(&answer, "/summary/harvested_power_w"));
    assert!(number(&answer, "/impact_dampers/0/max_abs_voltage_v") > 0.0);
}

#[test]
fn without_coupling_a_wall_is_the_soft_wall_of_one_degree_of_freedom() {
    let soft = "{ kind = \"voigt\", stiffness_n_per_m = 2e4, damping_n_s_per_m = 0, release = \"zero_force\" }";
    let short = FREE.replace("duration_s = 10", "duration_s = 2");
    let harvesting = simulated(&short.replace("WALL", &WALL.replace("0.02", "0")), &[]);
    let soft = simulated(&short.replace("WALL", soft), &[]);
    for key in ["rms_x_m", "max_abs_x_m", "impact_count"] {
        let [a, b] = [&harvesting, &soft].map(|answer| number(answer, &format!("/summary/{key}")));
        assert!((a / b - 1.0).abs() < 1e-9, "{key}: {a} {b}");
    }
    assert_eq!(number(&harvesting, "/summary/harvested_power_w"), 0.0);
}

#[test]
fn a_load_of_nearly_nothing_leaves_the_soft_wall_of_short_circuit() {
    let soft = "{ kind = \"voigt\", stiffness_n_per_m = 2e4, damping_n_s_per_m = 0, release = \"zero_force\" }";
    let short = FREE.replace("duration_s = 10", "duration_s = 1");
    let soft = number(&simulated(&short.replace("WALL", soft), &[]), "/summary/peak_contact_force_n");
    let peak_n = |load: &str| {
        let set = format!("particle.wall.load_ohm={load}");
        number(&simulated(&short.replace("WALL", WALL), &["--set", &set]), "/summary/peak_contact_force_n")
    };
    // What is left falls with R.
    let [ten, one] = [peak_n("10"), peak_n("1")].map(|peak_n| (peak_n / soft - 1.0).abs());
    assert!(one < 1e-4 && one < 0.2 * ten, "{ten} {one}");
}

#[test]
fn a_force_drives_a_structure_with_piezoelectric_walls_and_a_study_has_the_force_on_them() {
    let driven = FREE
        .replace("WALL", WALL)
        .replace("initial = { x_m = 0.05 }", "force = { kind = \"sine\", amplitude_n = 2, frequency_ratio = 0.98 }");
    let driven = driven.replace("run = { duration_s = 10 }", "run = { duration_s = 10, steady_from_cycle = 0 }");
    let answer = simulated(&driven, &[]);
    let peak_n = number(&answer, "/summary/peak_contact_force_n");
    assert!(peak_n > 0.0 && peak_n == number(&answer, "/impact_dampers/0/peak_contact_force_n"), "{answer}");
    let study = "case = \"case.toml\"\nmetrics = [\"peak_contact_force_n\"]\n[[axis]]\nkey = \"force.amplitude_n\"\nvalues = [2, 3]\n";
    let folder = folder(&[("case.toml", &driven), ("study.toml", study)]);
    let output = damprig(&folder).args(["study", "run", "study.toml", "--out", "out", "--json"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).to_string();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let best: Value = serde_json::from_str(&text).unwrap();
    assert!(text.contains("peak_contact_force_n"), "{best}");
}

#[test]
fn a_study_finds_the_load_that_takes_most() {
    let on_base = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }";
    let case = FREE.replace("WALL", WALL).replace("initial = { x_m = 0.05 }", on_base);
    let case = case.replace("damping_ratio = 0 ", "damping_ratio = 0.01 ");
    let study = "case = \"case.toml\"\nmetrics = [\"harvested_power_w\"]\ngoal = \"maximum\"\n[[axis]]\nkey = \"particle.wall.load_ohm\"\n\
                 from = 1e2\nto = 1e8\ncount = 7\nscale = \"log\"\n[record]\nsettle_cycles = 100\ncycles = 40\n";
    let folder = folder(&[("case.toml", &case), ("study.toml", study)]);
    let output = damprig(&folder).args(["study", "run", "study.toml", "--out", "out"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).to_string();
    // Contacts of about π√(m/k) = 9 ms against RC: 1.8e5 Ω at most.
    assert!(output.status.success() && text.contains("largest harvested_power_w"), "{text}");
    assert!(text.contains("particle.wall.load_ohm             100000 Ω"), "{text}");
}

#[test]
fn where_no_wall_can_be_piezoelectric_it_is_refused_with_what_to_do() {
    let text = FREE.replace("WALL", &WALL.replace("coupling_n_per_v = 0.02", "coupling_n_per_v = -0.02"));
    refused(&[("case.toml", &text)], &["simulate", "case.toml"], &["particle.wall.coupling_n_per_v", "0 or greater"]);
    for (set, words) in [
        ("coupling_n_per_v=3", ["means θ²/(kC)", "at most 100"]),
        ("load_ohm=1e-6", ["at short circuit it is a soft wall", "stiffness_n_per_m = 20000"]),
        ("load_ohm=1e30", ["at open circuit it is a soft wall", "stiffness_n_per_m = 28000"]),
    ] {
        let set = format!("particle.wall.{set}");
        let files = [("case.toml", FREE.replace("WALL", WALL))];
        refused(
            &files.each_ref().map(|(name, text)| (*name, text.as_str())),
            &["simulate", "case.toml", "--set", &set],
            &words,
        );
    }
    let hard = FREE.replace("WALL", "{ kind = \"restitution\", coefficient = 0.5 }");
    let study = "case = \"case.toml\"\nmetrics = [\"harvested_power_w\"]\n[[axis]]\nkey = \"particle.clearance_m\"\nvalues = [0.01, 0.02]\n";
    refused(
        &[("case.toml", &hard), ("study.toml", study)],
        &["study", "run", "study.toml"],
        &["harvested_power_w", "piezoelectric walls; the case has none"],
    );
    let campaign = short();
    let at = campaign.find("wall = ").unwrap();
    let end = at + campaign[at..].find('}').unwrap() + 1;
    let campaign = format!("{}wall = {WALL}{}", &campaign[..at], &campaign[end..]);
    refused(
        &[("test.toml", &campaign)],
        &["run", "test.toml", "--dry-run"],
        &["has a piezoelectric wall, which is for cases", "unmodelled"],
    );
}
