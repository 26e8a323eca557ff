//! A link that was lost in mid-run is sought again, at growing intervals, until the same device answers.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::{Run, RunError, device_record};
use crate::session::{Session, SessionError};

/// The first and the longest pause between two tries.
const PAUSES: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(5));

/// How long a pause lasts before Ctrl-C is looked at again.
const TURN: Duration = Duration::from_millis(50);

/// How a lost link is opened again.
pub struct Reconnect<'a> {
    /// For how long it is sought.
    pub within: Duration,
    /// Opens it.
    pub open: Box<dyn FnMut() -> Result<Session, SessionError> + 'a>,
}

/// Whether an error of the session may go away when the link is opened again.
pub(super) fn helps(error: &SessionError) -> bool {
    matches!(error, SessionError::Broken { .. } | SessionError::Silent { .. } | SessionError::Unreachable(_))
}

impl Run<'_> {
    /// Opens the link again and brings the device to idle.
    ///
    /// # Errors
    /// The link's own error when it cannot be found again in time; another device at its other end; Ctrl-C.
    pub(super) fn find_the_link_again(&mut self, lost: SessionError) -> Result<(), RunError> {
        let Some(mut reconnect) = self.reconnect.take() else { return Err(lost.into()) };
        let found = self.seek(&mut reconnect, lost);
        self.reconnect = Some(reconnect);
        found
    }

    fn seek(&mut self, reconnect: &mut Reconnect, lost: SessionError) -> Result<(), RunError> {
        // It may be that only the way back is gone: the rig should not go on for a host that does not listen.
        self.session.stop_blindly();
        self.session.close();
        self.interrupted(&format!("{lost}; seeking it for up to {} s", reconnect.within.as_secs_f64()));
        let deadline = Instant::now() + reconnect.within;
        let mut pause = PAUSES.0;
        loop {
            let answer = (reconnect.open)().and_then(|session| self.adopt(session));
            match answer {
                Ok(()) => break,
                Err(error) if !helps(&error) => return Err(error.into()),
                Err(error) => {
                    let left = deadline.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return Err(lost.into());
                    }
                    self.watcher.link(&format!("no link yet ({error}), {:.0} s left", left.as_secs_f64()));
                    self.pause(pause.min(left))?;
                    pause = (2 * pause).min(PAUSES.1);
                }
            }
        }
        self.watcher.link("the link is there again");
        let (what, at) = ("the link is there again".to_string(), jiff::Zoned::now().to_string());
        self.note(crate::recording::journal::Entry::Link { what, at });
        Ok(())
    }

    /// Goes on with a new session, if the device is the one that the run was begun on.
    fn adopt(&mut self, session: Session) -> Result<(), SessionError> {
        let (before, mut now) = (device_record(self.session), device_record(&session));
        // A port may have got another name; the settings are compared when the board is idle.
        now.link.clone_from(&before.link);
        now.settings.clone_from(&before.settings);
        if before != now {
            let what = format!("{} (firmware {}, {})", now.board, now.firmware, now.plant);
            return Err(SessionError::Another { link: before.link, board: before.board, what });
        }
        self.tally.counters.bad_frames_host += self.session.bad_frames();
        // What it said last.
        self.controller();
        *self.session = session;
        self.make_ready()
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
