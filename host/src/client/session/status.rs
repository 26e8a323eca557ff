//! Status, settings and counters of the device. Counters are taken from every status reply, also of keep-alive requests.

use damprig_core::rig::Status;
use damprig_core::settings::{Settings, Source};
use damprig_protocol::{Counters, Rejected, Reply, Request};

use super::{Session, SessionError};

impl Session {
    /// Status and counters.
    ///
    /// # Errors
    /// As [`Session::request`].
    pub fn status(&mut self) -> Result<(Status, Counters), SessionError> {
        match self.request("report its status", Request::Status)? {
            Reply::Status { status, counters } => {
                // A late grant may have advanced the device further than the present one.
                self.clock_tick = self.clock_tick.max(status.tick);
                self.granted_until = self.granted_until.map(|until| until.max(status.tick));
                Ok((status, counters))
            }
            _ => Err(SessionError::UnexpectedReply { what: "report its status" }),
        }
    }

    /// The values of all signals in the device's last tick, in the order of [`Session::signals`].
    ///
    /// # Errors
    /// As [`Session::request`]; a number of values other than that of the signals.
    pub fn signal_values(&mut self) -> Result<Vec<f32>, SessionError> {
        const WHAT: &str = "report the values of its signals";
        match self.request(WHAT, Request::SignalValues)? {
            Reply::SignalValues(values) if values.len() == self.signals.len() => Ok(values.to_vec()),
            Reply::SignalValues(values) => {
                let what = format!("{} values of {} signals", values.len(), self.signals.len());
                Err(self.unusable(what))
            }
            _ => Err(SessionError::UnexpectedReply { what: WHAT }),
        }
    }

    /// The settings in use, and where they come from.
    ///
    /// # Errors
    /// As [`Session::request`].
    pub fn read_settings(&mut self) -> Result<(Settings, Source), SessionError> {
        const WHAT: &str = "report its settings";
        match self.request(WHAT, Request::Settings)? {
            Reply::Settings { settings, source } => {
                self.check_settings(&settings)?;
                Ok((settings, source))
            }
            _ => Err(SessionError::UnexpectedReply { what: WHAT }),
        }
    }

    /// The device's latest counters since its start; none before its first status reply.
    #[must_use]
    pub fn counters(&self) -> Option<Counters> {
        self.counters.map(|(_, counters)| counters)
    }

    /// The device was reset: its earlier counters are invalid.
    pub fn forget_counters(&mut self) {
        self.counters = None;
    }

    /// Takes the counters of a status reply. A reply that was delayed does not replace a later one.
    pub(super) fn take_counters(&mut self, seq: u16, answer: &Result<Reply, Rejected>) {
        if let Ok(Reply::Status { counters, .. }) = answer
            && self.counters.is_none_or(|(latest, _)| seq.wrapping_sub(latest).cast_signed() > 0)
        {
            self.counters = Some((seq, *counters));
        }
    }
}
