//! `damprig simulate --analyse`, and what it rests on.

use std::path::Path;

use assert_cmd::Command;
use damprig::analysis::Analysis;
use damprig::simulation::Case;

fn case(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("cases").join(name)
}

#[test]
fn every_shipped_case_keeps_its_energy_balance() {
    for name in ["spid.toml", "soft-wall.toml", "friction-damper.toml", "hybrid.toml", "tmd.toml"] {
        let case = Case::read(&case(name)).expect("shipped cases are right");
        let energy = Analysis::of(&case).expect("in closed form").energy;
        let through = energy.input_j.abs() + energy.stored_j.abs();
        assert!(energy.residual_j.abs() <= 1e-12 * through, "{name}: {energy:?}");
    }
}

#[test]
fn a_record_has_no_analysis_in_closed_form() {
    let case = Case::read(&case("record.toml")).expect("shipped cases are right");
    assert!(Analysis::of(&case).is_none());
}

#[test]
fn the_answer_carries_the_analysis_only_where_it_was_asked_for() {
    let answer = |analyse: bool| -> serde_json::Value {
        let mut command = Command::cargo_bin("damprig").expect("it is built");
        command.arg("simulate").arg(case("spid.toml")).arg("--json");
        if analyse {
            command.arg("--analyse");
        }
        let output = command.assert().success().get_output().stdout.clone();
        serde_json::from_slice(&output).expect("one JSON object")
    };
    assert!(answer(false).get("analysis").is_none());
    let both = answer(true);
    let driven = &both["analysis"]["driven"];
    assert_eq!(driven["orbit"]["stable"], true);
    assert_eq!(driven["orbit"]["multipliers"].as_array().map(Vec::len), Some(4));
    let (amplitude, largest) = (driven["amplitude_m"].as_f64(), driven["mean_cycle_max_abs_x_m"].as_f64());
    assert!(amplitude > Some(0.0) && largest > Some(0.0));
    assert!(both["summary"]["rms_x_m"].as_f64() > Some(0.0));
}
