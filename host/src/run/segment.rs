//! One start of the device: some neighbouring points of an experiment on a set-up, from the configuration to the last
//! row of telemetry.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use damprig_core::io::TICK_HZ;
use damprig_core::measure::impacts::ImpactRecord;
use damprig_core::measure::point::PointResult;
use damprig_core::measure::transient::TransientResult;
use damprig_core::rig::State;
use damprig_protocol::{Event, MOST_SIGNALS, PlantKind, Reply, Request, Telemetry};
use damprig_simulator::messages::set_plant;

use super::convert::{self, fault_error};
use super::track::Track;
use super::transients;
use super::{Run, RunError};
use crate::campaign::{CampaignSetUp, Experiment, Kind};
use crate::recording::clock::{ClockPairs, Pair};
use crate::recording::impacts::Impacts;
use crate::recording::journal::{Entry, Finished, Segment as Started};
use crate::recording::recorder::Rows;
use crate::recording::samples::Label;
use crate::session::{Report, SessionError};

/// Wall time without an event after which the device is asked whether it is still running.
const ASK_AFTER: Duration = Duration::from_secs(2);

/// Impacts wait so long, or until so many are there, before they go into the journal together.
const HOLD_IMPACTS: Duration = Duration::from_millis(250);
const MOST_IMPACTS_HELD: usize = 256;

/// Latest impacts among which a copy is looked for.
const COPIES_AMONG: usize = 16;

/// What is to be done.
pub(super) struct Task<'c> {
    pub(super) set_up: &'c CampaignSetUp,
    pub(super) experiment: &'c Experiment,
    /// Places in the frequency list.
    pub(super) points: Range<usize>,
    /// How many times the experiment was started on the set-up before.
    pub(super) number: u32,
    /// Earlier results of the experiment count no more.
    pub(super) anew: bool,
}

/// How it ended, when nothing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The device finished.
    Finished,
    /// The device has forgotten what it was doing: it was reset.
    Forgotten,
}

/// One start of the device.
pub(super) struct Segment<'r, 'a, 'c> {
    run: &'r mut Run<'a>,
    task: &'r Task<'c>,
    track: Track,
    label: Arc<Label>,
    clock: ClockPairs,
    /// The signals that are sent, by their places in the device's table: those recorded, and the drive frequency.
    places: Vec<usize>,
    /// Place of the drive frequency among them, and its value in the last row.
    frequency_at: Option<usize>,
    frequency_hz: f32,
    /// The latest impacts, of which so many are in the journal since then.
    impacts: Vec<ImpactRecord>,
    impacts_noted: usize,
    impacts_noted_at: Instant,
}

impl<'r, 'a, 'c> Segment<'r, 'a, 'c> {
    /// Configures the device, starts it and sees it through.
    ///
    /// # Errors
    /// The device, the link, the disk, an interlock, or Ctrl-C. What was taken is with the recorder.
    pub(super) fn carry_out(run: &'r mut Run<'a>, task: &'r Task<'c>) -> Result<End, RunError> {
        let is_granted = run.session.is_granted();
        let track = Track::new(task.points.clone(), run.every_ticks, is_granted)
            .with_ramp(task.experiment.stepped_sine().map_or(0.0, |sine| sine.ramp_s));
        let label = Arc::new(convert::label(task.set_up, task.experiment, task.number, task.points.start));
        let before_s = run.tally.rig_s;
        let mut places = run.selection.positions.clone();
        let frequency = run.session.signals.iter().position(|s| s.name == "frequency");
        if let Some(place) = frequency.filter(|place| !places.contains(place) && places.len() < MOST_SIGNALS) {
            places.push(place);
        }
        let frequency_at = places.iter().position(|&place| Some(place) == frequency);
        let clock = ClockPairs::default();
        let mut segment = Self {
            run,
            task,
            track,
            label,
            clock,
            places,
            frequency_at,
            frequency_hz: 0.0,
            impacts: Vec::new(),
            impacts_noted: 0,
            impacts_noted_at: Instant::now(),
        };
        let end = segment.start().and_then(|()| segment.follow(before_s));
        segment.note_impacts();
        segment.run.tally.counters.missing_records += segment.track.missing_messages();
        end
    }

    fn start(&mut self) -> Result<(), RunError> {
        self.configure()?;
        // A granted clock stands at tick 0 after the start; a real one would be some ticks on.
        if self.run.session.is_granted() {
            self.run.session.start()?;
            self.telemetry()?;
        } else {
            self.telemetry()?;
            self.run.session.start()?;
        }
        let task = self.task;
        self.run.note(Entry::Segment(Started {
            set_up: task.set_up.name.clone(),
            experiment: task.experiment.name.clone(),
            segment: task.number,
            first_index: task.points.start,
            points: task.points.len(),
            anew: task.anew,
            at: jiff::Zoned::now().to_string(),
        }));
        Ok(())
    }

    fn configure(&mut self) -> Result<(), RunError> {
        let Task { set_up, experiment, .. } = self.task;
        let rig = &self.run.campaign.rig;
        let session = &mut *self.run.session;
        if session.description.plant != PlantKind::Real {
            let plant = convert::plant(rig, set_up, experiment);
            session.tell("take the simulated set-up", set_plant(plant))?;
        }
        session
            .tell("take the twin's set-up", Request::SetTwin(convert::twin(&self.run.selection, set_up, experiment)))?;
        let ask = match &experiment.kind {
            Kind::SteppedSine(sine) => {
                let drive_m = session.settings.calibration.drive.range().amplitude_m();
                Request::Configure(convert::plan(set_up, sine, self.task.points.clone(), drive_m))
            }
            Kind::Playback(playback) => {
                let stop = self.run.stop;
                let uploaded = session.upload(&playback.bytes(), &mut || !stop.load(Ordering::Relaxed));
                if let Err(SessionError::Interrupted) = uploaded {
                    return Err(RunError::Interrupted);
                }
                uploaded?;
                Request::ConfigurePlayback(playback.order())
            }
            Kind::FreeVibration(free) => Request::ConfigureFreeVibration(free.order()),
        };
        session.tell("take the experiment", ask)?;
        session.tell("take the campaign's limits", Request::SetLimits(rig.limits.of_experiment()))?;
        let keeps_ratio = experiment.stepped_sine().is_some();
        match set_up.spring() {
            Some(spring) => self.run.tune(set_up, &spring, keeps_ratio),
            None => self.run.free(set_up),
        }
    }

    fn telemetry(&mut self) -> Result<(), RunError> {
        let ask = Request::SetTelemetry {
            every_ticks: self.run.every_ticks,
            signals: self.places.iter().map(|&place| place as u8).collect(),
            impacts: self.task.set_up.model().particle.is_some(),
        };
        Ok(self.run.session.tell("send telemetry", ask)?)
    }

    fn follow(&mut self, before_s: f64) -> Result<End, RunError> {
        let mut heard = Instant::now();
        while !self.track.is_complete() {
            if self.run.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            self.run.recorder.check()?;
            match self.run.session.next_report()? {
                Some(report) => {
                    if let Report::Event { .. } = report {
                        heard = Instant::now();
                    }
                    self.handle(report)?;
                }
                // Under a granted clock what is still to come comes before the word that the credit is used up.
                None if !self.run.session.has_heard_all() => {}
                None => {
                    self.track.quiet();
                    self.record_overtakers()?;
                }
            }
            if heard.elapsed() > ASK_AFTER || self.track.is_overdue() {
                heard = Instant::now();
                if self.look_for_the_end()? == Some(End::Forgotten) {
                    // It has no results any more to ask for.
                    self.frequency_at = None;
                    self.record_all()?;
                    return Ok(End::Forgotten);
                }
            }
            if self.impacts_noted_at.elapsed() > HOLD_IMPACTS {
                self.note_impacts();
            }
            self.run.tally.rig_s = before_s + f64::from(self.track.latest_tick()) / f64::from(TICK_HZ);
            self.run.watcher.progress(self.run.tally.rig_s);
        }
        self.record_all()?;
        self.fetch_missing(self.track.end_index() as u16)?;
        if self.run.every_ticks > 0 {
            self.run.end_telemetry()?;
        }
        // As it was when the segment ended: the program may be killed in the next.
        let _ = self.run.session.status();
        let controller = self.run.controller();
        self.run.note(Entry::Finished(Finished {
            set_up: self.task.set_up.name.clone(),
            experiment: self.task.experiment.name.clone(),
            segment: self.task.number,
            end_tick: self.track.latest_tick(),
            lost_rows: 0,
            clock: self.clock.fit(),
            controller,
        }));
        Ok(End::Finished)
    }

    fn handle(&mut self, report: Report) -> Result<(), RunError> {
        match report {
            Report::Telemetry(message) => {
                let rows = message.values.len() / usize::from(message.width).max(1);
                let span = (rows.max(1) as u32 - 1).saturating_mul(u32::from(message.every_ticks));
                self.heard_of(message.first_tick.saturating_add(span));
                self.track.arrived(*message).iter().try_for_each(|message| self.record(message))
            }
            Report::Event { tick, event: Event::Point(result) } => {
                self.heard_of(tick);
                // The device keeps only the last few results: one that was lost is asked for at once.
                self.fetch_missing(result.index)?;
                if self.track.point_done(result.index, result.end_tick.saturating_sub(1)) {
                    self.take(&result);
                }
                Ok(())
            }
            Report::Event { tick, event: Event::Transient(result) } => {
                self.heard_of(tick);
                if self.track.point_done(result.index, result.end_tick.saturating_sub(1)) {
                    self.take_transient(&result);
                }
                Ok(())
            }
            Report::Event { tick, event: Event::Finished { rows_dropped, .. } } => {
                if self.track.finished(tick) {
                    self.run.tally.counters.dropped_records += u64::from(rows_dropped);
                }
                Ok(())
            }
            Report::Event { event: Event::Fault(fault), .. } => Err(fault_error(self.task.set_up, fault)),
            Report::Event { event: Event::Impact(impact), .. } => {
                self.run.watcher.impact(&impact);
                // A copy of one that was late on the way is not another one.
                if !self.impacts.iter().rev().take(COPIES_AMONG).any(|known| *known == impact) {
                    self.impacts.push(impact);
                }
                if self.impacts.len() - self.impacts_noted >= MOST_IMPACTS_HELD {
                    self.note_impacts();
                }
                Ok(())
            }
            Report::Event { event: Event::Spring(happening), .. } => {
                self.run.watcher.spring(&happening);
                Ok(())
            }
        }
    }

    /// The impacts since the last time go into the journal.
    fn note_impacts(&mut self) {
        let new = &self.impacts[self.impacts_noted..];
        if !new.is_empty() {
            let (set_up, experiment) = (self.task.set_up.name.clone(), self.task.experiment.name.clone());
            let some = Impacts { set_up, experiment, segment: self.task.number, impacts: new.to_vec() };
            self.run.note(Entry::Impacts(Box::new(some)));
        }
        self.impacts.drain(..self.impacts.len().saturating_sub(COPIES_AMONG));
        self.impacts_noted = self.impacts.len();
        self.impacts_noted_at = Instant::now();
    }

    /// Device time and host time belong together, for a board with a clock of its own.
    fn heard_of(&mut self, tick: u32) {
        if !self.run.session.is_granted() {
            let device_s = f64::from(tick) / f64::from(TICK_HZ);
            let pair = self.clock.heard(Pair { device_s, host_s: self.run.began.elapsed().as_secs_f64() });
            pair.into_iter().for_each(|pair| self.run.note(Entry::Clock(pair)));
        }
    }

    /// The word that the experiment is over may have been lost: a device that has become idle has finished, or was
    /// reset.
    fn look_for_the_end(&mut self) -> Result<Option<End>, RunError> {
        let (status, _) = self.run.session.status()?;
        while let Some(report) = self.run.session.report_at_hand() {
            self.handle(report)?;
        }
        if let Some(fault) = status.fault {
            return Err(fault_error(self.task.set_up, fault));
        }
        if status.state != State::Idle || self.track.has_finished() {
            return Ok(None);
        }
        if usize::from(status.points) < self.task.points.len() {
            return Ok(Some(End::Forgotten));
        }
        self.track.finished(self.track.latest_tick());
        Ok(Some(End::Finished))
    }

    /// What waits for messages that will not come any more.
    fn record_all(&mut self) -> Result<(), RunError> {
        while !self.track.is_quiet() {
            self.track.quiet();
        }
        self.record_overtakers()
    }

    fn record_overtakers(&mut self) -> Result<(), RunError> {
        self.track.overtakers().iter().try_for_each(|message| self.record(message))
    }

    fn record(&mut self, message: &Telemetry) -> Result<(), RunError> {
        let mut block: Option<Rows> = None;
        for (tick, values) in self.track.rows(message) {
            self.notice_the_end_of_a_point(values)?;
            let index = self.track.point_of(tick);
            if self.label.point_index as usize != index {
                block.take().into_iter().for_each(|rows| self.run.recorder.rows(rows, self.run.stop));
                self.label = Arc::new(convert::label(self.task.set_up, self.task.experiment, self.task.number, index));
            }
            let empty = || Rows { label: Arc::clone(&self.label), ticks: Vec::new(), values: Vec::new() };
            let rows = block.get_or_insert_with(empty);
            rows.ticks.push(tick);
            rows.values.extend(values.iter().take(self.run.selection.positions.len()));
        }
        block.into_iter().for_each(|rows| self.run.recorder.rows(rows, self.run.stop));
        Ok(())
    }

    /// A point's result goes before the rows after it. When the drive has left the frequency and the result is not
    /// there, it was lost: it is asked for at once, so that the rows are of the right point.
    fn notice_the_end_of_a_point(&mut self, values: &[f32]) -> Result<(), RunError> {
        let Some(now) = self.frequency_at.and_then(|at| values.get(at)) else { return Ok(()) };
        let before = std::mem::replace(&mut self.frequency_hz, *now);
        if before != 0.0 && before != *now && self.label.point_index < u32::from(u16::MAX) {
            self.fetch_missing(self.label.point_index as u16 + 1)?;
        }
        Ok(())
    }

    fn take(&mut self, result: &PointResult) {
        let index = usize::from(result.index);
        if !self.task.points.contains(&index) {
            return;
        }
        let label = convert::label(self.task.set_up, self.task.experiment, self.task.number, index);
        let row = convert::row(self.task.set_up, &label, result);
        self.run.watcher.point(&row);
        self.run.note(Entry::Result(Box::new(row)));
    }

    fn take_transient(&mut self, result: &TransientResult) {
        let Task { set_up, experiment, number, .. } = *self.task;
        let row = transients::row(set_up, experiment, number, result);
        self.run.watcher.transient(&row);
        self.run.note(Entry::Transient(Box::new(row)));
    }

    /// Asks for the results before `until` whose report did not arrive.
    fn fetch_missing(&mut self, until: u16) -> Result<(), RunError> {
        let is_transient = self.task.experiment.stepped_sine().is_none();
        for index in self.track.missing_points(until) {
            let ask = if is_transient { Request::Transient } else { Request::Result { index } };
            match self.run.session.ask("repeat a result", ask) {
                Ok(Reply::Transient(result)) => {
                    self.track.point_done(index, result.end_tick.saturating_sub(1));
                    self.take_transient(&result);
                }
                Ok(Reply::Result(result)) => {
                    self.track.point_done(index, result.end_tick.saturating_sub(1));
                    self.take(&result);
                }
                Ok(_) | Err(SessionError::Refused { .. }) => self.track.point_lost(index),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}
