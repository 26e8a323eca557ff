//! A conversation with one device over a [`Link`]: who it is, requests with their replies, and what it reports.
//!
//! Requests are repeated when a reply is late (the device carries a repeated number out once), a granted
//! clock is fed, and a device that falls silent is an error, not a hang. What is done with reports is
//! [`crate::run`]'s business.

mod idle;
mod status;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use damprig_core::settings::{Settings, Source};
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{
    Clock, ClockSource, Counters, Description, Event, FromDevice, Identity, NumberedRequest, Reply, Request, Reset,
    SCHEMA, Signal, Telemetry, ToDevice, VERSION,
};

use crate::link::{Address, Closed, Link, Unreachable};

/// What can go wrong with a device.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The link could not be opened.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The link broke.
    #[error("the link to {link} broke: {error}")]
    Broken {
        /// Which.
        link: String,
        /// What the system says.
        error: std::io::Error,
    },
    /// Nothing came for too long.
    #[error("the device at {link} stopped answering: nothing for {seconds} s{hint}")]
    Silent {
        /// Which.
        link: String,
        /// For how long.
        seconds: f64,
        /// What to look at.
        hint: String,
    },
    /// The two sides speak different protocols.
    #[error(
        "the device at {link} speaks another protocol: device version {device_version} (schema {device_schema}, firmware {firmware} on {board}), this program version {version} (schema {schema}, damprig {program}); flash the firmware that belongs to this program, or use the program that belongs to the firmware"
    )]
    Version {
        /// Which.
        link: String,
        /// The device's.
        device_version: u16,
        /// The device's.
        device_schema: String,
        /// The device's.
        firmware: String,
        /// The device's.
        board: String,
        /// Ours.
        version: u16,
        /// Ours.
        schema: String,
        /// Ours.
        program: &'static str,
    },
    /// Another device answers than before.
    #[error("another device answers at {link} now: it was {board}, it is {what}; the run was stopped")]
    Another {
        /// Which link.
        link: String,
        /// The board before.
        board: String,
        /// The device now.
        what: String,
    },
    /// The board's settings are not those that the run was begun with.
    #[error(
        "the board's settings have changed since the run was begun:\n  {}\n  put them back (`damprig settings set`), or run the campaign anew",
        differences.join("\n  ")
    )]
    Settings {
        /// One difference a line.
        differences: Vec<String>,
    },
    /// The device said no.
    #[error("the device refused to {what}: {why}")]
    Refused {
        /// What was asked.
        what: &'static str,
        /// Its words.
        why: String,
    },
    /// An upload did not come to its end.
    #[error("the record did not arrive whole at the device: {why}")]
    Upload {
        /// Why.
        why: String,
    },
    /// Ctrl-C.
    #[error("interrupted")]
    Interrupted,
    /// The device answered something else than what was asked.
    #[error("the device answered something else when asked to {what}")]
    Confused {
        /// What was asked.
        what: &'static str,
    },
}

/// Something that the device said unasked.
#[derive(Clone, Debug, PartialEq)]
pub enum Report {
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

/// Ticks granted to a simulated board at a time: short enough for Ctrl-C, long enough that the round trip
/// does not count.
const GRANT_TICKS: u32 = 4000;

/// How long a single wait for bytes lasts before Ctrl-C is looked at again.
const TURN: Duration = Duration::from_millis(50);

/// A device that has not answered for so long is asked again, until it counts as silent. The device carries a repeated
/// request out once.
const ASK_AGAIN: Duration = Duration::from_millis(250);

/// A board with a clock of its own hears of this program at least so often.
const KEEP_ALIVE: Duration = Duration::from_secs(1);

/// A conversation.
pub struct Session {
    link: Box<dyn Link>,
    name: String,
    timeout: Duration,
    reader: Reader,
    bytes: Vec<u8>,
    reports: VecDeque<Report>,
    replies: VecDeque<(u16, Result<Reply, damprig_protocol::Rejected>)>,
    seq: u16,
    /// The board's latest counters, and the number of the question that they answered.
    counters: Option<(u16, Counters)>,
    bad_frames: u64,
    stale_messages: u64,
    granted_until: Option<u32>,
    clock_tick: u32,
    heard: Instant,
    spoke: Instant,
    nudged: Instant,
    /// Who the device is.
    pub identity: Identity,
    /// What it can do.
    pub description: Description,
    /// Its telemetry signals.
    pub signals: Vec<Signal>,
    /// The settings that it had when the conversation began.
    pub settings: Settings,
}

impl Session {
    /// Opens the link, asks who is there and checks that both sides speak the same protocol.
    ///
    /// # Errors
    /// An unreachable link, a silent device, another protocol: each with both sides named.
    pub fn open(address: &Address, timeout: Duration) -> Result<Self, SessionError> {
        let link = crate::link::open(address)?;
        Self::over(link, address.to_string(), timeout)
    }

    /// As [`Session::open`], over a link that is open already; `name` is what errors call it.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub fn over(link: Box<dyn Link>, name: String, timeout: Duration) -> Result<Self, SessionError> {
        let nobody = Identity { protocol: 0, schema: [0; 8], firmware: Default::default(), board: Default::default() };
        let nothing = Description {
            tick_hz: 0.0,
            clock: Clock::RealTime,
            plant: damprig_protocol::PlantKind::Real,
            most_points: 0,
            signals: 0,
            most_signals: 0,
            force_rate_hz: 0.0,
            clock_source: ClockSource::Granted,
            revision: Default::default(),
            profile: Default::default(),
            reset: Reset::Unknown,
            last_crash: None,
            settings: Source::Default,
        };
        let now = Instant::now();
        let mut session = Self {
            link,
            name,
            timeout,
            reader: Reader::default(),
            bytes: Vec::new(),
            reports: VecDeque::new(),
            replies: VecDeque::new(),
            seq: 0,
            counters: None,
            bad_frames: 0,
            stale_messages: 0,
            granted_until: None,
            clock_tick: 0,
            heard: now,
            spoke: now,
            nudged: now,
            identity: nobody,
            description: nothing,
            signals: Vec::new(),
            settings: Settings::default(),
        };
        // Ends whatever half a frame an earlier host may have left in the device's reader.
        session.send_bytes(&[0])?;
        session.identity = match session.ask("say who it is", Request::Identify)? {
            Reply::Identity(identity) => identity,
            _ => return Err(SessionError::Confused { what: "say who it is" }),
        };
        session.check_version()?;
        session.description = match session.ask("describe itself", Request::Describe)? {
            Reply::Description(description) => description,
            _ => return Err(SessionError::Confused { what: "describe itself" }),
        };
        session.signals = session.read_signals()?;
        session.settings = session.read_settings()?.0;
        // Counted from here: bytes that were under way before are not this session's.
        session.bad_frames = 0;
        Ok(session)
    }

    fn read_signals(&mut self) -> Result<Vec<Signal>, SessionError> {
        const WHAT: &str = "say what it measures";
        let mut table = Vec::new();
        while table.len() < usize::from(self.description.signals) {
            match self.ask(WHAT, Request::Signals { from: table.len() as u8 })? {
                Reply::Signals(part) if !part.is_empty() => table.extend(part),
                _ => return Err(SessionError::Confused { what: WHAT }),
            }
        }
        Ok(table)
    }

    fn check_version(&self) -> Result<(), SessionError> {
        let it = &self.identity;
        if it.protocol == VERSION && it.schema == SCHEMA {
            return Ok(());
        }
        Err(SessionError::Version {
            link: self.name.clone(),
            device_version: it.protocol,
            device_schema: hex(&it.schema),
            firmware: it.firmware.to_string(),
            board: it.board.to_string(),
            version: VERSION,
            schema: hex(&SCHEMA),
            program: env!("CARGO_PKG_VERSION"),
        })
    }

    /// Name of the link, as given to `--rig`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Frames that arrived broken since the conversation began.
    #[must_use]
    pub fn bad_frames(&self) -> u64 {
        self.bad_frames
    }

    /// Whether the device's clock is the host's to grant.
    #[must_use]
    pub fn is_granted(&self) -> bool {
        self.description.clock == Clock::Granted
    }

    fn ask_again(&self) -> Duration {
        ASK_AGAIN.min(self.timeout / 3)
    }

    fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), SessionError> {
        self.spoke = Instant::now();
        self.link.send(bytes).map_err(|error| SessionError::Broken { link: self.name.clone(), error })
    }

    fn send(&mut self, message: &ToDevice) -> Result<(), SessionError> {
        let mut out = [0; LONGEST];
        // Every message fits a frame: its parts have their sizes in their types.
        let length = frame::encode(message, &mut out).unwrap_or(0);
        self.send_bytes(&out[..length])
    }

    /// Takes in what has arrived, waiting for at most `wait`.
    fn listen(&mut self, wait: Duration) -> Result<(), SessionError> {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        let received = self.link.receive(&mut bytes, wait);
        for &byte in &bytes {
            match self.reader.push::<FromDevice>(byte) {
                None => {}
                Some(Err(_)) => self.bad_frames += 1,
                Some(Ok(message)) => {
                    self.heard = Instant::now();
                    if self.is_stale(&message) {
                        self.stale_messages += 1;
                        continue;
                    }
                    match message {
                        FromDevice::Reply { seq, answer } => {
                            self.hear_counters(seq, &answer);
                            self.replies.push_back((seq, answer));
                        }
                        FromDevice::Event { tick, event, .. } => self.reports.push_back(Report::Event { tick, event }),
                        FromDevice::Telemetry(rows) => self.reports.push_back(Report::Telemetry(Box::new(rows))),
                        FromDevice::Clock { tick } => self.clock_tick = self.clock_tick.max(tick),
                    }
                }
            }
        }
        self.bytes = bytes;
        received.map_err(|error| SessionError::Broken { link: self.name.clone(), error })
    }

    /// Whether a message speaks of a tick that a granted clock has not reached: it is of the experiment before and was
    /// very late. (A real line keeps the order.)
    fn is_stale(&self, message: &FromDevice) -> bool {
        let tick = match message {
            FromDevice::Reply { .. } => return false,
            FromDevice::Event { tick, .. } => *tick,
            FromDevice::Telemetry(rows) => rows.first_tick,
            // It names the tick that has not run.
            FromDevice::Clock { tick } => tick.saturating_sub(1),
        };
        self.is_granted() && self.granted_until.is_none_or(|until| tick >= until)
    }

    /// Messages of an earlier experiment that came after the start of the present one, and were passed over.
    #[must_use]
    pub fn stale_messages(&self) -> u64 {
        self.stale_messages
    }

    /// Asks and waits for the reply; `what` says in words what is asked. A granted clock stands when the device gets the
    /// request, so that nothing depends on how fast either side is.
    ///
    /// # Errors
    /// The device refuses, is silent, or the link breaks.
    pub fn ask(&mut self, what: &'static str, ask: Request) -> Result<Reply, SessionError> {
        self.use_up_credit()?;
        self.seq = self.seq.wrapping_add(1);
        let seq = self.seq;
        let message = ToDevice::Request(NumberedRequest { seq, at_tick: None, request: ask });
        let silent_at = Instant::now() + self.timeout;
        while Instant::now() < silent_at {
            self.send(&message)?;
            let deadline = Instant::now() + self.ask_again();
            loop {
                self.listen(TURN)?;
                while let Some((number, answer)) = self.replies.pop_front() {
                    if number == seq {
                        return answer.map_err(|no| SessionError::Refused { what, why: no.to_string() });
                    }
                }
                if Instant::now() >= deadline {
                    break;
                }
            }
        }
        Err(self.silent())
    }

    /// Asks for something that is answered with "done".
    ///
    /// # Errors
    /// As [`Session::ask`].
    pub fn tell(&mut self, what: &'static str, ask: Request) -> Result<(), SessionError> {
        match self.ask(what, ask)? {
            Reply::Done => Ok(()),
            _ => Err(SessionError::Confused { what }),
        }
    }

    /// Begins the configured experiment; ticks count from 0, earlier reports are forgotten.
    ///
    /// # Errors
    /// As [`Session::ask`].
    pub fn start(&mut self) -> Result<(), SessionError> {
        self.reports.clear();
        self.tell("start", Request::Start)?;
        self.granted_until = None;
        self.clock_tick = 0;
        Ok(())
    }

    /// A report that has arrived already.
    pub fn report_at_hand(&mut self) -> Option<Report> {
        self.reports.pop_front()
    }

    /// The next report, waiting a moment for one; a granted clock runs on meanwhile.
    ///
    /// # Errors
    /// The device is silent, or the link breaks.
    pub fn next_report(&mut self) -> Result<Option<Report>, SessionError> {
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

    /// Nothing is under way: a granted clock stands, and the device has said so. Of a real one nobody knows.
    #[must_use]
    pub fn has_heard_all(&self) -> bool {
        !self.is_granted() || self.granted_until.is_some_and(|until| self.clock_tick >= until)
    }

    /// Waits until a granted clock stands; reports that arrive meanwhile are kept. Returns at once for a board with a clock
    /// of its own.
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

    fn grant(&mut self, until_tick: u32) -> Result<(), SessionError> {
        self.granted_until = Some(until_tick);
        let now = Instant::now();
        (self.heard, self.nudged) = (now, now);
        self.send(&ToDevice::Grant { until_tick })
    }

    /// A device that should be saying something and does not is asked again, then given up. One with a clock of its own hears
    /// of this program now and then: it ends the drive when nobody is there.
    fn watch(&mut self) -> Result<(), SessionError> {
        if self.heard.elapsed() > self.timeout {
            return Err(self.silent());
        }
        if self.heard.elapsed() > self.ask_again() && self.nudged.elapsed() > self.ask_again() {
            self.nudged = Instant::now();
            return match (self.is_granted(), self.granted_until) {
                // The grant, or the word that it is used up, may have been lost.
                (true, Some(until_tick)) => self.send(&ToDevice::Grant { until_tick }),
                _ => self.show_a_sign(),
            };
        }
        if !self.is_granted() && self.spoke.elapsed() > KEEP_ALIVE {
            return self.show_a_sign();
        }
        Ok(())
    }

    /// Asks for the status; nobody waits for the answer.
    fn show_a_sign(&mut self) -> Result<(), SessionError> {
        self.replies.clear();
        self.seq = self.seq.wrapping_add(1);
        self.send(&ToDevice::Request(NumberedRequest { seq: self.seq, at_tick: None, request: Request::Status }))
    }

    /// Tells the rig to stop without waiting for an answer: for when the conversation is over anyway.
    pub fn stop_blindly(&mut self) {
        self.seq = self.seq.wrapping_add(1);
        let _ = self.send(&ToDevice::Request(NumberedRequest { seq: self.seq, at_tick: None, request: Request::Stop }));
    }

    /// Lets go of the link, so that it can be opened again: a serial port has one user at a time.
    pub fn close(&mut self) {
        self.link = Box::new(Closed);
    }

    fn silent(&self) -> SessionError {
        let hint = match (self.identity.protocol, self.bad_frames) {
            (0, 0) => "; is this a damprig device, and is it powered?".to_string(),
            (_, 0) => String::new(),
            (_, bad) => format!(" but {bad} broken frames; is it the right port and rate?"),
        };
        SessionError::Silent { link: self.name.clone(), seconds: self.timeout.as_secs_f64(), hint }
    }
}

/// Bytes as hexadecimal digits.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
