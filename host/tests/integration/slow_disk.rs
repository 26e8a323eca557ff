//! A disk that stalls during a run of a board with its own clock: the link is not blocked, the results are right, and dropped
//! samples are counted where they are missing.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use crate::common::{PATIENCE, short};
use damprig::campaign::{Campaign, CampaignSetUp};
use damprig::client::link::VirtualRig;
use damprig::client::session::Session;
use damprig::failure::Failure;
use damprig::input::Source;
use damprig::run_folder::ResultRow;
use damprig::run_folder::journal::{Journal, JournalEntry};
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::write::recorder::{RecordSink, Recorder, RecorderMessage, Recording};
use damprig::run_folder::write::writer::{RecordLayout, RunWriter};
use damprig::runner::{Run, RunError, Selection, Watcher};
use damprig::table::values::{numbers, texts};
use tempfile::TempDir;

/// Capacity of the queue: the rows of one point, but not of two.
const ROWS_WAITING: usize = 700;

/// Opens and closes the disk.
#[derive(Default)]
struct Gate {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    is_shut: bool,
    /// The disk holds a message and is stalled.
    is_held: bool,
    /// Results that are on the disk.
    results: usize,
}

impl Gate {
    fn set(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.state.lock().unwrap());
        self.changed.notify_all();
    }

    fn wait_until(&self, what: &str, is_so: impl Fn(&State) -> bool) {
        let waiting = self.changed.wait_timeout_while(self.state.lock().unwrap(), PATIENCE, |state| !is_so(state));
        assert!(!waiting.unwrap().1.timed_out(), "timed out before {what}");
    }
}

/// A writer whose disk stalls while the gate is shut.
struct Slow {
    writer: RunWriter,
    gate: Arc<Gate>,
}

impl RecordSink for Slow {
    fn take(&mut self, message: RecorderMessage) -> Result<(), Failure> {
        if self.gate.state.lock().unwrap().is_shut {
            self.gate.set(|state| state.is_held = true);
            self.gate.wait_until("the disk moves again", |state| !state.is_shut);
            self.gate.set(|state| state.is_held = false);
        }
        let is_result = matches!(&message, RecorderMessage::Entry(entry) if matches!(**entry, JournalEntry::Result(_)));
        self.writer.take(message)?;
        if is_result {
            self.gate.set(|state| state.results += 1);
        }
        Ok(())
    }

    fn sync(&mut self) -> Result<(), Failure> {
        self.writer.sync()
    }
}

/// Stalls the disk from the first result to the third.
struct Clerk {
    gate: Arc<Gate>,
    points: usize,
    disturbs: bool,
}

impl Watcher for Clerk {
    fn mount(&mut self, _: &CampaignSetUp, _: bool) -> Result<bool, RunError> {
        Ok(false)
    }

    fn progress(&mut self, _: f64) {
        match self.points {
            1 if self.disturbs => self.gate.wait_until("the disk stands", |state| state.is_held),
            2 if self.disturbs => {}
            // A simulated rig is faster than a disk unless it waits.
            points => self.gate.wait_until("the disk has caught up", |state| state.results == points),
        }
    }

    fn point(&mut self, _: &ResultRow) {
        self.points += 1;
        if self.disturbs && self.points == 1 {
            self.gate.set(|state| state.is_shut = true);
        } else if self.points == 3 {
            self.gate.set(|state| state.is_shut = false);
        }
    }

    fn link(&mut self, state: &str) {
        panic!("{state}");
    }
}

/// Runs the short campaign into a folder; returns the writer and the number of rows that the recorder dropped.
fn run(folder: &Path, disturbs: bool) -> (RunWriter, u64) {
    std::fs::create_dir(folder).unwrap();
    let file = folder.join("campaign.toml");
    std::fs::write(&file, short()).unwrap();
    let campaign = Campaign::parse(Source::read(&file).unwrap()).unwrap();
    let link = Box::new(VirtualRig::new(false, None));
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
    let gate = Arc::new(Gate::default());
    // A recorder that does not wait for room: as for a board with its own clock.
    let slow = Slow { writer, gate: Arc::clone(&gate) };
    let mut recorder = Recorder::with_room(slow, false, 2 * ROWS_WAITING);
    let mut clerk = Clerk { gate, points: 0, disturbs };
    let stop = AtomicBool::new(false);
    let run = Run::new(&campaign, &mut session, &mut recorder, &mut clerk, &stop, selection, JournalState::default());
    run.carry_out().1.unwrap();
    let dropped = recorder.dropped_rows();
    let (slow, stored) = recorder.finish();
    stored.unwrap();
    let mut writer = slow.unwrap().writer;
    writer.close().unwrap();
    (writer, dropped)
}

/// Set-up, tick and gap of each row.
fn rows(folder: &Path) -> Vec<(String, f64, f64)> {
    let files = damprig::run_folder::read::sample_files::sample_files(folder);
    let batches =
        files.into_iter().flat_map(|file| damprig::run_folder::read::sample_files::read_samples(&file).unwrap());
    batches
        .flat_map(|batch| {
            let batch = batch.unwrap();
            let (ticks, gaps) = (numbers(&batch, "tick").unwrap(), numbers(&batch, "gap_before_ticks").unwrap());
            let names = texts(&batch, "set_up").unwrap();
            names.into_iter().zip(ticks).zip(gaps).map(|((name, tick), gap)| (name, tick, gap)).collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn a_stalled_disk_loses_only_the_samples_of_that_time() {
    let folder = TempDir::new().unwrap();
    let (whole, slow) = (folder.path().join("whole"), folder.path().join("slow"));
    let (undisturbed, none) = run(&whole, false);
    let (disturbed, dropped) = run(&slow, true);
    // The run is complete although its disk stalled for a third of the first set-up, with the same results.
    assert_eq!(format!("{:?}", disturbed.results()), format!("{:?}", undisturbed.results()));
    // Two points of 5 s at 100 Hz and more passed meanwhile, and seven hundred rows fit into the queue.
    assert_eq!(none, 0);
    assert!(dropped > 300, "{dropped} rows dropped");
    assert_eq!(disturbed.rows() + dropped, undisturbed.rows());
    assert_eq!((disturbed.state().losses().lost_rows, undisturbed.state().losses().lost_rows), (dropped, 0));
    // The gap is after the first result and before the next set-up. All other rows are those of the undisturbed run.
    let (here, there) = (rows(&slow), rows(&whole));
    let stopped_at = disturbed.results()[0].end_tick as f64;
    let every_ticks = 10.0;
    let mut last = 0.0;
    let mut found = 0.0;
    for (set_up, tick, gap) in &here {
        assert!(there.iter().any(|(s, t, _)| s == set_up && t == tick), "{set_up} {tick}");
        if *gap > 0.0 {
            assert_eq!((set_up.as_str(), *gap), ("bare", tick - last - every_ticks), "at {tick}");
            assert!(last >= stopped_at, "rows are missing at {tick}, before the disk stalled");
            found += gap / every_ticks;
        }
        last = *tick;
    }
    let after_the_last = disturbed.state().finished.iter().map(|f| f.lost_rows).sum::<u64>();
    assert_eq!(found as u64 + after_the_last, dropped);
}
