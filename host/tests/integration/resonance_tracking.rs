//! Experiments that follow a resonance: frequency and damping over the amplitude, the prediction of it, and what is refused.

use std::path::Path;

use damprig::campaign::Campaign;
use damprig::input::Source;
use damprig::report::resonance::{AtResonance, TrackedCurve, TrackedPoint};
use damprig::run_folder::RunFolder;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{Fate, Served, cut_off_at, damprig, folder_with};

/// The shipped campaign on these set-ups, with these amplitudes.
fn campaign(set_ups: &str, amplitudes: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("campaigns/resonance.toml");
    let text = std::fs::read_to_string(path).expect("shipped");
    let lines = text.lines().map(|line| match line.split_once(" = ") {
        Some(("x_amplitudes_m", _)) => format!("set_ups = [{set_ups}]\n{amplitudes}"),
        _ => line.into(),
    });
    lines.collect::<Vec<String>>().join("\n") + "\n"
}

/// Runs it on the virtual rig; the curves of the run folder.
fn run(folder: &TempDir, text: &str) -> Vec<TrackedCurve> {
    damprig(folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "out"]).assert().success();
    curves(folder, text)
}

fn curves(folder: &TempDir, text: &str) -> Vec<TrackedCurve> {
    let campaign = Campaign::parse(Source::new("test.toml", text.to_string())).unwrap();
    let run = RunFolder::open(&folder.path().join("out")).unwrap();
    TrackedCurve::of(&campaign, &run.result_rows().unwrap(), true)
}

/// Relative scale error of a data-sheet sensor at one amplitude: 2.6 times its linearity of 0.1 %, in x and in z.
const OF_SCALES: f64 = 2.0 * 2.6e-3;

#[test]
fn the_backbone_of_every_damper_is_that_of_its_model_with_data_sheet_sensors() {
    let text = campaign(r#""bare", "friction", "impact", "hybrid""#, "x_amplitudes_m = [0.006, 0.01, 0.014, 0.02]");
    let folder = folder_with(&text);
    let all = run(&folder, &text);
    assert_eq!(all.len(), 4);
    for curve in &all {
        assert_eq!((curve.measured.len(), curve.predicted.len()), (4, 4));
        for (own, model) in curve.measured.iter().zip(&curve.predicted) {
            assert_eq!((own.found, model.found), (AtResonance::Yes, AtResonance::Yes), "{own:?} {model:?}");
            let off = (own.damping_ratio - model.damping_ratio).abs();
            // Both are within the lock's tolerance of 2° of their phase, and x within 1 % of its amplitude; near the clearance the
            // damping of an impact damper rises in proportion to it.
            let allowed = own.damping_ratio_95 + (OF_SCALES + 0.02) * model.damping_ratio;
            assert!(off < allowed, "{}: {own:?} {model:?}", curve.set_up);
            let off_hz = (own.natural_frequency_hz - model.natural_frequency_hz).abs();
            assert!(off_hz < own.frequency_95_hz + 1e-3 * 2.5, "{}: {own:?} {model:?}", curve.set_up);
        }
    }
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("The resonance over the amplitude of x") && page.contains("equivalent ζ"));
    assert!(!page.contains("than the set Z"), "Z is a result here");
    assert!(folder.path().join("out/resonance.png").is_file());
    let table = std::fs::read_to_string(folder.path().join("out/resonance.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 2 * 16, "measured and predicted: {table}");
    assert!(table.starts_with("set_up,experiment,from,asked,resonance,frequency_hz"), "{table}");
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
}

/// Den Hartog's motion without stops: the largest |x − z| is √((b² Z V)² − (F U/k)²), b = Ω/ωn. At resonance both terms are large and
/// nearly equal, so Z is compared at the measured |x − z|. The structure's own damping is made small.
#[test]
fn the_friction_damper_follows_the_closed_form() {
    let text = campaign(r#""friction""#, "x_amplitudes_m = [0.003, 0.006, 0.012]")
        .replace("damping_ratio = 0.0038", "damping_ratio = 1e-6")
        .replace("sensors = { kind = \"data_sheet\" }", "sensors = { kind = \"ideal\" }\nsensor_noise_rms_m = 0.0")
        .replace("shaker = {}", "");
    let folder = folder_with(&text);
    let points: Vec<TrackedPoint> = run(&folder, &text).remove(0).measured;
    let rows = RunFolder::open(&folder.path().join("out")).unwrap().result_rows().unwrap();
    assert_eq!(rows.len(), 3);
    for (point, amplitude_m) in points.iter().zip([0.003, 0.006, 0.012]) {
        assert!(point.found == AtResonance::Yes && (point.x_m / amplitude_m - 1.0).abs() < 0.01, "{point:?}");
        let (b, friction_m) = (point.frequency_hz / 2.5, 0.6e-3);
        let v = 1.0 / (1.0 - b * b);
        let angle = std::f64::consts::PI / b;
        let u = angle.sin() / (b * (1.0 + angle.cos()));
        let relative_m = point.x_m.hypot(point.z_m);
        let closed_m = relative_m.hypot(friction_m * u) / (b * b * v).abs();
        println!("{point:?}: {closed_m}");
        // The largest |x − z| is up to 0.5 % above the amplitude at the drive frequency.
        assert!((closed_m / point.z_m - 1.0).abs() < 0.01, "{point:?}: {closed_m}");
        // Energy: 4 F a = π c Ω a².
        let equivalent = std::f64::consts::FRAC_2_PI * friction_m / relative_m / b;
        assert!((point.damping_ratio / equivalent - 1.0).abs() < 0.02, "{point:?}: {equivalent}");
    }
}

#[test]
fn identify_takes_fn_and_damping_from_the_bare_structures_backbone() {
    let of_base = "base_amplitudes_m = [0.0003, 0.00035, 0.0004, 0.00035, 0.0003]\ndrive = \"closed_loop\"";
    for amplitudes in ["x_amplitudes_m = [0.008, 0.01, 0.012, 0.014, 0.016, 0.018, 0.02]", of_base] {
        let text = campaign(r#""bare""#, amplitudes).replace("longest_dwell_s = 60", "longest_dwell_s = 200");
        identifies_the_bare_structure(&text);
    }
}

fn identifies_the_bare_structure(text: &str) {
    let folder = folder_with(text);
    run(&folder, text);
    let output =
        damprig(&folder).args(["identify", "response", "out", "--json"]).assert().success().get_output().clone();
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{said:#}");
    for (quantity, truth, most) in [("natural frequency", 2.5, 5e-4), ("damping ratio", 0.0038, 2e-4)] {
        let all = said["estimates"].as_array().or_else(|| said["values"].as_array()).expect("a list");
        let own = all.iter().find(|own| own["quantity"] == quantity).expect("found");
        let (value, standard) = (own["value"].as_f64().unwrap(), own["standard_uncertainty"].as_f64().unwrap());
        assert!(standard < most, "{quantity}: {own}");
        assert!((value - truth).abs() < 3.0 * standard, "{quantity}: {own}");
    }
}

#[test]
fn a_resonance_at_given_base_amplitudes_is_followed_up_and_down() {
    let amplitudes = "base_amplitudes_m = [0.0008, 0.001, 0.0008]\ndrive = \"closed_loop\"";
    let text = campaign(r#""friction""#, amplitudes).replace("longest_dwell_s = 60", "longest_dwell_s = 150");
    let folder = folder_with(&text);
    let points = run(&folder, &text).remove(0).measured;
    for (point, z_m) in points.iter().zip([0.0008, 0.001, 0.0008]) {
        assert!(point.found == AtResonance::Yes && (point.z_m / z_m - 1.0).abs() < 0.011, "{point:?}");
    }
    // Steady within 1 % of its amplitude; the scatter of both.
    assert!((points[0].x_m / points[2].x_m - 1.0).abs() < 0.03 && points[1].x_m > 4.0 * points[0].x_m, "{points:?}");
}

#[test]
fn what_would_leave_a_limit_is_refused_and_what_will_not_be_found_is_told() {
    for (limits, said) in [
        ("structure_limit_m = 0.008", "would leave the displacement limit of the structure"),
        ("base_limit_m = 0.0009", "would leave the displacement limit of the base"),
    ] {
        let text = campaign(r#""hybrid""#, "x_amplitudes_m = [0.004, 0.01]");
        let folder = folder_with(&text.replace("[rig]", &format!("[rig]\n{limits}")));
        let refused = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2);
        refused.stderr(contains(said).and(contains("x 10 mm is too much")));
    }
    let text = campaign(r#""impact""#, "x_amplitudes_m = [0.006]").replace("to_hz = 2.8", "to_hz = 2.3");
    let folder = folder_with(&text.replace("start_hz = 2.5", "start_hz = 2.25"));
    let told = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success();
    told.stderr(contains("no resonance is predicted to be found from 2.2 to 2.3 Hz at x 6 mm"));
    let ran = damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "out"]).assert().success();
    ran.stdout(contains("not locked: at an end of the range"));
}

#[test]
fn what_the_loop_cannot_do_is_refused_with_its_reason() {
    let text = campaign(r#""hybrid""#, "x_amplitudes_m = [0.004]");
    let base = campaign(r#""hybrid""#, "base_amplitudes_m = [0.001]");
    for (wrong, said) in [
        (text.replace("[0.004]", "[]"), "must hold at least one amplitude"),
        (text.replace("[0.004]", "[0.004, 0]"), "greater than 0"),
        (text.replace("x_amplitudes_m = [0.004]", ""), "`experiment[1].base_amplitudes_m` is missing"),
        (text.replace("to_hz = 2.8", "to_hz = 2.2"), "must be above from_hz = 2.2"),
        (text.replace("start_hz = 2.5", "start_hz = 2.9"), "must be from 2.2 to 2.8 Hz"),
        (text.replace("dwell_s = 8", "dwell_s = 2"), "must hold 6 periods of the lowest frequency, 2.2 Hz"),
        (text.replace("ramp_s = 1", "drive = \"closed_loop\""), "belongs to base_amplitudes_m"),
        (base.replace("ramp_s = 1", "response_loop = { tolerance = 0.1 }"), "belongs to amplitudes of the response"),
        (base.clone(), "must keep the base on a shaker"),
        (base.replace("[0.001]", "[0.1]").replace("shaker = {}", ""), "too large an amplitude"),
        (text.replace("ramp_s = 1", "phase_lock = { phase_deg = 0 }"), "from -150 to -30"),
        (text.replace("ramp_s = 1", "phase_lock = { gain_per_cycle = 2 }"), "from 0.1 to 1.5"),
        (text.replace("ramp_s = 1", "frequencies_hz = [2.5]"), "unknown key"),
        (
            text.replace("shaker = {}", "").replace("base_amplitude_m = 0.001", "force_amplitude_n = 0.4"),
            "is driven by a force over a fixed base",
        ),
    ] {
        let folder = folder_with(&wrong);
        damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2).stderr(contains(said));
    }
}

/// Carried over, the interrupted experiment begins again; from rest it goes on.
#[test]
fn an_interrupted_run_is_resumed_to_the_same_results() {
    for start in ["carry_over", "from_rest"] {
        let text = campaign(r#""hybrid""#, "x_amplitudes_m = [0.006, 0.008, 0.010]")
            .replace("start = \"carry_over\"", &format!("start = \"{start}\"\nrest_level_m = 5e-4"));
        let frequencies_hz = |folder: &TempDir| -> Vec<f64> {
            let run = RunFolder::open(&folder.path().join("out")).unwrap();
            run.result_rows().unwrap().iter().map(|row| row.frequency_hz).collect()
        };
        let whole = folder_with(&text);
        let uncut = Served::again_and_again(|_| Fate::Pass);
        damprig(&whole).args(["run", "test.toml", "--rig", &uncut, "--out", "out"]).assert().success();
        let (folder, rig) = cut_off_at(&text, 2);
        damprig(&folder).args(["run", "--resume", "out", "--rig", &rig]).assert().success();
        assert_eq!(frequencies_hz(&folder), frequencies_hz(&whole), "{start}");
    }
}
