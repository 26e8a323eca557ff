//! Tells the feed what a run folder holds: rows of samples in their order, and the entries of the journal, each when the rows have
//! reached its tick.

use std::collections::VecDeque;

use arrow_array::RecordBatch;
use damprig_core::io::TICK_HZ;

use super::recomputed::Recomputed;
use crate::failure::Failure;
use crate::monitor::feed::{Feed, Update, Watched};
use crate::monitor::message::{Activity, Impact, Level, LinkState, SourceKind};
use crate::monitor::run::{point, transient};
use crate::monitor::words;
use crate::run_folder::RunFolder;
use crate::run_folder::journal::{self, JournalEntry};
use crate::run_folder::schema::segment_id::SegmentId;
use crate::table::values::{numbers, texts};

/// The segment of the last row told.
#[derive(Clone, Debug, PartialEq)]
struct PresentSegment {
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
    present: Option<PresentSegment>,
    /// Rig time at tick 0 of the present segment, s.
    base_s: f64,
    recomputed: Recomputed,
    /// Journal entries whose tick the rows have not reached.
    waiting: VecDeque<JournalEntry>,
    /// Impacts whose tick the rows have not reached.
    impacts: VecDeque<TimedImpact>,
    /// Bytes of the journal that were read, and the segments among its entries with the last tick that an entry states.
    journal_bytes: u64,
    segments: Vec<(SegmentId, u64)>,
    /// What the run does is not what the page does.
    is_replay: bool,
}

/// An impact of a segment, its time from the segment's tick 0.
struct TimedImpact {
    id: SegmentId,
    tick: u64,
    impact: Impact,
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
            impacts: VecDeque::new(),
            journal_bytes: 0,
            segments: Vec::new(),
            is_replay: watched.source.kind == SourceKind::Replay,
        }
    }

    /// Goes back to the beginning; points that were told are out of date.
    pub(super) fn start_over(&mut self) -> Result<(), Failure> {
        (self.present, self.base_s, self.journal_bytes) = (None, 0.0, 0);
        self.segments.clear();
        self.waiting.clear();
        self.impacts.clear();
        if self.is_replay {
            // The table of a run that is over; the journal of one that grows.
            self.impacts.extend(self.run.impacts().map_or_else(|_| Vec::new(), |table| timed(&table)));
        }
        self.feed.send(Update::Forget);
        self.feed.send(Update::Link(self.link.clone()));
        self.read_journal()
    }

    /// Reads the entries of the journal that were appended since the last time.
    pub(super) fn read_journal(&mut self) -> Result<(), Failure> {
        // A folder of only results can be shown too.
        if !journal::is_in(self.run.path()) {
            return Ok(());
        }
        let new = journal::read_after(self.run.path(), &mut self.journal_bytes);
        for entry in new? {
            match &entry {
                JournalEntry::Segment(start) => self.segments.push((start.id.clone(), 0)),
                JournalEntry::Result(row) => self.note_end(&row.set_up, &row.experiment, row.segment, row.end_tick),
                JournalEntry::Transient(row) => self.note_end(&row.set_up, &row.experiment, row.segment, row.end_tick),
                JournalEntry::Finished(end) => {
                    self.note_end(&end.id.set_up, &end.id.experiment, end.id.segment, end.end_tick.into());
                }
                JournalEntry::Impacts(some) if !self.is_replay => {
                    let own = some.impacts.iter().map(|impact| TimedImpact {
                        id: some.id.clone(),
                        tick: impact.tick.into(),
                        impact: Impact::of(impact, 0.0),
                    });
                    self.impacts.extend(own);
                }
                _ => {}
            }
            self.waiting.push_back(entry);
        }
        Ok(())
    }

    fn note_end(&mut self, set_up: &str, experiment: &str, segment: u32, tick: u64) {
        let is_own = |id: &SegmentId| id.segment == segment && id.set_up == set_up && id.experiment == experiment;
        if let Some((_, end)) = self.segments.iter_mut().rfind(|(id, _)| is_own(id)) {
            *end = tick.max(*end);
        }
    }

    /// Rig time between the start of the present segment and that of a later one, s. Its own rows may go on beyond the last
    /// entry, when it was interrupted.
    fn between_starts_s(&self, is_next: impl Fn(&SegmentId) -> bool) -> f64 {
        let at = |is_it: &dyn Fn(&SegmentId) -> bool| self.segments.iter().position(|(id, _)| is_it(id));
        let own = match &self.present {
            Some(present) => at(&|id| *id == present.id),
            // A follower has set the time of the first segment that it sees.
            None => self.is_replay.then_some(0),
        };
        let ticks = match (own, at(&is_next)) {
            (Some(own), Some(next)) if own < next => {
                self.segments[own..next].iter().fold(0, |sum: u64, (_, end)| sum.saturating_add(*end))
            }
            _ => 0,
        };
        let told_s = self.present.as_ref().map_or(0.0, |present| present.last_s - self.base_s);
        (ticks as f64 / f64::from(TICK_HZ)).max(told_s)
    }

    /// Time of the first row of a run, in its first batch, s.
    pub(super) fn first_s(&self, first: &RecordBatch) -> Result<f64, Failure> {
        let (set_ups, experiments) = (texts(first, "set_up")?, texts(first, "experiment")?);
        let (segments, ticks) = (numbers(first, "segment")?, numbers(first, "tick")?);
        let (Some(set_up), Some(experiment)) = (set_ups.first(), experiments.first()) else { return Ok(0.0) };
        let is_own =
            |id: &SegmentId| id.segment == segments[0] as u32 && id.set_up == *set_up && id.experiment == *experiment;
        Ok(self.between_starts_s(is_own) + ticks[0] / f64::from(TICK_HZ))
    }

    /// The entries that wait for their rows.
    pub(super) fn waiting(&self) -> impl Iterator<Item = &JournalEntry> {
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
    ) -> Result<Option<RecordBatch>, Failure> {
        let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
        let (segments, ticks) = (numbers(batch, "segment")?, numbers(batch, "tick")?);
        let frequencies_hz = numbers(batch, "point_frequency_hz")?;
        let columns: Vec<Vec<f64>> = self.columns.iter().map(|name| numbers(batch, name)).collect::<Result<_, _>>()?;
        let drive = self.columns.iter().position(|name| name == "frequency_hz");
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
                    self.base_s += self.between_starts_s(is_at);
                    let (set_up, experiment) = (set_ups[row].clone(), experiments[row].clone());
                    let id = SegmentId { set_up: set_up.clone(), experiment: experiment.clone(), segment };
                    self.present = Some(PresentSegment { id, next_tick: tick, last_s: self.base_s });
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
                // A followed resonance has no frequency of its point; its drive's is recorded.
                let own_hz = frequencies_hz[row];
                let drive_hz = if own_hz > 0.0 { own_hz } else { drive.map_or(0.0, |column| columns[column][row]) };
                self.recomputed.push(time_s, drive_hz, own);
            }
        }
        self.tell_rows(&mut t_s, &mut values);
        Ok(rest)
    }

    /// Whether the rows are beyond the segment of which `is_it` says so: it is told already.
    fn has_passed(&self, is_it: impl Fn(&SegmentId) -> bool) -> bool {
        let Some(present) = &self.present else { return false };
        let own = self.segments.iter().position(|(id, _)| is_it(id));
        let present = self.segments.iter().position(|(id, _)| *id == present.id);
        own.zip(present).is_some_and(|(own, present)| own < present)
    }

    /// Tells rows, after the impacts that they have reached: who sees a row sees the impacts up to it.
    fn tell_rows(&mut self, t_s: &mut Vec<f64>, values: &mut Vec<f32>) {
        self.tell_impacts();
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

    /// Tells the impacts that the rows have reached. Those of segments without rows have no place in time.
    fn tell_impacts(&mut self) {
        while let Some(TimedImpact { id, tick, .. }) = self.impacts.front() {
            let is_present =
                self.present.as_ref().is_some_and(|present| present.id == *id && present.next_tick > *tick);
            if !is_present && !self.has_passed(|other| other == id) {
                break;
            }
            if let Some(TimedImpact { impact, .. }) = self.impacts.pop_front().filter(|_| is_present) {
                self.feed.send(Update::Impact(Impact { t_s: self.base_s + impact.t_s, ..impact }));
            }
        }
    }

    fn is_due(&self, entry: &JournalEntry) -> bool {
        let (set_up, experiment, segment, tick) = match entry {
            JournalEntry::Result(row) => (&row.set_up, &row.experiment, row.segment, row.end_tick),
            JournalEntry::Transient(row) => (&row.set_up, &row.experiment, row.segment, row.end_tick),
            // In a replay a link, an action and the start of a segment wait for the rows of their segment.
            JournalEntry::Segment(start) if self.is_replay && self.has_samples() => {
                (&start.id.set_up, &start.id.experiment, start.id.segment, 0)
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

    fn tell(&mut self, entry: &JournalEntry) {
        match entry {
            JournalEntry::Result(row) => self.feed.send(Update::Point(point(row))),
            JournalEntry::Transient(row) => self.feed.send(Update::Transient(transient(row))),
            JournalEntry::Segment(start) if !self.is_replay => {
                let SegmentId { set_up, experiment, .. } = &start.id;
                let text = format!("Running: set-up {set_up}, experiment {experiment}");
                self.feed.send(Update::Activity(Activity::Running, text));
            }
            JournalEntry::Link { what, .. } => {
                self.link.interruptions += 1;
                self.feed.log(Level::Warning, words::sentence(what));
            }
            JournalEntry::PeakPoints(points) => {
                let level = if points.is_notable() { Level::Warning } else { Level::Info };
                self.feed.log(level, words::sentence(&points.text()));
            }
            JournalEntry::Action { what, .. } => self.feed.log(Level::Action, words::sentence(what)),
            JournalEntry::Ended(ended) => {
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

/// The impacts of a table; none of one that lacks a column.
fn timed(table: &[RecordBatch]) -> Vec<TimedImpact> {
    let of = |batch: &RecordBatch| -> Result<Vec<TimedImpact>, Failure> {
        let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
        let (segments, ticks) = (numbers(batch, "segment")?, numbers(batch, "tick")?);
        let (times_s, sides, peaks_n) = (numbers(batch, "t_s")?, numbers(batch, "side")?, numbers(batch, "peak_n")?);
        let one = |row: usize| TimedImpact {
            id: SegmentId {
                set_up: set_ups[row].clone(),
                experiment: experiments[row].clone(),
                segment: segments[row] as u32,
            },
            tick: ticks[row] as u64,
            impact: Impact {
                t_s: times_s[row],
                side: if sides[row] < 0.0 { -1 } else { 1 },
                peak_n: Some(peaks_n[row]).filter(|peak| peak.is_finite()),
            },
        };
        Ok((0..batch.num_rows()).map(one).collect())
    };
    table.iter().flat_map(|batch| of(batch).unwrap_or_default()).collect()
}
