//! The recorder: a thread of its own between the link and the disk, so that neither waits for the other.
//!
//! Rows of samples wait in a queue with an end. When a real device goes on and the disk does not, rows beyond that end
//! are dropped and counted; the files show them as gaps. A device whose clock is granted by the host stands meanwhile,
//! so nothing is dropped: the host waits for room before it grants more. Results and other journal lines are few and
//! are never dropped. A disk that fails is told to whoever asks next.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::StorageError;
use super::journal::Entry;
use super::samples::Label;

/// Values (rows × signals) that may wait for the disk: nine minutes of 8 signals at 1 kHz, 8 s of 50 at 10 kHz; 16 MiB.
const MOST_WAITING: usize = 4 << 20;

/// How long samples are held in memory at most before they are handed to the system.
const SYNC_EVERY: Duration = Duration::from_millis(250);

/// How long a wait for room lasts before Ctrl-C is looked at again.
const TURN: Duration = Duration::from_millis(50);

/// Something to record.
#[derive(Debug)]
pub enum Message {
    /// A line of the journal.
    Entry(Box<Entry>),
    /// Samples.
    Rows(Rows),
}

/// Rows of one point.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// The point.
    pub label: Arc<Label>,
    /// Their ticks.
    pub ticks: Vec<u32>,
    /// Row after row, the recorded signals of each.
    pub values: Vec<f32>,
}

/// Where the recorder's thread puts what it gets.
pub trait Sink: Send + 'static {
    /// Takes a message.
    ///
    /// # Errors
    /// When it cannot be written.
    fn take(&mut self, message: Message) -> Result<(), StorageError>;

    /// Hands everything to the system.
    ///
    /// # Errors
    /// When it cannot be written.
    fn sync(&mut self) -> Result<(), StorageError>;
}

/// What a run sees of its recorder, wherever that puts what it gets.
pub trait Recording {
    /// The disk's failure, if there was one.
    ///
    /// # Errors
    /// That failure.
    fn check(&self) -> Result<(), StorageError>;

    /// Adds a line to the journal. Never waits.
    fn note(&self, entry: Entry);

    /// Adds samples, or counts them as dropped when there is no room. A patient recorder waits for room instead, until
    /// `stop` is set or the disk has failed.
    fn rows(&mut self, rows: Rows, stop: &AtomicBool);

    /// Rows dropped because the disk was too slow.
    fn dropped_rows(&self) -> u64;
}

#[derive(Debug, Default)]
struct Shared {
    waiting: Mutex<usize>,
    room: Condvar,
    failed: Mutex<Option<StorageError>>,
}

/// A list of numbers is sound whatever happened to the thread that held it.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The near end of the queue.
#[derive(Debug)]
pub struct Recorder<S> {
    queue: Option<Sender<Message>>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<S>>,
    is_patient: bool,
    dropped_rows: u64,
    accepted_rows: u64,
    most_waiting: usize,
}

impl<S: Sink> Recorder<S> {
    /// Starts the thread. `is_patient`: the device stands while it waits, so the host may wait for the disk.
    #[must_use]
    pub fn start(sink: S, is_patient: bool) -> Self {
        Self::with_room(sink, is_patient, MOST_WAITING)
    }

    /// As [`Recorder::start`], with room for so many values (rows × signals) that wait for the disk.
    #[must_use]
    pub fn with_room(sink: S, is_patient: bool, most_waiting: usize) -> Self {
        let (queue, messages) = mpsc::channel();
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        let thread = std::thread::spawn(move || work(sink, &messages, &theirs));
        Self {
            queue: Some(queue),
            shared,
            thread: Some(thread),
            is_patient,
            dropped_rows: 0,
            accepted_rows: 0,
            most_waiting,
        }
    }

    fn send(&self, message: Message) {
        // A thread that has failed has left its word in `failed`.
        let _ = self.queue.as_ref().map(|queue| queue.send(message));
    }

    /// Rows that were let into the queue, whether or not the disk took them later.
    #[must_use]
    pub fn accepted_rows(&self) -> u64 {
        self.accepted_rows
    }

    /// Waits until everything is written; gives the sink back, and the failure if there was one. `None` when the thread
    /// has died.
    pub fn finish(mut self) -> (Option<S>, Result<(), StorageError>) {
        self.queue = None;
        let sink = self.thread.take().and_then(|thread| thread.join().ok());
        let outcome = self.check();
        (sink, outcome)
    }
}

impl<S: Sink> Recording for Recorder<S> {
    fn check(&self) -> Result<(), StorageError> {
        if let Some(error) = lock(&self.shared.failed).clone() {
            return Err(error);
        }
        match &self.thread {
            // It ends by itself only when it has failed; a panic leaves no word.
            Some(thread) if thread.is_finished() => {
                let message = "the recorder's thread has died: this is a defect of the program";
                lock(&self.shared.failed).clone().map_or(Err(StorageError::new("record", Path::new(""), message)), Err)
            }
            _ => Ok(()),
        }
    }

    fn note(&self, entry: Entry) {
        self.send(Message::Entry(Box::new(entry)));
    }

    fn rows(&mut self, rows: Rows, stop: &AtomicBool) {
        let size = rows.values.len();
        let mut waiting = lock(&self.shared.waiting);
        // However long a message: an empty queue has room for it.
        while *waiting > 0 && *waiting + size > self.most_waiting {
            if !self.is_patient || stop.load(Ordering::Relaxed) || self.check().is_err() {
                self.dropped_rows += rows.ticks.len() as u64;
                return;
            }
            waiting = self.shared.room.wait_timeout(waiting, TURN).unwrap_or_else(PoisonError::into_inner).0;
        }
        *waiting += size;
        drop(waiting);
        self.accepted_rows += rows.ticks.len() as u64;
        self.send(Message::Rows(rows));
    }

    fn dropped_rows(&self) -> u64 {
        self.dropped_rows
    }
}

fn work<S: Sink>(mut sink: S, messages: &Receiver<Message>, shared: &Shared) -> S {
    let outcome = (|| {
        let mut synced = Instant::now();
        loop {
            match messages.recv_timeout(SYNC_EVERY.saturating_sub(synced.elapsed())) {
                Ok(message) => {
                    let size = if let Message::Rows(rows) = &message { rows.values.len() } else { 0 };
                    let taken = sink.take(message);
                    *lock(&shared.waiting) -= size;
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
    })();
    if let Err(error) = outcome {
        *lock(&shared.failed) = Some(error);
        shared.room.notify_all();
    }
    sink
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(tick: u32) -> Rows {
        let (set_up, experiment) = ("a".into(), "e".into());
        let label = Label { set_up, experiment, segment: 0, point_index: 0, frequency_hz: 2.0 };
        Rows { label: Arc::new(label), ticks: vec![tick], values: vec![0.0] }
    }

    /// Tells that it holds a message, and waits for leave to go on.
    struct Stalled {
        holds: Sender<()>,
        leave: Receiver<()>,
        rows: u64,
        entries: u64,
    }

    impl Sink for Stalled {
        fn take(&mut self, message: Message) -> Result<(), StorageError> {
            let _ = self.holds.send(());
            let _ = self.leave.recv();
            match message {
                Message::Rows(_) => self.rows += 1,
                Message::Entry(_) => self.entries += 1,
            }
            Ok(())
        }

        fn sync(&mut self) -> Result<(), StorageError> {
            Ok(())
        }
    }

    fn stalled(is_patient: bool) -> (Recorder<Stalled>, Receiver<()>, Sender<()>) {
        let ((holds, held), (give, leave)) = (mpsc::channel(), mpsc::channel());
        let recorder = Recorder::with_room(Stalled { holds, leave, rows: 0, entries: 0 }, is_patient, 10);
        (recorder, held, give)
    }

    #[test]
    fn a_stalled_disk_holds_nobody_up_and_what_it_cost_is_counted() {
        let (mut recorder, held, give) = stalled(false);
        let stop = AtomicBool::new(false);
        recorder.rows(rows(0), &stop);
        held.recv().unwrap();
        // The disk has the first row in hand and does not move.
        (1..100).for_each(|tick| recorder.rows(rows(tick), &stop));
        (0..100).for_each(|rows| recorder.note(Entry::Joined { rows, left: Vec::new() }));
        assert_eq!(recorder.dropped_rows(), 90);
        drop(give);
        let (sink, outcome) = recorder.finish();
        let sink = sink.unwrap();
        assert_eq!((sink.rows, sink.entries), (10, 100), "a journal line is never dropped");
        outcome.unwrap();
    }

    #[test]
    fn a_device_that_stands_is_kept_waiting_and_loses_nothing() {
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

    impl Sink for Full {
        fn take(&mut self, _: Message) -> Result<(), StorageError> {
            Err(StorageError::new("write", Path::new("samples"), "no space left on device"))
        }

        fn sync(&mut self) -> Result<(), StorageError> {
            Ok(())
        }
    }

    struct Defective;

    impl Sink for Defective {
        fn take(&mut self, _: Message) -> Result<(), StorageError> {
            panic!("a defect, on purpose");
        }

        fn sync(&mut self) -> Result<(), StorageError> {
            Ok(())
        }
    }

    #[test]
    fn a_thread_that_died_is_told_and_ends_every_wait() {
        let mut recorder = Recorder::with_room(Defective, true, 10);
        let stop = AtomicBool::new(false);
        (0..100).for_each(|tick| recorder.rows(rows(tick), &stop));
        assert!(recorder.check().unwrap_err().to_string().contains("the recorder's thread has died"));
        assert!(recorder.finish().0.is_none());
    }

    #[test]
    fn a_failed_disk_is_told_to_who_asks_and_ends_every_wait() {
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
