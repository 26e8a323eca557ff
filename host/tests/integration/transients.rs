//! Records, pulses and free vibrations in a campaign: results, resuming, and refusals.

use std::path::Path;

use crate::common::{Fate, Served, damprig, folder_with, manifest, read_parquet};
use damprig::input::Source;
use damprig::run_folder::RunFolder;
use damprig::run_folder::journal;
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::schema::transients::TransientRow;
use damprig::simulation::{Case, RunOptions, simulate};
use damprig::table::values::{numbers, texts};
use damprig_protocol::upload::{CHUNK_BYTES, UploadStage};
use damprig_protocol::{Event, FromDevice, Reply, Request, ToDevice};
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

/// Ten seconds of displacement at 100 Hz in mm, at rest at both ends.
fn record() -> String {
    use std::f64::consts::TAU;
    let z = |t: f64| {
        let envelope = (std::f64::consts::PI * t / 10.0).sin().powi(2);
        envelope * (1.5 * (TAU * 2.3 * t).sin() + 1.2 * (TAU * 3.7 * t + 1.0).sin() + 0.8 * (TAU * 0.6 * t).cos())
    };
    let rows: Vec<String> = (0..=1000).map(|n| f64::from(n) / 100.0).map(|t| format!("{t:.2},{:.9}", z(t))).collect();
    format!("t_s,z_mm\n{}\n", rows.join("\n"))
}

const SET_UPS: &str = r#"name = "events"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.0038
[[set_up]]
name = "bare"
base_amplitude_m = 0.003
[[set_up]]
name = "friction"
base_amplitude_m = 0.003
friction_damper = { force_n = 0.2 }
"#;

const PLAYBACK: &str = r#"
[[experiment]]
name = "record"
kind = "playback"
file = "record.csv"
quantity = "displacement"
unit = "mm"
tail_s = 2
"#;

const PULSE: &str = r#"
[[experiment]]
name = "pulse"
kind = "impulse"
shape = "half_sine"
amplitude_m = 0.004
duration_s = 0.2
tail_s = 4
"#;

const RELEASE: &str = r#"
[[experiment]]
name = "release"
kind = "free_vibration"
start_m = 0.035
measure_s = 8
"#;

const TELEMETRY: &str = "[telemetry]\nrate_hz = 1000\nsignals = [\"x\", \"z\"]\n";

fn campaign() -> String {
    [SET_UPS, PLAYBACK, PULSE, RELEASE, TELEMETRY].concat()
}

fn folder(campaign: &str) -> TempDir {
    let folder = folder_with(campaign);
    std::fs::write(folder.path().join("record.csv"), record()).unwrap();
    folder
}

fn rows(run: &Path) -> Vec<TransientRow> {
    JournalState::of(&journal::read(run).unwrap().entries).transients().to_vec()
}

fn row<'r>(rows: &'r [TransientRow], set_up: &str, experiment: &str) -> &'r TransientRow {
    rows.iter().find(|r| r.set_up == set_up && r.experiment == experiment).unwrap()
}

/// A signal during the measured ticks of a row: ticks and values.
fn history(run: &Path, of: &TransientRow, signal: &str) -> Vec<(u64, f64)> {
    let mut out = Vec::new();
    for batch in RunFolder::open(run).unwrap().samples() {
        let batch = batch.unwrap();
        let (set_ups, experiments) = (texts(&batch, "set_up").unwrap(), texts(&batch, "experiment").unwrap());
        let (ticks, values) = (numbers(&batch, "tick").unwrap(), numbers(&batch, signal).unwrap());
        let own = (0..values.len()).filter(|&n| set_ups[n] == of.set_up && experiments[n] == of.experiment);
        out.extend(
            own.map(|n| (ticks[n] as u64, values[n])).filter(|(tick, _)| (of.start_tick..of.end_tick).contains(tick)),
        );
    }
    out
}

#[test]
fn a_played_record_moves_the_structure_as_predicted_by_simulate() {
    let folder = folder(&[SET_UPS, PLAYBACK, TELEMETRY].concat());
    damprig(&folder).args(["run", "test.toml", "--out", "run"]).assert().success();
    let run = folder.path().join("run");
    for (set_up, friction) in [("bare", ""), ("friction", "friction_damper = { force_n = 0.2 }\n")] {
        let played = row(&rows(&run), set_up, "record").clone();
        let measured = history(&run, &played, "x_m");
        assert_eq!(measured.len() as u64, played.end_tick - played.start_tick, "a sample is missing");
        // The playback starts two samples of the record before it. A reading is 2.45 ticks later than its demand: one
        // tick of waiting, one for the velocity at the cubic's end, 0.45 for the mean of the block.
        let at = |tick: u64| (tick - played.start_tick) as f64 * 1e-3 - 0.02 - 2.45e-3;
        let wanted: Vec<(f64, f64)> =
            measured.iter().map(|(tick, x)| (at(*tick), *x)).filter(|(t, _)| *t >= 0.0).collect();
        let times: Vec<String> = wanted.iter().map(|(t, _)| format!("{t:.6}")).collect();
        let end = wanted.last().unwrap().0;
        let text = format!(
            "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n{friction}\
             base = {{ kind = \"record\", file = \"record.csv\", quantity = \"displacement\", unit = \"mm\" }}\n\
             run = {{ duration_s = {:.6}, sample_times_s = [{}] }}\n",
            end + 1e-3,
            times.join(", ")
        );
        let source = Source::new(folder.path().join("case.toml").display().to_string(), text);
        let case = Case::parse(&source, "case").unwrap();
        let answer =
            simulate(&case, &mut (), RunOptions { keep: true, longest_part_s: 1.0, go_on: &mut |_| true }).unwrap();
        // Tolerances: rounding to counts of peak/32767 gives half a count, at resonance at most 1/(2ζ) = 132 times
        // that. The mean over a block reduces a peak by (Ωh)²/24. Before its first sample the spline has to reach a
        // velocity of (z1 − 0)/2.
        let peak_z = f64::from(played.max_abs_z_m);
        let bound = 132.0 * peak_z / 65_534.0 + 1.1e-5 * f64::from(played.max_abs_x_m) + 1e-6;
        let worst = wanted.iter().zip(&answer.x_m).map(|((_, x), s)| (x - s).abs()).fold(0.0, f64::max);
        assert!(worst < bound, "{set_up}: {worst:.3e} m of {bound:.3e}, of a peak of {:.3e}", played.max_abs_x_m);
        assert!(f64::from(played.max_abs_x_m) > 2.0 * peak_z, "the structure should have answered: {played:?}");
        // The prediction in the folder agrees over the device's own window.
        assert!((f64::from(played.rms_x_m) / played.predicted_rms_x_m - 1.0).abs() < 1e-3, "{played:?}");
        assert!((f64::from(played.max_abs_x_m) / played.predicted_max_abs_x_m - 1.0).abs() < 1e-3, "{played:?}");
        // The base follows exactly. The remaining error is rounding to counts, and (Ωτ)²/2 at 3.7 Hz and 0.45 ticks.
        assert!(played.base_error_rms_m < 1e-4 * played.wanted_rms_m, "{played:?}");
        assert!((played.base_delay_s - 2.45e-3).abs() < 1e-5, "{played:?}");
    }
}

#[test]
fn all_three_kinds_are_measured_recorded_and_reported() {
    let folder = folder(&campaign());
    let said = damprig(&folder).args(["run", "test.toml", "--out", "run"]).assert().success();
    let said = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    for words in [
        "record: displacement of 1001 samples in 10.0000 s, baseline as recorded",
        "half sine of 4 mm",
        "6 of 6 points",
    ] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    let run = folder.path().join("run");
    let all = rows(&run);
    let release = row(&all, "bare", "release");
    // x0 has an error of (Ωh)²/6, a peak one of (Ωh)²/8: together 1e-4 over ten cycles.
    assert!((release.damping_ratio - 0.0038).abs() < 1e-4 / 62.8, "{release:?}");
    assert!((release.frequency_hz - 2.5).abs() < 1e-4 && release.cycles == 10, "{release:?}");
    // Coulomb friction removes 4F/k more in each cycle.
    let friction = row(&all, "friction", "release");
    let stiffness = 1.6 * (std::f64::consts::TAU * 2.5f64).powi(2);
    assert!(friction.start_m - friction.end_m > 10.0 * 4.0 * 0.2 / stiffness, "{friction:?}");
    let pulse = row(&all, "bare", "pulse");
    assert!((f64::from(pulse.max_abs_x_m) / pulse.predicted_max_abs_x_m - 1.0).abs() < 1e-3, "{pulse:?}");
    assert_eq!((pulse.kind.as_str(), pulse.damping_ratio.is_nan()), ("impulse", true));
    let table = read_parquet(run.join("transients.parquet"));
    assert_eq!(table.iter().map(arrow_array::RecordBatch::num_rows).sum::<usize>(), 6);
    let schema = table[0].schema();
    assert_eq!(schema.field_with_name("base_delay_s").unwrap().metadata()["unit"], "s");
    for file in ["transients.svg", "transients.png", "results.parquet", "records/1-record.csv"] {
        assert!(run.join(file).is_file(), "no {file}");
    }
    assert!(!run.join("figure.svg").exists(), "there is no frequency to draw over");
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("x over time of records, pulses and free vibrations"));
    assert_eq!(manifest(&run)["set_ups"].as_array().unwrap().len(), 2);
    damprig(&folder).args(["runs", "verify", "run"]).assert().success();
    damprig(&folder)
        .args(["runs", "show", "run"])
        .assert()
        .success()
        .stdout(contains("free_vibration").and(contains("0.00380")));
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("free vibration") && page.contains("0.00380"), "the page lacks them");
    damprig(&folder)
        .args(["runs", "export", "run", "--format", "csv", "--what", "transients", "--out", "t.csv"])
        .assert()
        .success();
    let csv = std::fs::read_to_string(folder.path().join("t.csv")).unwrap();
    assert_eq!(csv.lines().filter(|line| !line.starts_with('#')).count(), 1 + 6, "{csv}");
    damprig(&folder).args(["runs", "export", "run", "--format", "mat", "--out", "t.mat"]).assert().success();
}

#[test]
fn a_release_is_seen_by_sensors_with_filters() {
    let sensors = "[rig.sensors]\nkind = \"data_sheet\"\n";
    let folder = folder(&[SET_UPS, RELEASE, TELEMETRY, sensors].concat());
    damprig(&folder).args(["run", "test.toml", "--out", "run"]).assert().success();
    let rows = rows(&folder.path().join("run"));
    let released = row(&rows, "bare", "release");
    // 1 % of linearity, 0.5 % of the lag of the filters, and noise.
    assert!((released.start_m / 0.035 - 1.0).abs() < 0.02, "{released:?}");
    assert!((released.damping_ratio / 0.0038 - 1.0).abs() < 0.05, "{released:?}");
}

#[test]
fn the_shipped_campaign_runs() {
    let folder = TempDir::new().unwrap();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("campaigns/transients.toml");
    damprig(&folder).arg("run").arg(file).args(["--out", "run"]).assert().success().stdout(contains("6 of 6 points"));
}

#[test]
fn a_campaign_may_have_transients_and_a_stepped_sine() {
    let sine = "\n[[experiment]]\nname = \"sine\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.0]\nstart = \"from_rest\"\ndwell_s = 4.0\nset_ups = [\"bare\"]\n";
    let folder = folder(&[SET_UPS, PULSE, sine, TELEMETRY].concat());
    damprig(&folder).args(["run", "test.toml", "--out", "run"]).assert().success().stdout(contains("3 of 3 points"));
    let run = folder.path().join("run");
    assert!(run.join("figure.svg").is_file() && run.join("transients.svg").is_file());
    damprig(&folder).args(["runs", "verify", "run"]).assert().success();
}

fn is_event(message: &FromDevice) -> bool {
    matches!(message, FromDevice::Event { event: Event::Transient(_), .. })
}

/// The measured values without their times.
fn measured(run: &Path) -> Vec<String> {
    let one = |r: &TransientRow| format!("{:?}", TransientRow { start_tick: 0, end_tick: 0, segment: 0, ..r.clone() });
    rows(run).iter().map(one).collect()
}

#[test]
fn an_interrupted_run_keeps_complete_experiments_and_repeats_the_rest() {
    let folder = folder(&campaign());
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "whole"]).assert().success();
    let mut events = 0;
    let board = Served::start(move |message| {
        events += usize::from(is_event(message));
        if events == 3 { Fate::Close } else { Fate::Pass }
    });
    let run = ["run", "test.toml", "--out", "cut", "--reconnect-s", "0", "--rig", &board.rig];
    damprig(&folder).args(run).assert().code(1).stderr(contains("2 of 6 points are kept"));
    // From here on the record is read from the run folder.
    std::fs::remove_file(folder.path().join("record.csv")).unwrap();
    let again = Served::start(|_| Fate::Pass);
    let resumed = damprig(&folder).args(["run", "--resume", "cut", "--rig", &again.rig]).assert().success();
    let said = String::from_utf8_lossy(&resumed.get_output().stdout).into_owned();
    assert!(said.contains("2 of 6 points are kept as they are") && said.contains("\"release\" is repeated"), "{said}");
    assert_eq!(measured(&folder.path().join("cut")), measured(&folder.path().join("whole")));
    let starts =
        again.received().iter().filter(|m| matches!(m, ToDevice::Request(r) if r.request == Request::Start)).count();
    assert_eq!(starts, 4, "complete experiments are not measured again");
    damprig(&folder).args(["runs", "verify", "cut"]).assert().success();
}

#[test]
fn an_upload_continues_after_a_lost_link_and_is_not_repeated() {
    let folder = folder(&[SET_UPS, PLAYBACK, TELEMETRY].concat());
    let (told, hear) = std::sync::mpsc::channel();
    let mut closed = false;
    let rig = Served::again_and_again(move |message| {
        if let FromDevice::Reply { answer: Ok(Reply::Upload(progress)), .. } = message {
            told.send(*progress).unwrap();
            if !closed && progress.there == 6 * CHUNK_BYTES as u32 {
                closed = true;
                return Fate::Close;
            }
        }
        Fate::Pass
    });
    damprig(&folder).args(["run", "test.toml", "--out", "run", "--rig", &rig]).assert().success();
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "whole"]).assert().success();
    assert_eq!(measured(&folder.path().join("run")), measured(&folder.path().join("whole")));
    let progress: Vec<_> = hear.try_iter().collect();
    let there: Vec<u32> = progress.iter().map(|p| p.there).collect();
    assert!(there.is_sorted(), "the upload began again: {there:?}");
    // 2002 bytes are 16 chunks; the second set-up finds them on the board.
    let receiving = progress.iter().filter(|p| p.stage == UploadStage::Receiving && p.there > 0).count();
    assert!((15..=17).contains(&receiving), "{receiving} chunks");
}

/// Runs the campaign; it must be refused with all of `words`, before anything moves.
fn refused(campaign: &str, words: &[&str]) {
    let folder = folder(campaign);
    let output = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{answer}");
    for word in words.iter().copied().chain(["--> test.toml:"]) {
        assert!(answer.contains(word), "no {word:?} in:\n{answer}");
    }
    assert!(!folder.path().join("runs").exists(), "a run was begun");
}

fn edited(experiment: &str, from: &str, to: &str) -> String {
    assert!(experiment.contains(from));
    [SET_UPS, &experiment.replacen(from, to, 1), TELEMETRY].concat()
}

#[test]
fn a_missing_record_is_answered_with_files_of_similar_name() {
    refused(&edited(PLAYBACK, "record.csv", "recrod.csv"), &["experiment[1].file", "did you mean", "record.csv"]);
}

#[test]
fn a_record_that_is_too_long_is_refused_with_the_limit_and_a_rate_that_fits() {
    let words = ["20480", "40 KiB", "30001 samples", "write sample_rate_hz = 68"];
    refused(&edited(PLAYBACK, "tail_s = 2", "time_step_s = 0.3\ncolumn = 2\nsample_rate_hz = 100"), &words);
}

#[test]
fn a_record_that_would_leave_the_limits_is_refused_with_the_peak_that_fits() {
    let words = [
        "would leave the displacement limit",
        "largest |x|",
        "`target_peak_m` is too large",
        "write target_peak_m = 0.0",
    ];
    refused(&edited(PLAYBACK, "tail_s = 2", "target_peak_m = 0.03"), &words);
    let words = ["largest |z|", "write amplitude_m = 0.0"];
    refused(&edited(PULSE, "amplitude_m = 0.004", "amplitude_m = 0.3"), &words);
}

#[test]
fn a_record_beyond_the_shakers_stroke_is_reported_before_anything_moves() {
    let campaign = edited(PULSE, "amplitude_m = 0.004", "amplitude_m = 0.02") + "[rig.shaker]\nhalf_stroke_m = 0.015\n";
    refused(&campaign, &["the shaker's stroke", "20.000 mm, at most 15.000 mm", "write amplitude_m = 0.015"]);
}

/// Regression test: a 10 mm pulse became 5 mm on a board and stayed 10 mm on a virtual rig.
#[test]
fn a_pulse_or_a_record_that_the_drive_cannot_deliver_is_refused_before_anything_moves() {
    let words = ["asks the drive for 10 mm", "delivers ±4.392 mm", "calibration.drive", "write amplitude_m = 0.0043"];
    refused(&edited(PULSE, "amplitude_m = 0.004", "amplitude_m = 0.01"), &words);
    refused(
        &edited(PLAYBACK, "tail_s = 2", "target_peak_m = 0.0045"),
        &["exceeds the drive's range", "write target_peak_m = 0.0043"],
    );
}

#[test]
fn a_record_not_at_rest_at_its_ends_is_refused_without_a_ramp() {
    let shifted = PLAYBACK.replace("unit = \"mm\"", "unit = \"mm\"\ncolumn = 2\ntime_column = 1");
    let jump = |text: &str| {
        let folder = folder_with(&[SET_UPS, text, TELEMETRY].concat());
        let rows: Vec<String> =
            (0..500).map(|n| format!("{:.2},{}", f64::from(n) * 0.01, 2.0 + 0.001 * f64::from(n))).collect();
        std::fs::write(folder.path().join("record.csv"), rows.join("\n")).unwrap();
        damprig(&folder).args(["run", "test.toml", "--dry-run"]).output().unwrap()
    };
    let answer = jump(&shifted);
    let words = String::from_utf8_lossy(&answer.stderr).into_owned();
    assert!(words.contains("begins at 2.000 mm and ends at 2.499 mm") && words.contains("write ramp_s"), "{words}");
    assert!(jump(&format!("{shifted}ramp_s = 1.0\n")).status.success());
}

#[test]
fn invalid_keys_and_values_are_refused_with_what_is_allowed() {
    refused(
        &edited(PLAYBACK, "tail_s = 2", "scale = 2\ntarget_peak_m = 0.001"),
        &["leave out `scale` or `target_peak_m`"],
    );
    refused(&edited(PLAYBACK, "tail_s = 2", "scale = 0"), &["must be a number other than 0"]);
    refused(&edited(PLAYBACK, "tail_s", "tial_s"), &["unknown key `experiment[1].tial_s`", "did you mean `tail_s`"]);
    refused(&edited(PULSE, "half_sine", "half-sine"), &["must be", "did you mean \"half_sine\""]);
    refused(&edited(PULSE, "duration_s = 0.2", "duration_s = 0.2\nrise_s = 0.01"), &["rectangle"]);
    refused(&edited(PULSE, "duration_s = 0.2", "duration_s = 0.002"), &["fewer than 10 samples", "write 0.01 or more"]);
    refused(&edited(PULSE, "duration_s = 0.2", ""), &["`experiment[1].duration_s` is missing"]);
    refused(&edited(RELEASE, "0.035", "0.3"), &["would leave the displacement limit"]);
    refused(&edited(RELEASE, "measure_s = 8", "measure_s = 8\nlevel_m = 0.04"), &["below |start_m|", "write level_m"]);
    refused(&edited(RELEASE, "free_vibration", "free_vibrations"), &["did you mean \"free_vibration\""]);
    refused(&edited(RELEASE, "measure_s = 8", "measure_s = 8\ncycles = 2.5"), &["a whole number from 1 to 1000"]);
}
