//! Serves the watcher of a run: shows it the controller's values, and carries out what a person asks for.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use damprig_core::io::SensorSet;
use damprig_simulator::messages::ToSimulator;
use damprig_simulator::plant::InjectedFault;

use super::context::Run;
use super::error::RunError;
use super::watcher::{RunAction, Watcher};
use crate::client::session::SessionError;
use crate::host_time;
use crate::run_folder::journal::JournalEntry;

/// Host time between two questions for the controller's values, and for the status of a rig in a pause.
const VALUES_EVERY: Duration = Duration::from_millis(100);
const STATUS_EVERY: Duration = Duration::from_millis(500);

impl Run<'_> {
    /// Asks for the controller's values, if the watcher wants them and it is time.
    pub(super) fn show_values(&mut self) -> Result<(), RunError> {
        if !self.watcher.wants_values() || self.values_shown.elapsed() < VALUES_EVERY {
            return Ok(());
        }
        let values = self.session.signal_values()?;
        let mut losses = self.tally.counters;
        losses.bad_frames_host += self.session.bad_frames();
        losses.dropped_rows_host = self.recorder.dropped_rows();
        self.watcher.values(self.tally.rig_s, &values, &losses);
        self.values_shown = Instant::now();
        Ok(())
    }

    /// Tells the watcher what the run still takes, if it is time.
    pub(super) fn tell_time_left(&mut self) {
        self.estimate.next(self.campaign, &self.journal).into_iter().for_each(|left| self.watcher.time_left(left));
    }

    /// Waits for a person: this time is no part of what the run takes.
    pub(super) fn with_person<T>(&mut self, wait: impl FnOnce(&mut dyn Watcher) -> T) -> T {
        self.estimate.stand();
        let answer = wait(self.watcher);
        self.estimate.go_on();
        answer
    }

    /// Answers the last action, and notes it in the journal if it was done.
    pub(super) fn answer(&mut self, done: Result<(), SessionError>, what: &str) -> Result<(), RunError> {
        match done {
            Ok(()) => {
                self.note_action(what);
                self.watcher.answer(Ok(what));
            }
            Err(SessionError::Refused { why, .. }) => self.watcher.answer(Err(&why)),
            Err(error) => {
                self.watcher.answer(Err(&error.to_string()));
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// Injects a fault into the simulated rig, or ends it.
    pub(super) fn inject(&mut self, fault: InjectedFault, what: &str, how: Option<&str>) -> Result<(), RunError> {
        let done = self.session.execute("inject a fault", ToSimulator::Inject(fault).request());
        let text = match how {
            Some(how) => format!("fault injected into the simulated rig: {what} is {how}"),
            None => format!("injected fault ended: {what}"),
        };
        self.answer(done, &text)
    }

    /// Notes what was done just before the run ended; everything else comes too late.
    pub(super) fn note_last_actions(&mut self) {
        while let Some(action) = self.watcher.action() {
            match action {
                RunAction::Noted(what) => self.note_action(what),
                _ => self.watcher.answer(Err("the run has ended")),
            }
        }
    }

    /// Notes in the journal what a person did.
    pub(super) fn note_action(&mut self, what: &str) {
        self.note(JournalEntry::Action { what: what.to_string(), at: host_time::now_text() });
    }

    /// Waits until a person resumes the run. The drive is off.
    pub(super) fn wait_for_resumption(&mut self) -> Result<(), RunError> {
        self.watcher.answer(Ok("paused: the drive is off; the interrupted point is repeated"));
        let mut status_at: Option<Instant> = None;
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            self.recorder.check()?;
            if self.watcher.wants_values() && status_at.is_none_or(|at| at.elapsed() >= STATUS_EVERY) {
                status_at = Some(Instant::now());
                let (status, _) = self.session.status()?;
                self.watcher.lost_sensors(status.sensors.lost);
            }
            // Keeps the link alive; reports of the ended experiment are out of date.
            self.session.idle_turn()?;
            self.show_values()?;
            match self.watcher.action() {
                None => {}
                Some(RunAction::Resume) => {
                    self.note_action("resumed");
                    self.watcher.lost_sensors(SensorSet::default());
                    self.watcher.answer(Ok("resumed"));
                    return Ok(self.make_ready()?);
                }
                Some(RunAction::Noted(what)) => self.answer(Ok(()), what)?,
                Some(RunAction::Inject { fault, what, how }) => self.inject(fault, what, how)?,
                Some(RunAction::Pause) => self.watcher.answer(Err("the run is paused already")),
                Some(RunAction::Hold(_)) => self.watcher.answer(Err("the run is paused: resume it first")),
            }
        }
    }
}
