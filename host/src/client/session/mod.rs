//! A session with one device over a [`Link`]: identification, requests with their replies, and reports.
//!
//! A request is repeated when its reply is late (the device executes a repeated sequence number once). Under a granted
//! clock the session grants the ticks. A device that sends nothing within the timeout is an error.

mod checks;
mod consent;
mod error;
mod idle;
mod opening;
mod status;
mod version_5;

use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use damprig_core::settings::Settings;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{
    Clock, Counters, Description, Event, FromDevice, Identity, NumberedRequest, Reply, Request, Signal, Telemetry,
    ToDevice,
};

pub use error::SessionError;
pub use opening::AnyBoard;

use crate::client::link::{Closed, Link, Speed};

/// A message of the device that is not a reply.
#[derive(Clone, Debug, PartialEq)]
pub enum DeviceReport {
    /// An event, with its tick.
    Event {
        /// The tick.
        tick: u32,
        /// What happened.
        event: Event,
    },
    /// Rows of signals.
    Telemetry(Box<Telemetry>),
}

/// Ticks granted to a simulated board at a time: short enough for Ctrl-C, long enough that the round trip takes a
/// negligible share.
const GRANT_TICKS: u32 = 4000;

/// Longest wait for bytes before Ctrl-C is checked again.
const TURN: Duration = Duration::from_millis(50);

/// Time without a reply after which a request is repeated.
const REPEAT_AFTER: Duration = Duration::from_millis(250);

/// Longest rig time without a message to a board with its own clock, which stops the drive when the host is silent.
const KEEP_ALIVE: Duration = Duration::from_secs(1);

/// A session.
pub struct Session {
    link: Box<dyn Link>,
    name: String,
    timeout: Duration,
    /// Of a board with its own clock.
    speed: Speed,
    reader: Reader,
    bytes: Vec<u8>,
    reports: VecDeque<DeviceReport>,
    /// The answer to the latest request.
    reply: Option<Result<Reply, damprig_protocol::Rejected>>,
    seq: u16,
    /// The board's latest counters, and the sequence number of their request.
    counters: Option<(u16, Counters)>,
    bad_frames: u64,
    stale_messages: u64,
    unasked: u32,
    granted_until: Option<u32>,
    clock_tick: u32,
    heard: Instant,
    spoke: Instant,
    repeated: Instant,
    /// The device's identity.
    pub identity: Identity,
    /// Its capabilities.
    pub description: Description,
    /// Its telemetry signals.
    pub signals: Vec<Signal>,
    /// Its settings when the session was opened.
    pub settings: Settings,
    /// The file that gave a virtual board its settings.
    settings_file: Option<PathBuf>,
    /// The board has been told that the settings in use are accepted.
    has_accepted_settings: bool,
}

impl Session {
    /// Name of the link, as given to `--rig`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Frames rejected since the session was opened.
    #[must_use]
    pub fn bad_frames(&self) -> u64 {
        self.bad_frames
    }

    /// Whether the host grants the device's ticks.
    #[must_use]
    pub fn is_granted(&self) -> bool {
        self.description.clock == Clock::Granted
    }

    /// Rig seconds per second of the wall clock, of a device with its own clock.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.speed.get()
    }

    /// The number of a new request; earlier answers are dropped.
    fn next_seq(&mut self) -> u16 {
        self.seq = self.seq.wrapping_add(1);
        self.reply = None;
        self.seq
    }

    fn repeat_after(&self) -> Duration {
        REPEAT_AFTER.min(self.timeout / 3)
    }

    fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), SessionError> {
        self.spoke = Instant::now();
        self.link.send(bytes).map_err(|error| SessionError::Broken { link: self.name.clone(), error })
    }

    fn send(&mut self, message: &ToDevice) -> Result<(), SessionError> {
        let mut out = [0; LONGEST];
        // Cannot fail: the types bound the size of every message.
        let length = frame::encode(message, &mut out).unwrap_or(0);
        self.send_bytes(&out[..length])
    }

    /// Receives and decodes bytes, waiting for at most `wait`.
    fn listen(&mut self, wait: Duration) -> Result<(), SessionError> {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        let received = self.link.receive(&mut bytes, wait);
        for &byte in &bytes {
            match self.reader.push::<FromDevice>(byte) {
                None => {}
                Some(Err(_)) => self.bad_frames += 1,
                Some(Ok(message)) => self.take(message),
            }
        }
        self.bytes = bytes;
        received.map_err(|error| SessionError::Broken { link: self.name.clone(), error })?;
        self.check_flood()
    }

    /// Takes a message. A reply to no request and a clock that stands still are no sign of a device that works.
    fn take(&mut self, message: FromDevice) {
        let is_news = match &message {
            message if self.is_stale(message) => {
                self.stale_messages += 1;
                return self.note_unasked();
            }
            FromDevice::Reply { seq, .. } => *seq == self.seq,
            FromDevice::Clock { tick } => *tick > self.clock_tick,
            FromDevice::Event { .. } | FromDevice::Telemetry(_) => true,
        };
        if is_news {
            self.heard = Instant::now();
        } else {
            self.note_unasked();
        }
        match message {
            FromDevice::Reply { seq, answer } => {
                self.take_counters(seq, &answer);
                if seq == self.seq {
                    self.reply = Some(answer);
                }
            }
            FromDevice::Event { tick, event, .. } => self.reports.push_back(DeviceReport::Event { tick, event }),
            FromDevice::Telemetry(rows) => self.reports.push_back(DeviceReport::Telemetry(Box::new(rows))),
            FromDevice::Clock { tick } => self.clock_tick = self.clock_tick.max(tick),
        }
    }

    /// Whether a message has a tick that a granted clock has not reached: then it is a late one of the experiment before. (A
    /// real line keeps the order.)
    fn is_stale(&self, message: &FromDevice) -> bool {
        let tick = match message {
            FromDevice::Reply { .. } => return false,
            FromDevice::Event { tick, .. } => *tick,
            FromDevice::Telemetry(rows) => rows.first_tick,
            // It has the next tick to run.
            FromDevice::Clock { tick } => tick.saturating_sub(1),
        };
        self.is_granted() && self.granted_until.is_none_or(|until| tick >= until)
    }

    /// Messages of an earlier experiment that arrived after the start of the present one and were dropped.
    #[must_use]
    pub fn stale_messages(&self) -> u64 {
        self.stale_messages
    }

    /// Sends a request and waits for its reply; `what` is the request in words. A granted clock stands still when the device
    /// gets the request, so the tick does not depend on the speed of either side.
    ///
    /// # Errors
    /// The device rejects the request or is silent, or the link breaks.
    pub fn request(&mut self, what: &'static str, ask: Request) -> Result<Reply, SessionError> {
        self.use_up_credit()?;
        let seq = self.next_seq();
        let message = ToDevice::Request(NumberedRequest { seq, at_tick: None, request: ask });
        let silent_at = Instant::now() + self.timeout;
        while Instant::now() < silent_at {
            self.send(&message)?;
            let deadline = Instant::now() + self.repeat_after();
            loop {
                self.listen(TURN)?;
                if let Some(answer) = self.reply.take() {
                    self.unasked = 0;
                    return answer.map_err(|no| SessionError::Refused { what, why: no.to_string() });
                }
                if Instant::now() >= deadline {
                    break;
                }
            }
        }
        Err(self.silent())
    }

    /// Sends a request whose reply has no content.
    ///
    /// # Errors
    /// As [`Session::request`].
    pub fn execute(&mut self, what: &'static str, ask: Request) -> Result<(), SessionError> {
        match self.request(what, ask)? {
            Reply::Done => Ok(()),
            _ => Err(SessionError::UnexpectedReply { what }),
        }
    }

    /// Starts the configured experiment; ticks count from 0, earlier reports are dropped.
    ///
    /// # Errors
    /// As [`Session::request`].
    pub fn start(&mut self) -> Result<(), SessionError> {
        self.reports.clear();
        self.execute("start", Request::Start)?;
        self.granted_until = None;
        self.clock_tick = 0;
        Ok(())
    }

    /// A report that has already arrived.
    pub fn report_at_hand(&mut self) -> Option<DeviceReport> {
        self.reports.pop_front()
    }

    /// The next report, waiting a short time for one; grants ticks meanwhile.
    ///
    /// # Errors
    /// The device is silent, or the link breaks.
    pub fn next_report(&mut self) -> Result<Option<DeviceReport>, SessionError> {
        if let Some(report) = self.report_at_hand() {
            return Ok(Some(report));
        }
        if self.is_granted() && self.granted_until.is_none_or(|until| self.clock_tick >= until) {
            self.grant(self.clock_tick.saturating_add(GRANT_TICKS))?;
        }
        self.listen(TURN)?;
        self.watch()?;
        Ok(self.report_at_hand())
    }

    /// Whether all reports have arrived under a granted clock: it stands still, and the device has said so. Always true for a
    /// board with its own clock.
    #[must_use]
    pub fn has_used_up_credit(&self) -> bool {
        !self.is_granted() || self.granted_until.is_some_and(|until| self.clock_tick >= until)
    }

    /// Waits until a granted clock stands still; reports that arrive meanwhile are kept. Returns at once for a board with its
    /// own clock.
    ///
    /// # Errors
    /// The device is silent, or the link breaks.
    pub fn use_up_credit(&mut self) -> Result<(), SessionError> {
        while self.is_granted() && self.granted_until.is_some_and(|until| self.clock_tick < until) {
            self.listen(TURN)?;
            self.watch()?;
        }
        Ok(())
    }

    /// Lets a granted clock run this many ticks; reports that arrive meanwhile are kept. A board with its own clock is left alone.
    ///
    /// # Errors
    /// The device is silent, or the link breaks.
    pub fn advance(&mut self, ticks: u32) -> Result<(), SessionError> {
        self.use_up_credit()?;
        let mut left = if self.is_granted() { ticks } else { 0 };
        while left > 0 {
            let part = left.min(GRANT_TICKS);
            self.grant(self.clock_tick.saturating_add(part))?;
            self.use_up_credit()?;
            left -= part;
        }
        Ok(())
    }

    fn grant(&mut self, until_tick: u32) -> Result<(), SessionError> {
        self.granted_until = Some(until_tick);
        let now = Instant::now();
        (self.heard, self.repeated) = (now, now);
        self.send(&ToDevice::Grant { until_tick })
    }

    /// Repeats the latest message to a silent device, then gives up. Sends keep-alive requests to a board with its own clock,
    /// which stops the drive when the host is silent.
    fn watch(&mut self) -> Result<(), SessionError> {
        if self.heard.elapsed() > self.timeout {
            return Err(self.silent());
        }
        if self.heard.elapsed() > self.repeat_after() && self.repeated.elapsed() > self.repeat_after() {
            self.repeated = Instant::now();
            return match (self.is_granted(), self.granted_until) {
                // The grant, or the message that it is used up, may have been lost.
                (true, Some(until_tick)) => self.send(&ToDevice::Grant { until_tick }),
                _ => self.keep_alive(),
            };
        }
        if !self.is_granted() && self.spoke.elapsed() > KEEP_ALIVE.div_f64(self.speed()) {
            return self.keep_alive();
        }
        Ok(())
    }

    /// Sends a status request without waiting for the reply.
    fn keep_alive(&mut self) -> Result<(), SessionError> {
        let seq = self.next_seq();
        self.send(&ToDevice::Request(NumberedRequest { seq, at_tick: None, request: Request::Status }))
    }

    /// Sends a stop request without waiting for the reply: for a link that has failed.
    pub fn stop_without_reply(&mut self) {
        let seq = self.next_seq();
        let _ = self.send(&ToDevice::Request(NumberedRequest { seq, at_tick: None, request: Request::Stop }));
    }

    /// Closes the link, so that it can be opened again: a serial port has one user at a time.
    pub fn close(&mut self) {
        self.link = Box::new(Closed);
    }

    fn silent(&self) -> SessionError {
        let hint = match (self.identity.protocol, self.bad_frames) {
            (0, 0) => "; is this a damprig device, and is it powered?".to_string(),
            (_, 0) => String::new(),
            (_, bad) => format!(" but {bad} damaged frames; is it the right port and rate?"),
        };
        SessionError::Silent { link: self.name.clone(), seconds: self.timeout.as_secs_f64(), hint }
    }
}

/// Bytes as hexadecimal digits.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
