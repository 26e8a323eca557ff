//! A run folder as a source of the monitor: follows one that another program is recording, or replays one that is over.
//!
//! Nothing here writes to the folder. Rows come from the sample files in their order; results, impacts and events come from the
//! journal, each when the rows have reached its tick.

use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use arrow_array::RecordBatch;
use damprig_core::io::TICK_HZ;
use damprig_core::measure::running::{DriveReference, RunningLockIn};

use super::control::Asked;
use super::feed::{Feed, Update, Watched};
use super::message::{Action, Activity, Impact, Level, Limits, LinkState, ReplayState, SignalName, Source, SourceKind};
use super::run::{curves, point, transient};
use super::words;
use crate::campaign::Campaign;
use crate::prediction::Predicted;
use crate::run_folder::journal::{self, Entry};
use crate::run_folder::read::columns::{numbers, texts};
use crate::run_folder::read::sample_files::{read_samples, sample_files};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::manifest::Manifest;
use crate::run_folder::schema::samples::SampleColumn;
use crate::run_folder::schema::segment_id::SegmentId;
use crate::run_folder::{ReadError, RunFolder};

/// Time between two looks at a growing folder.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Time from one part of a replay to the next.
const STEP: Duration = Duration::from_millis(40);

/// Rig time shown before the present when a replay is moved, s.
const BEFORE_S: f64 = 20.0;

/// Longest run that is replayed: ten years.
const LONGEST_S: f64 = 3.2e8;

/// Slowest and fastest replay, rig seconds per second.
pub const REPLAY_SPEEDS: (f64, f64) = (0.01, 1000.0);

/// Watches a run folder until `stop` is set: follows it while it grows, or replays it with this many rig seconds per second.
///
/// # Errors
/// The folder holds no run, or its manifest or samples cannot be read.
pub fn watch(
    path: &Path,
    speed: f64,
    feed: &Feed,
    actions: &Receiver<Asked>,
    stop: &AtomicBool,
) -> Result<(), ReadError> {
    let run = RunFolder::open(path)?;
    let grows = journal::is_being_written(path) == Some(true);
    let kind = if grows { SourceKind::Folder } else { SourceKind::Replay };
    let (watched, warning) = describe(&run, kind);
    feed.send(Update::Watch(Box::new(watched.clone())));
    warning.into_iter().for_each(|text| feed.log(Level::Warning, text));
    let mut reader = Reader::new(path, run.manifest().clone(), feed.clone(), watched);
    if grows { reader.follow(actions, stop) } else { reader.replay(speed, actions, stop) }
}

/// What is watched, and why the prediction is missing.
fn describe(run: &RunFolder, kind: SourceKind) -> (Watched, Option<String>) {
    let manifest = run.manifest();
    let device = manifest.device.as_ref();
    let signals: Vec<SignalName> = manifest.signals.iter().map(signal).collect();
    let predicted = Campaign::read(&run.path().join("campaign.toml")).and_then(|mut campaign| {
        if let Some(settings) = device.and_then(|device| device.settings.as_ref()) {
            campaign.on_board(&settings.settings, device.is_some_and(|device| device.simulated))?;
        }
        let predicted = Predicted::of(&campaign)?;
        let limits = Limits {
            x_m: Some(campaign.rig.structure_limit_m()),
            z_m: Some(campaign.rig.base_limit_m()),
            wall_force_n: Some(f64::from(campaign.rig.acting.wall_force_n)).filter(|limit| *limit > 0.0),
            clearance_m: None,
        };
        Ok((curves(&campaign, &predicted), limits, campaign.expected_s()))
    });
    let (warning, predicted) = match predicted {
        Ok(predicted) => (None, Some(predicted)),
        Err(refusal) => {
            let first = refusal.to_string().lines().next().unwrap_or_default().to_string();
            (Some(format!("Without a prediction: the copy of the campaign cannot be used: {first}")), None)
        }
    };
    let (curves, limits, expected_s) = predicted.unwrap_or_default();
    let watched = Watched {
        source: Source {
            kind,
            name: manifest.campaign.clone(),
            rig: device.map_or_else(String::new, |device| device.link.clone()),
            board: device.map_or_else(String::new, |device| device.board.clone()),
            folder: Some(run.path().display().to_string()),
        },
        // What was recorded comes first, so it is preferred to what is computed again.
        table: signals.iter().map(|s| s.name.clone()).chain(Recomputed::NAMES.map(String::from)).collect(),
        signals,
        curves,
        points_planned: manifest.points_planned,
        expected_s: (kind == SourceKind::Folder).then_some(expected_s),
        limits,
    };
    (watched, warning)
}

/// The device's name of a recorded column: `x` for `x_m`.
fn signal(column: &SampleColumn) -> SignalName {
    let unit = column.unit.to_lowercase().replace('/', "_per_");
    let name = column.name.strip_suffix(&format!("_{unit}")).filter(|_| !unit.is_empty()).unwrap_or(&column.name);
    SignalName { name: name.to_string(), unit: column.unit.clone() }
}

/// Amplitudes and phase of the recorded x and z at the drive frequency, as the controller computed them during the run.
#[derive(Debug)]
struct Recomputed {
    /// Columns of x and z.
    at: Option<(usize, usize)>,
    lock_in: RunningLockIn,
    frequency_hz: f64,
    /// Cycles of the drive since the last row that was used, below 1.
    phase: f64,
    last_s: f64,
}

impl Recomputed {
    /// Names of its values in the device's table.
    const NAMES: [&str; 5] = ["frequency", "x_amplitude", "x_phase", "z_amplitude", "x_over_z"];

    fn new(signals: &[SignalName]) -> Self {
        let at = |name: &str| signals.iter().position(|signal| signal.name == name);
        Self { at: at("x").zip(at("z")), lock_in: RunningLockIn::default(), frequency_hz: 0.0, phase: 0.0, last_s: 0.0 }
    }

    fn push(&mut self, t_s: f64, frequency_hz: f64, row: &[f32]) {
        let Some((x, z)) = self.at else { return };
        let step = frequency_hz * (t_s - self.last_s);
        self.last_s = t_s;
        // Another frequency, or a gap, begins a new cycle.
        if frequency_hz != self.frequency_hz || !(0.0..0.5).contains(&step) {
            self.lock_in.push(0.0, 0.0, None);
            (self.frequency_hz, self.phase) = (frequency_hz, 0.0);
            return;
        }
        self.phase += step;
        let cycle_ended = self.phase >= 1.0;
        self.phase = self.phase.fract();
        let (sine, cosine) = (TAU * self.phase).sin_cos();
        let reference = DriveReference { wave: (sine as f32, cosine as f32), cycle_ended };
        self.lock_in.push(row[x], row[z], Some(reference));
    }

    fn values(&self) -> [f32; 5] {
        let motion = self.lock_in.motion();
        let values = [motion.x_amplitude_m, motion.x_phase_rad, motion.z_amplitude_m, motion.x_over_z];
        let frequency_hz = if self.frequency_hz > 0.0 { self.frequency_hz as f32 } else { f32::NAN };
        // Unknown before the first whole cycle.
        let [a, b, c, d] = if motion.z_amplitude_m > 0.0 { values } else { [f32::NAN; 4] };
        [frequency_hz, a, b, c, d]
    }
}

/// A row's place: its segment and tick.
#[derive(Clone, Debug, PartialEq)]
struct Place {
    id: SegmentId,
    tick: u64,
}

/// Reads a run folder and tells the feed.
struct Reader {
    path: PathBuf,
    manifest: Manifest,
    feed: Feed,
    watched: Watched,
    link: LinkState,
    /// Columns of the samples' files.
    columns: Vec<String>,
    longest_step_s: f64,
    /// The last row told, and its time, s.
    last: Option<(Place, f64)>,
    /// Rig time at tick 0 of its segment, s.
    base_s: f64,
    recomputed: Recomputed,
    /// Journal entries whose tick the rows have not reached.
    waiting: VecDeque<Entry>,
    /// Entries of the journal that were read, and the segments among them.
    entries: usize,
    segments: Vec<SegmentId>,
}

impl Reader {
    fn new(path: &Path, manifest: Manifest, feed: Feed, watched: Watched) -> Self {
        let every = manifest.every_ticks().unwrap_or(1) as f64;
        let link = LinkState { name: watched.source.rig.clone(), state: "recorded".into(), ..LinkState::default() };
        Self {
            recomputed: Recomputed::new(&watched.signals),
            path: path.to_path_buf(),
            columns: manifest.signals.iter().map(|column| column.name.clone()).collect(),
            manifest,
            feed,
            watched,
            link,
            longest_step_s: 1.5 * every / f64::from(TICK_HZ),
            last: None,
            base_s: 0.0,
            waiting: VecDeque::new(),
            entries: 0,
            segments: Vec::new(),
        }
    }

    /// Follows a folder that grows, until `stop`.
    fn follow(&mut self, actions: &Receiver<Asked>, stop: &AtomicBool) -> Result<(), ReadError> {
        // What was recorded long ago is not shown again, but its results are.
        let entries = self.new_entries()?;
        self.base_s = JournalState::of(&entries).ticks() as f64 / f64::from(TICK_HZ);
        let mut part = sample_files(&self.path).len().saturating_sub(1);
        self.waiting.extend(entries);
        let mut over = false;
        while !stop.load(Ordering::Relaxed) {
            let looked = Instant::now();
            answer_all(actions, "this page only follows a run that another program records");
            if !over {
                let entries = self.new_entries()?;
                self.waiting.extend(entries);
                let files = sample_files(&self.path);
                // The parts have been joined, or this is the first look.
                part = part.min(files.len().saturating_sub(1));
                for (index, file) in files.iter().enumerate().skip(part) {
                    // A file may be closed or removed while it is listed: the next look finds its rows.
                    let Ok(batches) = read_samples(file) else { break };
                    for batch in batches.flatten() {
                        self.rows(&batch, f64::INFINITY)?;
                    }
                    part = index;
                }
                self.tell_due(true);
                over = journal::is_being_written(&self.path) != Some(true);
                if over {
                    self.tell_end();
                }
            } else if journal::is_being_written(&self.path) == Some(true) {
                // The run is resumed.
                over = false;
            }
            while looked.elapsed() < LOOK_EVERY && !stop.load(Ordering::Relaxed) {
                std::thread::sleep(STEP);
            }
        }
        Ok(())
    }

    /// Replays a folder that no longer changes, until `stop`.
    fn replay(&mut self, speed: f64, actions: &Receiver<Asked>, stop: &AtomicBool) -> Result<(), ReadError> {
        // A manifest may state anything.
        let rig_s = self.manifest.clock.rig_s;
        let end_s = if rig_s.is_finite() { rig_s.clamp(0.0, LONGEST_S) } else { 0.0 };
        let mut state = ReplayState { t_s: 0.0, end_s, speed, paused: false };
        let mut batches = self.start_over()?;
        let mut batch: Option<RecordBatch> = None;
        let mut then = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            let mut moved = None;
            while let Ok(asked) = actions.try_recv() {
                moved = control(&mut state, asked).or(moved);
            }
            if let Some(to_s) = moved {
                state.t_s = to_s;
                self.feed.send(Update::Watch(Box::new(self.watched.clone())));
                (batches, batch) = (self.start_over()?, None);
            }
            let now = Instant::now();
            if !state.paused {
                state.t_s = (state.t_s + state.speed * (now - then).as_secs_f64()).min(state.end_s);
            }
            then = now;
            // Rows long before the present are passed over.
            let from_s = state.t_s - BEFORE_S.max(2.0 * state.speed);
            loop {
                let Some(present) = batch.take().map(Ok).or_else(|| batches.next()) else { break };
                if let Some(rest) = self.rows_between(&present?, from_s, state.t_s)? {
                    batch = Some(rest);
                    break;
                }
            }
            let is_over = state.t_s >= state.end_s;
            self.tell_due(is_over);
            let activity = if state.paused || is_over { Activity::Paused } else { Activity::Running };
            self.feed.send(Update::Activity(activity, self.headline(&state, is_over)));
            self.feed.send(Update::Progress(state.t_s));
            self.feed.send(Update::Replay(state));
            std::thread::sleep(STEP);
        }
        Ok(())
    }

    fn headline(&self, state: &ReplayState, is_over: bool) -> String {
        let what = self.last.as_ref().map_or(String::new(), |(place, _)| {
            format!(": set-up {}, experiment {}", place.id.set_up, place.id.experiment)
        });
        match (is_over, state.paused) {
            (true, _) => format!("Replay at its end. State of the run: {}.", self.manifest.ending_text()),
            (false, true) => format!("Replay stands{what}"),
            (false, false) => format!("Replay{what}"),
        }
    }

    /// The samples from the beginning.
    fn start_over(&mut self) -> Result<Box<dyn Iterator<Item = Result<RecordBatch, ReadError>>>, ReadError> {
        (self.last, self.base_s, self.entries) = (None, 0.0, 0);
        self.segments.clear();
        self.waiting = self.new_entries()?.into();
        self.feed.send(Update::Forget);
        self.feed.send(Update::Link(self.link.clone()));
        let files = sample_files(&self.path);
        if files.is_empty() {
            self.feed.log(Level::Warning, "The folder has no samples that can be read: only results are shown.");
        }
        if !journal::is_in(&self.path) {
            self.feed.log(Level::Warning, "journal.jsonl is missing: results, impacts and events are not shown.");
        }
        Ok(Box::new(files.into_iter().flat_map(|file| -> Box<dyn Iterator<Item = _>> {
            match read_samples(&file) {
                Ok(batches) => batches,
                Err(error) => Box::new(std::iter::once(Err(error))),
            }
        })))
    }

    /// Entries of the journal that were not read yet.
    fn new_entries(&mut self) -> Result<Vec<Entry>, ReadError> {
        let lines = match journal::read(&self.path) {
            Ok(lines) => lines,
            // A folder of only results can be shown too.
            Err(_) if !journal::is_in(&self.path) => return Ok(Vec::new()),
            Err(error) => return Err(ReadError(error.to_string())),
        };
        let new: Vec<Entry> = lines.entries.into_iter().skip(self.entries).collect();
        self.entries += new.len();
        let started = new
            .iter()
            .filter_map(|entry| if let Entry::Segment(start) = entry { Some(start.id.clone()) } else { None });
        self.segments.extend(started);
        Ok(new)
    }

    /// Tells the rows of a batch up to a time; returns those after it.
    fn rows(&mut self, batch: &RecordBatch, until_s: f64) -> Result<Option<RecordBatch>, ReadError> {
        self.rows_between(batch, f64::NEG_INFINITY, until_s)
    }

    /// Tells the rows of a batch between two times, and passes over those before; returns those after.
    fn rows_between(
        &mut self,
        batch: &RecordBatch,
        from_s: f64,
        until_s: f64,
    ) -> Result<Option<RecordBatch>, ReadError> {
        if batch.num_rows() == 0 {
            return Ok(None);
        }
        let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
        let (segments, ticks) = (numbers(batch, "segment")?, numbers(batch, "tick")?);
        let frequencies = numbers(batch, "point_frequency_hz")?;
        let columns: Vec<Vec<f64>> = self.columns.iter().map(|name| numbers(batch, name)).collect::<Result<_, _>>()?;
        let (mut t_s, mut values) = (Vec::new(), Vec::new());
        let mut rest = None;
        for row in 0..batch.num_rows() {
            let id = SegmentId {
                set_up: set_ups[row].clone(),
                experiment: experiments[row].clone(),
                segment: segments[row] as u32,
            };
            let tick = ticks[row] as u64;
            let is_new_segment = self.last.as_ref().is_none_or(|(last, _)| last.id != id);
            if !is_new_segment && self.last.as_ref().is_some_and(|(last, _)| tick <= last.tick) {
                // Told before.
                continue;
            }
            if is_new_segment {
                self.tell_rows(&mut t_s, &mut values);
                if let Some((_, last_s)) = self.last {
                    self.base_s = last_s;
                }
            }
            let time_s = self.base_s + tick as f64 / f64::from(TICK_HZ);
            if time_s > until_s {
                rest = Some(batch.slice(row, batch.num_rows() - row));
                break;
            }
            if is_new_segment {
                self.feed.send(Update::Experiment {
                    set_up: id.set_up.clone(),
                    experiment: id.experiment.clone(),
                    clearance_m: None,
                });
            }
            self.last = Some((Place { id, tick }, time_s));
            if time_s >= from_s {
                t_s.push(time_s);
                values.extend(columns.iter().map(|column| column[row] as f32));
                let own = &values[values.len() - self.columns.len()..];
                self.recomputed.push(time_s, frequencies[row], own);
            }
        }
        self.tell_rows(&mut t_s, &mut values);
        Ok(rest)
    }

    fn tell_rows(&mut self, t_s: &mut Vec<f64>, values: &mut Vec<f32>) {
        let Some(last_s) = t_s.last().copied() else { return };
        let mut last_row = values[values.len() - self.columns.len()..].to_vec();
        last_row.extend(self.recomputed.values());
        let tick = self.last.as_ref().map_or(0, |(place, _)| place.tick) as u32;
        let (t_s, values) = (std::mem::take(t_s), std::mem::take(values));
        self.feed.send(Update::Rows { t_s, values, longest_step_s: self.longest_step_s });
        self.feed.send(Update::Values { rig_s: last_s, tick, values: last_row });
        self.feed.send(Update::Progress(last_s));
    }

    /// Tells the entries whose tick the rows have reached, or all of them.
    fn tell_due(&mut self, all: bool) {
        while let Some(entry) = self.waiting.front() {
            if !all && !self.is_due(entry) {
                break;
            }
            if let Some(entry) = self.waiting.pop_front() {
                self.tell(&entry);
            }
        }
    }

    /// Whether the rows have reached an entry. Entries are in the order of the rows.
    fn is_due(&self, entry: &Entry) -> bool {
        let (set_up, experiment, segment, tick) = match entry {
            Entry::Result(row) => (&row.set_up, &row.experiment, row.segment, row.end_tick),
            Entry::Transient(row) => (&row.set_up, &row.experiment, row.segment, row.end_tick),
            Entry::Impacts(some) => {
                let tick = some.impacts.iter().map(|impact| u64::from(impact.tick)).min();
                (&some.id.set_up, &some.id.experiment, some.id.segment, tick.unwrap_or(0))
            }
            _ => return true,
        };
        let Some((last, _)) = &self.last else { return false };
        let is_here = last.id.set_up == *set_up && last.id.experiment == *experiment && last.id.segment == segment;
        // An entry of a segment that has passed is due too: its own rows were lost.
        if is_here { last.tick >= tick } else { self.has_passed(set_up, experiment, segment) }
    }

    fn has_passed(&self, set_up: &str, experiment: &str, segment: u32) -> bool {
        let same = |id: &SegmentId| id.set_up == set_up && id.experiment == experiment && id.segment == segment;
        let own = self.segments.iter().position(same);
        let present = self.last.as_ref().and_then(|(last, _)| self.segments.iter().position(|id| *id == last.id));
        own.zip(present).is_some_and(|(own, present)| own < present)
    }

    fn tell(&mut self, entry: &Entry) {
        match entry {
            Entry::Result(row) => self.feed.send(Update::Point(point(row))),
            Entry::Transient(row) => self.feed.send(Update::Transient(transient(row))),
            Entry::Impacts(some) if self.last.as_ref().is_some_and(|(last, _)| last.id == some.id) => {
                for impact in &some.impacts {
                    let ticks = f64::from(impact.tick) + f64::from(impact.centre_ticks);
                    let t_s = self.base_s + ticks / f64::from(TICK_HZ);
                    let peak_n = impact.peak_n.is_finite().then_some(f64::from(impact.peak_n));
                    self.feed.send(Update::Impact(Impact { t_s, side: impact.side, peak_n }));
                }
            }
            Entry::Segment(start) => {
                let SegmentId { set_up, experiment, .. } = &start.id;
                let text = format!("Running: set-up {set_up}, experiment {experiment}");
                self.feed.send(Update::Activity(Activity::Running, text));
            }
            Entry::Link { what, .. } => {
                self.link.interruptions += 1;
                self.feed.log(Level::Warning, words::sentence(what));
            }
            Entry::Action { what, .. } => self.feed.log(Level::Action, words::sentence(what)),
            Entry::Ended(ended) => {
                let lost = &ended.counters;
                self.link.lost_rows += lost.lost_rows;
                self.link.dropped_rows += lost.dropped_rows_host;
                self.link.bad_frames += lost.bad_frames_host.saturating_add(lost.bad_frames_device);
                self.feed.send(Update::Link(self.link.clone()));
                let (level, text) = match &ended.reason {
                    Some(reason) => (Level::Fault, format!("The run ended early: {reason}")),
                    None => (Level::Info, "The run is complete.".into()),
                };
                self.feed.log(level, text);
            }
            _ => {}
        }
    }

    fn tell_end(&self) {
        let text = match RunFolder::open(&self.path) {
            Ok(run) => format!("State of the run: {}.", run.manifest().ending_text()),
            Err(error) => format!("The run can no longer be read: {error}"),
        };
        self.feed.send(Update::Activity(Activity::Over, text));
    }
}

/// Changes the replay; returns the time to move to.
fn control(state: &mut ReplayState, asked: Asked) -> Option<f64> {
    let Action::Replay { speed, paused, to_s } = asked.action else {
        asked.answer(Err("this is the replay of a run that is over".into()));
        return None;
    };
    let (slowest, fastest) = REPLAY_SPEEDS;
    if speed.is_some_and(|speed| !(slowest..=fastest).contains(&speed)) {
        asked.answer(Err(format!("the speed must be from {slowest} to {fastest}")));
        return None;
    }
    if to_s.is_some_and(|to_s| !to_s.is_finite()) {
        asked.answer(Err("the time must be a number".into()));
        return None;
    }
    state.speed = speed.unwrap_or(state.speed);
    state.paused = paused.unwrap_or(state.paused);
    asked.answer(Ok("Done.".into()));
    to_s.map(|to_s| to_s.clamp(0.0, state.end_s))
}

fn answer_all(actions: &Receiver<Asked>, why: &str) {
    while let Ok(asked) = actions.try_recv() {
        asked.answer(Err(words::sentence(why)));
    }
}
