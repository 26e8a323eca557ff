//! The recorder: a bounded queue and a thread between the link and the disk, so that neither waits for the other.
//!
//! When the disk is too slow for a board with its own clock, rows beyond the queue's capacity are dropped and counted; the
//! files show them as gaps. Under a granted clock nothing is dropped: the host waits for room before it grants more
//! ticks. Results and other journal lines are few and are never dropped. A disk failure is returned by the next
//! [`Recording::check`].

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::failure::Failure;
use crate::run_folder::journal::{JOURNAL, JournalEntry};
use crate::run_folder::schema::samples::PointLabel;

/// Capacity of the queue in values (rows × signals): nine minutes of 8 signals at 1 kHz, 8 s of 50 at 10 kHz; 16 MiB.
const MAX_WAITING: usize = 4 << 20;

/// Most lines of the journal that wait: more than a disk that writes at all leaves behind.
const MAX_ENTRIES: usize = 1 << 16;

/// Longest time for which samples are held in memory before they are synced.
const SYNC_EVERY: Duration = Duration::from_millis(250);

/// Longest wait for room before Ctrl-C is checked again.
const TURN: Duration = Duration::from_millis(50);

/// Something to record.
#[derive(Debug)]
pub enum RecorderMessage {
    /// A line of the journal.
    Entry(Box<JournalEntry>),
    /// Samples.
    Rows(PointRows),
}

/// Rows of one point.
#[derive(Clone, Debug, PartialEq)]
pub struct PointRows {
    /// The point.
    pub label: Arc<PointLabel>,
    /// Their ticks.
    pub ticks: Vec<u32>,
    /// The recorded signals, row after row.
    pub values: Vec<f32>,
}

/// Stores the messages of the recorder's thread.
pub trait RecordSink: Send + 'static {
    /// Stores a message.
    ///
    /// # Errors
    /// When it cannot be written.
    fn take(&mut self, message: RecorderMessage) -> Result<(), Failure>;

    /// Syncs everything to the disk.
    ///
    /// # Errors
    /// When it cannot be written.
    fn sync(&mut self) -> Result<(), Failure>;
}

/// The recorder as a run uses it, whatever its sink.
pub trait Recording {
    /// The disk's failure, if there was one.
    ///
    /// # Errors
    /// That failure.
    fn check(&self) -> Result<(), Failure>;

    /// Adds a line to the journal. Never waits.
    fn note(&self, entry: JournalEntry);

    /// Adds samples, or counts them as dropped when there is no room. Under a granted clock it waits for room instead, until
    /// `stop` is set or the disk has failed.
    fn rows(&mut self, rows: PointRows, stop: &AtomicBool);

    /// Rows dropped because the disk was too slow.
    fn dropped_rows(&self) -> u64;
}

#[derive(Debug, Default)]
struct RecorderQueue {
    waiting: Mutex<usize>,
    /// Lines of the journal that wait.
    entries: Mutex<usize>,
    room: Condvar,
    failed: Mutex<Option<Failure>>,
}

/// The data behind these locks are valid even if a thread panicked while it held one.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The sending end of the queue.
#[derive(Debug)]
pub struct Recorder<S> {
    queue: Option<Sender<RecorderMessage>>,
    shared: Arc<RecorderQueue>,
    thread: Option<JoinHandle<S>>,
    waits_for_room: bool,
    dropped_rows: u64,
    accepted_rows: u64,
    most_waiting: usize,
}

impl<S: RecordSink> Recorder<S> {
    /// Starts the thread. `waits_for_room`: the clock is granted, so the device stands still while the host waits.
    #[must_use]
    pub fn start(sink: S, waits_for_room: bool) -> Self {
        Self::with_room(sink, waits_for_room, MAX_WAITING)
    }

    /// As [`Recorder::start`], with this capacity in values (rows × signals).
    #[must_use]
    pub fn with_room(sink: S, waits_for_room: bool, most_waiting: usize) -> Self {
        let (queue, messages) = mpsc::channel();
        let shared = Arc::new(RecorderQueue::default());
        let theirs = Arc::clone(&shared);
        let thread = std::thread::spawn(move || work(sink, &messages, &theirs));
        Self {
            queue: Some(queue),
            shared,
            thread: Some(thread),
            waits_for_room,
            dropped_rows: 0,
            accepted_rows: 0,
            most_waiting,
        }
    }

    fn send(&self, message: RecorderMessage) {
        // A thread that has failed has left its error in `failed`.
        let _ = self.queue.as_ref().map(|queue| queue.send(message));
    }

    /// Rows that were put into the queue, whether or not they were written later.
    #[must_use]
    pub fn accepted_rows(&self) -> u64 {
        self.accepted_rows
    }

    /// Waits until everything is written; gives the sink back, and the failure if there was one. `None` when the thread
    /// could not even give the sink back.
    pub fn finish(mut self) -> (Option<S>, Result<(), Failure>) {
        self.queue = None;
        let sink = self.thread.take().and_then(|thread| thread.join().ok());
        let outcome = self.check();
        (sink, outcome)
    }
}

impl<S: RecordSink> Recording for Recorder<S> {
    fn check(&self) -> Result<(), Failure> {
        if let Some(error) = lock(&self.shared.failed).clone() {
            return Err(error);
        }
        match &self.thread {
            // It ends by itself only when it has failed.
            Some(thread) if thread.is_finished() => lock(&self.shared.failed).clone().map_or(Err(defect(None)), Err),
            _ => Ok(()),
        }
    }

    fn note(&self, entry: JournalEntry) {
        let mut entries = lock(&self.shared.entries);
        if *entries >= MAX_ENTRIES {
            let message = format!("{MAX_ENTRIES} lines of the journal are waiting: the disk is too slow");
            lock(&self.shared.failed).get_or_insert(Failure::cannot("record", Path::new(JOURNAL), message));
            return;
        }
        *entries += 1;
        drop(entries);
        self.send(RecorderMessage::Entry(Box::new(entry)));
    }

    fn rows(&mut self, rows: PointRows, stop: &AtomicBool) {
        let size = rows.values.len();
        let mut waiting = lock(&self.shared.waiting);
        // An empty queue has room for a message of any length.
        while *waiting > 0 && *waiting + size > self.most_waiting {
            if !self.waits_for_room || stop.load(Ordering::Relaxed) || self.check().is_err() {
                self.dropped_rows += rows.ticks.len() as u64;
                return;
            }
            waiting = self.shared.room.wait_timeout(waiting, TURN).unwrap_or_else(PoisonError::into_inner).0;
        }
        *waiting += size;
        drop(waiting);
        self.accepted_rows += rows.ticks.len() as u64;
        self.send(RecorderMessage::Rows(rows));
    }

    fn dropped_rows(&self) -> u64 {
        self.dropped_rows
    }
}

/// The error of a thread that has panicked, with the panic's message.
fn defect(panic: Option<&(dyn Any + Send)>) -> Failure {
    let said = panic.and_then(|p| p.downcast_ref::<String>().map(String::as_str).or(p.downcast_ref::<&str>().copied()));
    let said = said.map_or(String::new(), |said| format!(" ({said})"));
    Failure::cannot(
        "record",
        Path::new("the run"),
        format!("the recorder has failed: this is a defect of damprig{said}"),
    )
}

fn work<S: RecordSink>(mut sink: S, messages: &Receiver<RecorderMessage>, shared: &RecorderQueue) -> S {
    // A panic must not lose the sink: what it has written is closed, and the run gets its manifest and report.
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        let mut synced = Instant::now();
        loop {
            match messages.recv_timeout(SYNC_EVERY.saturating_sub(synced.elapsed())) {
                Ok(message) => {
                    let (size, entries) = match &message {
                        RecorderMessage::Rows(rows) => (rows.values.len(), 0),
                        RecorderMessage::Entry(_) => (0, 1),
                    };
                    let taken = sink.take(message);
                    *lock(&shared.waiting) -= size;
                    *lock(&shared.entries) -= entries;
                    shared.room.notify_all();
                    taken?;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return sink.sync(),
            }
            if synced.elapsed() >= SYNC_EVERY {
                sink.sync()?;
                synced = Instant::now();
            }
        }
    }))
    .unwrap_or_else(|panic| Err(defect(Some(&*panic))));
    if let Err(error) = outcome {
        *lock(&shared.failed) = Some(error);
        shared.room.notify_all();
    }
    sink
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_folder::journal::Joined;

    fn rows(tick: u32) -> PointRows {
        PointRows { label: Arc::default(), ticks: vec![tick], values: vec![0.0] }
    }

    /// Reports that it holds a message, and waits for leave to go on.
    struct Stalled {
        holds: Sender<()>,
        leave: Receiver<()>,
        rows: u64,
        entries: u64,
    }

    impl RecordSink for Stalled {
        fn take(&mut self, message: RecorderMessage) -> Result<(), Failure> {
            let _ = self.holds.send(());
            let _ = self.leave.recv();
            match message {
                RecorderMessage::Rows(_) => self.rows += 1,
                RecorderMessage::Entry(_) => self.entries += 1,
            }
            Ok(())
        }

        fn sync(&mut self) -> Result<(), Failure> {
            Ok(())
        }
    }

    fn stalled(waits_for_room: bool) -> (Recorder<Stalled>, Receiver<()>, Sender<()>) {
        let ((holds, held), (give, leave)) = (mpsc::channel(), mpsc::channel());
        let recorder = Recorder::with_room(Stalled { holds, leave, rows: 0, entries: 0 }, waits_for_room, 10);
        (recorder, held, give)
    }

    #[test]
    fn a_stalled_disk_does_not_block_the_link_and_dropped_rows_are_counted() {
        let (mut recorder, held, give) = stalled(false);
        let stop = AtomicBool::new(false);
        recorder.rows(rows(0), &stop);
        held.recv().unwrap();
        // The sink holds the first row and is stalled.
        (1..100).for_each(|tick| recorder.rows(rows(tick), &stop));
        (0..100).for_each(|rows| recorder.note(JournalEntry::Joined(Joined { rows, ..Joined::default() })));
        assert_eq!(recorder.dropped_rows(), 90);
        drop(give);
        let (sink, outcome) = recorder.finish();
        let sink = sink.unwrap();
        assert_eq!((sink.rows, sink.entries), (10, 100), "a journal line is never dropped");
        outcome.unwrap();
    }

    #[test]
    fn under_a_granted_clock_the_host_waits_and_nothing_is_lost() {
        let (mut recorder, held, give) = stalled(true);
        let disk = std::thread::spawn(move || {
            while held.recv().is_ok() {
                let _ = give.send(());
            }
        });
        let stop = AtomicBool::new(false);
        (0..1000).for_each(|tick| recorder.rows(rows(tick), &stop));
        assert_eq!(recorder.dropped_rows(), 0);
        let (sink, _) = recorder.finish();
        assert_eq!(sink.map(|s| s.rows), Some(1000));
        disk.join().unwrap();
    }

    struct Full;

    impl RecordSink for Full {
        fn take(&mut self, _: RecorderMessage) -> Result<(), Failure> {
            Err(Failure::cannot("write", Path::new("samples"), "no space left on device"))
        }

        fn sync(&mut self) -> Result<(), Failure> {
            Ok(())
        }
    }

    struct Defective;

    impl RecordSink for Defective {
        fn take(&mut self, _: RecorderMessage) -> Result<(), Failure> {
            panic!("a defect, on purpose");
        }

        fn sync(&mut self) -> Result<(), Failure> {
            Ok(())
        }
    }

    #[test]
    fn a_panic_is_reported_ends_every_wait_and_gives_the_sink_back() {
        let mut recorder = Recorder::with_room(Defective, true, 10);
        let stop = AtomicBool::new(false);
        (0..100).for_each(|tick| recorder.rows(rows(tick), &stop));
        let (sink, outcome) = recorder.finish();
        let error = outcome.unwrap_err().to_string();
        assert!(error.contains("this is a defect of damprig (a defect, on purpose)"), "{error}");
        assert!(sink.is_some(), "it closes what it has written");
    }

    #[test]
    fn lines_beyond_what_a_working_disk_leaves_behind_end_the_run() {
        let (recorder, held, give) = stalled(false);
        let line = || JournalEntry::Joined(Joined::default());
        recorder.note(line());
        held.recv().unwrap();
        (0..MAX_ENTRIES - 1).for_each(|_| recorder.note(line()));
        assert!(recorder.check().is_ok());
        recorder.note(line());
        assert!(recorder.check().unwrap_err().to_string().contains("the disk is too slow"));
        drop(give);
        assert_eq!(recorder.finish().0.unwrap().entries, MAX_ENTRIES as u64, "those that were taken are written");
    }

    #[test]
    fn a_failed_disk_is_reported_and_ends_every_wait() {
        let mut recorder = Recorder::with_room(Full, true, 10);
        let stop = AtomicBool::new(false);
        (0..100).for_each(|tick| recorder.rows(rows(tick), &stop));
        while recorder.check().is_ok() {
            std::thread::yield_now();
        }
        let (_, outcome) = recorder.finish();
        assert!(outcome.unwrap_err().to_string().contains("no space left on device"));
    }
}
