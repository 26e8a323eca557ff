//! What the monitor knows at present: the recent past, bounded, and what has not been sent yet.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use damprig_core::control::fault::FaultCause;
use damprig_core::control::friction_spring::SpringStage;
use damprig_core::control::outcome::ExperimentStage;
use damprig_core::control::safety::SafeStage;
use damprig_core::io::{Sensor, SensorSet};

use super::Permissions;
use super::feed::{Update, Watched};
use super::history::History;
use super::message::{
    Activity, Frame, Impact, Level, Limits, LinkState, Log, News, Numbers, Point, Snapshot, Source, SourceKind, State,
    Transient,
};
use super::running_ratio::RunningRatio;
use super::section::Section;
use super::spectrum::Spectrum;
use super::unsent::Unsent;
use super::words;
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

/// Spectra that are kept, and the time from one to the next.
const MAX_SPECTRA: usize = 60;
const SPECTRUM_EVERY: Duration = Duration::from_millis(500);

/// Time over which the pace of rig time is measured.
const PACE_OVER: Duration = Duration::from_secs(2);

/// Fastest replay that shows every row, rig seconds per second.
const SLOW_REPLAY: f64 = 2.0;

/// Time over which x and z are averaged while nothing is driven.
const MEAN_OVER: Duration = Duration::from_secs(1);

/// Time over which the largest |x| and |z| are taken, s.
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

/// Signals of a cycle of the drive.
const OF_A_CYCLE: [&str; 6] =
    ["x_over_z_lock_in", "x_amplitude", "x_phase", "z_amplitude", "z_phase", "impacts_in_cycle"];

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
    recent: History,
    unsent: History,
    slow: History,
    slow_unsent: History,
    slow_clock: SlowClock,
    section_of: Section,
    section: Unsent<(f32, f32, f32)>,
    ratio: RunningRatio,
    spectra: Unsent<Spectrum>,
    /// When the last spectrum was computed.
    spectrum_at: Option<Instant>,
    points: Unsent<Point>,
    transients: Unsent<Transient>,
    impacts: Unsent<Impact>,
    log: Unsent<Log>,
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
                limits: Limits::default(),
            },
            row_names: Vec::new(),
            state: State::default(),
            recent: History::default(),
            unsent: History::default(),
            slow: History::default(),
            slow_unsent: History::default(),
            slow_clock: SlowClock::default(),
            section_of: Section::default(),
            section: Unsent::new(MAX_SECTION),
            ratio: RunningRatio::default(),
            spectra: Unsent::new(MAX_SPECTRA),
            spectrum_at: None,
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
        (self.recent, self.unsent) = (History::new(width), History::new(width));
        (self.slow, self.slow_unsent) = (History::new(SLOW.len()), History::new(SLOW.len()));
        self.slow_clock = SlowClock::default();
        self.section_of = Section::new(&self.row_names);
        self.section.clear();
        self.ratio.clear();
        self.spectra.clear();
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
        let table = &self.watched.table;
        let value = |name: &str| {
            let at = table.iter().position(|known| known.name == name)?;
            values.get(at).copied().filter(|value| value.is_finite())
        };
        // Without a drive, and in the first cycle, the controller's amplitudes are 0: nothing is measured.
        let is_driven = value("frequency").is_some_and(|hz| hz > 0.0) && value("z_amplitude") != Some(0.0);
        let is_at_work = matches!(self.state.activity, Activity::Running | Activity::Held);
        let index = |name: &str| value(name).map(|index| index as usize);
        let mut numbers = Numbers {
            tick: Some(tick),
            twin_alarm: value("twin_alarm") == Some(1.0),
            spring_stage: index("spring_stage").and_then(|i| SpringStage::ALL.get(i)).map(|stage| stage.text()),
            safety: index("safety").and_then(|i| SafeStage::ALL.get(i)).map(|stage| stage.text()),
            stage: index("stage").and_then(|i| ExperimentStage::ALL.get(i.wrapping_sub(1))).map(|stage| stage.text()),
            ..Numbers::default()
        };
        for signal in table {
            let own = value(&signal.name);
            match signal.name.as_str() {
                "twin_alarm" | "spring_stage" | "safety" | "stage" => {}
                "x" | "z" if is_driven || is_at_work => {}
                name @ ("x" | "z") => numbers.add(format!("{name}_mean_m"), self.mean(name).or(own)),
                name if OF_A_CYCLE.contains(&name) => numbers.add(signal.key(), own.filter(|_| is_driven)),
                // Exactly 0 without a twin.
                "twin_residual" => numbers.add(signal.key(), own.filter(|residual| *residual > 0.0)),
                _ => numbers.add(signal.key(), own),
            }
        }
        match (value("frequency"), numbers.get("x_over_z_lock_in")) {
            (Some(drive_hz), Some(ratio)) if is_driven => self.ratio.push(rig_s, drive_hz, ratio),
            _ => self.ratio.clear(),
        }
        numbers.add("x_over_z_lock_in", self.ratio.median());
        numbers.add("x_over_z_spread", self.ratio.spread());
        for (key, name) in [("x_largest_m", "x"), ("z_largest_m", "z")] {
            numbers.add(key, self.largest(name));
        }
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
        let column = self.row_names.iter().position(|known| known == name)?;
        self.rows_at.filter(|at| at.elapsed() < MEAN_OVER)?;
        self.recent.mean_since(column, self.recent.last_s()? - MEAN_OVER.as_secs_f64())
    }

    /// Largest absolute value of a recorded signal over the last seconds, while rows arrive.
    fn largest(&self, name: &str) -> Option<f32> {
        let column = self.row_names.iter().position(|known| known == name)?;
        self.rows_at.filter(|at| at.elapsed() < MEAN_OVER)?;
        self.recent.largest_since(column, self.recent.last_s()? - LARGEST_OVER_S)
    }

    /// Adds a spectrum of the newest x, when it is time for one and rows have come.
    fn add_spectrum(&mut self) {
        let (Some(column), Some(last_s)) = (self.row_names.iter().position(|known| known == "x"), self.recent.last_s())
        else {
            return;
        };
        let has_news = self.spectra.iter().last().is_none_or(|last| last.t_s < last_s);
        if !has_news || self.spectrum_at.is_some_and(|at| at.elapsed() < SPECTRUM_EVERY) {
            return;
        }
        let drive_hz = self.state.numbers.get("frequency_hz").map_or(0.0, f64::from);
        let (x_m, step_s) = self.recent.unbroken(column);
        self.spectrum_at = Some(Instant::now());
        Spectrum::of(&x_m, last_s, step_s, drive_hz).into_iter().for_each(|spectrum| self.spectra.push(spectrum));
    }

    /// Removes the numbers of sensors without a signal, and raises the alarms.
    fn forget_lost(&mut self) {
        for sensor in Sensor::ALL.into_iter().filter(|sensor| self.lost.contains(*sensor)) {
            let own: &[&str] = match sensor {
                Sensor::X => &[
                    "x_amplitude_m",
                    "x_largest_m",
                    "x_mean_m",
                    "x_over_z_lock_in",
                    "x_over_z_spread",
                    "x_peak_m",
                    "x_phase_rad",
                    "x_velocity_m_per_s",
                ],
                Sensor::Z => &[
                    "base_amplitude_m",
                    "x_over_z_lock_in",
                    "x_over_z_spread",
                    "x_phase_rad",
                    "z_amplitude_m",
                    "z_largest_m",
                    "z_mean_m",
                    "z_phase_rad",
                ],
                Sensor::SpringForce => &["spring_force_n"],
                Sensor::WallLow => &["wall_low_n"],
                Sensor::WallHigh => &["wall_high_n"],
            };
            self.state.numbers.forget(own);
        }
        self.state.alarms = alarms(&self.state.numbers, self.lost);
    }

    /// The present state, with the age of the newest sample.
    fn state(&self) -> State {
        let age_s = match (self.state.replay, self.recent.last_s()) {
            (Some(replay), last_s) => last_s.map(|last_s| (replay.t_s - last_s).max(0.0)),
            (None, _) => self.heard_at.map(|at| at.elapsed().as_secs_f64()),
        };
        State { age_s, ..self.state.clone() }
    }

    fn point(&mut self, point: Point) {
        let is_same =
            |p: &Point| p.set_up == point.set_up && p.experiment == point.experiment && p.index == point.index;
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
        self.add_spectrum();
        self.changed = false;
        let news = News {
            points: self.points.take_new(),
            transients: self.transients.take_new(),
            impacts: self.impacts.take_new(),
            section: self.section.take_new(),
            spectra: self.spectra.take_new(),
            log: self.log.take_new(),
            rows: self.unsent.columns(&self.row_names, self.most_rows(FRAME_ROWS), TAIL),
            slow: self.slow_unsent.columns(&slow_names(), FRAME_ROWS, TAIL),
        };
        self.unsent.clear();
        self.slow_unsent.clear();
        Frame { restart: std::mem::take(&mut self.restart), news, state: self.state() }
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
                spectra: self.spectra.everything(),
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

/// Alarms that follow from the controller's numbers and the sensors without a signal.
fn alarms(numbers: &Numbers, lost: SensorSet) -> Vec<String> {
    let count = |key: &str| numbers.get(key).unwrap_or(0.0) as u64;
    let lost = Sensor::ALL.into_iter().filter(|sensor| lost.contains(*sensor));
    let mut alarms: Vec<String> = lost.map(|sensor| words::sentence(FaultCause::SensorAtRail(sensor).text())).collect();
    if numbers.twin_alarm {
        alarms.push(format!(
            "Impacts are missing: the twin predicted {}, {} were measured, {} are missing. Check the walls' force sensors.",
            count("twin_predicted"),
            count("twin_detected"),
            count("twin_missing")
        ));
    }
    alarms
}
