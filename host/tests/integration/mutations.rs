//! Mutated campaigns and cases, in this process: no panic, no hang, and what the dry run accepts the controller accepts.
//!
//! 1 000 files, or 20 000 with DAMPRIG_FULL. Seeds are fixed, so a failure repeats; its message has the whole file.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use damprig::campaign::{Campaign, CampaignSetUp};
use damprig::client::link::Address;
use damprig::client::session::{Session, SessionError};
use damprig::failure::Failure;
use damprig::input::Source;
use damprig::prediction::CampaignPrediction;
use damprig::run_folder::ResultRow;
use damprig::run_folder::journal::JournalEntry;
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::schema::transients::TransientRow;
use damprig::run_folder::write::recorder::{PointRows, Recording};
use damprig::runner::rehearsal::accept;
use damprig::runner::{Run, RunError, Selection, Watcher};
use damprig::simulation::{Case, RunOptions, cost, simulate};
use fastrand::Rng;
use tempfile::TempDir;
use toml::{Table, Value};

use crate::common::is_full;

/// Longest time for one file.
const LONGEST: Duration = Duration::from_secs(20);

/// Rig time for which an accepted campaign runs, s.
const RUN_S: f64 = 20.0;

/// Time after which a simulation is told to stop.
const SIMULATED: Duration = Duration::from_millis(200);

const SINE: &str = include_str!("mutations/sine.toml");
const SPRING: &str = include_str!("mutations/spring.toml");
const SHAKER: &str = include_str!("mutations/shaker.toml");
const TRANSIENTS: &str = include_str!("mutations/transients.toml");
/// The campaigns that are mutated.
pub const CAMPAIGNS: [&str; 4] = [SINE, SPRING, SHAKER, TRANSIENTS];

const RECORD: &str = "t,z_mm\n0,0\n0.01,0.4\n0.02,1.0\n0.03,-0.8\n0.04,0.3\n0.05,0\n";

const CASES: [&str; 10] = [
    include_str!("../../cases/boring-bar.toml"),
    include_str!("../../cases/frame.toml"),
    include_str!("../../cases/modal-test.toml"),
    include_str!("../../cases/friction-damper.toml"),
    include_str!("../../cases/hybrid.toml"),
    include_str!("../../cases/record.toml"),
    include_str!("../../cases/soft-wall.toml"),
    include_str!("../../cases/hertz-wall.toml"),
    include_str!("../../cases/spid.toml"),
    include_str!("../../cases/tmd.toml"),
];

fn count() -> usize {
    if is_full() { 20_000 } else { 1_000 }
}

/// A folder with the records that the files name.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("record.csv"), RECORD).unwrap();
    let shake = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases/shake.csv");
    std::fs::copy(shake, folder.path().join("shake.csv")).unwrap();
    folder
}

/// Values that have been wrong before, or are at an end of a range.
const NUMBERS: [f64; 22] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    20.0,
    50.0,
    1000.0,
    1e-3,
    1e-9,
    1e-12,
    1e-46,
    1e-300,
    1e6,
    1e9,
    1e12,
    1e18,
    1e39,
    1e300,
    -1e300,
    f64::INFINITY,
    f64::NAN,
    0.47,
];

const TEXTS: [&str; 12] = [
    "",
    "x",
    "z",
    "hybrid",
    "bare",
    "stepped_sine",
    "constant",
    "voigt",
    "record.csv",
    "no.csv",
    "a\u{1b}[2J\u{202e}b\n",
    "ζ",
];

/// One or two changes to the parsed file; now and then to its bytes instead.
pub fn mutate(text: &str, rng: &mut Rng) -> String {
    if rng.u8(..10) == 0 {
        return mutate_bytes(text, rng);
    }
    let mut table: Value = Value::Table(text.parse::<Table>().expect("a seed is TOML"));
    for _ in 0..rng.usize(1..3) {
        let leaves = places(&table).len();
        let place = places(&table).swap_remove(rng.usize(..leaves));
        change(&mut table, &place, rng);
    }
    // A case may be JSON.
    let written = if rng.u8(..8) == 0 { serde_json::to_string(&table).ok() } else { toml::to_string(&table).ok() };
    written.unwrap_or_else(|| text.to_string())
}

fn mutate_bytes(text: &str, rng: &mut Rng) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..rng.usize(1..6) {
        if bytes.is_empty() {
            break;
        }
        let at = rng.usize(..bytes.len());
        match rng.u8(..4) {
            0 => bytes[at] = b"=[]{}\"'#.,-+eE0189\n\t\x00\x7f"[rng.usize(..22)],
            1 => drop(bytes.remove(at)),
            2 => bytes.insert(at, b"=[]{}\"\n9"[rng.usize(..8)]),
            _ => bytes.truncate(at.max(1)),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[derive(Clone, Debug)]
enum Step {
    Key(String),
    Item(usize),
}

/// The paths of all values below `value`.
fn places(value: &Value) -> Vec<Vec<Step>> {
    let mut all = Vec::new();
    let inner: Vec<(Step, &Value)> = match value {
        Value::Table(table) => table.iter().map(|(key, value)| (Step::Key(key.clone()), value)).collect(),
        Value::Array(list) => list.iter().enumerate().map(|(n, value)| (Step::Item(n), value)).collect(),
        _ => Vec::new(),
    };
    for (step, value) in inner {
        all.push(vec![step.clone()]);
        all.extend(places(value).into_iter().map(|rest| [vec![step.clone()], rest].concat()));
    }
    all
}

fn change(root: &mut Value, place: &[Step], rng: &mut Rng) {
    let Some((last, path)) = place.split_last() else { return };
    let parent = path.iter().try_fold(root, |value, step| match step {
        Step::Key(key) => value.get_mut(key.as_str()),
        Step::Item(n) => value.get_mut(*n),
    });
    match (parent, last) {
        (Some(Value::Table(table)), Step::Key(key)) => match rng.u8(..12) {
            0 => drop(table.remove(key)),
            1 => drop(table.insert(format!("{key}_m"), Value::Float(1.0))),
            2 => {
                if let Some(value) = table.remove(key) {
                    table
                        .insert(["mass_ratio", "clearance_m", "scale", "friction_ratio"][rng.usize(..4)].into(), value);
                }
            }
            _ => {
                if let Some(value) = table.get_mut(key) {
                    *value = changed(value, rng);
                }
            }
        },
        (Some(Value::Array(list)), Step::Item(n)) => match rng.u8(..6) {
            0 => drop(list.remove(*n)),
            1 => list.insert(*n, list[*n].clone()),
            2 => list.resize(rng.usize(..500), list[*n].clone()),
            _ => list[*n] = changed(&list[*n], rng),
        },
        _ => {}
    }
}

fn changed(value: &Value, rng: &mut Rng) -> Value {
    match (value, rng.u8(..20)) {
        (_, 0) => Value::String(TEXTS[rng.usize(..TEXTS.len())].into()),
        (_, 1) => Value::Boolean(true),
        (_, 2) => Value::Array(Vec::new()),
        (Value::Float(_) | Value::Integer(_), kind) => {
            let number = value.as_float().unwrap_or_else(|| value.as_integer().unwrap_or(0) as f64);
            Value::Float(match kind {
                3..9 => NUMBERS[rng.usize(..NUMBERS.len())],
                9..12 => number * 10f64.powi(rng.i32(-8..9)),
                12..16 => number * (0.5 + rng.f64()),
                _ => number * [0.1, 10.0, 30.0, 0.03, -1.0][rng.usize(..5)],
            })
        }
        (Value::String(_), _) => Value::String(TEXTS[rng.usize(..TEXTS.len())].into()),
        (Value::Table(_), 3..6) => Value::Table(Table::new()),
        (Value::Array(list), 3..6) => {
            Value::Array(list.iter().cycle().take(list.len() * rng.usize(..200)).cloned().collect())
        }
        _ => value.clone(),
    }
}

/// Drops everything.
struct Nothing;

impl Recording for Nothing {
    fn check(&self) -> Result<(), Failure> {
        Ok(())
    }

    fn note(&self, _: JournalEntry) {}

    fn rows(&mut self, _: PointRows, _: &AtomicBool) {}

    fn dropped_rows(&self) -> u64 {
        0
    }
}

/// Ends a run after [`RUN_S`] of rig time.
struct Limited<'a> {
    stop: &'a AtomicBool,
}

impl Watcher for Limited<'_> {
    fn mount(&mut self, _: &CampaignSetUp, _: bool) -> Result<bool, RunError> {
        Ok(false)
    }

    fn progress(&mut self, rig_s: f64) {
        self.stop.fetch_or(rig_s > RUN_S, Ordering::Relaxed);
    }

    fn point(&mut self, _: &ResultRow) {}

    fn transient(&mut self, _: &TransientRow) {}

    fn link(&mut self, _: &str) {}
}

fn session() -> Session {
    Session::open(&Address::VIRTUAL, Duration::from_secs(60)).unwrap()
}

/// The dry run of a campaign.
fn dry_run(path: &Path, text: &str) -> Result<(Campaign, Selection), String> {
    let mut campaign = Campaign::parse(Source::new(path.display().to_string(), text)).map_err(|e| e.to_string())?;
    let session = session();
    let (selection, _) = accept(&mut campaign, &session).map_err(|e| e.to_string())?;
    let predicted = CampaignPrediction::of(&campaign).map_err(|e| e.to_string())?;
    let drive_m = f64::from(session.settings.calibration.drive.range().amplitude_m());
    predicted.check(&campaign, drive_m).map_err(|e| e.to_string())?;
    Ok((campaign, selection))
}

/// Runs a campaign on the virtual rig for some seconds of rig time; why the controller refused something, if it did.
fn refusal_of_controller(campaign: &Campaign, selection: Selection) -> Option<String> {
    let (mut session, stop) = (session(), AtomicBool::new(false));
    let (mut watcher, mut recorder) = (Limited { stop: &stop }, Nothing);
    let journal = JournalState::default();
    let run = Run::new(campaign, &mut session, &mut recorder, &mut watcher, &stop, selection, journal);
    match run.carry_out().1 {
        Err(RunError::Session(error @ (SessionError::Refused { .. } | SessionError::Upload { .. }))) => {
            Some(error.to_string())
        }
        _ => None,
    }
}

/// Attempts at a file that took too long: a loaded machine is slow now and then, a hang is one every time.
const ATTEMPTS: usize = 5;

/// Gives every mutated text to `check`, which is timed, and what that accepts to `follow`; how many it accepted.
fn all<T>(seeds: &[&str], count: usize, check: impl Fn(&str) -> Option<T>, follow: impl Fn(T)) -> usize {
    let mut slowest = Duration::ZERO;
    let mut accepted = 0;
    for n in 0..count {
        let mut rng = Rng::with_seed(20_261_122 + n as u64);
        let text = mutate(seeds[n % seeds.len()], &mut rng);
        let mut took = Duration::MAX;
        for _ in 0..ATTEMPTS {
            let begun = Instant::now();
            let checked = catch_unwind(AssertUnwindSafe(|| check(&text)));
            took = took.min(begun.elapsed());
            let checked = checked.unwrap_or_else(|_| panic!("mutation {n}:\n{text}"));
            if took < LONGEST {
                if let Some(found) = checked {
                    accepted += 1;
                    let followed = catch_unwind(AssertUnwindSafe(|| follow(found)));
                    followed.unwrap_or_else(|_| panic!("mutation {n}:\n{text}"));
                }
                break;
            }
        }
        assert!(took < LONGEST, "mutation {n} took {took:?}:\n{text}");
        slowest = slowest.max(took);
    }
    println!("{accepted} of {count} accepted; the slowest took {slowest:?}");
    accepted
}

#[test]
fn what_the_dry_run_accepts_of_mutated_campaigns_the_controller_accepts() {
    let folder = folder();
    let path = folder.path().join("test.toml");
    let count = count() / 2;
    let check = |text: &str| match dry_run(&path, text) {
        Err(answer) => {
            assert!(!answer.is_empty() && answer.len() < 100_000, "{} bytes of answer", answer.len());
            None
        }
        Ok(accepted) => Some(accepted),
    };
    let accepted = all(&CAMPAIGNS, count, check, |(campaign, selection)| {
        let refused = refusal_of_controller(&campaign, selection);
        assert_eq!(refused, None, "the controller refuses what the dry run accepted");
    });
    // The mutations are neither all harmless nor all fatal.
    assert!((count / 20..count * 9 / 10).contains(&accepted), "{accepted} of {count} accepted");
}

#[test]
fn mutated_cases_are_refused_or_simulated() {
    let folder = folder();
    let path = folder.path().join("case.toml").display().to_string();
    let count = count() / 2;
    let check = |text: &str| {
        let case = Case::parse(&Source::new(path.clone(), text), "case").ok()?;
        cost::estimate(&case).ok()?;
        let longest_part_s = cost::longest_part_s(&case, None).ok()?;
        let begun = Instant::now();
        let options = RunOptions { keep: false, longest_part_s, go_on: &mut |_| begun.elapsed() < SIMULATED };
        simulate(&case, &mut (), options).ok()
    };
    let accepted = all(&CASES, count, check, |_| ());
    assert!((count / 20..count * 19 / 20).contains(&accepted), "{accepted} of {count} accepted");
}
