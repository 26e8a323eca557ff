//! Carries a campaign out on a device and hands what it reports to the recorder.
//!
//! Set-up by set-up and experiment by experiment, whatever points are not taken yet: so going on after a lost link, and
//! taking up a run that was killed, are what a run does anyway. Whatever ends a run early, the rig is told to stop and
//! what was taken is kept. One start of the device is `segment`'s, bytes and time-outs are [`crate::session`]'s, files
//! are [`crate::recording`]'s, words for people the command's (through [`Watcher`]).

mod controller;
mod convert;
mod in_order;
mod reconnect;
pub mod resume;
mod segment;
mod track;
mod transients;
mod tune;

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use damprig_core::control::friction_spring;
use damprig_core::io::TICK_HZ;
use damprig_core::measure::impacts::ImpactRecord;
use damprig_protocol::{Ask, ClockSource, PlantKind};

use crate::campaign::{Campaign, CampaignSetUp, Experiment};
use crate::input::Refusal;
use crate::recording::controller::Controller;
use crate::recording::journal::Entry;
use crate::recording::manifest::{BoardSettings, Counters, Device};
use crate::recording::recorder::Recording;
use crate::recording::taken::Taken;
use crate::recording::transients::TransientRow;
use crate::recording::{ResultRow, StorageError};
use crate::session::{Session, SessionError, hex};
use crate::settings::{self, origin_text};
use controller::Readings;
pub use convert::Selection;
pub use reconnect::Reconnect;
use segment::{End, Segment, Task};

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
        cause: damprig_core::control::fault::FaultCause,
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
        cause: damprig_core::control::fault::FaultCause,
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
        stage: friction_spring::SpringStage,
    },
    /// The same point was begun again and again and never came to its end.
    #[error(
        "set-up {set_up:?}: {tries} starts in a row brought no new point (the last one: {last}); {missing} are missing"
    )]
    NoProgress {
        /// The set-up.
        set_up: String,
        /// How many starts.
        tries: u32,
        /// How the last one ended.
        last: String,
        /// How many points the experiment lacks.
        missing: usize,
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

    /// A record, a pulse or a free vibration has been taken.
    fn transient(&mut self, row: &TransientRow) {
        let _ = row;
    }

    /// The particle hit a wall, in a tick since the experiment's start.
    fn impact(&mut self, impact: &ImpactRecord) {
        let _ = impact;
    }

    /// The friction damper's spring has something to tell.
    fn spring(&mut self, happening: &friction_spring::SpringEvent) {
        let _ = happening;
    }

    /// The link was lost, is sought, or is there again.
    fn link(&mut self, state: &str);
}

/// What a run leaves besides its folder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Time that passed on the rig, s.
    pub rig_s: f64,
    /// What got lost.
    pub counters: Counters,
    /// How the controller kept up; none when it was never asked.
    pub controller: Option<Controller>,
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
        plant: match session.description.plant {
            PlantKind::Real => "real",
            PlantKind::SimulatedF32 => "simulated in f32",
            PlantKind::SimulatedF64 => "simulated in f64",
        }
        .to_string(),
        clock: if session.is_granted() { "granted" } else { "real time" }.to_string(),
        tick_hz: f64::from(session.description.tick_hz),
        build: format!("{} {}", session.description.revision, session.description.profile).trim().to_string(),
        clock_source: match session.description.clock_source {
            ClockSource::Granted => "host",
            ClockSource::Crystal => "crystal",
            ClockSource::InternalOscillator => "internal oscillator",
        }
        .to_string(),
        last_crash: session.description.last_crash.map(|crash| crash.to_string()),
        settings: Some(BoardSettings {
            source: origin_text(session.description.settings).to_string(),
            settings: session.settings,
        }),
    }
}

/// Starts in a row without a new point after which a run is given up.
const FRUITLESS_STARTS: u32 = 5;

/// A campaign on a device.
pub struct Run<'a> {
    campaign: &'a Campaign,
    session: &'a mut Session,
    recorder: &'a mut dyn Recording,
    watcher: &'a mut dyn Watcher,
    stop: &'a AtomicBool,
    selection: Selection,
    reconnect: Option<Reconnect<'a>>,
    every_ticks: u16,
    tally: Tally,
    taken: Taken,
    readings: Readings,
    began: Instant,
}

impl<'a> Run<'a> {
    /// Puts the parts together; `selection` is what [`Selection::of`] gave for this session, `taken` what the journal
    /// holds already.
    pub fn new(
        campaign: &'a Campaign,
        session: &'a mut Session,
        recorder: &'a mut dyn Recording,
        watcher: &'a mut dyn Watcher,
        stop: &'a AtomicBool,
        selection: Selection,
        taken: Taken,
    ) -> Self {
        let every_ticks = campaign.telemetry.every_ticks();
        let tally = Tally { rig_s: taken.ticks() as f64 / f64::from(TICK_HZ), ..Tally::default() };
        Self {
            campaign,
            session,
            recorder,
            watcher,
            stop,
            selection,
            reconnect: None,
            every_ticks,
            tally,
            taken,
            readings: Readings::default(),
            began: Instant::now(),
        }
    }

    /// A link that is lost is opened again.
    #[must_use]
    pub fn with_reconnect(mut self, reconnect: Option<Reconnect<'a>>) -> Self {
        self.reconnect = reconnect;
        self
    }

    /// Runs all experiments. Whatever happens, the tally says what has passed, and the rig has been told to stop.
    pub fn carry_out(mut self) -> (Tally, Result<(), RunError>) {
        let result = self.all().and_then(|()| Ok(self.recorder.check()?));
        if result.is_err() {
            self.end_drive(&result);
        }
        // A device that is gone need not be waited for again.
        if !matches!(result, Err(RunError::Session(_))) {
            let _ = self.session.status();
        }
        self.tally.controller = self.controller();
        self.tally.counters.bad_frames_device = self.tally.controller.map_or(0, |c| c.bad_frames);
        self.tally.counters.bad_frames_host += self.session.bad_frames();
        self.tally.counters.dropped_rows_host = self.recorder.dropped_rows();
        (self.tally, result)
    }

    fn all(&mut self) -> Result<(), RunError> {
        self.make_ready()?;
        let campaign = self.campaign;
        let simulated = self.session.description.plant != PlantKind::Real;
        for (index, set_up) in campaign.set_ups.iter().enumerate() {
            let own = || campaign.experiments.iter().filter(move |e| e.set_ups.contains(&index));
            // Each set-up is mounted once, and not at all when nothing is left to do on it.
            if own().any(|e| self.next(set_up, e).is_some()) {
                self.watcher.mount(set_up, simulated)?;
                for experiment in own() {
                    self.experiment(set_up, experiment)?;
                }
            }
        }
        Ok(())
    }

    fn make_ready(&mut self) -> Result<(), SessionError> {
        let watcher = &mut *self.watcher;
        self.session.bring_to_idle(|what| watcher.link(what))?;
        self.check_settings()?;
        self.controller();
        self.end_telemetry()
    }

    /// A board that was reset has forgotten settings that were not saved.
    fn check_settings(&mut self) -> Result<(), SessionError> {
        let (now, _) = self.session.read_settings()?;
        let differences = settings::differences(&self.campaign.rig.board, &now, |_| true);
        if differences.is_empty() { Ok(()) } else { Err(SessionError::Settings { differences }) }
    }

    /// How the controller kept up since the run began, by what it said last.
    fn controller(&mut self) -> Option<Controller> {
        self.session.counters().into_iter().for_each(|now| self.readings.take(now));
        self.readings.sum()
    }

    /// The next start that an experiment on a set-up needs, if any.
    fn next<'c>(&self, set_up: &'c CampaignSetUp, experiment: &'c Experiment) -> Option<Task<'c>> {
        let points = experiment.points();
        let missing = self.taken.missing(&set_up.name, &experiment.name, points).into_iter().next()?;
        let number = self.taken.next_segment(&set_up.name, &experiment.name);
        // The motion that a sweep had when it was interrupted is gone: it begins anew.
        let anew = experiment.carries_over() && number > 0;
        let points = if anew { 0..points } else { missing };
        Some(Task { set_up, experiment, points, number, anew })
    }

    fn experiment(&mut self, set_up: &CampaignSetUp, experiment: &Experiment) -> Result<(), RunError> {
        let mut fruitless = 0;
        while let Some(task) = self.next(set_up, experiment) {
            let before = self.taken.points();
            let last = match Segment::carry_out(self, &task) {
                Ok(End::Finished) => "results were lost on the way and the device keeps them no more".to_string(),
                Ok(End::Forgotten) => {
                    self.readings.board_began_anew();
                    self.session.forget_counters();
                    self.interrupted("the device began anew in mid-run: it was reset");
                    self.make_ready()?;
                    "the device was reset".to_string()
                }
                Err(RunError::Session(error)) if reconnect::helps(&error) => {
                    let words = error.to_string();
                    self.find_the_link_again(error)?;
                    words
                }
                Err(error) => return Err(error),
            };
            fruitless = if self.taken.points() > before { 0 } else { fruitless + 1 };
            if fruitless >= FRUITLESS_STARTS {
                let left = self.taken.missing(&set_up.name, &experiment.name, experiment.points());
                let missing = left.iter().map(ExactSizeIterator::len).sum();
                return Err(RunError::NoProgress { set_up: set_up.name.clone(), tries: fruitless, last, missing });
            }
        }
        Ok(())
    }

    /// Adds a line to the journal, and counts it here too.
    fn note(&mut self, entry: Entry) {
        self.taken.add(&entry);
        self.recorder.note(entry);
    }

    fn interrupted(&mut self, what: &str) {
        self.tally.counters.interruptions += 1;
        self.watcher.link(what);
        self.note(Entry::Link { what: what.to_string(), at: jiff::Zoned::now().to_string() });
    }

    /// The rig must not go on driving for a host that has given up.
    fn end_drive(&mut self, result: &Result<(), RunError>) {
        match result {
            Err(RunError::Session(SessionError::Broken { .. } | SessionError::Silent { .. })) => {
                self.session.stop_blindly()
            }
            _ => {
                if self.session.silence_the_drive().is_err() {
                    self.session.stop_blindly();
                }
            }
        }
    }

    fn end_telemetry(&mut self) -> Result<(), SessionError> {
        let ask = Ask::SetTelemetry { every_ticks: 0, signals: Default::default(), impacts: false };
        self.session.tell("end the telemetry", ask)
    }
}
