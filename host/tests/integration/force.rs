//! Set-ups that a force drives over a fixed base.

use crate::common::{damprig, folder_with, manifest, read_parquet};
use damprig::table::values::numbers;
use predicates::str::contains;

/// A strongly damped structure at its natural frequency with ideal sensors; `amplitude` is the line of the drive's amplitude.
fn campaign(amplitude: &str) -> String {
    format!(
        "name = \"force\"\n[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.05\n\
         [[set_up]]\nname = \"bare\"\n{amplitude}\n\
         [[experiment]]\nname = \"sweep\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.5]\nstart = \"from_rest\"\n\
         settle_s = 24.0\ndwell_s = 8.0\n[telemetry]\nrate_hz = 100\nsignals = [\"x\", \"z\"]\n"
    )
}

fn x_over_z(amplitude: &str) -> f64 {
    let folder = folder_with(&campaign(amplitude));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let rows = &read_parquet(folder.path().join("out/results.parquet"))[0];
    numbers(rows, "x_over_z_lock_in").unwrap()[0]
}

#[test]
fn at_resonance_a_force_is_magnified_as_its_closed_form_says_and_a_base_by_more() {
    let zeta = 0.05_f64;
    // The start has decayed by e^(−ζω·24 s) = 7e-9. The lock-in of noise-free samples in single precision is within 1e-5.
    let force = x_over_z("force_amplitude_n = 0.4");
    assert!((force * 2.0 * zeta - 1.0).abs() < 2e-5, "{force}");
    let base = x_over_z("base_amplitude_m = 0.001");
    assert!((base * 2.0 * zeta / (1.0 + 4.0 * zeta * zeta).sqrt() - 1.0).abs() < 2e-5, "{base}");
}

#[test]
fn the_force_is_in_manifest_and_page() {
    let folder = folder_with(&campaign("force_amplitude_n = 0.4"));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let run = folder.path().join("out");
    assert_eq!(manifest(&run)["set_ups"][0]["model"]["is_force_driven"], true);
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("P = 0.4 N") && page.contains("P, force amplitude (N)"));
}

#[test]
fn what_moves_the_base_does_not_go_with_a_force() {
    let text = campaign("force_amplitude_n = 0.4");
    for (wrong, said) in [
        (
            text.replace("[[set_up]]", "[rig.shaker]\n[[set_up]]"),
            "is driven by a force, and `[rig.shaker]` moves the base",
        ),
        (campaign("force_amplitude_n = 0.4\nbase_amplitude_m = 0.001"), "says the same quantity"),
        (campaign("force_amplitude_n = 0"), "greater than 0"),
        (campaign("force_amplitude_n = 40"), "force_amplitude_n = 1.7"),
        (
            text.clone()
                + "[[experiment]]\nname = \"pulse\"\nkind = \"impulse\"\nshape = \"versine\"\namplitude_m = 0.001\nduration_s = 0.2\n",
            "set-up \"bare\" is driven by a force over a fixed base",
        ),
    ] {
        let folder = folder_with(&wrong);
        damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2).stderr(contains(said));
    }
}

#[test]
fn a_model_of_another_stiffness_is_compared_at_the_same_force() {
    let folder = folder_with(&campaign("force_amplitude_n = 0.4"));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    // Twice the mass at the same frequency: twice the stiffness, so half the motion under the same force.
    let stiff = campaign("force_amplitude_n = 0.4").replace("mass_kg = 1.6", "mass_kg = 3.2");
    std::fs::write(folder.path().join("stiff.toml"), stiff).unwrap();
    let output = damprig(&folder).args(["compare", "out", "--set-ups", "stiff.toml", "--json"]).output().unwrap();
    let comparison: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let metrics = comparison["experiments"][0]["points"][0]["metrics"].as_array().unwrap();
    let mut halved = 0;
    for metric in metrics
        .iter()
        .filter(|m| ["x_over_z", "x_over_z_lock_in", "max_abs_x_m"].contains(&m["metric"].as_str().unwrap()))
    {
        let of = |which: &str| metric[which]["value"].as_f64().unwrap();
        let ratio = of("on_ideal_base") / of("measured");
        assert!((ratio - 0.5).abs() < 1e-4, "{metric}");
        halved += 1;
    }
    assert_eq!(halved, 3, "{metrics:?}");
    let moved = campaign("base_amplitude_m = 0.001");
    std::fs::write(folder.path().join("moved.toml"), moved).unwrap();
    let said = contains("stands on a base that moves, that of the run is driven by a force");
    damprig(&folder).args(["compare", "out", "--set-ups", "moved.toml"]).assert().code(2).stderr(said);
}
