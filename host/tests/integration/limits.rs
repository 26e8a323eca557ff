//! Limits in a campaign: the board's limits act; a campaign may tighten them while it runs, but not loosen them.

use crate::common::{Fate, Served, damprig, folder_with, is_point, manifest, read_parquet, short};
use damprig_protocol::{Event, FromDevice};
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

/// A campaign of one set-up at 2.5 Hz, with `[rig]` and the set-up's other keys.
fn campaign(rig: &str, set_up: &str) -> String {
    format!(
        r#"
name = "limits"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.0038
[rig]
{rig}
[[set_up]]
name = "one"
{set_up}
[[experiment]]
kind = "stepped_sine"
frequencies_hz = [2.45, 2.5]
start = "from_rest"
settle_s = 1.0
dwell_s = 8.0
[telemetry]
rate_hz = 100
signals = ["x", "spring_force"]
"#
    )
}

/// A particle whose impacts reach 310 N to 400 N.
const HARD: &str = "base_amplitude_m = 0.004\nparticle = { mass_ratio = 0.4, clearance_m = 0.02, wall = { kind = \"restitution\", coefficient = 0.8 } }";

/// A particle whose impacts reach 80 N to 100 N.
const SOFT: &str = "base_amplitude_m = 0.002\nparticle = { mass_ratio = 0.1, clearance_m = 0.015, wall = { kind = \"restitution\", coefficient = 0.5 } }";

/// A simulated board that keeps running between the commands, and a folder to run them in.
struct Lab {
    rig: String,
    folder: TempDir,
}

impl Lab {
    fn new() -> Self {
        Self::with(|_| Fate::Pass)
    }

    fn with(fate: impl FnMut(&FromDevice) -> Fate + Send + 'static) -> Self {
        Self { rig: Served::again_and_again(fate), folder: folder_with("") }
    }

    fn settings(&self, arguments: &[&str]) -> String {
        let done = damprig(&self.folder).arg("settings").args(arguments).args(["--rig", &self.rig]).assert().success();
        String::from_utf8(done.get_output().stdout.clone()).unwrap()
    }

    /// Runs a campaign into the folder `out`; returns its exit code and its error messages.
    fn run(&self, campaign: &str, out: &str) -> (i32, String) {
        std::fs::write(self.folder.path().join("test.toml"), campaign).unwrap();
        let arguments = ["run", "test.toml", "--rig", &self.rig, "--out", out, "--reconnect-s", "0"];
        let output = damprig(&self.folder).args(arguments).output().unwrap();
        (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&output.stderr).into_owned())
    }

    fn manifest(&self, out: &str) -> serde_json::Value {
        manifest(&self.folder.path().join(out))
    }
}

/// The entry of a setting in a manifest.
fn acting<'m>(manifest: &'m serde_json::Value, setting: &str) -> &'m serde_json::Value {
    let list = manifest["acting_settings"].as_array().expect("a list");
    list.iter().find(|entry| entry["setting"] == setting).unwrap_or_else(|| panic!("no {setting} in {list:?}"))
}

#[test]
fn a_saved_limit_trips_at_its_value_not_at_the_default() {
    let lab = Lab::new();
    let (code, words) = lab.run(&campaign("", HARD), "delivered");
    assert_eq!(code, 0, "{words}");
    lab.settings(&["set", "safety.wall_force_n=300", "--save"]);
    let (code, words) = lab.run(&campaign("", HARD), "saved");
    assert_eq!(code, 1, "{words}");
    assert!(words.contains("the force on a wall reached its limit") && words.contains("limit 300 N)"), "{words}");
    let manifest = lab.manifest("saved");
    let force = acting(&manifest, "safety.wall_force_n");
    assert_eq!((&force["value"], &force["origin"]), (&300.0.into(), &"board (stored)".into()));
}

/// How a campaign that has tightened a limit of its board ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Complete,
    Trip,
    LostLink,
    #[cfg(unix)]
    Signal(&'static str),
}

/// A lab whose first campaign ends in this way at its first point. The channel supplies the process to signal.
fn lab_that_ends(end: End) -> (Lab, std::sync::mpsc::Sender<u32>) {
    let (tell, process) = std::sync::mpsc::channel::<u32>();
    let mut is_over = false;
    let lab = Lab::with(move |message| {
        if !is_point(message) || std::mem::replace(&mut is_over, true) {
            return Fate::Pass;
        }
        match end {
            End::LostLink => Fate::Close,
            #[cfg(unix)]
            End::Signal(signal) => {
                let id = process.recv().unwrap().to_string();
                assert!(std::process::Command::new("kill").args([signal, &id]).status().unwrap().success());
                Fate::Pass
            }
            _ => Fate::Pass,
        }
    });
    (lab, tell)
}

#[test]
fn a_tightened_limit_acts_only_in_its_campaign_however_the_campaign_ends() {
    let mut ends = vec![End::Complete, End::Trip, End::LostLink];
    #[cfg(unix)]
    ends.extend([End::Signal("-INT"), End::Signal("-KILL")]);
    for end in ends {
        let (lab, tell) = lab_that_ends(end);
        lab.settings(&["set", "safety.wall_force_n=300", "--save"]);
        // The experiment stays within this limit unless it is to trip.
        let limit = if end == End::Trip { "wall_force_limit_n = 50" } else { "wall_force_limit_n = 200" };
        let tightened = campaign(limit, SOFT);
        std::fs::write(lab.folder.path().join("test.toml"), tightened).unwrap();
        let arguments = ["run", "test.toml", "--rig", &lab.rig, "--out", "tightened", "--reconnect-s", "0"];
        let child = std::process::Command::new(assert_cmd::cargo::cargo_bin("damprig"))
            .args(arguments)
            .current_dir(lab.folder.path())
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        // Fails where no signal is sent, because nobody receives.
        let _ = tell.send(child.id());
        let output = child.wait_with_output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.success(), end == End::Complete, "{end:?}: {words}");
        assert_eq!(words.contains("limit 50 N)"), end == End::Trip, "{end:?}: {words}");
        let manifest = lab.manifest("tightened");
        let force = acting(&manifest, "safety.wall_force_n");
        let expected = if end == End::Trip { 50.0 } else { 200.0 };
        assert_eq!(force["value"], expected);
        assert_eq!(force["origin"], "campaign (rig.wall_force_limit_n)");
        assert_eq!(force["board_value"], 300.0);
        // The board's own limit acts again: a smaller value does not trip, a larger one does.
        let (code, words) = lab.run(&campaign("", SOFT), "soft");
        assert_eq!(code, 0, "{end:?}: {words}");
        let (code, words) = lab.run(&campaign("", HARD), "hard");
        assert!(code == 1 && words.contains("limit 300 N)"), "{end:?}: {code} {words}");
        assert!(lab.settings(&["show"]).contains("wall_force_n = 300.0"), "{end:?}");
    }
}

#[test]
fn a_limit_that_would_loosen_the_boards_is_refused_with_both_values_before_anything_moves() {
    let lab = Lab::with(|message| {
        assert!(!matches!(message, FromDevice::Event { event: Event::Point(_), .. }), "it moved");
        Fate::Pass
    });
    lab.settings(&["set", "safety.wall_force_n=300", "safety.limits.base_m=0.01", "--save"]);
    for (rig, key, words) in [
        ("wall_force_limit_n = 450", "wall_force_limit_n", "safety.wall_force_n = 300.0"),
        ("displacement_limit_m = 0.078", "displacement_limit_m", "safety.limits.base_m = 0.01"),
        ("structure_limit_m = 0.09", "structure_limit_m", "safety.limits.structure_m = 0.078"),
        ("half_cycles_ahead = 0", "half_cycles_ahead", "safety.half_cycles_ahead = 6.0"),
        ("host_silent_s = 0", "host_silent_s", "safety.host_silent_s = 10.0"),
        ("host_silent_s = 11", "host_silent_s", "safety.host_silent_s = 10.0"),
    ] {
        let (code, answer) = lab.run(&campaign(rig, SOFT), "out");
        assert_eq!(code, 2, "{answer}");
        let value = rig.split(" = ").nth(1).unwrap();
        for part in [&format!("`rig.{key}` = {value} is not allowed"), "test.toml:8:", "looser than the board's", words]
        {
            assert!(answer.contains(part), "no {part:?} in:\n{answer}");
        }
        assert!(!lab.folder.path().join("out").exists(), "{rig}");
    }
    let equal = "wall_force_limit_n = 300\nhost_silent_s = 10\nhalf_cycles_ahead = 6\nstructure_limit_m = 0.078";
    std::fs::write(lab.folder.path().join("test.toml"), campaign(equal, SOFT)).unwrap();
    let dry = damprig(&lab.folder).args(["run", "test.toml", "--dry-run", "--rig", &lab.rig]).assert().success();
    dry.stdout(contains(format!("Checked with the settings of test at {} (stored).", lab.rig)));
}

#[test]
fn a_dry_run_compares_with_the_virtual_boards_own_limits() {
    let lab = Lab::new();
    lab.settings(&["set", "safety.wall_force_n=300"]);
    lab.settings(&["export", "board.toml"]);
    std::fs::write(lab.folder.path().join("test.toml"), campaign("wall_force_limit_n = 400", SOFT)).unwrap();
    let dry = ["run", "test.toml", "--dry-run"];
    damprig(&lab.folder).args(dry).assert().success();
    for rig in ["virtual:board.toml", "virtual:f32,board.toml"] {
        let answer = damprig(&lab.folder).args(dry).args(["--rig", rig]).assert().code(2);
        answer.stderr(contains("`rig.wall_force_limit_n` = 400").and(contains("safety.wall_force_n = 300.0")));
    }
}

#[test]
fn a_virtual_board_with_exported_settings_gives_the_same_bits() {
    let folder = folder_with(&short());
    damprig(&folder).args(["settings", "export", "board.toml", "--rig", "virtual"]).assert().success();
    for (rig, out) in [("virtual:f32", "delivered"), ("virtual:f32,board.toml", "exported")] {
        damprig(&folder).args(["run", "test.toml", "--rig", rig, "--out", out]).assert().success();
    }
    for file in ["results.parquet", "samples.parquet", "impacts.parquet"] {
        let read = |run: &str| read_parquet(folder.path().join(run).join(file));
        assert_eq!(read("delivered"), read("exported"), "{file}");
    }
    let device = &manifest(&folder.path().join("exported"))["device"];
    assert_eq!((&device["link"], &device["settings"]["source"]), (&"virtual:f32,board.toml".into(), &"stored".into()));
}

#[test]
fn the_virtual_sensors_range_follows_from_the_boards_calibration() {
    let folder = folder_with(&short());
    // ±12 mm over the converter's 65520 counts.
    let board = "[calibration.x]\nmetres_per_count = 3.6630037e-7\n[safety.limits]\nstructure_m = 0.0115\n";
    std::fs::write(folder.path().join("board.toml"), board).unwrap();
    damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success();
    let answer =
        damprig(&folder).args(["run", "test.toml", "--dry-run", "--rig", "virtual:board.toml"]).assert().code(2);
    answer.stderr(contains("set-up \"bare\" would leave the displacement limit").and(contains("sensor range ±12 mm")));
}

#[test]
fn a_sensor_range_in_a_campaign_is_refused_with_what_to_do() {
    for (range, fix) in [("0.08", "leave it out"), ("0.1", "metres_per_count = 3.0525")] {
        let folder = folder_with(&short().replace("[rig]", &format!("[rig]\nsensor_range_m = {range}")));
        let answer = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2);
        answer.stderr(
            contains(format!("`rig.sensor_range_m` = {range} is not allowed"))
                .and(contains("belongs to the board's calibration"))
                .and(contains(fix)),
        );
    }
}

#[test]
fn sensors_coarser_than_the_board_expects_are_refused_on_a_simulated_rig() {
    let folder = folder_with(&short().replace("sensor_resolution_m = 10e-6", "sensor_resolution_m = 50e-6"));
    let answer = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().code(2);
    answer.stderr(contains("`rig.sensor_resolution_m` = 0.00005").and(contains("safety.resolution_m = 1e-5")));
    std::fs::write(folder.path().join("board.toml"), "[safety]\nresolution_m = 5e-5\n").unwrap();
    damprig(&folder).args(["run", "test.toml", "--dry-run", "--rig", "virtual:board.toml"]).assert().success();
}

#[test]
fn a_wrong_board_file_is_refused_by_name_key_value_and_what_is_allowed() {
    let folder = folder_with(&short());
    std::fs::write(folder.path().join("board.toml"), "[safety]\nwall_force_n = -3\n").unwrap();
    std::fs::write(folder.path().join("other.toml"), "[safety]\nwall_force = 3\n").unwrap();
    for (rig, words) in [
        ("virtual:bord.toml", &["cannot read bord.toml", "did you mean ./board.toml?"][..]),
        ("virtual:board.toml", &["board.toml:2", "`safety.wall_force_n` = -3", "greater than 0"]),
        ("virtual:f32,other.toml", &["other.toml:2", "unknown key `safety.wall_force`", "write `wall_force_n`"]),
        ("virtual:f64,board", &["virtual:f32,BOARD.toml"]),
    ] {
        for arguments in [&["run", "test.toml"][..], &["run", "test.toml", "--dry-run"], &["settings", "show"]] {
            let output = damprig(&folder).args(arguments).args(["--rig", rig]).output().unwrap();
            let answer = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{answer}");
            for word in words {
                assert!(answer.contains(word), "{rig}: no {word:?} in:\n{answer}");
            }
        }
    }
    assert!(!folder.path().join("runs").exists());
}

/// Mean spring force of the last tenth of the samples, N.
fn last_force_n(lab: &Lab, out: &str) -> f64 {
    let samples = read_parquet(lab.folder.path().join(out).join("samples.parquet"));
    let force: Vec<f64> =
        samples.iter().flat_map(|batch| damprig::table::values::numbers(batch, "spring_force_n").unwrap()).collect();
    let last = &force[force.len() * 9 / 10..];
    last.iter().sum::<f64>() / last.len() as f64
}

#[test]
fn spring_properties_that_a_set_up_leaves_out_are_the_boards() {
    let lab = Lab::new();
    lab.settings(&["set", "spring.friction_coefficient=0.25", "--save"]);
    let damper = |more: &str| {
        let damper = format!("friction_damper = {{ spring = {{ friction_ratio = 0.9{more} }} }}");
        campaign("", &format!("base_amplitude_m = 0.0015\n{damper}"))
    };
    // F_N = γF k Z/μe = 0.9 · 394.78 · 0.0015/μe; kept within the dead band of 0.02 N by a measured Z that follows the
    // prescribed one within 1 %.
    for (more, friction_coefficient, origin) in [
        ("", 0.25, "board (stored)"),
        (", friction_coefficient = 0.4", 0.4, "campaign (set_up \"one\", spring.friction_coefficient)"),
    ] {
        let out = format!("mu-{friction_coefficient}");
        let (code, words) = lab.run(&damper(more), &out);
        assert_eq!(code, 0, "{words}");
        let expected = 0.9 * 394.78 * 0.0015 / friction_coefficient;
        let force = last_force_n(&lab, &out);
        assert!((force - expected).abs() < 0.02 + 0.01 * expected, "{force} N for {expected} N");
        let manifest = lab.manifest(&out);
        let friction = acting(&manifest, "spring.friction_coefficient");
        assert_eq!(friction["value"], friction_coefficient);
        assert_eq!((&friction["origin"], &friction["set_up"]), (&origin.into(), &"one".into()));
    }
}

#[test]
fn a_campaign_leaves_the_boards_limit_on_the_springs_force_in_force() {
    let lab = Lab::new();
    lab.settings(&["set", "spring.largest_force_n=3", "spring.touch_span_n=0.5", "--save"]);
    let damper = "base_amplitude_m = 0.0015\nfriction_damper = { spring = { normal_force_n = 2.9 } }";
    let (code, words) = lab.run(&campaign("", damper), "out");
    assert!(code == 2 && words.contains("small enough for 0.9 of spring.largest_force_n"), "{code} {words}");
    assert!(words.contains("write normal_force_n = 2.6") && !lab.folder.path().join("out").exists(), "{words}");
}

#[test]
fn the_report_lists_the_limits_that_acted_with_their_origin() {
    let lab = Lab::new();
    let (code, words) = lab.run(&campaign("structure_limit_m = 0.05", SOFT), "out");
    assert_eq!(code, 0, "{words}");
    let page = std::fs::read_to_string(lab.folder.path().join("out/report.html")).unwrap();
    for word in ["safety.limits.structure_m", "campaign (rig.structure_limit_m)", "board (as delivered"] {
        assert!(page.contains(word), "no {word:?}");
    }
}

#[test]
fn a_board_that_loses_its_settings_during_the_run_ends_the_run_with_the_difference() {
    let mut points = 0;
    let lab = Lab::with(move |message| {
        points += usize::from(is_point(message));
        if is_point(message) && points == 1 { Fate::Reset } else { Fate::Pass }
    });
    lab.settings(&["set", "safety.wall_force_n=300"]);
    let (code, words) = lab.run(&campaign("", SOFT), "out");
    assert_eq!(code, 1, "{words}");
    assert!(words.contains("safety.wall_force_n: 300.0 when it was started, 450.0 now"), "{words}");
}

#[test]
fn a_resumed_run_notes_other_limits_and_refuses_other_constants() {
    let mut points = 0;
    let lab = Lab::with(move |message| {
        points += usize::from(is_point(message));
        if is_point(message) && points == 1 { Fate::Close } else { Fate::Pass }
    });
    let (code, words) = lab.run(&campaign("", SOFT), "out");
    assert_eq!(code, 1, "{words}");
    // A board that looks the same to a run but has no experiment in progress.
    let again = Lab::new();
    let resume = || damprig(&lab.folder).args(["run", "--resume", "out", "--rig", &again.rig]).output().unwrap();
    again.settings(&["set", "impacts.threshold_n=3"]);
    let output = resume();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{answer}");
    assert!(answer.contains("impacts.threshold_n: 2.5 when it was started, 3.0 now"), "{answer}");
    again.settings(&["set", "impacts.threshold_n=2.5", "safety.wall_force_n=300"]);
    let output = resume();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{answer}");
    assert!(answer.contains("safety.wall_force_n: 450.0 when it was started, 300.0 now"), "{answer}");
}
