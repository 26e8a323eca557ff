//! A campaign over links that drop, delay, duplicate and reorder frames or bytes: it completes with the results of an
//! undisturbed run, and lost samples are counted.

use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use crate::common::short;
use damprig::campaign::Campaign;
use damprig::client::link::{Link, VirtualRig};
use damprig::client::session::Session;
use damprig::input::Source;
use damprig::run_folder::ResultRow;
use damprig::run_folder::journal::Journal;
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::write::recorder::Recorder;
use damprig::run_folder::write::writer::{RecordLayout, RunWriter};
use damprig::runner::{Run, Selection, Tally};
use tempfile::TempDir;

/// The short campaign with ten times the samples, so that many messages are disturbed.
fn campaign() -> Campaign {
    Campaign::parse(Source::new("short.toml", short().replace("rate_hz = 100", "rate_hz = 1000"))).unwrap()
}

/// Disturbed items in a thousand.
const PER_MILLE: u32 = 10;

/// The unit that a fault affects.
#[derive(Clone, Copy, Debug)]
enum Unit {
    /// Whole frames, from one zero to the next.
    Frame,
    /// Single bytes.
    Byte,
}

/// One direction of a line.
struct Faults {
    unit: Unit,
    random: fastrand::Rng,
    /// The beginning of an incomplete frame.
    begun: Vec<u8>,
    /// Delayed items, and how many others overtake them.
    late: VecDeque<(usize, Vec<u8>)>,
    hit: Arc<AtomicU64>,
}

impl Faults {
    fn new(unit: Unit, seed: u64, hit: &Arc<AtomicU64>) -> Self {
        let (random, hit) = (fastrand::Rng::with_seed(seed), Arc::clone(hit));
        Self { unit, random, begun: vec![], late: VecDeque::new(), hit }
    }

    /// The output for the input `bytes`.
    fn carry(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        for &byte in bytes {
            self.begun.push(byte);
            if byte == 0 || matches!(self.unit, Unit::Byte) {
                let piece = std::mem::take(&mut self.begun);
                self.one(piece, &mut out);
            }
        }
        out
    }

    fn one(&mut self, piece: Vec<u8>, out: &mut Vec<u8>) {
        for (others, _) in &mut self.late {
            *others = others.saturating_sub(1);
        }
        if self.random.u32(0..1000) < PER_MILLE {
            self.hit.fetch_add(1, Ordering::Relaxed);
            match self.random.u32(0..4) {
                0 => {}
                1 => out.extend([piece.clone(), piece].concat()),
                // Swapped with the next, or behind some.
                2 => self.late.push_back((1, piece)),
                _ => self.late.push_back((self.random.usize(2..7), piece)),
            }
        } else {
            out.extend(piece);
        }
        self.release(out, |others| others == 0);
    }

    fn release(&mut self, out: &mut Vec<u8>, is_due: impl Fn(usize) -> bool) {
        let (due, late) = std::mem::take(&mut self.late).into_iter().partition(|(others, _)| is_due(*others));
        self.late = late;
        let due: VecDeque<(usize, Vec<u8>)> = due;
        out.extend(due.into_iter().flat_map(|(_, piece)| piece));
    }
}

struct Faulty {
    rig: VirtualRig,
    out: Faults,
    back: Faults,
}

impl Link for Faulty {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let bytes = self.out.carry(bytes);
        self.rig.send(&bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, wait: Duration) -> io::Result<()> {
        let mut bytes = Vec::new();
        self.rig.receive(&mut bytes, wait)?;
        into.extend(self.back.carry(&bytes));
        if bytes.is_empty() {
            // Delayed items are released.
            self.back.release(into, |_| true);
            let mut late = Vec::new();
            self.out.release(&mut late, |_| true);
            self.rig.send(&late)?;
        }
        Ok(())
    }
}

/// Runs the campaign over a link into a folder.
fn run(link: Box<dyn Link>, folder: &Path) -> (RunWriter, Tally) {
    let campaign = campaign();
    let mut session = Session::over(link, "the link".into(), Duration::from_secs(60)).unwrap();
    let selection = Selection::of(&campaign, &session).unwrap();
    let plan = RecordLayout {
        signals: selection.signals.clone(),
        every_ticks: campaign.telemetry.every_ticks(),
        tick_hz: 1000.0,
        order: campaign.in_order(),
        about: Default::default(),
    };
    let writer = RunWriter::new(folder, Journal::open(folder).unwrap(), plan, JournalState::default()).unwrap();
    let (mut recorder, mut nobody) = (Recorder::start(writer, true), ());
    let stop = AtomicBool::new(false);
    let run = Run::new(&campaign, &mut session, &mut recorder, &mut nobody, &stop, selection, JournalState::default());
    let (tally, result) = run.carry_out();
    result.unwrap();
    let (writer, stored) = recorder.finish();
    stored.unwrap();
    let mut writer = writer.unwrap();
    writer.close().unwrap();
    (writer, tally)
}

/// Every value as text; equal text of a number means equal bits.
fn figures(writer: &RunWriter) -> Vec<String> {
    writer
        .results()
        .iter()
        .map(|row| format!("{:?}", ResultRow { segment: 0, start_tick: 0, end_tick: 0, ..row.clone() }))
        .collect()
}

/// Each row of the samples: its place in the run, and its point with the signals' values.
fn samples(folder: &Path) -> impl Iterator<Item = (String, String)> {
    let files = damprig::run_folder::read::sample_files::sample_files(folder);
    let batches =
        files.into_iter().flat_map(|file| damprig::run_folder::read::sample_files::read_samples(&file).unwrap());
    batches.flat_map(|batch| {
        let batch = batch.unwrap();
        let columns = ["set_up", "experiment", "tick", "point_index", "x_m", "z_m", "gap_before_ticks"];
        let columns = columns.map(|name| damprig::table::values::column(&batch, name).unwrap());
        let cell = move |c: usize, row: usize| format!("{:?} ", columns[c][row]);
        let join = move |cells: std::ops::Range<usize>, row| cells.map(|c| cell(c, row)).collect::<String>();
        let row = move |row| (join(0..3, row), format!("{}gap {}", join(3..6, row), join(6..7, row)));
        (0..batch.num_rows()).map(row).collect::<Vec<(String, String)>>()
    })
}

fn over_faults(unit: Unit, seed: u64) {
    let folder = TempDir::new().unwrap();
    let (whole, faulty) = (folder.path().join("whole"), folder.path().join("faulty"));
    std::fs::create_dir(&whole).unwrap();
    std::fs::create_dir(&faulty).unwrap();
    let (undisturbed, _) = run(Box::new(VirtualRig::new(false, None)), &whole);
    let hit = Arc::new(AtomicU64::new(0));
    let (out, back) = (Faults::new(unit, seed, &hit), Faults::new(unit, seed + 1000, &hit));
    let link = Faulty { rig: VirtualRig::new(false, None), out, back };
    let (disturbed, tally) = run(Box::new(link), &faulty);
    assert_eq!(figures(&disturbed), figures(&undisturbed), "{unit:?}, seed {seed}");
    let lost = disturbed.state().losses().lost_rows;
    let hit = hit.load(Ordering::Relaxed);
    assert!(hit > 10, "{hit}");
    println!("{unit:?}, seed {seed}: {hit} hit, {} rows, {lost} lost, {:?}", disturbed.rows(), tally.counters);
    // Every row of the finished segments is recorded or counted as lost.
    let starts = disturbed.state().segments.len();
    if starts == undisturbed.state().segments.len() {
        let end = |w: &RunWriter| w.state().finished.iter().map(|f| u64::from(f.end_tick) + 1).sum::<u64>();
        assert_eq!(disturbed.rows() + lost, end(&disturbed), "{unit:?}, seed {seed}");
    }
    // Each gap is stated in the row after it.
    let gap = |row: &String| row.split("gap U64(").nth(1).and_then(|t| t.split(')').next()?.parse::<u64>().ok());
    let gaps: u64 = samples(&faulty).map(|(_, row)| gap(&row).unwrap()).sum();
    assert_eq!(gaps, disturbed.state().sealed.iter().map(|s| s.lost_rows).sum::<u64>(), "one tick a row");
    // Each recorded row is that of the undisturbed run, with the same point.
    let without_gap = |row: String| row.split("gap ").next().unwrap().to_string();
    let rows = |folder: &Path| -> BTreeMap<String, String> {
        samples(folder).map(|(key, row)| (key, without_gap(row))).collect()
    };
    let (here, there) = (rows(&faulty), rows(&whole));
    if starts == undisturbed.state().segments.len() {
        // If the event that ends an experiment is lost, rows of the idle rig follow until the host requests the status.
        let parts = |key: &str| {
            let (experiment, tick) = key.rsplit_once("U64(").unwrap();
            (experiment.to_string(), tick.trim().trim_end_matches(')').parse::<u64>().unwrap())
        };
        let mut ends: BTreeMap<String, u64> = BTreeMap::new();
        for (experiment, tick) in there.keys().map(|key| parts(key.as_str())) {
            let end = ends.entry(experiment).or_default();
            *end = tick.max(*end);
        }
        let compared: Vec<_> = here.iter().filter(|(key, _)| parts(key).1 <= ends[&parts(key).0]).collect();
        assert!(compared.len() + 4000 * ends.len() >= here.len(), "{unit:?}, seed {seed}: idle for too long");
        for (key, row) in compared {
            assert_eq!(there.get(key), Some(row), "{unit:?}, seed {seed}: {key}");
        }
    }
    match unit {
        Unit::Frame => assert!(disturbed.rows() * 10 > undisturbed.rows() * 9),
        // At this rate nearly every message of 64 values is disturbed.
        Unit::Byte => {
            assert!(tally.counters.bad_frames_host > 0 && tally.counters.missing_records > 0);
            // The board's own count, sent over the same link.
            let told = tally.controller.expect("the board was asked");
            assert!(told.bad_frames > 0 && told.overruns == 0, "{told:?}");
            assert_eq!(tally.counters.bad_frames_device, told.bad_frames);
        }
    }
}

#[test]
fn frames_dropped_delayed_duplicated_and_reordered_change_no_result() {
    (1..=5).for_each(|seed| over_faults(Unit::Frame, seed));
}

#[test]
fn bytes_dropped_delayed_duplicated_and_reordered_change_no_result() {
    over_faults(Unit::Byte, 1);
}
