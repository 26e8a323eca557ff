//! One start of the device: neighbouring points of an experiment on a set-up, from the configuration to the last row of
//! telemetry.

mod results;

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use damprig_core::io::TICK_HZ;
use damprig_core::rig::RigState;
use damprig_protocol::{Event, MAX_SIGNALS, PlantKind, Request, Telemetry};
use damprig_simulator::messages::set_plant;

use super::context::Run;
use super::error::RunError;
use super::held_impacts::HeldImpacts;
use super::held_results::HeldResults;
use super::plan_check::PlanCheck;
use super::progress::SegmentProgress;
use super::watcher::{RunAction, WatchedStart};
use super::wire_mapping::{self, fault_error};
use crate::campaign::{CampaignSetUp, Experiment, ExperimentKind};
use crate::client::session::{DeviceReport, SessionError};
use crate::host_time;
use crate::run_folder::journal::{Finished, JournalEntry, SegmentStart};
use crate::run_folder::schema::clock_fit::{ClockPair, ClockPairs};
use crate::run_folder::schema::samples::PointLabel;
use crate::run_folder::schema::segment_id::SegmentId;
use crate::run_folder::write::recorder::PointRows;

/// Wall time without a result after which the device's status is requested.
const ASK_AFTER: Duration = Duration::from_secs(2);

/// What a segment is to measure.
pub(super) struct Task<'c> {
    pub(super) set_up: &'c CampaignSetUp,
    pub(super) experiment: &'c Experiment,
    pub(super) id: SegmentId,
    /// Places among its points.
    pub(super) points: Range<usize>,
    /// Earlier results of the experiment are superseded.
    pub(super) anew: bool,
}

impl Task<'_> {
    fn label(&self, index: usize) -> PointLabel {
        PointLabel { id: self.id.clone(), point_index: index as u32, frequency_hz: self.experiment.frequency_hz(index) }
    }
}

/// How a segment ended when nothing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SegmentEnd {
    /// The device finished.
    Finished,
    /// The device was reset and has lost its experiment.
    Reset,
    /// A person paused the run: the drive is off.
    Paused,
}

/// One start of the device.
pub(super) struct Segment<'r, 'a, 'c> {
    run: &'r mut Run<'a>,
    task: &'r Task<'c>,
    /// Rig time of the run before this start, s.
    before_s: f64,
    check: PlanCheck,
    progress: SegmentProgress,
    label: Arc<PointLabel>,
    clock: ClockPairs,
    /// Places in the device's signal table of the signals sent: those recorded, and the drive frequency.
    places: Vec<usize>,
    /// Place of the drive frequency among `places`, and its value in the last row.
    frequency_at: Option<usize>,
    frequency_hz: f32,
    impacts: HeldImpacts,
    results: HeldResults,
    is_held: bool,
}

impl<'r, 'a, 'c> Segment<'r, 'a, 'c> {
    /// Configures the device, starts it and follows it to its end.
    ///
    /// # Errors
    /// The device, the link, the disk, an interlock, or Ctrl-C. The recorder has what was taken.
    pub(super) fn carry_out(run: &'r mut Run<'a>, task: &'r Task<'c>) -> Result<SegmentEnd, RunError> {
        let mut segment = Self::new(run, task);
        let end = segment.start().and_then(|()| segment.follow());
        if !matches!(end, Ok(_) | Err(RunError::Session(_))) {
            segment.receive_rows();
        }
        segment.note_impacts();
        segment.run.tally.counters.missing_records += segment.progress.missing_messages();
        end
    }

    fn new(run: &'r mut Run<'a>, task: &'r Task<'c>) -> Self {
        let is_granted = run.session.is_granted();
        let progress = SegmentProgress::new(task.points.clone(), run.every_ticks, is_granted)
            .with_ramp(task.experiment.stepped_sine().map_or(0.0, |sine| sine.ramp_s));
        let label = Arc::new(task.label(task.points.start));
        let before_s = run.tally.rig_s;
        let mut places = run.selection.positions.clone();
        let frequency = run.session.signals.iter().position(|s| s.name == "frequency");
        if let Some(place) = frequency.filter(|place| !places.contains(place) && places.len() < MAX_SIGNALS) {
            places.push(place);
        }
        // The frequency of a tracked resonance changes within a point: it does not tell its end.
        let frequency_at =
            places.iter().position(|&place| Some(place) == frequency).filter(|_| task.experiment.tracking().is_none());
        let has_impacts = task.set_up.may_have_impacts();
        let check = PlanCheck::new(task.experiment, task.points.clone(), places.len(), run.every_ticks, has_impacts);
        let clock = ClockPairs::default();
        let results = HeldResults::new(run.every_ticks);
        Self {
            run,
            task,
            before_s,
            check,
            progress,
            label,
            clock,
            places,
            frequency_at,
            frequency_hz: 0.0,
            impacts: HeldImpacts::new(),
            results,
            is_held: false,
        }
    }

    /// Configures the device and starts it; the reports are left to the session. Returns the places in the device's signal table of
    /// the values in a row.
    ///
    /// # Errors
    /// As [`Segment::carry_out`].
    pub(super) fn start_only(run: &'r mut Run<'a>, task: &'r Task<'c>) -> Result<Vec<usize>, RunError> {
        let mut segment = Self::new(run, task);
        segment.start()?;
        Ok(segment.places)
    }

    fn start(&mut self) -> Result<(), RunError> {
        self.configure()?;
        // A granted clock stands at tick 0 after the start; a real one would have passed it.
        if self.run.session.is_granted() {
            self.run.session.start()?;
            self.telemetry()?;
        } else {
            self.telemetry()?;
            self.run.session.start()?;
        }
        let task = self.task;
        self.run.note(JournalEntry::Segment(SegmentStart {
            id: task.id.clone(),
            first_index: task.points.start,
            points: task.points.len(),
            anew: task.anew,
            at: host_time::now_text(),
        }));
        let run = &mut *self.run;
        run.watcher.started(&WatchedStart {
            set_up: task.set_up,
            experiment: task.experiment,
            from_s: self.before_s,
            places: &self.places,
            every_ticks: run.every_ticks,
        });
        Ok(())
    }

    fn configure(&mut self) -> Result<(), RunError> {
        let Task { set_up, experiment, .. } = self.task;
        let rig = &self.run.campaign.rig;
        let session = &mut *self.run.session;
        if session.description.plant != PlantKind::Real {
            let plant = wire_mapping::plant(rig, set_up, experiment);
            session.execute("take the simulated set-up", set_plant(plant))?;
        }
        session.execute(
            "take the twin's set-up",
            Request::SetTwin(wire_mapping::twin(&self.run.selection, set_up, experiment)),
        )?;
        if let ExperimentKind::Playback(playback) = &experiment.kind {
            let stop = self.run.stop;
            session.upload(&playback.bytes(), &mut || !stop.load(Ordering::Relaxed))?;
        }
        let drive_m = session.settings.calibration.drive.range().amplitude_m();
        let ask = wire_mapping::experiment(set_up, experiment, self.task.points.clone(), drive_m);
        session.execute("take the experiment", ask)?;
        session.execute("take the campaign's limits", Request::SetLimits(rig.limits.of_experiment()))?;
        let keeps_ratio = experiment.stepped_sine().is_some();
        match set_up.spring() {
            Some(spring) => self.run.set_spring(set_up, &spring, keeps_ratio),
            None => self.run.release_spring(set_up),
        }
    }

    fn telemetry(&mut self) -> Result<(), RunError> {
        let ask = Request::SetTelemetry {
            every_ticks: self.run.every_ticks,
            signals: self.places.iter().map(|&place| place as u8).collect(),
            impacts: self.task.set_up.may_have_impacts(),
        };
        Ok(self.run.session.execute("send telemetry", ask)?)
    }

    fn follow(&mut self) -> Result<SegmentEnd, RunError> {
        let mut heard = Instant::now();
        while !self.progress.is_complete() {
            if self.run.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            self.run.recorder.check()?;
            match self.run.session.next_report()? {
                Some(report) => {
                    if self.handle(report)? {
                        heard = Instant::now();
                    }
                }
                // Under a granted clock all reports arrive before the message that the credit is used up.
                None if !self.run.session.has_used_up_credit() => {}
                None => {
                    self.progress.quiet();
                    self.record_held()?;
                }
            }
            if heard.elapsed() > ASK_AFTER || self.progress.is_overdue() {
                heard = Instant::now();
                if self.check_status()? == Some(SegmentEnd::Reset) {
                    // It no longer has results to request.
                    self.frequency_at = None;
                    self.record_all()?;
                    return Ok(SegmentEnd::Reset);
                }
            }
            if self.impacts.are_due() {
                self.note_impacts();
            }
            self.run.tally.rig_s = self.before_s + f64::from(self.progress.latest_tick()) / f64::from(TICK_HZ);
            self.run.watcher.progress(self.run.tally.rig_s);
            self.run.tell_time_left();
            self.run.show_values()?;
            if self.act()? == Some(SegmentEnd::Paused) {
                self.record_all()?;
                return Ok(SegmentEnd::Paused);
            }
        }
        self.record_all()?;
        self.fetch_missing(self.progress.end_index() as u16)?;
        // Rows that have not arrived by now were lost on the way, and are counted.
        while let Some(measured) = self.results.take() {
            self.note_result(measured);
        }
        self.note_impacts();
        if self.run.every_ticks > 0 {
            self.run.end_telemetry()?;
        }
        // The counters at the end of the segment: the program may be killed in the next one.
        let _ = self.run.session.status();
        let controller = self.run.controller();
        self.run.note(JournalEntry::Finished(Finished {
            id: self.task.id.clone(),
            end_tick: self.progress.latest_tick(),
            lost_rows: 0,
            clock: self.clock.fit(),
            controller,
        }));
        Ok(SegmentEnd::Finished)
    }

    /// Carries out what a person asks for.
    fn act(&mut self) -> Result<Option<SegmentEnd>, RunError> {
        while let Some(action) = self.run.watcher.action() {
            match action {
                RunAction::Pause => {
                    self.run.note_action("paused");
                    self.run.session.stop_drive()?;
                    self.run.end_telemetry()?;
                    return Ok(Some(SegmentEnd::Paused));
                }
                RunAction::Resume => self.run.watcher.answer(Err("the run is not paused")),
                RunAction::Hold(on) if on == self.is_held => {
                    self.run.watcher.answer(Err(if on { "the run is held already" } else { "the run is not held" }));
                }
                RunAction::Hold(on) => {
                    let done = self.run.session.execute("hold", Request::Hold(on));
                    self.is_held = if done.is_ok() { on } else { self.is_held };
                    self.run.answer(done, if on { "held at the present point" } else { "released from the hold" })?;
                }
                RunAction::Noted(what) => self.run.answer(Ok(()), what)?,
                RunAction::Inject { fault, what, how } => self.run.inject(fault, what, how)?,
            }
        }
        Ok(None)
    }

    /// Handles a report; whether it was a new result, or the end.
    fn handle(&mut self, report: DeviceReport) -> Result<bool, RunError> {
        if !self.check.admits(&report) {
            if matches!(report, DeviceReport::Telemetry(_)) && std::mem::take(&mut self.run.has_rows_at_rest) {
                return Ok(false);
            }
            return self.count_misfit().map(|()| false);
        }
        match report {
            DeviceReport::Telemetry(message) => {
                self.run.has_rows_at_rest = false;
                let rows = message.values.len() / usize::from(message.width).max(1);
                let span = (rows.max(1) as u32 - 1).saturating_mul(u32::from(message.every_ticks));
                self.add_clock_pair(message.first_tick.saturating_add(span));
                self.progress.arrived(*message).iter().try_for_each(|message| self.record(message))?;
                Ok(false)
            }
            DeviceReport::Event { tick, event: Event::Point(result) } => {
                self.add_clock_pair(tick);
                // The device keeps only the last few results, so a lost one is requested at once.
                self.fetch_missing(result.index)?;
                let is_new = self.progress.point_done(result.index, result.end_tick.saturating_sub(1));
                if is_new {
                    self.take(&result);
                }
                Ok(is_new)
            }
            DeviceReport::Event { tick, event: Event::Transient(result) } => {
                self.add_clock_pair(tick);
                let is_new = self.progress.point_done(result.index, result.end_tick.saturating_sub(1));
                if is_new {
                    self.take_transient(&result);
                }
                Ok(is_new)
            }
            DeviceReport::Event { tick, event: Event::Finished { rows_dropped, .. } } => {
                let is_new = self.progress.finished(tick);
                if is_new {
                    self.run.tally.counters.dropped_records += u64::from(rows_dropped);
                }
                Ok(is_new)
            }
            DeviceReport::Event { event: Event::Fault(fault), .. } => Err(fault_error(self.task.set_up, fault)),
            // The structure may still ring: how many ticks follow the end depends on the host.
            DeviceReport::Event { event: Event::Impact(impact), .. } if self.progress.is_after_end(impact.tick) => {
                Ok(false)
            }
            DeviceReport::Event { event: Event::Impact(impact), .. } => {
                if self.impacts.add(impact) {
                    self.run.watcher.impact(&impact);
                }
                if self.impacts.are_many() {
                    self.note_impacts();
                }
                Ok(false)
            }
            DeviceReport::Event { event: Event::Spring(happening), .. } => {
                self.run.watcher.spring(&happening);
                Ok(false)
            }
        }
    }

    /// Counts a message that does not fit the plan.
    fn count_misfit(&mut self) -> Result<(), RunError> {
        self.run.tally.counters.misfit_messages += 1;
        Ok(self.run.session.note_misfit()?)
    }

    /// The last rows of a result may still be on the way when an experiment is ended early.
    fn receive_rows(&mut self) {
        if self.results.is_empty() || self.run.session.use_up_credit().is_err() {
            return;
        }
        while !self.results.is_empty()
            && let Ok(Some(report)) = self.next_arrived()
        {
            if let DeviceReport::Telemetry(message) = report
                && !self.progress.arrived(*message).iter().all(|message| self.record(message).is_ok())
            {
                return;
            }
        }
    }

    /// The next report; under a granted clock, of those that have arrived: the device stands still.
    fn next_arrived(&mut self) -> Result<Option<DeviceReport>, SessionError> {
        let session = &mut *self.run.session;
        if session.is_granted() { Ok(session.report_at_hand()) } else { session.next_report() }
    }

    /// Pairs a tick with the host time of its arrival, for a board with its own clock.
    fn add_clock_pair(&mut self, tick: u32) {
        if !self.run.session.is_granted() {
            let device_s = f64::from(tick) / f64::from(TICK_HZ);
            // In rig seconds: the pace of a rig with a speed of its own is no drift.
            let host_s = self.run.began.elapsed().as_secs_f64() * self.run.session.speed();
            let pair = self.clock.add(ClockPair { device_s, host_s });
            pair.into_iter().for_each(|pair| self.run.note(JournalEntry::Clock(pair)));
        }
    }

    /// Requests the status: the report of the end may have been lost. A device that is idle has finished, or was reset.
    fn check_status(&mut self) -> Result<Option<SegmentEnd>, RunError> {
        let (status, _) = self.run.session.status()?;
        while let Some(report) = self.run.session.report_at_hand() {
            self.handle(report)?;
        }
        if let Some(fault) = status.fault {
            return Err(fault_error(self.task.set_up, fault));
        }
        if status.held {
            self.check.held_in(status.tick);
        }
        if status.state != RigState::Idle && status.tick > self.check.last_tick() {
            let last = self.check.last_tick();
            let what = format!("tick {} of an experiment that ends by tick {last}", status.tick);
            return Err(self.run.session.unusable(what).into());
        }
        if status.state != RigState::Idle || self.progress.has_finished() {
            return Ok(None);
        }
        if usize::from(status.points) < self.task.points.len() {
            return Ok(Some(SegmentEnd::Reset));
        }
        self.progress.finished(self.progress.latest_tick());
        Ok(Some(SegmentEnd::Finished))
    }

    /// Records the messages held for missing ones.
    fn record_all(&mut self) -> Result<(), RunError> {
        while !self.progress.is_quiet() {
            self.progress.quiet();
        }
        self.record_held()
    }

    fn record_held(&mut self) -> Result<(), RunError> {
        self.progress.held().iter().try_for_each(|message| self.record(message))
    }

    fn record(&mut self, message: &Telemetry) -> Result<(), RunError> {
        let mut block: Option<PointRows> = None;
        let rows = self.progress.rows(message);
        let ticks: Vec<u32> = rows.iter().map(|(tick, _)| *tick).collect();
        self.run.watcher.rows(&ticks, &message.values[..ticks.len() * usize::from(message.width)]);
        for (tick, values) in rows {
            self.fetch_at_end_of_point(values)?;
            let index = self.progress.point_of(tick);
            if self.label.point_index as usize != index {
                block.take().into_iter().for_each(|rows| self.run.recorder.rows(rows, self.run.stop));
                self.label = Arc::new(self.task.label(index));
            }
            let empty = || PointRows { label: Arc::clone(&self.label), ticks: Vec::new(), values: Vec::new() };
            let rows = block.get_or_insert_with(empty);
            rows.ticks.push(tick);
            rows.values.extend(values.iter().take(self.run.selection.positions.len()));
        }
        block.into_iter().for_each(|rows| self.run.recorder.rows(rows, self.run.stop));
        ticks.last().into_iter().for_each(|tick| self.results.recorded(*tick));
        self.note_recorded_results();
        Ok(())
    }
}
