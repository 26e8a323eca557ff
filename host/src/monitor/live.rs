//! What the monitor knows at present: the recent past, bounded, and what has not been sent yet.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use damprig_core::io::SensorSet;

use super::Permissions;
use super::feed::{Update, Watched};
use super::history::TelemetryHistory;
use super::message::{
    Activity, Impact, Level, Limits, LinkState, LogLine, MeasuredPoint, News, Snapshot, SourceKind, State, Transient,
    ViewerUpdate, WatchedSource,
};
use super::numbers::Numbers;
use super::running_ratio::RunningRatio;
use super::section::PointFinder;
use super::spectrum::Spectra;
use super::unsent::Unsent;
use crate::host_time;
use crate::report::numbers::duration;

/// Rows kept for new viewers: 20 s at 1 kHz.
const MAX_ROWS: usize = 20_000;

/// Entries of rows in a snapshot, and in a frame; the newest of them are not reduced.
const SNAPSHOT_ROWS: usize = 4000;
const FRAME_ROWS: usize = 400;
const TAIL: usize = 200;

/// Values of the controller kept for new viewers: five minutes at 10 Hz; and entries in a snapshot.
const MAX_VALUES: usize = 3000;
const SNAPSHOT_VALUES: usize = 1200;

/// Points, impacts, Poincaré points and lines of the log that are kept.
const MAX_POINTS: usize = 20_000;
const MAX_IMPACTS: usize = 2000;
const MAX_SECTION: usize = 1000;
const MAX_LOG: usize = 1000;

/// Time over which the pace of rig time is measured.
const PACE_OVER: Duration = Duration::from_secs(2);

/// Fastest replay that shows every row, rig seconds per second.
const SLOW_REPLAY: f64 = 2.0;

/// Time over which x and z are averaged while nothing is driven.
const MEAN_OVER: Duration = Duration::from_secs(1);

/// Time over which the largest |x| is taken, s.
const LARGEST_OVER_S: f64 = 5.0;

/// The controller's numbers that are shown over time.
const SLOW: [&str; 9] = [
    "x_over_z_lock_in",
    "x_amplitude_m",
    "z_amplitude_m",
    "impacts_in_cycle",
    "twin_residual_m",
    "spring_force_n",
    "spring_target_n",
    "wall_low_n",
    "wall_high_n",
];

/// Time axis of the controller's numbers: rig time, and host time while rig time stands (the spring is being set, or a run is
/// paused).
#[derive(Debug, Default)]
struct SlowClock {
    last: Option<(Instant, f64)>,
    stood_s: f64,
}

impl SlowClock {
    fn time_s(&mut self, rig_s: f64) -> f64 {
        let now = Instant::now();
        if let Some((then, last_s)) = self.last
            && rig_s <= last_s
        {
            self.stood_s += (now - then).as_secs_f64() + (last_s - rig_s);
        }
        self.last = Some((now, rig_s));
        rig_s + self.stood_s
    }
}

/// The present state of the monitor.
#[derive(Debug)]
pub(super) struct Live {
    permissions: Permissions,
    watched: Watched,
    row_names: Vec<String>,
    state: State,
    recent: TelemetryHistory,
    unsent: TelemetryHistory,
    slow: TelemetryHistory,
    slow_unsent: TelemetryHistory,
    slow_clock: SlowClock,
    section_of: PointFinder,
    section: Unsent<(f32, f32, f32)>,
    ratio: RunningRatio,
    spectra: Spectra,
    points: Unsent<MeasuredPoint>,
    transients: Unsent<Transient>,
    impacts: Unsent<Impact>,
    log: Unsent<LogLine>,
    restart: bool,
    changed: bool,
    pace: VecDeque<(Instant, f64)>,
    /// Sensors without a signal.
    lost: SensorSet,
    /// When the newest row arrived, and the newest sample of any kind.
    rows_at: Option<Instant>,
    heard_at: Option<Instant>,
    /// The next row does not follow the one before.
    is_gap: bool,
}

impl Live {
    pub(super) fn new(permissions: Permissions) -> Self {
        let source = WatchedSource {
            kind: SourceKind::Rig,
            name: String::new(),
            rig: String::new(),
            board: String::new(),
            folder: None,
        };
        let mut live = Self {
            permissions,
            watched: Watched {
                source,
                signals: Vec::new(),
                table: Vec::new(),
                curves: Vec::new(),
                points_planned: 0,
                limits: Limits::default(),
            },
            row_names: Vec::new(),
            state: State::default(),
            recent: TelemetryHistory::default(),
            unsent: TelemetryHistory::default(),
            slow: TelemetryHistory::default(),
            slow_unsent: TelemetryHistory::default(),
            slow_clock: SlowClock::default(),
            section_of: PointFinder::default(),
            section: Unsent::new(MAX_SECTION),
            ratio: RunningRatio::default(),
            spectra: Spectra::default(),
            points: Unsent::new(MAX_POINTS),
            transients: Unsent::new(MAX_POINTS),
            impacts: Unsent::new(MAX_IMPACTS),
            log: Unsent::new(MAX_LOG),
            restart: false,
            changed: true,
            pace: VecDeque::new(),
            lost: SensorSet::default(),
            rows_at: None,
            heard_at: None,
            is_gap: false,
        };
        live.watch(live.watched.clone());
        live
    }

    /// Takes an update. Returns whether what is watched has changed, so that every viewer needs a new snapshot.
    pub(super) fn take(&mut self, update: Update) -> bool {
        self.changed = true;
        match update {
            Update::Watch(watched) => {
                self.watch(*watched);
                return true;
            }
            Update::Forget => {
                self.points.clear();
                self.transients.clear();
                self.state.points_taken = 0;
            }
            Update::Restart => self.restart(),
            Update::Activity(activity, headline) => {
                (self.state.activity, self.state.headline) = (activity, headline);
                if activity == Activity::Over {
                    self.state.left = None;
                }
            }
            Update::Experiment { set_up, experiment, clearance_m } => {
                self.is_gap = true;
                self.state.limits.clearance_m = clearance_m;
                (self.state.set_up, self.state.experiment) = (Some(set_up), Some(experiment));
            }
            Update::Rows { t_s, values, longest_step_s } => self.rows(&t_s, &values, longest_step_s),
            Update::Values { rig_s, tick, values } => self.values(rig_s, tick, &values),
            Update::Progress(rig_s) => self.state.rig_s = rig_s,
            Update::TimeLeft(left) => self.state.left = Some(left.into()),
            Update::LostSensors(lost) => {
                self.lost = lost;
                self.forget_lost();
            }
            Update::Point(point) => self.point(point),
            Update::Transient(transient) => {
                self.transients.push(transient);
                self.state.points_taken += 1;
            }
            Update::Impact(impact) => self.impacts.push(impact),
            Update::Link(link) => self.state.link = LinkState { rows: self.state.link.rows, ..link },
            Update::Fault(fault) => {
                if let Some(fault) = &fault
                    && self.state.fault.as_ref() != Some(fault)
                {
                    self.note(Level::Fault, fault.what.clone());
                }
                self.state.fault = fault;
            }
            Update::Injected(what) => self.state.injected = what,
            Update::Replay(replay) => self.state.replay = Some(replay),
            Update::Log(level, text) => self.note(level, text),
            Update::Join(_) | Update::End => {}
        }
        false
    }

    fn watch(&mut self, watched: Watched) {
        self.row_names = watched.signals.iter().map(|signal| signal.name.clone()).collect();
        self.state.points_planned = watched.points_planned;
        self.state.limits = watched.limits;
        self.watched = watched;
        self.restart();
    }

    fn restart(&mut self) {
        let width = self.row_names.len();
        (self.recent, self.unsent) = (TelemetryHistory::new(width), TelemetryHistory::new(width));
        (self.slow, self.slow_unsent) = (TelemetryHistory::new(SLOW.len()), TelemetryHistory::new(SLOW.len()));
        self.slow_clock = SlowClock::default();
        self.section_of = PointFinder::new(&self.row_names);
        self.section.clear();
        self.ratio.clear();
        self.spectra.list.clear();
        self.impacts.clear();
        self.pace.clear();
        // They are of another time.
        self.state.numbers = Numbers::default();
        self.restart = true;
    }

    fn rows(&mut self, t_s: &[f64], values: &[f32], longest_step_s: f64) {
        let width = self.row_names.len();
        if width == 0 {
            return;
        }
        for (&t, row) in t_s.iter().zip(values.chunks_exact(width)) {
            if let Some(last) = self.recent.last_s() {
                if t <= last {
                    // A row of a segment before, or one that came twice.
                    continue;
                }
                if self.is_gap || t - last > longest_step_s {
                    self.section_of.restart();
                    self.recent.push_gap(last);
                    self.unsent.push_gap(last);
                }
            }
            self.is_gap = false;
            self.recent.push(t, row);
            self.unsent.push(t, row);
            self.section_of.push(t, row).into_iter().for_each(|point| self.section.push(point));
        }
        self.rows_at = Some(Instant::now());
        self.heard_at = self.rows_at;
        self.state.link.rows += t_s.len() as u64;
        self.recent.bound(MAX_ROWS);
        self.unsent.bound(MAX_ROWS);
    }

    fn values(&mut self, rig_s: f64, tick: u32, values: &[f32]) {
        let is_at_work = matches!(self.state.activity, Activity::Running | Activity::Held);
        let mut numbers = Numbers::of(&self.watched.table, values, is_at_work, |name| self.mean(name));
        numbers.tick = Some(tick);
        match (numbers.get("frequency_hz"), numbers.get("x_over_z_lock_in")) {
            (Some(drive_hz), Some(ratio)) => self.ratio.push(rig_s, drive_hz, ratio),
            _ => self.ratio.clear(),
        }
        numbers.forget(&["x_over_z_lock_in"]);
        numbers.add("x_over_z_lock_in", self.ratio.median());
        numbers.add("x_over_z_spread", self.ratio.spread());
        numbers.add("max_abs_x_m", self.max_abs_x_m());
        self.state.numbers = numbers;
        self.heard_at = Some(Instant::now());
        self.forget_lost();
        let row = SLOW.map(|key| self.state.numbers.get(key).unwrap_or(f32::NAN));
        let t_s = self.slow_clock.time_s(rig_s);
        self.slow.push(t_s, &row);
        self.slow_unsent.push(t_s, &row);
        self.slow.bound(MAX_VALUES);
        self.slow_unsent.bound(MAX_VALUES);
    }

    /// Mean of a recorded signal over the last second, while rows arrive.
    fn mean(&self, name: &str) -> Option<f32> {
        self.recent.mean_since(self.arriving(name)?, self.recent.last_s()? - MEAN_OVER.as_secs_f64())
    }

    /// Largest |x| of the last seconds, m, while rows arrive.
    fn max_abs_x_m(&self) -> Option<f32> {
        self.recent.largest_since(self.arriving("x")?, self.recent.last_s()? - LARGEST_OVER_S)
    }

    /// Column of a recorded signal, while rows arrive.
    fn arriving(&self, name: &str) -> Option<usize> {
        self.rows_at.filter(|at| at.elapsed() < MEAN_OVER)?;
        self.column(name)
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.row_names.iter().position(|known| known == name)
    }

    /// Removes the numbers of sensors without a signal, and raises the alarms.
    fn forget_lost(&mut self) {
        self.state.numbers.forget_sensors(self.lost);
        self.state.alarms = self.state.numbers.alarms(self.lost);
    }

    /// The present state, with the age of the newest sample.
    fn state(&self) -> State {
        let age_s = match (self.state.replay, self.recent.last_s()) {
            (Some(replay), last_s) => last_s.map(|last_s| (replay.t_s - last_s).max(0.0)),
            (None, _) => self.heard_at.map(|at| at.elapsed().as_secs_f64()),
        };
        State { age_s, ..self.state.clone() }
    }

    fn point(&mut self, point: MeasuredPoint) {
        let is_same =
            |p: &MeasuredPoint| p.set_up == point.set_up && p.experiment == point.experiment && p.index == point.index;
        // A point that is measured again replaces the earlier result.
        let earlier = self.points.iter().position(is_same);
        match earlier {
            Some(at) => self.points.remove(at),
            None => self.state.points_taken += 1,
        }
        self.points.push(point);
    }

    fn note(&mut self, level: Level, text: String) {
        let at = match self.state.replay {
            Some(replay) => duration(replay.t_s),
            None => host_time::now().strftime("%H:%M:%S").to_string(),
        };
        // What was wrong is kept longest.
        let oldest = self.log.iter().position(|line| line.level == Level::Info);
        if let Some(oldest) = oldest.filter(|_| self.log.iter().count() == MAX_LOG) {
            self.log.remove(oldest);
        }
        self.log.push(LogLine { at, level, text });
    }

    /// Adds the counts that the monitor has itself.
    pub(super) fn count(&mut self, viewers: usize, skipped: u64) {
        self.changed |= self.state.link.viewers != viewers;
        (self.state.link.viewers, self.state.link.skipped_frames) = (viewers, skipped);
    }

    /// Whether there is anything new to send.
    pub(super) fn has_changed(&self) -> bool {
        self.changed
    }

    /// What is new since the last frame.
    pub(super) fn frame(&mut self) -> ViewerUpdate {
        self.measure_pace();
        if let Some(column) = self.column("x") {
            let drive_hz = self.state.numbers.get("frequency_hz").map_or(0.0, f64::from);
            self.spectra.follow(&self.recent, column, drive_hz);
        }
        self.changed = false;
        let news = News {
            points: self.points.take_new(),
            transients: self.transients.take_new(),
            impacts: self.impacts.take_new(),
            section: self.section.take_new(),
            spectra: self.spectra.list.take_new(),
            log: self.log.take_new(),
            rows: self.unsent.columns(&self.row_names, self.most_rows(FRAME_ROWS), TAIL),
            slow: self.slow_unsent.columns(&slow_names(), FRAME_ROWS, TAIL),
        };
        self.unsent.clear();
        self.slow_unsent.clear();
        ViewerUpdate { restart: std::mem::take(&mut self.restart), news, state: self.state() }
    }

    /// Everything for a new viewer. What has not been sent in a frame yet comes again in the next one, so a snapshot is taken
    /// just after a frame.
    pub(super) fn snapshot(&self) -> Snapshot {
        Snapshot {
            version: crate::VERSION_LINE.to_string(),
            source: self.watched.source.clone(),
            can_control: self.permissions.can_control,
            can_inject: self.permissions.can_inject,
            is_replay: self.watched.source.kind == SourceKind::Replay,
            where_to_stop: self.permissions.where_to_stop.clone(),
            signals: self.watched.signals.clone(),
            curves: self.watched.curves.clone(),
            news: News {
                points: self.points.everything(),
                transients: self.transients.everything(),
                impacts: self.impacts.everything(),
                section: self.section.everything(),
                spectra: self.spectra.list.everything(),
                log: self.log.everything(),
                rows: self.recent.columns(&self.row_names, self.most_rows(SNAPSHOT_ROWS), TAIL),
                slow: self.slow.columns(&slow_names(), SNAPSHOT_VALUES, TAIL),
            },
            state: self.state(),
        }
    }

    /// Most rows of a message. A replay that stands or goes slowly shows every row: its times are looked at closely, and extremes
    /// have the times of their bucket.
    fn most_rows(&self, usual: usize) -> usize {
        let is_slow = self.state.replay.is_some_and(|replay| replay.paused || replay.speed <= SLOW_REPLAY);
        if is_slow { 2 * MAX_ROWS } else { usual }
    }

    /// Measures how fast rig time passes.
    fn measure_pace(&mut self) {
        let now = Instant::now();
        self.pace.push_back((now, self.state.rig_s));
        while self.pace.len() > 2 && now - self.pace[1].0 > PACE_OVER {
            self.pace.pop_front();
        }
        let (then, rig_s) = self.pace[0];
        let wall_s = (now - then).as_secs_f64();
        let passed = self.state.rig_s - rig_s;
        self.state.speed = (wall_s > 0.5 && passed > 0.0).then_some(passed / wall_s);
    }
}

fn slow_names() -> Vec<String> {
    SLOW.map(String::from).into()
}
