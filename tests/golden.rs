//! `damprig simulate` on the golden cases: free, forced, frictional, soft-walled, hybrid, tuned and pulsed.
//!
//! The expected values come from an independent event-driven integrator of order 18; each file states its tolerance and
//! its conditioning (relative output change per relative input change), which bounds what double precision can reach.

use std::fs;
use std::path::Path;

use damprig_tests::support::command::{damprig, told};
use damprig_tests::support::images::project;
use serde_json::Value;

/// Largest difference of two lists, relative to the largest expected magnitude.
fn error(found: &Value, expected: &Value) -> f64 {
    let numbers = |list: &Value| list.as_array().map(|l| l.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
    let (Some(found), Some(expected)) = (numbers(found), numbers(expected)) else { return f64::INFINITY };
    if found.len() != expected.len() {
        return f64::INFINITY;
    }
    let scale = expected.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let worst = found.iter().zip(&expected).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    if scale > 0.0 { worst / scale } else { worst }
}

fn relative(found: &Value, expected: &Value) -> f64 {
    match (found.as_f64(), expected.as_f64()) {
        (Some(found), Some(expected)) if expected != 0.0 => (found / expected - 1.0).abs(),
        (Some(found), Some(_)) => found.abs(),
        _ => f64::INFINITY,
    }
}

/// The largest error of a case and its location.
fn worst(answer: &Value, golden: &Value) -> (f64, String) {
    let expected = &golden["expected"];
    let mut errors = vec![];
    for key in ["x_m", "v_m_per_s", "y_m"] {
        if !expected[key].is_null() {
            errors.push((error(&answer[key], &expected[key]), key.to_string()));
        }
    }
    for (n, impact) in expected["impacts"].as_array().into_iter().flatten().enumerate() {
        let found = &answer["impacts"][n];
        errors.push((relative(&found["t_s"], &impact["t_s"]), format!("time of impact {n}")));
        if golden["not_compared"].is_null() {
            let key = "approach_speed_m_per_s";
            errors.push((relative(&found[key], &impact[key]), format!("speed of impact {n}")));
        }
    }
    for (key, value) in expected["summary"].as_object().into_iter().flatten() {
        errors.push((relative(&answer["summary"][key], value), key.clone()));
    }
    errors.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("a case expects something")
}

fn check(path: &Path, scratch: &Path) -> Result<(), String> {
    let golden: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let case = scratch.join("case.json");
    fs::write(&case, golden["case"].to_string()).unwrap();
    let output = damprig().arg("simulate").arg(&case).arg("--json").output().unwrap();
    let name = golden["name"].as_str().unwrap_or_default();
    if !output.status.success() {
        return Err(format!("{name}: {}", told(&output)));
    }
    let answer: Value = serde_json::from_slice(&output.stdout).map_err(|e| format!("{name}: {e}"))?;
    let Some(tolerance) = golden["relative_tolerance"].as_f64() else {
        // A chaotic case has no trajectory to compare; its mean over a thousand cycles scatters by several per cent.
        let key = "steady_mean_cycle_max_abs_x_m";
        let off = relative(&answer["summary"][key], &golden["expected"]["summary"][key]);
        return if off < 0.15 { Ok(()) } else { Err(format!("{name}: {key} is off by {off:.1e}")) };
    };
    let conditioning = golden["conditioning"].as_f64().unwrap_or(0.0);
    let allowed = tolerance.max(50.0 * f64::EPSILON * conditioning);
    match worst(&answer, &golden) {
        (off, _) if off <= allowed => Ok(()),
        (off, what) => Err(format!("{name}: {what} is off by {off:.1e}, allowed is {allowed:.1e}")),
    }
}

#[test]
fn every_golden_case_agrees_within_its_tolerance() {
    let scratch = tempfile::TempDir::new().unwrap();
    let mut cases: Vec<_> =
        fs::read_dir(project().join("tests/cases")).unwrap().map(|entry| entry.unwrap().path()).collect();
    cases.sort();
    let missed: Vec<String> = cases.iter().filter_map(|path| check(path, scratch.path()).err()).collect();
    assert!(missed.is_empty(), "{} of {} cases missed:\n{}", missed.len(), cases.len(), missed.join("\n"));
    assert!(cases.len() >= 36, "only {} cases found", cases.len());
}

#[test]
fn accumulating_impacts_end_in_contact_and_never_hang() {
    let scratch = tempfile::TempDir::new().unwrap();
    for (restitution, cycles) in [(0.3, 1000), (0.5, 1000), (0.0, 200), (1.0, 200)] {
        let case = scratch.path().join("chatter.toml");
        let text = format!(
            "[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.0038\n\
             [particle]\nmass_ratio = 0.1\nclearance_m = 0.06\nfriction_coefficient = 0.0\n\
             wall = {{ kind = \"restitution\", coefficient = {restitution:?} }}\n\
             [base]\nkind = \"sine\"\namplitude_m = 0.003\nfrequency_hz = 2.5\nphase_rad = 0.0\n\
             [initial]\nx_m = 0.0\nv_m_per_s = 0.0\ny_m = 0.0\nu_m_per_s = 0.0\n\
             [run]\nduration_s = {}\ncycle_s = 0.4\nsteady_from_cycle = 50\n",
            f64::from(cycles) * 0.4
        );
        fs::write(&case, text).unwrap();
        let output = damprig().arg("simulate").arg(&case).arg("--json").output().unwrap();
        assert!(output.status.success(), "e = {restitution}: {}", told(&output));
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        let summary = &answer["summary"];
        assert_eq!(summary["simulated_s"].as_f64(), Some(f64::from(cycles) * 0.4));
        let swing = summary["steady_mean_cycle_max_abs_x_m"].as_f64().unwrap() / 0.003;
        println!("e = {restitution}, d/Z = 20, {cycles} cycles: mean cycle maximum {swing:.4} Z");
        assert!(swing > 1.0 && swing < 131.6, "e = {restitution}: {swing} Z");
    }
}
