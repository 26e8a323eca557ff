//! What the monitor knows at present: the recent past, bounded, and what has not been sent yet.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use damprig_core::control::friction_spring::SpringStage;
use damprig_core::control::safety::SafeStage;

use super::Permissions;
use super::feed::{Update, Watched};
use super::history::History;
use super::message::{
    Frame, Impact, Level, Limits, LinkState, Log, News, Numbers, Point, Snapshot, Source, SourceKind, State, Transient,
};
use super::section::Section;
use crate::host_time;

/// Rows kept for new viewers: 20 s at 1 kHz.
const MOST_ROWS: usize = 20_000;

/// Entries of rows in a snapshot, and in a frame; the newest of them are not reduced.
const SNAPSHOT_ROWS: usize = 4000;
const FRAME_ROWS: usize = 400;
const TAIL: usize = 200;

/// Values of the controller kept for new viewers: five minutes at 10 Hz; and entries in a snapshot.
const MOST_VALUES: usize = 3000;
const SNAPSHOT_VALUES: usize = 1200;

/// Points, impacts, Poincaré points and lines of the log that are kept.
const MOST_POINTS: usize = 20_000;
const MOST_IMPACTS: usize = 2000;
const MOST_SECTION: usize = 1000;
const MOST_LOG: usize = 200;

/// Time over which the pace of rig time is measured.
const PACE_OVER: Duration = Duration::from_secs(2);

/// The controller's numbers that are shown over time: name in the signal table and name in the message.
const SLOW: [(&str, &str); 9] = [
    ("x_over_z_lock_in", "x_over_z_lock_in"),
    ("x_amplitude", "x_amplitude_m"),
    ("z_amplitude", "z_amplitude_m"),
    ("impacts_in_cycle", "impacts_in_cycle"),
    ("twin_residual", "twin_residual_m"),
    ("spring_force", "spring_force_n"),
    ("spring_target", "spring_target_n"),
    ("wall_low", "wall_low_n"),
    ("wall_high", "wall_high_n"),
];

/// Place of the twin's residual in [`SLOW`].
const RESIDUAL: usize = 4;

/// A bounded list of which the newest entries have not been sent yet.
#[derive(Debug)]
struct Kept<T> {
    all: VecDeque<T>,
    most: usize,
    new: usize,
}

impl<T: Clone> Kept<T> {
    fn new(most: usize) -> Self {
        Self { all: VecDeque::new(), most, new: 0 }
    }

    fn push(&mut self, value: T) {
        if self.all.len() == self.most {
            self.all.pop_front();
        }
        self.all.push_back(value);
        self.new = (self.new + 1).min(self.all.len());
    }

    fn remove(&mut self, at: usize) {
        let is_new = at >= self.all.len() - self.new;
        self.all.remove(at);
        self.new -= usize::from(is_new);
    }

    fn clear(&mut self) {
        self.all.clear();
        self.new = 0;
    }

    fn take_new(&mut self) -> Vec<T> {
        let new = self.all.iter().skip(self.all.len() - self.new).cloned().collect();
        self.new = 0;
        new
    }

    fn everything(&self) -> Vec<T> {
        self.all.iter().cloned().collect()
    }
}

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
    /// Columns of [`SLOW`] in the device's table.
    slow_at: Vec<Option<usize>>,
    state: State,
    recent: History,
    unsent: History,
    slow: History,
    slow_unsent: History,
    slow_clock: SlowClock,
    section_of: Section,
    section: Kept<(f32, f32, f32)>,
    points: Kept<Point>,
    transients: Kept<Transient>,
    impacts: Kept<Impact>,
    log: Kept<Log>,
    restart: bool,
    changed: bool,
    pace: VecDeque<(Instant, f64)>,
}

impl Live {
    pub(super) fn new(permissions: Permissions) -> Self {
        let source = Source {
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
                expected_s: None,
                limits: Limits::default(),
            },
            row_names: Vec::new(),
            slow_at: Vec::new(),
            state: State::default(),
            recent: History::default(),
            unsent: History::default(),
            slow: History::default(),
            slow_unsent: History::default(),
            slow_clock: SlowClock::default(),
            section_of: Section::default(),
            section: Kept::new(MOST_SECTION),
            points: Kept::new(MOST_POINTS),
            transients: Kept::new(MOST_POINTS),
            impacts: Kept::new(MOST_IMPACTS),
            log: Kept::new(MOST_LOG),
            restart: false,
            changed: true,
            pace: VecDeque::new(),
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
            }
            Update::Experiment { set_up, experiment, clearance_m } => {
                self.state.limits.clearance_m = clearance_m;
                (self.state.set_up, self.state.experiment) = (Some(set_up), Some(experiment));
            }
            Update::Rows { t_s, values, longest_step_s } => self.rows(&t_s, &values, longest_step_s),
            Update::Values { rig_s, tick, values } => self.values(rig_s, tick, &values),
            Update::Progress(rig_s) => self.progress(rig_s),
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
        let at = |(name, _): &(&str, &str)| watched.table.iter().position(|known| known == name);
        self.slow_at = SLOW.iter().map(at).collect();
        self.state.points_planned = watched.points_planned;
        self.state.limits = watched.limits;
        self.watched = watched;
        self.restart();
    }

    fn restart(&mut self) {
        let width = self.row_names.len();
        (self.recent, self.unsent) = (History::new(width), History::new(width));
        (self.slow, self.slow_unsent) = (History::new(SLOW.len()), History::new(SLOW.len()));
        self.slow_clock = SlowClock::default();
        self.section_of = Section::new(&self.row_names);
        self.section.clear();
        self.impacts.clear();
        self.pace.clear();
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
                if t - last > longest_step_s {
                    self.section_of.restart();
                    self.recent.push_gap(last);
                    self.unsent.push_gap(last);
                }
            }
            self.recent.push(t, row);
            self.unsent.push(t, row);
            self.section_of.push(t, row).into_iter().for_each(|point| self.section.push(point));
        }
        self.state.link.rows += t_s.len() as u64;
        self.recent.bound(MOST_ROWS);
        self.unsent.bound(MOST_ROWS);
    }

    fn values(&mut self, rig_s: f64, tick: u32, values: &[f32]) {
        let table = &self.watched.table;
        let value = |name: &str| {
            let at = table.iter().position(|known| known == name)?;
            values.get(at).copied().filter(|value| value.is_finite())
        };
        let index = |name: &str| value(name).map(|index| index as usize);
        self.state.numbers = Numbers {
            tick: Some(tick),
            frequency_hz: value("frequency"),
            x_over_z_lock_in: value("x_over_z_lock_in"),
            x_amplitude_m: value("x_amplitude"),
            x_phase_rad: value("x_phase"),
            z_amplitude_m: value("z_amplitude"),
            z_phase_rad: value("z_phase"),
            impacts_in_cycle: value("impacts_in_cycle"),
            impacts: value("impacts"),
            // Exactly 0 without a twin.
            twin_residual_m: value("twin_residual").filter(|residual| *residual > 0.0),
            twin_predicted: value("twin_predicted"),
            twin_detected: value("twin_detected"),
            twin_missing: value("twin_missing"),
            twin_alarm: value("twin_alarm") == Some(1.0),
            spring_force_n: value("spring_force"),
            spring_target_n: value("spring_target"),
            spring_position_m: value("spring_position"),
            spring_stage: index("spring_stage").and_then(|i| SpringStage::ALL.get(i)).map(|stage| stage.text()),
            wall_low_n: value("wall_low"),
            wall_high_n: value("wall_high"),
            safety: index("safety").and_then(|i| SafeStage::ALL.get(i)).map(|stage| stage.text()),
        };
        self.state.alarms = alarms(&self.state.numbers);
        let mut row: Vec<f32> =
            self.slow_at.iter().map(|at| at.and_then(|at| values.get(at)).copied().unwrap_or(f32::NAN)).collect();
        row[RESIDUAL] = self.state.numbers.twin_residual_m.unwrap_or(f32::NAN);
        let t_s = self.slow_clock.time_s(rig_s);
        self.slow.push(t_s, &row);
        self.slow_unsent.push(t_s, &row);
        self.slow.bound(MOST_VALUES);
        self.slow_unsent.bound(MOST_VALUES);
    }

    fn progress(&mut self, rig_s: f64) {
        self.state.rig_s = rig_s;
        self.state.left_s = self.watched.expected_s.map(|expected_s| (expected_s - rig_s).max(0.0));
    }

    fn point(&mut self, point: Point) {
        let is_same = |p: &Point| {
            p.set_up == point.set_up && p.experiment == point.experiment && p.frequency_hz == point.frequency_hz
        };
        // A point that is measured again replaces the earlier result.
        match self.points.all.iter().position(is_same) {
            Some(at) => self.points.remove(at),
            None => self.state.points_taken += 1,
        }
        self.points.push(point);
    }

    fn note(&mut self, level: Level, text: String) {
        let at = host_time::now().strftime("%H:%M:%S").to_string();
        self.log.push(Log { at, level, text });
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
    pub(super) fn frame(&mut self) -> Frame {
        self.measure_pace();
        self.changed = false;
        let news = News {
            points: self.points.take_new(),
            transients: self.transients.take_new(),
            impacts: self.impacts.take_new(),
            section: self.section.take_new(),
            log: self.log.take_new(),
            rows: self.unsent.columns(&self.row_names, FRAME_ROWS, TAIL),
            slow: self.slow_unsent.columns(&slow_names(), FRAME_ROWS, TAIL),
        };
        self.unsent.clear();
        self.slow_unsent.clear();
        Frame { restart: std::mem::take(&mut self.restart), news, state: self.state.clone() }
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
                log: self.log.everything(),
                rows: self.recent.columns(&self.row_names, SNAPSHOT_ROWS, TAIL),
                slow: self.slow.columns(&slow_names(), SNAPSHOT_VALUES, TAIL),
            },
            state: self.state.clone(),
        }
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
    SLOW.iter().map(|(_, name)| (*name).to_string()).collect()
}

/// Alarms that follow from the controller's numbers.
fn alarms(numbers: &Numbers) -> Vec<String> {
    let count = |value: Option<f32>| value.unwrap_or(0.0) as u64;
    let mut alarms = Vec::new();
    if numbers.twin_alarm {
        alarms.push(format!(
            "Impacts are missing: the twin predicted {}, {} were measured, {} are missing. Check the walls' force sensors.",
            count(numbers.twin_predicted),
            count(numbers.twin_detected),
            count(numbers.twin_missing)
        ));
    }
    alarms
}
