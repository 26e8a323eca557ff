//! What a run works with: campaign, session, recorder and the journal's sum, and the operations that its parts share.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use damprig_core::io::TICK_HZ;
use damprig_protocol::{ClockSource, PlantKind, Request};

use super::time_left::Estimate;
use super::watcher::Watcher;
use super::wire_mapping::Selection;
use crate::campaign::Campaign;
use crate::client::board_check;
use crate::client::controller::{Controller, Readings};
use crate::client::session::{Session, SessionError, hex};
use crate::host_time;
use crate::run_folder::journal::{JournalEntry, Losses};
use crate::run_folder::schema::device::{BoardSettings, Device};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::write::recorder::Recording;
use crate::settings::{self, origin_text};

/// Totals of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Time that passed on the rig, s.
    pub rig_s: f64,
    /// What was lost.
    pub counters: Losses,
    /// The controller's counters; none when it was never asked.
    pub controller: Option<Controller>,
}

/// The device's description, for journal and manifest.
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
        warnings: board_check::warnings(session),
        settings: Some(BoardSettings {
            source: origin_text(session.description.settings).to_string(),
            settings: session.settings,
        }),
    }
}

/// How a lost link is reopened.
pub struct Reconnect<'a> {
    /// Time within which it must answer again.
    pub within: Duration,
    /// Opens it.
    pub open: Box<dyn FnMut() -> Result<Session, SessionError> + 'a>,
}

/// A campaign on a device.
pub struct Run<'a> {
    pub(super) campaign: &'a Campaign,
    pub(super) session: &'a mut Session,
    pub(super) recorder: &'a mut dyn Recording,
    pub(super) watcher: &'a mut dyn Watcher,
    pub(super) stop: &'a AtomicBool,
    pub(super) selection: Selection,
    pub(super) reconnect: Option<Reconnect<'a>>,
    pub(super) every_ticks: u16,
    pub(super) tally: Tally,
    pub(super) journal: JournalState,
    pub(super) readings: Readings,
    /// The board may still hold a message with rows of the check at rest: it sends it before the first row of a segment.
    pub(super) has_rows_at_rest: bool,
    pub(super) began: Instant,
    /// When the watcher last got the controller's values.
    pub(super) values_shown: Instant,
    pub(super) estimate: Estimate,
}

impl<'a> Run<'a> {
    /// `selection` is the result of [`Selection::of`] for this session, `journal` the sum of the journal so far.
    pub fn new(
        campaign: &'a Campaign,
        session: &'a mut Session,
        recorder: &'a mut dyn Recording,
        watcher: &'a mut dyn Watcher,
        stop: &'a AtomicBool,
        selection: Selection,
        journal: JournalState,
    ) -> Self {
        let every_ticks = campaign.telemetry.every_ticks();
        let tally = Tally { rig_s: journal.ticks() as f64 / f64::from(TICK_HZ), ..Tally::default() };
        let estimate = Estimate::new((!session.is_granted()).then(|| session.speed()));
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
            journal,
            readings: Readings::default(),
            has_rows_at_rest: false,
            began: Instant::now(),
            values_shown: Instant::now(),
            estimate,
        }
    }

    /// Reopens a lost link.
    #[must_use]
    pub fn with_reconnect(mut self, reconnect: Option<Reconnect<'a>>) -> Self {
        self.reconnect = reconnect;
        self
    }

    pub(super) fn make_ready(&mut self) -> Result<(), SessionError> {
        let watcher = &mut *self.watcher;
        self.session.bring_to_idle(|what| watcher.link(what), self.stop)?;
        self.check_settings()?;
        self.controller();
        self.end_telemetry()
    }

    /// A board that was reset has lost settings that were not saved.
    fn check_settings(&mut self) -> Result<(), SessionError> {
        let (now, _) = self.session.read_settings()?;
        let differences = settings::differences(&self.campaign.rig.board, &now, |_| true);
        if differences.is_empty() { Ok(()) } else { Err(SessionError::Settings { differences }) }
    }

    /// The controller's counters since the run started, up to its latest reply.
    pub(super) fn controller(&mut self) -> Option<Controller> {
        self.session.counters().into_iter().for_each(|now| self.readings.take(now));
        self.readings.sum()
    }

    /// Adds a line to the journal and to its sum here.
    pub(super) fn note(&mut self, entry: JournalEntry) {
        self.journal.add(&entry);
        self.recorder.note(entry);
    }

    pub(super) fn interrupted(&mut self, what: &str) {
        self.tally.counters.interruptions += 1;
        self.watcher.link(what);
        self.note(JournalEntry::Link { what: what.to_string(), at: host_time::now_text() });
    }

    pub(super) fn end_telemetry(&mut self) -> Result<(), SessionError> {
        let ask = Request::SetTelemetry { every_ticks: 0, signals: Default::default(), impacts: false };
        self.session.execute("end the telemetry", ask)
    }
}
