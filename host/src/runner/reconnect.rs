//! Reopens a link that was lost during a run, at growing intervals, until the same device answers.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::context::{Reconnect, Run, device_record};
use super::error::RunError;
use crate::client::session::{Session, SessionError};
use crate::host_time;
use crate::run_folder::journal::JournalEntry;

/// The first and the longest pause between two tries.
const PAUSES: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(5));

/// Longest pause before Ctrl-C is checked again.
const TURN: Duration = Duration::from_millis(50);

/// Whether reopening the link may recover from an error.
pub(super) fn is_recoverable(error: &SessionError) -> bool {
    matches!(error, SessionError::Broken { .. } | SessionError::Silent { .. } | SessionError::Unreachable(_))
}

impl Run<'_> {
    /// Reopens the link and brings the device to idle.
    ///
    /// # Errors
    /// The link's own error when it does not answer in time; another device at its other end; Ctrl-C.
    pub(super) fn reconnect(&mut self, lost: SessionError) -> Result<(), RunError> {
        let Some(mut reconnect) = self.reconnect.take() else { return Err(lost.into()) };
        let outcome = self.try_until_deadline(&mut reconnect, lost);
        self.reconnect = Some(reconnect);
        outcome
    }

    fn try_until_deadline(&mut self, reconnect: &mut Reconnect, lost: SessionError) -> Result<(), RunError> {
        // The device may still receive although nothing arrives from it: stop the drive.
        self.session.stop_without_reply();
        self.session.close();
        self.interrupted(&format!("{lost}; trying to reconnect for up to {} s", reconnect.within.as_secs_f64()));
        let deadline = Instant::now() + reconnect.within;
        let mut pause = PAUSES.0;
        loop {
            let answer = (reconnect.open)().and_then(|session| self.adopt(session));
            match answer {
                Ok(()) => break,
                Err(error) if !is_recoverable(&error) => return Err(error.into()),
                Err(error) => {
                    let left = deadline.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return Err(lost.into());
                    }
                    self.watcher.link(&format!("not connected yet ({error}), {:.0} s left", left.as_secs_f64()));
                    self.pause(pause.min(left))?;
                    pause = (2 * pause).min(PAUSES.1);
                }
            }
        }
        let (what, at) = ("the link is back".to_string(), host_time::now_text());
        self.watcher.link(&what);
        self.note(JournalEntry::Link { what, at });
        Ok(())
    }

    /// Continues with a new session, if the device is the one that the run was started on.
    fn adopt(&mut self, session: Session) -> Result<(), SessionError> {
        let (before, mut now) = (device_record(self.session), device_record(&session));
        // A port may have another name now; settings are compared when the board is idle.
        now.link.clone_from(&before.link);
        now.settings.clone_from(&before.settings);
        if before != now {
            let what = format!("{} (firmware {}, {})", now.board, now.firmware, now.plant);
            return Err(SessionError::Another { link: before.link, board: before.board, what });
        }
        self.tally.counters.bad_frames_host += self.session.bad_frames();
        // Takes its latest counters.
        self.controller();
        *self.session = session;
        let ready = self.make_ready();
        if ready.is_err() {
            // A port has one user at a time, and the next try opens it again.
            self.session.close();
        }
        ready
    }

    fn pause(&self, pause: Duration) -> Result<(), RunError> {
        let end = Instant::now() + pause;
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            self.recorder.check()?;
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            std::thread::sleep(left.min(TURN));
        }
    }
}
