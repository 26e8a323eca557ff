//! The feed: what a source (a run, an idle rig, a run folder) tells the monitor. It never waits: what the monitor cannot take
//! in time is skipped and counted, and what is recorded does not depend on it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};

use damprig_core::io::SensorSet;
use tokio::sync::{broadcast, oneshot};

use super::message::{
    Activity, FaultText, Impact, Level, Limits, LinkState, MeasuredPoint, PredictedCurve, ReplayState, SharedFrame,
    Snapshot, Transient, WatchedSource,
};
use super::numbers::SignalName;
use crate::runner::TimeLeft;

/// Most updates that wait for the monitor before rows are skipped.
const MAX_WAITING: usize = 2048;

/// What is watched: told once, and again when it changes.
#[derive(Clone, Debug)]
pub struct Watched {
    /// Description of the source.
    pub source: WatchedSource,
    /// Columns of the rows.
    pub signals: Vec<SignalName>,
    /// The device's signal table: what the values in [`Update::Values`] are of.
    pub table: Vec<SignalName>,
    /// Predicted responses.
    pub curves: Vec<PredictedCurve>,
    /// Points of the whole campaign; 0 without one.
    pub points_planned: usize,
    /// Limits in force.
    pub limits: Limits,
}

/// What a source tells.
#[derive(Debug)]
pub enum Update {
    /// What is watched.
    Watch(Box<Watched>),
    /// Points and transients so far are out of date: a replay begins again.
    Forget,
    /// The time axis has jumped.
    Restart,
    /// What the source does.
    Activity(Activity, String),
    /// An experiment on a set-up has started; the set-up's clearance, m.
    Experiment {
        /// Name of the set-up.
        set_up: String,
        /// Name of the experiment.
        experiment: String,
        /// Clearance, m.
        clearance_m: Option<f64>,
    },
    /// Rows of telemetry.
    Rows {
        /// Their times, s.
        t_s: Vec<f64>,
        /// Their values, row after row.
        values: Vec<f32>,
        /// Longest time between two rows that is no gap, s.
        longest_step_s: f64,
    },
    /// Values of the device's signal table at a time.
    Values {
        /// Rig time, s.
        rig_s: f64,
        /// The device's tick.
        tick: u32,
        /// The values in the order of the table.
        values: Vec<f32>,
    },
    /// Rig time so far, s.
    Progress(f64),
    /// What the run still takes.
    TimeLeft(TimeLeft),
    /// The sensors without a signal.
    LostSensors(SensorSet),
    /// A measured point.
    Point(MeasuredPoint),
    /// A measured transient.
    Transient(Transient),
    /// An impact.
    Impact(Impact),
    /// State and counters of the link.
    Link(LinkState),
    /// The latched fault, or none any more.
    Fault(Option<FaultText>),
    /// Injected faults in words.
    Injected(Vec<String>),
    /// Position of a replay.
    Replay(ReplayState),
    /// A line for the log.
    Log(Level, String),
    /// A viewer joins.
    Join(oneshot::Sender<(Box<Snapshot>, broadcast::Receiver<Arc<SharedFrame>>)>),
    /// The source has ended.
    End,
}

impl Update {
    /// Whether it may be skipped when the monitor is slow: one of very many.
    fn can_be_skipped(&self) -> bool {
        matches!(self, Self::Rows { .. } | Self::Impact(_) | Self::Progress(_) | Self::Values { .. })
    }
}

/// Counts that both ends share.
#[derive(Debug, Default)]
pub(super) struct Counts {
    waiting: AtomicUsize,
    skipped: AtomicU64,
}

/// The source's end.
#[derive(Clone, Debug)]
pub struct Feed {
    queue: Sender<Update>,
    counts: Arc<Counts>,
}

/// The monitor's end.
#[derive(Debug)]
pub(super) struct Updates {
    pub(super) queue: Receiver<Update>,
    counts: Arc<Counts>,
}

/// A feed and its other end.
pub(super) fn feed() -> (Feed, Updates) {
    let (sender, receiver) = channel();
    let counts = Arc::new(Counts::default());
    (Feed { queue: sender, counts: Arc::clone(&counts) }, Updates { queue: receiver, counts })
}

impl Feed {
    /// Tells the monitor; never waits.
    pub fn send(&self, update: Update) {
        if update.can_be_skipped() && self.counts.waiting.load(Ordering::Relaxed) >= MAX_WAITING {
            self.counts.skipped.fetch_add(1, Ordering::Relaxed);
            return;
        }
        self.counts.waiting.fetch_add(1, Ordering::Relaxed);
        // A monitor that has ended needs nothing.
        let _ = self.queue.send(update);
    }

    /// Adds a line to the log.
    pub fn log(&self, level: Level, text: impl Into<String>) {
        self.send(Update::Log(level, text.into()));
    }
}

impl Updates {
    /// Notes that an update was taken from the queue.
    pub(super) fn taken(&self) {
        self.counts.waiting.fetch_sub(1, Ordering::Relaxed);
    }

    /// Updates skipped so far.
    pub(super) fn skipped(&self) -> u64 {
        self.counts.skipped.load(Ordering::Relaxed)
    }
}
