//! Sensitivity indices and distributions of a study, against closed forms.

use damprig::study::table::StudyTable;
use serde_json::Value;
use std::f64::consts::TAU;
use tempfile::TempDir;

use crate::common::damprig;
use crate::study::{folder, run};

/// Damping ratio and natural frequency of the bare structure.
const ZETA: f64 = 0.02;
const NATURAL_HZ: f64 = 2.5;

/// A bare structure in its settled motion, whose amplitude is Z times |H(f)|.
fn linear(sampling: &str, axes: &str) -> TempDir {
    let folder = folder(&format!(
        "case = \"linear.toml\"\nmetrics = [\"mean_cycle_max_m\"]\nrecord = {{ settle_s = 800, cycles = 10 }}\n{sampling}\n{axes}"
    ));
    let case = format!(
        "structure = {{ mass_kg = 1.6, natural_frequency_hz = {NATURAL_HZ}, damping_ratio = {ZETA} }}\n\
         base = {{ kind = \"sine\", amplitude_m = 0.003, frequency_hz = 1.5 }}\nrun = {{ duration_s = 8 }}\n"
    );
    std::fs::write(folder.path().join("linear.toml"), case).unwrap();
    folder
}

fn axis(key: &str, values: &str) -> String {
    format!("[[axis]]\nkey = \"{key}\"\n{values}\n")
}

/// |X/Z| of the structure.
fn magnitude(hz: f64) -> f64 {
    let (r, d) = (hz / NATURAL_HZ, 2.0 * ZETA * hz / NATURAL_HZ);
    ((1.0 + d * d) / ((1.0 - r * r) * (1.0 - r * r) + d * d)).sqrt()
}

fn answer(folder: &TempDir) -> Value {
    let output = run(folder, "2", &["--out", "out", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("one JSON text")
}

/// Value and interval of an index.
fn index(answer: &Value, key: &str, name: &str) -> [f64; 3] {
    let all = answer["sensitivity"][0]["indices"].as_array().unwrap();
    let index = all.iter().find(|index| index["key"] == key && index["index"] == name).expect("the index");
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    [number(&index["value"]), number(&index["interval_95"][0]), number(&index["interval_95"][1])]
}

#[test]
fn sobol_indices_of_a_linear_structure_are_those_of_its_closed_form() {
    let amplitude = axis("base.amplitude_m", "distribution = \"normal\"\nmean = 0.003\nstandard_deviation = 0.0004");
    let frequency = axis("base.frequency_hz", "from = 1\nto = 2");
    let folder = linear("sampling = { method = \"sobol_indices\", count = 1024 }", &format!("{amplitude}{frequency}"));
    let answer = answer(&folder);
    assert_eq!(answer["rows"], 4 * 1024);
    // X = Z·|H|, of independent factors: Var X = E Z²·E H² − (E Z·E H)². Midpoint rule over the frequency.
    let points = 10_000;
    let of_h = |power: i32| {
        let at = |n: i32| magnitude(1.0 + (f64::from(n) + 0.5) / f64::from(points)).powi(power);
        (0..points).map(at).sum::<f64>() / f64::from(points)
    };
    let (h, h2): (f64, f64) = (of_h(1), of_h(2));
    // Cut off at four standard deviations, the variance is smaller by 8·φ(4): 1.07e-3.
    let (z, variance_z): (f64, f64) = (0.003, 0.0004 * 0.0004 * (1.0 - 8.0 * (-8.0_f64).exp() / TAU.sqrt()));
    let all = (z * z + variance_z) * h2 - z * z * h * h;
    let [of_z, of_f] = [variance_z * h * h / all, z * z * (h2 - h * h) / all];
    for (key, own, other) in [("base.amplitude_m", of_z, of_f), ("base.frequency_hz", of_f, of_z)] {
        for (name, exact) in [("first_order", own), ("total", 1.0 - other)] {
            let [value, low, high] = index(&answer, key, name);
            // The error of evenly spread points is about 1/1024 times a power of its logarithm.
            assert!((value - exact).abs() < 0.01, "{key} {name}: {value} and not {exact}");
            assert!(low < exact && exact < high, "{key} {name}: {low} to {high}, not {exact}");
        }
    }
    let said = String::from_utf8(run(&folder, "2", &["--out", "out"]).stdout).unwrap();
    for words in ["shares of the variance of mean_cycle_max_m, 1024 base points", "base.amplitude_m", "first order"] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    let out = folder.path().join("out");
    let bytes = std::fs::read(out.join("sensitivity.parquet")).unwrap();
    let table = StudyTable::read("sensitivity.parquet", bytes.into()).unwrap();
    assert_eq!(table.words("index").unwrap(), ["first_order", "total", "first_order", "total"]);
    assert_eq!(table.column("value").unwrap()[0], index(&answer, "base.amplitude_m", "first_order")[0]);
    let page = std::fs::read_to_string(out.join("study.html")).unwrap();
    assert!(page.contains("first order: alone") && page.contains("1024 base points"));
    let mut verify = damprig(&folder);
    assert!(verify.args(["study", "verify", "study.toml", "--out", "out"]).output().unwrap().status.success());
}

#[test]
fn elementary_effects_of_a_linear_metric_are_its_slope_over_the_range() {
    let axes = [
        axis("base.amplitude_m", "from = 0.002\nto = 0.004"),
        // Neither ratio nor frequency depends on it.
        axis("structure.mass_kg", "from = 1\nto = 2\nscale = \"log\""),
    ];
    let answer = answer(&linear("sampling = { method = \"morris\", count = 8, seed = 5 }", &axes.concat()));
    assert_eq!(answer["rows"], 3 * 8);
    assert_eq!([&answer["sensitivity"][0]["method"], &answer["sensitivity"][0]["unit"]], ["morris", "m"]);
    let slope = 0.002 * magnitude(1.5);
    // Rounding of X, about 5 mm, and of its closed form, over the step; σ is the root of what is left of a difference of squares.
    for (name, exact, tolerance) in
        [("mean_effect", slope, 1e-12), ("mean_absolute_effect", slope, 1e-12), ("effect_deviation", 0.0, 1e-9)]
    {
        let [value, ..] = index(&answer, "base.amplitude_m", name);
        assert!((value - exact).abs() < tolerance * slope.max(1.0), "{name}: {value}, not {exact}");
        let [value, ..] = index(&answer, "structure.mass_kg", name);
        assert!(value.abs() < 1e-9 * slope, "{name} of the mass: {value}");
    }
}

#[test]
fn drawn_values_follow_their_distribution() {
    let axes =
        axis("base.amplitude_m", "distribution = \"lognormal\"\nmean = 0.003\nstandard_deviation = 0.001\nto = 0.01");
    let folder = linear("sampling = { method = \"latin_hypercube\", count = 400 }", &axes);
    let mut drawn = crate::study::column(&crate::study::done(&folder), "base.amplitude_m");
    drawn.sort_by(f64::total_cmp);
    let (sigma2, n) = ((1.0_f64 + 1.0 / 9.0).ln(), drawn.len() as f64);
    let median = 0.003 / (0.5 * sigma2).exp();
    // One value in each of 400 equal parts: the middle two are within a part of the median, whose density is 1/(x σ √(2π)). The end cuts off 1e-4.
    let part = median * sigma2.sqrt() * TAU.sqrt() / n;
    assert!((drawn[200] - median).abs() < 1.1 * part, "{} and not {median}", drawn[200]);
    assert!(drawn[0] > 0.0 && drawn[399] <= 0.01);
    let below_mean = drawn.iter().filter(|value| **value < 0.003).count() as f64 / n;
    // Φ(σ/2) with σ = 0.3246.
    assert!((below_mean - 0.5645).abs() < 2.0 / n, "{below_mean}");
}

#[test]
fn wrong_samplings_and_distributions_are_refused_with_key_value_and_what_is_allowed() {
    let indices = "sampling = { method = \"sobol_indices\", count = 64 }";
    let range = axis("base.amplitude_m", "from = 0.002\nto = 0.004");
    let normal = |rest: &str| axis("structure.damping_ratio", &format!("distribution = \"normal\"\n{rest}"));
    let cases: &[(&str, String, &[&str])] = &[
        ("sampling = { method = \"morris\", count = 2 }", range.clone(), &["count", "at least 4", "morris"]),
        (
            indices,
            format!("{range}{}", axis("base.frequency_hz", "values = [1, 2]")),
            &["listed values", "sobol_indices"],
        ),
        (indices, normal("mean = 0.02"), &["standard_deviation", "missing"]),
        (indices, normal("mean = 0.02\nstandard_deviation = -1"), &["standard_deviation", "-1", "greater than 0"]),
        // Four standard deviations below the mean there is no damping.
        (
            indices,
            normal("mean = 0.02\nstandard_deviation = 0.01"),
            &["structure.damping_ratio", "-0.02", "`from` and `to`"],
        ),
        (
            indices,
            normal("mean = 0.02\nstandard_deviation = 0.01\nfrom = 0.5\nto = 0.6"),
            &["mean", "1 %", "0.5 and 0.6"],
        ),
        (indices, normal("mean = 0.02\nstandard_deviation = 0.01\nscale = \"log\""), &["scale", "lognormal"]),
        ("", normal("mean = 0.02\nstandard_deviation = 0.001"), &["distribution", "[sampling]"]),
        (
            indices,
            axis("base.amplitude_m", "from = 0.002\nto = 0.004\nmean = 0.003"),
            &["mean", "does not go with", "uniform"],
        ),
        (
            indices,
            axis("base.amplitude_m", "distribution = \"lognormal\"\nmean = -0.003\nstandard_deviation = 0.001"),
            &["mean", "-0.003", "greater than 0"],
        ),
    ];
    for (sampling, axes, words) in cases {
        let output = run(&linear(sampling, axes), "2", &["--out", "out"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{axes}\n{told}");
        for word in *words {
            assert!(told.contains(word), "no {word:?} in:\n{told}");
        }
    }
}
