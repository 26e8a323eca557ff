//! How the device is, and what it has counted: asked for, and picked up from whatever answer goes by.

use damprig_core::rig::Status;
use damprig_protocol::{Counters, Rejected, Reply, Request};

use super::{Session, SessionError};

impl Session {
    /// State and counters.
    ///
    /// # Errors
    /// As [`Session::ask`].
    pub fn status(&mut self) -> Result<(Status, Counters), SessionError> {
        match self.ask("say how it is", Request::Status)? {
            Reply::Status { status, counters } => {
                // A late grant may have carried the device further than the present one.
                self.clock_tick = self.clock_tick.max(status.tick);
                self.granted_until = self.granted_until.map(|until| until.max(status.tick));
                Ok((status, counters))
            }
            _ => Err(SessionError::Confused { what: "say how it is" }),
        }
    }

    /// What the device has counted since its supply came on, by its latest word; none before it was first asked.
    #[must_use]
    pub fn counters(&self) -> Option<Counters> {
        self.counters.map(|(_, counters)| counters)
    }

    /// The device was reset: what it said before counts no more.
    pub fn forget_counters(&mut self) {
        self.counters = None;
    }

    /// Signs of life are asked for the status too, and nobody waits for their answers. One that was late on the way does
    /// not go back behind a later one.
    pub(super) fn hear_counters(&mut self, seq: u16, answer: &Result<Reply, Rejected>) {
        if let Ok(Reply::Status { counters, .. }) = answer
            && self.counters.is_none_or(|(latest, _)| seq.wrapping_sub(latest).cast_signed() > 0)
        {
            self.counters = Some((seq, *counters));
        }
    }
}
