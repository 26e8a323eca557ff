//! Tells the feed what a run folder holds: rows of samples in their order, and the entries of the journal, each when the rows have
//! reached its tick.

use std::collections::VecDeque;

use arrow_array::RecordBatch;
use damprig_core::io::TICK_HZ;

use super::recomputed::Recomputed;
use crate::monitor::feed::{Feed, Update, Watched};
use crate::monitor::message::{Activity, Impact, Level, LinkState};
use crate::monitor::run::{point, transient};
use crate::monitor::words;
use crate::run_folder::journal::{self, Entry};
use crate::run_folder::read::columns::{numbers, texts};
use crate::run_folder::schema::segment_id::SegmentId;
use crate::run_folder::{ReadError, RunFolder};

/// The segment of the last row told.
#[derive(Clone, Debug, PartialEq)]
struct Present {
    id: SegmentId,
    /// The first tick that has not been told.
    next_tick: u64,
    /// Time of the last row, s.
    last_s: f64,
}

/// Reads a run folder and tells the feed.
pub(super) struct Reader {
    pub(super) run: RunFolder,
    pub(super) feed: Feed,
    link: LinkState,
    /// Columns of the samples' files.
    columns: Vec<String>,
    longest_step_s: f64,
    present: Option<Present>,
    /// Rig time at tick 0 of the present segment, s.
    base_s: f64,
    recomputed: Recomputed,
    /// Journal entries whose tick the rows have not reached.
    waiting: VecDeque<Entry>,
    /// Bytes of the journal that were read, and the segments among its entries.
    journal_bytes: u64,
    segments: Vec<SegmentId>,
}

impl Reader {
    /// At the beginning of a run.
    pub(super) fn new(run: RunFolder, feed: Feed, watched: &Watched) -> Self {
        let manifest = run.manifest();
        let every = manifest.every_ticks().unwrap_or(1) as f64;
        let link = LinkState { name: watched.source.rig.clone(), state: "recorded".into(), ..LinkState::default() };
        Self {
            columns: manifest.signals.iter().map(|column| column.name.clone()).collect(),
            run,
            feed,
            link,
            longest_step_s: 1.5 * every / f64::from(TICK_HZ),
            present: None,
            base_s: 0.0,
            recomputed: Recomputed::new(&watched.signals),
            waiting: VecDeque::new(),
            journal_bytes: 0,
            segments: Vec::new(),
        }
    }

    /// Goes back to the beginning; points that were told are out of date.
    pub(super) fn start_over(&mut self) -> Result<(), ReadError> {
        (self.present, self.base_s, self.journal_bytes) = (None, 0.0, 0);
        self.segments.clear();
        self.waiting.clear();
        self.feed.send(Update::Forget);
        self.feed.send(Update::Link(self.link.clone()));
        self.read_journal()
    }

    /// Reads the entries of the journal that were appended since the last time.
    pub(super) fn read_journal(&mut self) -> Result<(), ReadError> {
        // A folder of only results can be shown too.
        if !journal::is_in(self.run.path()) {
            return Ok(());
        }
        let new = journal::read_after(self.run.path(), &mut self.journal_bytes);
        for entry in new.map_err(|e| ReadError(e.to_string()))? {
            if let Entry::Segment(start) = &entry {
                self.segments.push(start.id.clone());
            }
            self.waiting.push_back(entry);
        }
        Ok(())
    }

    /// The entries that wait for their rows.
    pub(super) fn waiting(&self) -> impl Iterator<Item = &Entry> {
        self.waiting.iter()
    }

    /// Sets the rig time at which the segment of the next row began, s.
    pub(super) fn begin_at(&mut self, base_s: f64) {
        self.base_s = base_s;
    }

    /// Whether the run records samples, so that its entries have rows to wait for.
    pub(super) fn has_samples(&self) -> bool {
        !self.columns.is_empty()
    }

    /// Set-up and experiment of the last row told.
    pub(super) fn present(&self) -> Option<(&str, &str)> {
        self.present.as_ref().map(|present| (present.id.set_up.as_str(), present.id.experiment.as_str()))
    }

    /// Tells the rows of a batch between two times, and passes over those before; returns those after.
    pub(super) fn tell_between(
        &mut self,
        batch: &RecordBatch,
        from_s: f64,
        until_s: f64,
    ) -> Result<Option<RecordBatch>, ReadError> {
        let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
        let (segments, ticks) = (numbers(batch, "segment")?, numbers(batch, "tick")?);
        let frequencies_hz = numbers(batch, "point_frequency_hz")?;
        let columns: Vec<Vec<f64>> = self.columns.iter().map(|name| numbers(batch, name)).collect::<Result<_, _>>()?;
        let (mut t_s, mut values) = (Vec::new(), Vec::new());
        let mut rest = None;
        for row in 0..batch.num_rows() {
            let (segment, tick) = (segments[row] as u32, ticks[row] as u64);
            let is_at = |id: &SegmentId| {
                id.segment == segment && id.set_up == set_ups[row] && id.experiment == experiments[row]
            };
            match &self.present {
                Some(present) if is_at(&present.id) && tick < present.next_tick => continue,
                Some(present) if is_at(&present.id) => {}
                _ if self.has_passed(is_at) => continue,
                _ => {
                    self.tell_rows(&mut t_s, &mut values);
                    self.base_s = self.present.as_ref().map_or(self.base_s, |present| present.last_s);
                    let (set_up, experiment) = (set_ups[row].clone(), experiments[row].clone());
                    let id = SegmentId { set_up: set_up.clone(), experiment: experiment.clone(), segment };
                    self.present = Some(Present { id, next_tick: tick, last_s: self.base_s });
                    self.feed.send(Update::Experiment { set_up, experiment, clearance_m: None });
                }
            }
            let time_s = self.base_s + tick as f64 / f64::from(TICK_HZ);
            if time_s > until_s {
                rest = Some(batch.slice(row, batch.num_rows() - row));
                break;
            }
            if let Some(present) = &mut self.present {
                (present.next_tick, present.last_s) = (tick.saturating_add(1), time_s);
            }
            if time_s >= from_s {
                t_s.push(time_s);
                values.extend(columns.iter().map(|column| column[row] as f32));
                let own = &values[values.len() - self.columns.len()..];
                self.recomputed.push(time_s, frequencies_hz[row], own);
            }
        }
        self.tell_rows(&mut t_s, &mut values);
        Ok(rest)
    }

    /// Whether the rows are beyond the segment of which `is_it` says so: it is told already.
    fn has_passed(&self, is_it: impl Fn(&SegmentId) -> bool) -> bool {
        let Some(present) = &self.present else { return false };
        let own = self.segments.iter().position(is_it);
        let present = self.segments.iter().position(|id| *id == present.id);
        own.zip(present).is_some_and(|(own, present)| own < present)
    }

    fn tell_rows(&mut self, t_s: &mut Vec<f64>, values: &mut Vec<f32>) {
        let Some(last_s) = t_s.last().copied() else { return };
        let mut last_row = values[values.len() - self.columns.len()..].to_vec();
        last_row.extend(self.recomputed.values());
        let tick = self.present.as_ref().map_or(0, |present| present.next_tick.saturating_sub(1)) as u32;
        let (t_s, values) = (std::mem::take(t_s), std::mem::take(values));
        self.feed.send(Update::Rows { t_s, values, longest_step_s: self.longest_step_s });
        self.feed.send(Update::Values { rig_s: last_s, tick, values: last_row });
        self.feed.send(Update::Progress(last_s));
    }

    /// Tells the entries whose tick the rows have reached, or all of them. They are in the order of the rows.
    pub(super) fn tell_due(&mut self, all: bool) {
        while self.waiting.front().is_some_and(|entry| all || self.is_due(entry)) {
            if let Some(entry) = self.waiting.pop_front() {
                self.tell(&entry);
            }
        }
    }

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
        let is_own = |id: &SegmentId| id.segment == segment && id.set_up == *set_up && id.experiment == *experiment;
        match &self.present {
            Some(present) if is_own(&present.id) => present.next_tick > tick,
            // An entry of a segment that has passed is due too: its own rows were lost.
            _ => self.has_passed(is_own),
        }
    }

    fn tell(&mut self, entry: &Entry) {
        match entry {
            Entry::Result(row) => self.feed.send(Update::Point(point(row))),
            Entry::Transient(row) => self.feed.send(Update::Transient(transient(row))),
            Entry::Impacts(some) if self.present.as_ref().is_some_and(|present| present.id == some.id) => {
                some.impacts.iter().for_each(|i| self.feed.send(Update::Impact(Impact::of(i, self.base_s))));
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
            Entry::PeakPoints(points) => {
                let level = if points.is_notable() { Level::Warning } else { Level::Info };
                self.feed.log(level, words::sentence(&points.text()));
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
}
