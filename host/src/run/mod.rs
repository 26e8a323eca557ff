//! Carries a campaign out on a device and records what it reports.
//!
//! Set-up by set-up and experiment by experiment: configure, start, take results and telemetry until the
//! experiment is finished. Whatever ends a run early, the rig is told to stop and what was taken is kept.
//! Bytes and time-outs are [`crate::session`]'s, files are [`crate::recording`]'s, words for people the
//! command's (through [`Watcher`]).

mod convert;
mod track;
mod tune;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use damprig_core::control::friction_spring;
use damprig_core::measure::impacts::ImpactRecord;
use damprig_core::measure::point::PointResult;
use damprig_core::rig::{State, TICK_HZ};
use damprig_protocol::{Answer, Ask, Happening, PlantKind, Telemetry};

use crate::campaign::{Campaign, CampaignSetUp, SteppedSine};
use crate::input::Refusal;
use crate::recording::manifest::{Counters, Device, Manifest};
use crate::recording::{ResultRow, RunFolder, StorageError};
use crate::session::{Report, Session, SessionError, hex};
pub use convert::Selection;
use convert::{fault_error, plan, point, row};
use track::Track;

/// Why a run ended before its end.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The campaign asks for what this device does not have; nothing has moved.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The device or the link.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The disk.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// An interlock.
    #[error("set-up {set_up:?}: {} at t = {t_s:.3} s (value {value}, limit {limit}); the drive was stopped", cause.text())]
    Fault {
        /// The set-up.
        set_up: String,
        /// What happened.
        cause: damprig_core::control::safety::Danger,
        /// When, since the start of the experiment, s.
        t_s: f64,
        /// The value that broke the limit.
        value: f32,
        /// The limit.
        limit: f32,
    },
    /// The friction damper's spring could not be set.
    #[error("set-up {set_up:?}: {} (value {value}, limit {limit})", cause.text())]
    Spring {
        /// The set-up.
        set_up: String,
        /// What happened.
        cause: friction_spring::Cause,
        /// The value that broke the limit.
        value: f32,
        /// The limit.
        limit: f32,
    },
    /// The friction damper's spring never said that it was done.
    #[error("set-up {set_up:?}: the friction damper's spring did not come to its end; it is {}", stage.text())]
    SpringLost {
        /// The set-up.
        set_up: String,
        /// What the spring is doing.
        stage: friction_spring::Stage,
    },
    /// A result never arrived and the device has it no more.
    #[error("set-up {set_up:?}: {missing} of {points} results were lost on the way")]
    Lost {
        /// The set-up.
        set_up: String,
        /// How many.
        missing: usize,
        /// Of how many.
        points: usize,
    },
    /// Ctrl-C.
    #[error("interrupted")]
    Interrupted,
    /// A person has to change the set-up, and nobody is there.
    #[error("{0}")]
    NobodyThere(String),
}

/// Is told how a run goes on.
pub trait Watcher {
    /// A set-up must be on the rig before this returns; on a real rig a person mounts it.
    ///
    /// # Errors
    /// Nobody is there to do it.
    fn mount(&mut self, set_up: &CampaignSetUp, simulated: bool) -> Result<(), RunError>;

    /// Rig time of the whole run has come to `rig_s`.
    fn progress(&mut self, rig_s: f64);

    /// A point has been taken.
    fn point(&mut self, row: &ResultRow);

    /// The particle hit a wall, in a tick since the experiment's start.
    fn impact(&mut self, impact: &ImpactRecord) {
        let _ = impact;
    }

    /// The friction damper's spring has something to tell.
    fn spring(&mut self, happening: &friction_spring::Happening) {
        let _ = happening;
    }
}

/// What a run leaves besides its folder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Time that passed on the rig, s.
    pub rig_s: f64,
    /// What got lost.
    pub counters: Counters,
}

/// What the device says about itself, for the manifest.
#[must_use]
pub fn device_record(session: &Session) -> Device {
    Device {
        link: session.name().to_string(),
        board: session.identity.board.to_string(),
        firmware: session.identity.firmware.to_string(),
        protocol_version: session.identity.protocol,
        protocol_schema: hex(&session.identity.schema),
        simulated: session.description.plant != PlantKind::Real,
        tick_hz: f64::from(session.description.tick_hz),
    }
}

/// Wall time without an event after which the device is asked whether it is still running.
const ASK_AFTER: Duration = Duration::from_secs(2);

/// A campaign on a device.
pub struct Run<'a> {
    campaign: &'a Campaign,
    session: &'a mut Session,
    folder: &'a mut RunFolder,
    watcher: &'a mut dyn Watcher,
    stop: &'a AtomicBool,
    selection: Selection,
    every_ticks: u16,
    tally: Tally,
}

impl<'a> Run<'a> {
    /// Puts the parts together; `selection` is what [`Selection::of`] gave for this session.
    pub fn new(
        campaign: &'a Campaign,
        session: &'a mut Session,
        folder: &'a mut RunFolder,
        watcher: &'a mut dyn Watcher,
        stop: &'a AtomicBool,
        selection: Selection,
    ) -> Self {
        let every_ticks = campaign.telemetry.every_ticks();
        Self { campaign, session, folder, watcher, stop, selection, every_ticks, tally: Tally::default() }
    }

    /// Writes what is known before the start into the run folder.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn begin(self, campaign_text: &str, manifest: &Manifest) -> Result<Self, RunError> {
        self.folder.write_campaign(campaign_text)?;
        self.folder.write_manifest(manifest)?;
        self.folder.record(&self.selection.signals)?;
        Ok(self)
    }

    /// Runs all experiments. Whatever happens, the tally says what has passed, and the rig has been told to stop.
    pub fn carry_out(mut self) -> (Tally, Result<(), RunError>) {
        let result = self.all();
        if result.is_err() {
            self.end_drive(&result);
        }
        // A device that is gone need not be waited for again.
        if !matches!(result, Err(RunError::Session(_)))
            && let Ok((_, device)) = self.session.status()
        {
            self.tally.counters.bad_frames_device = u64::from(device.bad_frames);
        }
        self.tally.counters.bad_frames_host = self.session.bad_frames();
        (self.tally, result)
    }

    fn all(&mut self) -> Result<(), RunError> {
        self.session.bring_to_idle()?;
        self.end_telemetry()?;
        for set_up in self.in_order() {
            let it = &self.campaign.set_ups[set_up];
            let simulated = self.session.description.plant != PlantKind::Real;
            self.watcher.mount(it, simulated)?;
            for experiment in self.campaign.experiments.iter().filter(|e| e.set_ups.contains(&set_up)) {
                self.one(it, experiment)?;
            }
        }
        Ok(())
    }

    /// The set-ups that any experiment uses: each is mounted once.
    fn in_order(&self) -> Vec<usize> {
        let used = |i: &usize| self.campaign.experiments.iter().any(|e| e.set_ups.contains(i));
        (0..self.campaign.set_ups.len()).filter(used).collect()
    }

    /// The rig must not go on driving for a host that has given up.
    fn end_drive(&mut self, result: &Result<(), RunError>) {
        match result {
            Err(RunError::Session(SessionError::Broken { .. } | SessionError::Silent { .. })) => {
                self.session.stop_blindly()
            }
            _ => {
                if self.session.bring_to_idle().is_err() {
                    self.session.stop_blindly();
                }
            }
        }
    }

    fn one(&mut self, set_up: &CampaignSetUp, experiment: &SteppedSine) -> Result<(), RunError> {
        self.configure(set_up, experiment)?;
        match set_up.spring() {
            Some(spring) => self.tune(set_up, &spring)?,
            None => self.free(set_up)?,
        }
        // A granted clock stands at tick 0 after the start; a real one would be some ticks on.
        if self.session.is_granted() {
            self.session.start()?;
            self.telemetry(set_up)?;
        } else {
            self.telemetry(set_up)?;
            self.session.start()?;
        }
        let mut track = Track::new(experiment.frequencies_hz.len(), self.every_ticks, self.session.is_granted())
            .with_ramp(experiment.ramp_s);
        let before_s = self.tally.rig_s;
        let mut heard = Instant::now();
        while !track.is_complete() {
            if self.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            match self.session.next_report()? {
                Some(report) => {
                    if let Report::Event { .. } = report {
                        heard = Instant::now();
                    }
                    self.handle(set_up, experiment, &mut track, report)?;
                }
                // A simulated board may take its time for what it was granted.
                None if self.session.is_clock_running() => {}
                None => track.quiet(),
            }
            if heard.elapsed() > ASK_AFTER || track.is_overdue() {
                heard = Instant::now();
                self.look_for_the_end(set_up, experiment, &mut track)?;
            }
            self.tally.rig_s = before_s + f64::from(track.latest_tick()) / f64::from(TICK_HZ);
            self.watcher.progress(self.tally.rig_s);
        }
        self.tally.counters.missing_records += track.missing_messages();
        let points = experiment.frequencies_hz.len();
        self.fetch_missing(set_up, experiment, &mut track, points as u16)?;
        if self.every_ticks > 0 {
            self.end_telemetry()?;
        }
        match track.lost() {
            0 => Ok(()),
            missing => Err(RunError::Lost { set_up: set_up.name.clone(), missing, points }),
        }
    }

    fn handle(
        &mut self,
        set_up: &CampaignSetUp,
        experiment: &SteppedSine,
        track: &mut Track,
        report: Report,
    ) -> Result<(), RunError> {
        match report {
            Report::Telemetry(rows) => self.record(set_up, experiment, track, &rows),
            Report::Event { event: Happening::Point(result), .. } => {
                // The device keeps only the last few results: one that was lost is asked for at once.
                self.fetch_missing(set_up, experiment, track, result.index)?;
                if track.point_done(result.index, result.end_tick.saturating_sub(1)) {
                    self.take(set_up, experiment, &result)
                } else {
                    Ok(())
                }
            }
            Report::Event { tick, event: Happening::Finished { rows_dropped, .. } } => {
                track.finished(tick);
                self.tally.counters.dropped_records += u64::from(rows_dropped);
                Ok(())
            }
            Report::Event { event: Happening::Fault(fault), .. } => Err(fault_error(set_up, fault)),
            Report::Event { event: Happening::Impact(impact), .. } => {
                self.watcher.impact(&impact);
                Ok(())
            }
            Report::Event { event: Happening::Spring(happening), .. } => {
                self.watcher.spring(&happening);
                Ok(())
            }
        }
    }

    /// The word that the experiment is over may have been lost: a device that has become idle is finished.
    fn look_for_the_end(
        &mut self,
        set_up: &CampaignSetUp,
        experiment: &SteppedSine,
        track: &mut Track,
    ) -> Result<(), RunError> {
        let (status, _) = self.session.status()?;
        while let Some(report) = self.session.report_at_hand() {
            self.handle(set_up, experiment, track, report)?;
        }
        if let Some(fault) = status.fault {
            return Err(fault_error(set_up, fault));
        }
        if status.state == State::Idle && !track.has_finished() {
            track.finished(track.latest_tick());
        }
        Ok(())
    }

    fn record(
        &mut self,
        set_up: &CampaignSetUp,
        experiment: &SteppedSine,
        track: &mut Track,
        rows: &Telemetry,
    ) -> Result<(), RunError> {
        for (tick, values) in track.rows(rows) {
            let index = track.point_of(tick).min(experiment.frequencies_hz.len() - 1);
            let values = values.iter().copied();
            let t_s = f64::from(tick) / f64::from(TICK_HZ);
            self.folder.push_sample(point(set_up, experiment, index), u64::from(tick), t_s, values)?;
        }
        Ok(())
    }

    fn configure(&mut self, set_up: &CampaignSetUp, experiment: &SteppedSine) -> Result<(), RunError> {
        let rig = &self.campaign.rig;
        if self.session.description.plant != PlantKind::Real {
            let plant = convert::plant(rig, set_up);
            self.session.tell("take the simulated set-up", Ask::SetPlant(plant))?;
        }
        self.session.tell("take the limits", Ask::SetSafety(convert::safety(rig, set_up, experiment)))?;
        self.session.tell("take the twin's set-up", Ask::SetTwin(convert::twin(&self.selection, set_up)))?;
        self.session.tell("take the experiment", Ask::Configure(plan(set_up, experiment)))?;
        Ok(())
    }

    fn telemetry(&mut self, set_up: &CampaignSetUp) -> Result<(), RunError> {
        let signals = self.selection.positions.iter().map(|&place| place as u8).collect();
        let impacts = set_up.model().particle.is_some();
        let ask = Ask::SetTelemetry { every_ticks: self.every_ticks, signals, impacts };
        Ok(self.session.tell("send telemetry", ask)?)
    }

    fn end_telemetry(&mut self) -> Result<(), RunError> {
        let ask = Ask::SetTelemetry { every_ticks: 0, signals: Default::default(), impacts: false };
        Ok(self.session.tell("end the telemetry", ask)?)
    }

    fn take(&mut self, set_up: &CampaignSetUp, experiment: &SteppedSine, result: &PointResult) -> Result<(), RunError> {
        let index = usize::from(result.index);
        if index >= experiment.frequencies_hz.len() {
            return Ok(());
        }
        let row = row(set_up, point(set_up, experiment, index), result);
        self.watcher.point(&row);
        self.folder.push_result(row)?;
        Ok(())
    }

    /// Asks for the results before `until` whose report did not arrive.
    fn fetch_missing(
        &mut self,
        set_up: &CampaignSetUp,
        experiment: &SteppedSine,
        track: &mut Track,
        until: u16,
    ) -> Result<(), RunError> {
        for index in track.missing_points(until) {
            match self.session.ask("repeat a result", Ask::Result { index }) {
                Ok(Answer::Result(result)) => {
                    track.point_done(index, result.end_tick.saturating_sub(1));
                    self.take(set_up, experiment, &result)?;
                }
                Ok(_) | Err(SessionError::Refused { .. }) => track.point_lost(index),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}
