//! Experiments that keep the structure's amplitude: the hidden part of a response, the prediction of it, and what is refused.

use std::path::Path;

use damprig::campaign::Campaign;
use damprig::continuation::Continuation;
use damprig::input::Source;
use damprig::prediction::held_response;
use damprig::report::force_surface::{Fold, ForceSurface};
use damprig::run_folder::RunFolder;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{cut_off_at, damprig, folder_with, is_full};

fn shipped() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("campaigns/hidden-branch.toml"))
        .expect("shipped")
}

/// The sheets of the shipped campaign alone, on this set-up; by default at fewer amplitudes and frequencies.
fn sheets(set_up: &str) -> String {
    let text = shipped();
    let (head, _) = text.split_once("[[experiment]]\nname = \"up\"").expect("sweeps after the sheets");
    let head = head
        .replace("kind = \"response_controlled\"", &format!("kind = \"response_controlled\"\nset_ups = [{set_up:?}]"));
    if is_full() {
        return head;
    }
    let fewer = [
        (
            "0.0017, 0.0019, 0.0021, 0.0023, 0.0026, 0.0029, 0.0032, 0.0035, 0.0038, 0.0041, 0.0044",
            "0.0018, 0.0021, 0.0024, 0.0031, 0.0034, 0.0037, 0.004",
        ),
        ("from_hz = 3.02, to_hz = 3.2, step_hz = 0.01", "from_hz = 3.04, to_hz = 3.19, step_hz = 0.03"),
    ];
    fewer.iter().fold(head.to_string(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    })
}

/// Frequencies of the folds at Z = 1 mm of the set-up's periodic motions, Hz, falling.
fn continued_hz(folder: &TempDir, friction: &str) -> Vec<f64> {
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
    let found = Continuation::read(&file).expect("valid").follow().expect("periodic");
    let folds = found.branches[0].special_points.iter().filter(|point| point.kind == "fold");
    folds.map(|point| point.parameter).collect()
}

#[test]
fn the_folds_of_both_shipped_set_ups_are_measured_with_data_sheet_sensors() {
    for (name, place, friction) in
        [("soft-walls", 0, ""), ("hybrid", 1, "friction_damper = { friction_ratio = 0.2 }\n")]
    {
        let folder = folder_with(&sheets(name));
        damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "out"]).assert().success();
        let campaign = Campaign::parse(Source::new("test.toml", sheets(name))).unwrap();
        let rows = RunFolder::open(&folder.path().join("out")).unwrap().result_rows().unwrap();
        let [surface] = &ForceSurface::of(&campaign, &rows)[..] else { panic!("one surface") };
        assert_eq!(surface.set_up, place);
        let held = surface.z_m.iter().filter(|z_m| z_m.is_finite()).count();
        assert!(held + 1 >= surface.z_m.len(), "{name}: {held} of {} points held", surface.z_m.len());
        let mut measured: Vec<Fold> = surface.folds(0.001);
        measured.sort_by(|a, b| b.frequency_hz.total_cmp(&a.frequency_hz));
        let continued = continued_hz(&folder, friction);
        println!("{name}: measured {measured:?}, continued {continued:?}");
        assert_eq!((measured.len(), continued.len()), (2, 2), "{name}: {measured:?} {continued:?}");
        for (fold, continued_hz) in measured.iter().zip(continued) {
            assert!(
                (fold.frequency_hz / continued_hz - 1.0).abs() < 0.01,
                "{name}: {fold:?}, continued {continued_hz}"
            );
        }
        assert!(measured[0].is_highest && !measured[1].is_highest && measured[0].amplitude > measured[1].amplitude);
        let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
        assert!(page.contains("at Z = 1 mm the response turns back at"), "{name}");
        assert!(folder.path().join("out/force-surface.png").is_file());
    }
}

#[test]
fn the_prediction_is_what_the_rig_measures() {
    let text = sheets("soft-walls")
        .replace("data_sheet", "ideal")
        .replace("0.0018, 0.0021, 0.0024, 0.0031, 0.0034, 0.0037, 0.004", "0.0031");
    if is_full() {
        return;
    }
    let campaign = Campaign::parse(Source::new("test.toml", text.clone())).unwrap();
    let predicted = held_response::predict(&campaign).unwrap();
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
    let text = sheets("soft-walls");
    let list = &text[text.find("x_amplitudes_m").unwrap()..];
    let list = &list[..list.find('\n').unwrap()];
    for (limits, said) in [
        ("structure_limit_m = 0.003", "would leave the displacement limit of the structure"),
        ("base_limit_m = 0.0009", "would leave the displacement limit of the base"),
    ] {
        let text = text.replace(list, "x_amplitudes_m = [0.0035]").replace("[rig]", &format!("[rig]\n{limits}"));
        let folder = folder_with(&text);
        let refused = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2);
        refused.stderr(contains(said).and(contains("x_amplitudes_m = [0.0035]")).and(contains("x 3.5 mm is too much")));
    }
}

/// The rig as delivered moves its base by 4.39 mm.
#[test]
fn an_amplitude_that_the_drive_cannot_reach_is_told_before_the_run() {
    let text = sheets("soft-walls");
    let list = &text[text.find("x_amplitudes_m").unwrap()..];
    let list = &list[..list.find('\n').unwrap()];
    let folder = folder_with(&text.replace(list, "x_amplitudes_m = [0.09]"));
    let told = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success();
    told.stderr(
        contains("x 90 mm is not predicted to be held at 3.04").and(contains("the drive is at its limit there")),
    );
}

#[test]
fn what_the_loop_cannot_do_is_refused_with_its_reason() {
    let text = sheets("soft-walls");
    let list = &text[text.find("x_amplitudes_m").unwrap()..];
    let list = &list[..list.find('\n').unwrap()];
    for (wrong, said) in [
        (text.replace(list, "x_amplitudes_m = []"), "must hold at least one amplitude"),
        (text.replace(list, "x_amplitudes_m = [0.002, 0.002]"), "holds the same amplitude twice"),
        (text.replace(list, "x_amplitudes_m = [0.002, -0.002]"), "greater than 0"),
        (text.replace(list, "x_amplitudes_m = [0.002]\nrelative_amplitudes_m = [0.002]"), "says the same quantity"),
        (text.replace(list, ""), "x_amplitudes_m"),
        (text.replace("shaker = {}", "shaker = { amplifier = \"current\" }"), "needs a shaker in voltage mode"),
        (
            text.replace("settle_s = 4", "settle_s = 4\nresponse_loop = { gain_per_cycle = 3 }"),
            "greater than 0 and at most 2",
        ),
        (text.replace("settle_s = 4", "settle_s = 4\ndrive = \"closed_loop\""), "drive"),
        (
            text.replace("shaker = {}", "").replacen("base_amplitude_m = 0.001", "force_amplitude_n = 0.4", 1),
            "is driven by a force over a fixed base",
        ),
    ] {
        let folder = folder_with(&wrong);
        damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2).stderr(contains(said));
    }
}

/// A run that is stopped between two sheets, and in one, goes on to the same results.
#[test]
fn an_interrupted_run_of_sheets_is_resumed() {
    let text = sheets("soft-walls").replace("0.0018, 0.0021, 0.0024, 0.0031, 0.0034, 0.0037, 0.004", "0.0018, 0.0031");
    if is_full() {
        return;
    }
    let (folder, rig) = cut_off_at(&text, 8);
    damprig(&folder).args(["run", "--resume", "out", "--rig", &rig]).assert().success();
    let rows = RunFolder::open(&folder.path().join("out")).unwrap().result_rows().unwrap();
    assert_eq!(rows.len(), 12);
}
