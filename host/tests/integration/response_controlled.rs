//! Experiments that keep the structure's amplitude: the hidden part of a response, the prediction of it, and what is refused.

use std::path::Path;
use std::sync::Arc;

use damprig::campaign::Campaign;
use damprig::continuation::Continuation;
use damprig::input::Source;
use damprig::prediction::loops;
use damprig::report::force_surface::{Fold, ForceSurface};
use damprig::run_folder::RunFolder;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::real_board::real_board;
use crate::common::{cut_off_at, damprig, folder_with, is_full};

fn shipped() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("campaigns/hidden-branch.toml"))
        .expect("shipped")
}

/// The sheets of the shipped campaign alone, on this set-up.
fn all_sheets(set_up: &str) -> String {
    let text = shipped();
    let (head, _) = text.split_once("[[experiment]]\nname = \"up\"").expect("sweeps after the sheets");
    head.replace("kind = \"response_controlled\"", &format!("kind = \"response_controlled\"\nset_ups = [{set_up:?}]"))
}

/// The same at these amplitudes (m) and six frequencies.
fn sheets(set_up: &str, amplitudes_m: &str) -> String {
    let text = all_sheets(set_up);
    let lines = text.lines().map(|line| match line.split_once(" = ") {
        Some(("x_amplitudes_m", _)) => format!("x_amplitudes_m = [{amplitudes_m}]"),
        Some(("frequencies_hz", _)) => "frequencies_hz = { from_hz = 3.04, to_hz = 3.19, step_hz = 0.03 }".into(),
        _ => line.into(),
    });
    lines.collect::<Vec<String>>().join("\n") + "\n"
}

const EIGHT: &str = "0.0018, 0.0021, 0.0024, 0.0031, 0.0034, 0.0037, 0.004, 0.0043";

/// Half the largest distance between neighbouring amplitudes, mm.
const HALF_STEP_MM: f64 = 0.35;

/// The folds at Z = 1 mm of the set-up's periodic motions: frequency (Hz, falling) and largest |x| (mm).
fn continued(folder: &TempDir, friction: &str) -> Vec<(f64, f64)> {
    let particle = "mass_ratio = 0.1\nclearance_m = 0.0018\nwall = { kind = \"voigt\", stiffness_n_per_m = 55, damping_n_s_per_m = 0.25, release = \"zero_force\" }";
    assert!(shipped().contains(particle), "the case is that of the campaign");
    let case = format!(
        "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\nrun = {{ duration_s = 40 }}\n\
         base = {{ kind = \"sine\", amplitude_m = 0.001, frequency_hz = 3.0 }}\n{friction}[particle]\n{particle}\n"
    );
    std::fs::write(folder.path().join("case.toml"), case).unwrap();
    let file = folder.path().join("continuation.toml");
    let text = "case = \"case.toml\"\nparameter = \"base.frequency_hz\"\nfrom = 2.9\nto = 3.3\nrestarts = 0\n";
    std::fs::write(&file, text).unwrap();
    let found = Continuation::read(&file).expect("valid").follow(&|_| true).expect("periodic");
    let folds = found.branches[0].special_points.iter().filter(|point| point.kind == "fold");
    folds.map(|point| (point.parameter, 1e3 * point.max_abs_x_m)).collect()
}

#[test]
fn the_folds_of_both_shipped_set_ups_are_measured_with_data_sheet_sensors() {
    for (name, place, friction) in
        [("soft-walls", 0, ""), ("hybrid", 1, "friction_damper = { friction_ratio = 0.2 }\n")]
    {
        let text = if is_full() { all_sheets(name) } else { sheets(name, EIGHT) };
        let folder = folder_with(&text);
        damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "out"]).assert().success();
        let campaign = Campaign::parse(Source::new("test.toml", text)).unwrap();
        let rows = RunFolder::open(&folder.path().join("out")).unwrap().result_rows().unwrap();
        let [surface] = &ForceSurface::of(&campaign, &rows)[..] else { panic!("one surface") };
        assert_eq!(surface.set_up, place);
        let held = surface.z_m.iter().filter(|z_m| z_m.is_finite()).count();
        assert!(held + 1 >= surface.z_m.len(), "{name}: {held} of {} points held", surface.z_m.len());
        let mut measured: Vec<Fold> = surface.folds(0.001);
        measured.sort_by(|a, b| b.frequency_hz.total_cmp(&a.frequency_hz));
        let continued = continued(&folder, friction);
        println!("{name}: measured {measured:?}, continued {continued:?}");
        assert_eq!((measured.len(), continued.len()), (2, 2), "{name}: {measured:?} {continued:?}");
        for (fold, &(at_hz, max_x_mm)) in measured.iter().zip(&continued) {
            // A fifth of the coarse step of 0.03 Hz: within a cell Z² is taken as linear, and x is held within 1 %.
            assert!((fold.frequency_hz / at_hz - 1.0).abs() < 2e-3, "{name}: {fold:?}, continued {at_hz} Hz");
            assert!((fold.amplitude - max_x_mm).abs() < HALF_STEP_MM, "{name}: {fold:?}, continued {max_x_mm} mm");
        }
        assert!(measured[0].is_highest && !measured[1].is_highest && measured[0].amplitude > measured[1].amplitude);
        let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
        assert!(page.contains("at Z = 1 mm the response turns back at"), "{name}");
        assert!(folder.path().join("out/force-surface.png").is_file());
        // `compare` has the model's motions behind the sheets, with the same folds.
        let compared = damprig(&folder).args(["compare", "out", "--out", "compared"]).assert().success();
        let line = format!("{name}, sheets: folds at Z = 1 mm, measured:");
        let folds: Vec<String> =
            continued.iter().map(|(f, _)| format!("{} Hz", format!("{f:.4}").trim_end_matches('0'))).collect();
        let text = String::from_utf8(compared.get_output().stdout.clone()).unwrap();
        let own = text.lines().find(|own| own.starts_with(&line)).expect("a line of folds");
        assert!(folds.iter().all(|fold| own.contains(fold.as_str())), "{own}: {folds:?}");
        let page = std::fs::read_to_string(folder.path().join("compared/comparison.html")).unwrap();
        assert!(page.contains("Responses that were kept"), "{name}");
    }
}

#[test]
fn the_prediction_is_what_the_rig_measures() {
    let text = sheets("soft-walls", "0.0031").replace("data_sheet", "ideal");
    let campaign = Campaign::parse(Source::new("test.toml", text.clone())).unwrap();
    let predicted = loops::predict(&campaign).unwrap();
    let folder = folder_with(&text);
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let rows = RunFolder::open(&folder.path().join("out")).unwrap().result_rows().unwrap();
    assert_eq!(predicted[0].points.len(), rows.len());
    for (point, row) in predicted[0].points.iter().zip(&rows) {
        // The shaker of the rig follows its demand within the loop's tolerance, so Z at the same x is the same within it.
        let off = f64::from(row.z_amplitude_m) / f64::from(point.z_amplitude_m) - 1.0;
        assert!(off.abs() < 0.02, "{} Hz: {off}", row.frequency_hz);
    }
}

#[test]
fn an_amplitude_that_would_leave_a_limit_is_refused_with_its_line() {
    for (limits, said) in [
        ("structure_limit_m = 0.003", "would leave the displacement limit of the structure"),
        ("base_limit_m = 0.0009", "would leave the displacement limit of the base"),
    ] {
        let text = sheets("soft-walls", "0.0035").replace("[rig]", &format!("[rig]\n{limits}"));
        let folder = folder_with(&text);
        let refused = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2);
        refused.stderr(contains(said).and(contains("x_amplitudes_m = [0.0035]")).and(contains("x 3.5 mm is too much")));
    }
}

/// The rig as delivered moves its base by 4.39 mm.
#[test]
fn an_amplitude_that_the_drive_cannot_reach_is_told_before_the_run() {
    let folder = folder_with(&sheets("soft-walls", "0.09"));
    let told = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success();
    told.stderr(
        contains("x 90 mm is not predicted to be held at 3.04").and(contains("the drive is at its limit there")),
    );
}

#[test]
fn what_the_loop_cannot_do_is_refused_with_its_reason() {
    let of = |amplitudes_m: &str| sheets("soft-walls", amplitudes_m);
    let text = of("0.002");
    for (wrong, said) in [
        (of(""), "must hold at least one amplitude"),
        (of("0.002, 0.002"), "holds the same amplitude twice"),
        (of("0.002, 0.00200000001"), "holds the same amplitude twice"),
        (text.replace("step_hz = 0.03", "step_hz = 0.03, peak_points = 4"), "there is no peak of X/Z"),
        (
            format!(
                "{}[[experiment]]\nname = \"sheets\"\nkind = \"response_controlled\"\nx_amplitudes_m = [0.002, 0.003]\n\
                 frequencies_hz = [3.0]\nstart = \"carry_over\"\ndwell_s = 4\n",
                text.replace("name = \"sheets\"", "name = \"sheets, x 2 mm\"")
            ),
            "gives a sheet the name \"sheets, x 2 mm\"",
        ),
        (of("0.002, -0.002"), "greater than 0"),
        (text.replace("start = ", "relative_amplitudes_m = [0.002]\nstart = "), "says the same quantity"),
        (text.replace("x_amplitudes_m = [0.002]", ""), "`experiment[1].x_amplitudes_m` is missing"),
        (text.replace("shaker = {}", "shaker = { amplifier = \"current\" }"), "needs a shaker in voltage mode"),
        (
            text.replace("settle_s = 4", "settle_s = 4\nresponse_loop = { gain_per_cycle = 3 }"),
            "greater than 0 and at most 2",
        ),
        (text.replace("settle_s = 4", "settle_s = 4\ndrive = \"closed_loop\""), "unknown key"),
        (
            text.replace("shaker = {}", "").replacen("base_amplitude_m = 0.001", "force_amplitude_n = 0.4", 1),
            "is driven by a force over a fixed base",
        ),
    ] {
        let folder = folder_with(&wrong);
        damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2).stderr(contains(said));
    }
}

/// Without it the loop would take the base to follow the drive, and swing up on a source of velocity.
#[test]
fn a_real_rig_must_state_its_shaker() {
    let rig = real_board(&Arc::default());
    let text = sheets("soft-walls", "0.002").replace("sensors = { kind = \"data_sheet\" }", "");
    for (shaker, said) in [("", "write [rig.shaker] with calibrated_at_hz"), ("shaker = {}", "Nothing has moved")] {
        let folder = folder_with(&text.replace("shaker = {}", shaker));
        let output = damprig(&folder).args(["run", "test.toml", "--dry-run", "--rig", &rig]).output().unwrap();
        let all = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
        assert!(all.contains(said), "{shaker:?}: {all}");
    }
}

/// Stopped at the last point of the first sheet, and in the second, whose sweep then begins again from rest.
#[test]
fn an_interrupted_run_of_sheets_is_resumed_to_the_same_results() {
    let text = sheets("soft-walls", "0.0018, 0.0031").replace("data_sheet", "ideal");
    let z_m = |folder: &TempDir| -> Vec<f32> {
        let run = RunFolder::open(&folder.path().join("out")).unwrap();
        run.result_rows().unwrap().iter().map(|row| row.z_amplitude_m).collect()
    };
    let whole = folder_with(&text);
    damprig(&whole).args(["run", "test.toml", "--out", "out"]).assert().success();
    for point in [6, 8] {
        let (folder, rig) = cut_off_at(&text, point);
        damprig(&folder).args(["run", "--resume", "out", "--rig", &rig]).assert().success();
        assert_eq!(z_m(&folder).len(), 12);
        for (resumed, own) in z_m(&folder).into_iter().zip(z_m(&whole)) {
            // Z may differ by more than x, which is held within 1 %: near the bottom of a sheet by three times as much.
            assert!((resumed / own - 1.0).abs() < 0.03, "{point}: {resumed} {own}");
        }
    }
}

#[test]
fn a_single_sheet_has_its_line_and_its_figure() {
    let folder = folder_with(&sheets("soft-walls", "0.0018"));
    let said = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    said.stdout(contains("x held at 6 of 6 points, with Z from"));
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(folder.path().join("out/force-surface.png").is_file());
    assert!(!page.contains("than the set Z"), "Z is a result here");
}
