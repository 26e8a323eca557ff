//! Resuming a run that was killed, cut off or stopped: no point is measured twice, none is lost, and the results are those of
//! an undisturbed run.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{
    Fate, Served, cut_off, damprig, folder_with, is_point, manifest, read_parquet, result_rows, sample_rows, short,
};
use arrow_array::RecordBatch;
use damprig::run_folder::journal;
use damprig::run_folder::schema::journal_entry::JournalEntry;
use damprig::run_folder::schema::journal_state::JournalState;
use predicates::prelude::*;
use predicates::str::contains;

/// Columns that depend on when a point was measured.
const OF_THE_CLOCK: [&str; 3] = ["start_tick", "end_tick", "segment"];

/// The measured columns of the results as text: equal text is equal bits, but for the sign of a NaN.
pub(crate) fn measured(run: &Path) -> String {
    let without = |batch: RecordBatch| {
        let schema = batch.schema();
        let kept: Vec<usize> =
            (0..schema.fields().len()).filter(|i| !OF_THE_CLOCK.contains(&schema.field(*i).name().as_str())).collect();
        let batch = batch.project(&kept).unwrap();
        let columns = batch.columns().iter().map(|c| damprig::table::values::values(c.as_ref()).unwrap());
        columns.map(|column| format!("{column:?}")).collect::<Vec<_>>().join("\n")
    };
    read_parquet(run.join("results.parquet")).into_iter().map(without).collect()
}

fn taken(run: &Path) -> JournalState {
    JournalState::of(&journal::read(run).unwrap().entries)
}

/// The short campaign with more points, some around its peaks, more samples and a sweep that carries its motion over.
fn longer() -> String {
    let carried = "\n[[experiment]]\nname = \"carried\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.45, 2.55]\nstart = \"carry_over\"\nset_ups = [\"bare\"]\nsettle_s = 2.0\ndwell_s = 4.0\n";
    let more = "frequencies_hz = { from_hz = 2.2, to_hz = 2.8, step_hz = 0.05, peak_points = 6 }";
    short().replace("frequencies_hz = [2.4, 2.5, 2.6]", more).replace("rate_hz = 100", "rate_hz = 1000") + carried
}

/// A result in the journal is kept when the run is resumed after a kill, so the impacts of its point must stand before it.
#[test]
fn the_impacts_of_a_point_are_in_the_journal_before_its_result() {
    let release = "\n[[experiment]]\nname = \"release\"\nkind = \"free_vibration\"\nstart_m = 0.035\nmeasure_s = 4.0\n";
    let campaign = short() + release;
    let folder = folder_with(&campaign);
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let entries = journal::read(&folder.path().join("out")).unwrap().entries;
    let mut with_impacts = 0;
    for (place, entry) in entries.iter().enumerate() {
        let (set_up, experiment, segment, ticks) = match entry {
            JournalEntry::Result(row) => (&row.set_up, &row.experiment, row.segment, row.start_tick..row.end_tick),
            JournalEntry::Transient(row) => (&row.set_up, &row.experiment, row.segment, row.start_tick..row.end_tick),
            _ => continue,
        };
        let impacts_in = |entries: &[JournalEntry]| -> usize {
            let own = entries.iter().filter_map(|entry| match entry {
                JournalEntry::Impacts(some)
                    if some.id.set_up == *set_up && some.id.experiment == *experiment && some.id.segment == segment =>
                {
                    Some(some.impacts.iter().filter(|impact| ticks.contains(&u64::from(impact.tick))).count())
                }
                _ => None,
            });
            own.sum()
        };
        let all = impacts_in(&entries);
        assert_eq!(impacts_in(&entries[..place]), all, "{set_up}, {experiment}, {ticks:?}");
        with_impacts += usize::from(all > 0);
    }
    assert!(with_impacts >= 2, "{with_impacts}");
}

/// Number of kills: 8, or `DAMPRIG_KILLS`.
fn kills() -> u64 {
    std::env::var("DAMPRIG_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(8)
}

#[cfg(unix)]
#[test]
fn a_run_killed_at_any_instant_is_resumed_and_gives_the_same_results() {
    let folder = folder_with(&longer());
    let begun = Instant::now();
    damprig(&folder).args(["run", "test.toml", "--out", "whole"]).assert().success();
    let whole_run = begun.elapsed();
    let whole = measured(&folder.path().join("whole"));
    let planned = manifest(&folder.path().join("whole"))["points_planned"].as_u64().unwrap() as usize;
    let mut random = fastrand::Rng::with_seed(20_261_121);
    let (mut left, mut killed_with_points, mut unborn) = (kills(), 0, 0);
    let mut runs = 0;
    while left > 0 {
        runs += 1;
        let run = folder.path().join(format!("killed-{runs}"));
        let name = run.file_name().unwrap().to_str().unwrap().to_string();
        // Killed repeatedly until it is complete.
        loop {
            // Nothing to resume: the kill came before the folder had a campaign.
            let is_new = !run.join("campaign.toml").exists();
            if is_new && run.exists() {
                unborn += 1;
                std::fs::remove_dir_all(&run).unwrap();
            }
            let arguments: &[&str] =
                if is_new { &["run", "test.toml", "--out", &name] } else { &["run", "--resume", &name] };
            let before = if is_new {
                JournalState::default()
            } else {
                journal::read(&run).map_or(JournalState::default(), |l| JournalState::of(&l.entries))
            };
            let mut child = Command::new(assert_cmd::cargo::cargo_bin("damprig"))
                .args(arguments)
                .current_dir(folder.path())
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap();
            if left > 0 {
                // A kill at any instant is allowed, so nothing is waited for.
                std::thread::sleep(Duration::from_secs_f64(random.f64() * whole_run.as_secs_f64()));
                child.kill().unwrap();
                left -= 1;
            }
            let output = child.wait_with_output().unwrap();
            // Earlier closed parts and results are unchanged.
            if run.join(journal::JOURNAL).exists() {
                let now = taken(&run);
                // As text: NaN is not equal to itself.
                let rows: Vec<String> = now.rows().iter().chain(now.superseded()).map(|r| format!("{r:?}")).collect();
                for row in before.rows().iter().map(|r| format!("{r:?}")) {
                    assert!(rows.contains(&row), "a result was lost: {row}");
                }
                for sealed in &before.sealed {
                    assert!(now.sealed.contains(sealed), "a sealed part was lost: {sealed:?}");
                }
                if now.joined.is_none() {
                    for sealed in &now.sealed {
                        let file = damprig::run_folder::checksum::of_file(&run, &sealed.file.name).unwrap();
                        assert_eq!(file, sealed.file, "a sealed part was changed");
                    }
                }
                killed_with_points += usize::from(!output.status.success() && !now.rows().is_empty());
            }
            if output.status.success() {
                break;
            }
            assert!(output.status.code().is_none(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        }
        assert_eq!(measured(&run), whole, "{name}");
        let taken = taken(&run);
        assert_eq!(taken.rows().len(), planned);
        let sealed: u64 = taken.sealed.iter().map(|s| s.rows).sum();
        assert_eq!(sealed, sample_rows(&run) as u64, "{name}: every sealed sample is in the joined file");
        assert_eq!(taken.losses().lost_rows, 0, "{name}");
        damprig(&folder).args(["runs", "verify", &name]).assert().success();
        std::fs::remove_dir_all(&run).unwrap();
    }
    println!(
        "{} kills in {runs} runs, {killed_with_points} with points taken, {unborn} before the run had a folder",
        kills()
    );
    assert!(killed_with_points > 0, "no kill hit a run under way: {whole_run:?}");
}

#[test]
fn resuming_a_complete_run_changes_nothing() {
    let folder = folder_with(&short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let before = std::fs::read(folder.path().join("out/manifest.json")).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    answer.stdout(contains("The run is complete: all 6 points are measured. Nothing was done."));
    assert_eq!(std::fs::read(folder.path().join("out/manifest.json")).unwrap(), before);
}

#[test]
fn a_resumed_run_measures_the_missing_points_and_reports_them() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    assert_eq!(result_rows(&run), 3);
    let begun = sample_rows(&run);
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    let words = "set-up \"hybrid\", \"sweep\" continues at 2.4 Hz, from rest";
    answer.stdout(contains("3 of 6 points are kept as they are").and(contains(words)).and(contains("6 of 6 points")));
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "whole"]).assert().success();
    assert_eq!(measured(&run), measured(&folder.path().join("whole")));
    assert!(sample_rows(&run) > begun, "samples of the interrupted point are kept too");
    let manifest = manifest(&run);
    assert_eq!((manifest["resumed"].as_u64(), manifest["status"].as_str()), (Some(1), Some("complete")));
    damprig(&folder).args(["runs", "verify", "out"]).assert().success();
    damprig(&folder).args(["runs", "show", "out"]).assert().success().stdout(contains("Resumed 1 times"));
}

/// The short campaign on a shaker that feels its load, with the base amplitude in closed loop and noisy sensors.
fn closed_loop() -> String {
    const SHAKER: &str = "[rig.shaker]\nmoving_mass_kg = 5.0\nsuspension_stiffness_n_per_m = 200\nsuspension_damping_n_s_per_m = 5\nforce_factor_n_per_a = 30\namplifier = \"voltage\"\ncoil_resistance_ohm = 1.5\nlimit_v = 20\ncurrent_limit_a = 4.5\nhalf_stroke_m = 0.079\ncalibrated_at_hz = 2.5\n\n[[set_up]]";
    short()
        .replacen("[[set_up]]", SHAKER, 1)
        .replace("base_amplitude_m = 0.0004", "base_amplitude_m = 0.0003")
        .replace("start = \"from_rest\"", "start = \"from_rest\"\ndrive = \"closed_loop\"\nramp_s = 0.5")
}

#[test]
fn a_point_in_closed_loop_does_not_depend_on_the_points_before_it() {
    for campaign in [closed_loop(), closed_loop().replace("ramp_s = 0.5", "ramp_s = 0.0")] {
        let (folder, _) = cut_off(&campaign);
        damprig(&folder).args(["run", "--resume", "out"]).assert().success();
        damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "whole"]).assert().success();
        assert_eq!(measured(&folder.path().join("out")), measured(&folder.path().join("whole")));
    }
}

#[test]
fn a_sweep_that_carries_its_motion_over_starts_from_its_beginning() {
    let campaign = short().replace("start = \"from_rest\"", "start = \"carry_over\"");
    let (folder, _) = cut_off(&campaign);
    // Cut off one point into the second set-up: that point is superseded when its sweep starts from its beginning.
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    answer.stdout(contains("starts from its beginning: the motion at 2.4 Hz cannot be carried over"));
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "whole"]).assert().success();
    assert_eq!(measured(&folder.path().join("out")), measured(&folder.path().join("whole")));
}

#[test]
fn a_changed_campaign_is_refused_with_every_difference() {
    let (folder, _) = cut_off(&short());
    let path = folder.path().join("out/campaign.toml");
    let changed = short().replace("noise_seed = 7", "noise_seed = 8").replace("dwell_s = 4.0", "dwell_s = 5.0");
    std::fs::write(&path, changed).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(2);
    let seed = contains("rig.noise_seed: 7 when it was started, 8 now");
    answer.stderr(seed.and(contains("experiment[1].dwell_s: 4.0 when it was started, 5.0 now")));
    std::fs::write(&path, format!("# a remark\n{}", short())).unwrap();
    damprig(&folder).args(["run", "--resume", "out"]).assert().success();
}

#[test]
fn another_device_is_refused_with_every_difference() {
    let (folder, _) = cut_off(&short());
    let answer = damprig(&folder).args(["run", "--resume", "out", "--rig", "virtual"]).assert().code(2);
    let board = contains("board: test when it was started, virtual now");
    answer.stderr(board.and(contains("plant: simulated in f32 when it was started, simulated in f64 now")));
    assert_eq!(result_rows(&folder.path().join("out")), 3, "nothing was changed");
}

#[test]
fn a_run_that_cannot_be_resumed_names_the_damage_and_what_can_be_read() {
    let (folder, _) = cut_off(&short());
    let run = folder.path().join("out");
    // A part of the samples is cut in half: the results are not affected.
    let part = run.join(&taken(&run).sealed[0].file.name);
    let bytes = std::fs::read(&part).unwrap();
    std::fs::write(&part, &bytes[..bytes.len() / 2]).unwrap();
    damprig(&folder).args(["runs", "verify", "out"]).assert().code(1).stdout(contains("cut off or damaged"));
    let lost = taken(&run).sealed[0].rows;
    let resumed = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    resumed.stdout(
        contains("warning: samples.parts/000001.parquet: changed since it was closed")
            .and(contains(format!("{lost} lost (0 dropped)"))),
    );
    assert_eq!(manifest(&run)["counters"]["lost_rows"], lost);
    assert_eq!(manifest(&run)["sample_rows"], sample_rows(&run));
    let verify = damprig(&folder).args(["runs", "verify", "out"]).assert().code(1);
    verify.stdout(contains(format!(
        "samples.parts/000001.parquet: was damaged when the samples were joined; its {lost} rows"
    )));
    assert_eq!(result_rows(&run), 6);
    assert_eq!(std::fs::read(&part).unwrap().len(), bytes.len() / 2, "nothing is rewritten");
    // Without a journal the points taken are unknown.
    std::fs::remove_file(run.join(journal::JOURNAL)).unwrap();
    let answer = damprig(&folder).args(["run", "--resume", "out"]).assert().code(2);
    answer.stderr(contains("out has no journal.jsonl").and(contains("`damprig runs verify out`")));
    damprig(&folder).args(["run", "--resume", "nowhere"]).assert().code(2).stderr(contains("there is no run"));
}

#[test]
fn a_reconnected_link_loses_no_point() {
    let folder = folder_with(&short());
    let mut points = 0;
    let rig = Served::again_and_again(move |message| {
        points += usize::from(is_point(message));
        if is_point(message) && matches!(points, 2 | 5) { Fate::Close } else { Fate::Pass }
    });
    let answer = damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out"]).assert().success();
    answer.stderr(contains("the link is back"));
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "whole"]).assert().success();
    assert_eq!(measured(&folder.path().join("out")), measured(&folder.path().join("whole")));
    assert_eq!(manifest(&folder.path().join("out"))["counters"]["interruptions"], 2);
}

#[test]
fn after_a_reset_of_the_board_the_run_continues_at_the_interrupted_point() {
    let folder = folder_with(&short());
    let mut points = 0;
    let rig = Served::again_and_again(move |message| {
        points += usize::from(is_point(message));
        if is_point(message) && points == 2 { Fate::Reset } else { Fate::Pass }
    });
    let arguments = ["run", "test.toml", "--rig", &rig, "--out", "out", "--timeout", "1.5"];
    damprig(&folder).args(arguments).assert().success().stderr(contains("the device was reset during the run"));
    damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "whole"]).assert().success();
    assert_eq!(measured(&folder.path().join("out")), measured(&folder.path().join("whole")));
}
