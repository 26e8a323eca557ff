//! Runs that are killed right after each kind of journal entry, also on a disk that keeps only what was synced: every result that is
//! noted is kept with its samples, nothing is mixed up, and the resumed run has the results of an undisturbed one. `faults.c`, loaded
//! into the program, kills it and keeps what was synced; without a C compiler these tests are skipped.
#![cfg(target_os = "linux")]

use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::process::{Command, Stdio};

use damprig::run_folder::journal;
use damprig::run_folder::read::verify::{Finding, verify};
use damprig::run_folder::schema::journal_entry::JournalEntry;
use damprig::run_folder::schema::journal_state::JournalState;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{damprig, folder_with, is_full, two_records};
use crate::file_faults::preload;
use crate::resume::measured;

/// Every kind of experiment: sweeps from rest with points around the peak, a sweep that carries its motion over, two records in files
/// of the same name of which the first is repeated, noise with repeats, a pulse, a release.
const EXPERIMENTS: &str = r#"
[[experiment]]
name = "sweep"
kind = "stepped_sine"
frequencies_hz = { from_hz = 2.3, to_hz = 2.6, step_hz = 0.1, peak_points = 2 }
start = "from_rest"
settle_s = 0.5
dwell_s = 3.0

[[experiment]]
name = "carried"
kind = "stepped_sine"
frequencies_hz = [2.45, 2.55]
start = "carry_over"
set_ups = ["bare"]
settle_s = 1.0
dwell_s = 3.0

[[experiment]]
name = "hiss"
kind = "playback"
repeats = 2
set_ups = ["bare"]
target_peak_m = 0.002
tail_s = 0.5
noise = { seed = 7, from_hz = 0.5, to_hz = 10, duration_s = 3 }
"#;

const ENDS: &str = r#"
[[experiment]]
name = "pulse"
kind = "impulse"
shape = "half_sine"
amplitude_m = 0.003
duration_s = 0.2
tail_s = 2

[[experiment]]
name = "release"
kind = "free_vibration"
start_m = 0.03
measure_s = 3.0

[telemetry]
rate_hz = 1000
signals = ["x", "z"]
"#;

/// A folder with the campaign `test.toml` and its records.
pub(crate) fn folder() -> TempDir {
    let short = crate::common::short();
    let (head, _) = short.split_once("[[experiment]]").unwrap();
    let folder = folder_with("");
    let records = two_records(folder.path(), &["bare"]);
    std::fs::write(folder.path().join("test.toml"), [head, EXPERIMENTS, &records, ENDS].concat()).unwrap();
    folder
}

/// Kinds of entries of the journal of a rig whose clock is granted.
const KINDS: [&str; 10] =
    ["begin", "segment", "result", "peak_points", "transient", "impacts", "sealed", "finished", "joined", "ended"];

/// Number of kills: 10, 200 in the full tests, or `DAMPRIG_KILLS`.
fn kills() -> u32 {
    let wanted = std::env::var("DAMPRIG_KILLS").ok().and_then(|n| n.parse().ok());
    wanted.unwrap_or(if is_full() { 200 } else { 10 })
}

/// What a disk holds after a power cut: `faults.c` copies into it what is synced.
pub(crate) struct Disk(TempDir);

impl Disk {
    /// With everything that is in the folder.
    fn with(folder: &Path) -> Self {
        let disk = Self(TempDir::new().unwrap());
        disk.add(folder);
        disk
    }

    fn add(&self, folder: &Path) {
        let mut listing = String::new();
        for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let (inode, name) = (entry.metadata().unwrap().ino(), entry.file_name().into_string().unwrap());
            let kind = if entry.file_type().unwrap().is_dir() {
                self.add(&entry.path());
                'd'
            } else {
                std::fs::copy(entry.path(), self.0.path().join(format!("f-{inode}"))).unwrap();
                'f'
            };
            listing += &format!("{kind} {inode} {name}\n");
        }
        let inode = std::fs::metadata(folder).unwrap().ino();
        std::fs::write(self.0.path().join(format!("d-{inode}")), listing).unwrap();
    }

    /// Puts what it holds of one entry of a folder in place of what is there.
    fn put_back(&self, folder: &Path, name: &str) {
        let inode = std::fs::metadata(folder).unwrap().ino();
        std::fs::remove_dir_all(folder.join(name)).unwrap();
        for (kind, inode, entry) in self.list(inode) {
            if entry == name {
                self.put(&folder.join(name), kind, inode);
            }
        }
    }

    fn put(&self, path: &Path, kind: char, inode: u64) {
        if kind == 'd' {
            std::fs::create_dir(path).unwrap();
            self.list(inode).into_iter().for_each(|(kind, inode, name)| self.put(&path.join(name), kind, inode));
        } else {
            // A name without content: the file was never synced.
            let content = std::fs::read(self.0.path().join(format!("f-{inode}"))).unwrap_or_default();
            std::fs::write(path, content).unwrap();
        }
    }

    /// Kind, inode and name of the entries of a folder.
    fn list(&self, inode: u64) -> Vec<(char, u64, String)> {
        let text = std::fs::read_to_string(self.0.path().join(format!("d-{inode}"))).unwrap_or_default();
        let entry = |line: &str| {
            let (kind, rest) = line.split_at(1);
            let (inode, name) = rest.trim_start().split_once(' ').unwrap();
            (kind.chars().next().unwrap(), inode.parse().unwrap(), name.to_string())
        };
        text.lines().map(entry).collect()
    }
}

fn entries(run: &Path) -> Vec<JournalEntry> {
    journal::read(run).map_or(Vec::new(), |lines| lines.entries)
}

/// All results as text: equal text is equal bits.
fn results(state: &JournalState) -> Vec<String> {
    let rows = state.rows().iter().map(|row| format!("{row:?}"));
    rows.chain(state.transients().iter().map(|row| format!("{row:?}"))).collect()
}

/// The measured values of records, pulses and releases, without their times.
fn transients(run: &Path) -> Vec<String> {
    let mut rows = JournalState::of(&entries(run)).transients().to_vec();
    rows.sort_by(|a, b| (&a.set_up, &a.experiment).cmp(&(&b.set_up, &b.experiment)));
    rows.iter_mut().for_each(|row| (row.start_tick, row.end_tick, row.segment) = (0, 0, 0));
    rows.iter().map(|row| format!("{row:?}")).collect()
}

/// Impacts in the measured windows by set-up, experiment and point, with ticks from the start of the window.
pub(crate) fn impacts(run: &Path) -> BTreeMap<(String, String, u32), Vec<String>> {
    let state = JournalState::of(&entries(run));
    let rows = state.rows().iter();
    let rows = rows.map(|r| (&r.set_up, &r.experiment, r.segment, r.point_index, r.start_tick..r.end_tick));
    let events = state.transients().iter();
    let events = events.map(|r| (&r.set_up, &r.experiment, r.segment, r.point_index, r.start_tick..r.end_tick));
    let mut all = BTreeMap::new();
    for (set_up, experiment, segment, point, ticks) in rows.chain(events) {
        let own = state.impacts.iter().filter(|some| {
            some.id.set_up == *set_up && some.id.experiment == *experiment && some.id.segment == segment
        });
        let within = own.flat_map(|some| &some.impacts).filter(|hit| ticks.contains(&u64::from(hit.tick)));
        let hits = within.map(|hit| {
            let after = u64::from(hit.tick) - ticks.start;
            format!("{after} {hit:?}").replace(&format!("tick: {}", hit.tick), "")
        });
        all.insert((set_up.clone(), experiment.clone(), point), hits.collect());
    }
    all
}

/// Starts or resumes a run that is killed after a line of its journal, and waits for its end; whether it was killed.
pub(crate) fn killed(folder: &TempDir, library: &Path, kind: &str, at: u32, disk: Option<&Disk>) -> bool {
    let is_new = !folder.path().join("out/campaign.toml").exists();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let arguments: &[&str] = if is_new { &["run", "test.toml", "--out", out] } else { &["run", "--resume", out] };
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("damprig"));
    command.args(arguments).current_dir(folder.path()).stdout(Stdio::null()).stderr(Stdio::piped());
    command.env("LD_PRELOAD", library).env("FAULT_UNDER", folder.path());
    command.env("FAULT_KILL", format!("\"entry\":\"{kind}\"")).env("FAULT_AT", at.to_string());
    if let Some(disk) = disk {
        command.env("FAULT_DISK", disk.0.path());
    }
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), None | Some(0)), "after {kind} {at}: {:?}: {said}", output.status);
    output.status.code().is_none()
}

#[test]
fn a_run_killed_right_after_each_kind_of_entry_loses_no_result_and_mixes_nothing_up() {
    let Some(library) = preload() else { return };
    let (folder, undisturbed) = (folder(), folder());
    damprig(&undisturbed).args(["run", "test.toml", "--out", "whole"]).assert().success();
    let whole = undisturbed.path().join("whole");
    let run = folder.path().join("out");
    let (points, events, hits) = (measured(&whole), transients(&whole), impacts(&whole));
    assert!(hits.values().map(Vec::len).sum::<usize>() > 20, "{hits:?}");
    let mut random = fastrand::Rng::with_seed(20_261_124);
    let mut after: BTreeMap<&str, u32> = BTreeMap::new();
    let (mut done, mut runs, mut power_cuts) = (0, 0, 0);
    while done < kills() {
        runs += 1;
        let loses_power = runs % 2 == 0;
        let mut history = Vec::new();
        // Killed several times, then left alone.
        for turn in 0..12 {
            // The kinds in turn; a few come only near the end of a run.
            let kind = if (done as usize).is_multiple_of(2) {
                KINDS[done as usize / 2 % KINDS.len()]
            } else {
                *random.choice(KINDS.iter()).unwrap()
            };
            let disk = loses_power.then(|| Disk::with(folder.path()));
            let at = if turn == 0 { random.u32(1..5) } else { random.u32(1..3) };
            let before = JournalState::of(&entries(&run));
            if !killed(&folder, &library, kind, at, disk.as_ref()) {
                break;
            }
            done += 1;
            history.push(format!("{kind} {at}"));
            power_cuts += u32::from(loses_power);
            *after.entry(kind).or_default() += 1;
            if let Some(disk) = disk {
                disk.put_back(folder.path(), "out");
            }
            if !run.join("campaign.toml").exists() {
                let _ = std::fs::remove_dir_all(&run);
                continue;
            }
            let now = JournalState::of(&entries(&run));
            let kept = results(&now);
            let superseded: Vec<String> = now.superseded().iter().map(|row| format!("{row:?}")).collect();
            for row in results(&before) {
                assert!(
                    kept.contains(&row) || superseded.contains(&row),
                    "after {kind} {at}: a result was lost: {row}"
                );
            }
            let lacking: Vec<Finding> = verify(&run)
                .unwrap()
                .into_iter()
                .filter(|found| matches!(found, Finding::Wrong(text) if text.contains("rows of point") || text.contains("damaged") || text.contains("changed")))
                .collect();
            assert_eq!(lacking, [], "after {kind} {at}, power cut: {loses_power}");
        }
        let how = format!("run {runs}, loss of power: {loses_power}, killed after {history:?}");
        let is_begun = run.join("campaign.toml").exists();
        let arguments: &[&str] = if is_begun { &["--resume", "out"] } else { &["test.toml", "--out", "out"] };
        let output = damprig(&folder).arg("run").args(arguments).output().unwrap();
        assert!(output.status.success(), "{how}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(measured(&run), points, "{how}");
        assert_eq!(transients(&run), events, "{how}");
        assert_eq!(impacts(&run), hits, "{how}");
        let state = JournalState::of(&entries(&run));
        assert_eq!(state.withdrawn(), [], "{how}: each result that was noted had its samples");
        damprig(&folder).args(["runs", "verify", "out"]).assert().success();
        std::fs::remove_dir_all(&run).unwrap();
    }
    println!("{done} kills in {runs} runs, {power_cuts} of them with a loss of power; after {after:?}");
}

/// Some disks lose what they have reported as synced, and earlier versions did not wait for it.
#[test]
fn a_result_whose_samples_are_cut_off_is_found_and_measured_again() {
    let Some(library) = preload() else { return };
    let folder = crate::copies::folder("");
    damprig(&folder).args(["run", "test.toml", "--out", "whole"]).assert().success();
    let run = folder.path().join("out");
    assert!(killed(&folder, &library, "transient", 1, None));
    let rows = |run: &Path| crate::common::sample_rows(run) as u64;
    let before = rows(&run);
    let verified = damprig(&folder).args(["runs", "verify", "out"]).assert().code(1);
    verified.stdout(contains("are missing").not());
    for entry in std::fs::read_dir(&run).unwrap().map(Result::unwrap) {
        if entry.path().extension().is_some_and(|end| end == "arrows") {
            let stream = std::fs::read(entry.path()).unwrap();
            std::fs::write(entry.path(), &stream[..stream.len() * 95 / 100]).unwrap();
        }
    }
    let end_tick = JournalState::of(&entries(&run)).transients()[0].end_tick;
    let lost = end_tick - rows(&run);
    assert!(lost > 0 && before >= end_tick, "{lost} of {before} rows, {end_tick} ticks");
    let words = format!("\"bare\", \"a 1 of 2\", segment 0: the last {lost} rows of point 0 are missing");
    damprig(&folder).args(["runs", "verify", "out"]).assert().code(1).stdout(contains(words));
    let resumed = damprig(&folder).args(["run", "--resume", "out"]).assert().success();
    let words = format!("\"a 1 of 2\": the last {lost} rows of its samples were lost; the point is measured again");
    resumed.stdout(contains(words).and(contains("3 of 3 points")));
    assert_eq!(transients(&run), transients(&folder.path().join("whole")));
    let state = JournalState::of(&entries(&run));
    let counted: Vec<u64> = state.withdrawn().iter().map(|withdrawn| withdrawn.lost_rows).collect();
    assert_eq!((counted, state.transients().len()), (vec![lost], 3));
    let verified = damprig(&folder).args(["runs", "verify", "out"]).assert().success();
    verified.stdout(contains(format!("was measured again: {lost} rows of its samples had been lost")));
    damprig(&folder).args(["run", "--resume", "out"]).assert().success().stdout(contains("Nothing was done"));
}
