//! Opens a session: identifies the device, checks its protocol, and reads its description, signals and settings.
//!
//! With a device of another protocol only the messages that never change can be exchanged: [`AnyBoard`] has those.

use std::time::{Duration, Instant};

use damprig_core::settings::{Settings, Source};
use damprig_protocol::frame::Reader;
use damprig_protocol::{
    Clock, ClockSource, Description, Identity, PlantKind, Reply, Request, Reset, SCHEMA, Signal, StoredPart, VERSION,
};

use super::{Session, SessionError, hex, version_5};
use crate::client::link::{Address, Link, Speed};

/// Most pages of a settings memory, and most bytes of a page: more than any board has.
const MAX_PAGES: u8 = 8;
const MAX_BYTES: u16 = 4096;

/// A device that has identified itself and may have another protocol than this program.
pub struct AnyBoard(Session);

impl AnyBoard {
    /// Opens the link and identifies the device.
    ///
    /// # Errors
    /// An unreachable link, a silent device.
    pub fn open(address: &Address, timeout: Duration) -> Result<Self, SessionError> {
        let link = crate::client::link::open(address)?;
        let mut board = Self::over(link, address.to_string(), timeout)?;
        board.0.speed = address.speed();
        board.0.settings_file = address.board().map(Into::into);
        Ok(board)
    }

    fn over(link: Box<dyn Link>, name: String, timeout: Duration) -> Result<Self, SessionError> {
        let mut session = unidentified(link, name, timeout);
        // Ends the partial frame that an earlier host may have left in the device's reader.
        session.send_bytes(&[0])?;
        session.identity = match session.request("identify itself", Request::Identify)? {
            Reply::Identity(identity) => identity,
            _ => return Err(SessionError::UnexpectedReply { what: "identify itself" }),
        };
        Ok(Self(session))
    }

    /// The device's identity.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.0.identity
    }

    /// Whether the device has this program's protocol.
    #[must_use]
    pub fn has_this_protocol(&self) -> bool {
        let it = self.identity();
        it.protocol == VERSION && it.schema == SCHEMA
    }

    /// The bytes of every page of the device's settings memory.
    ///
    /// # Errors
    /// As [`Session::stored_records`]; a device without such memory.
    pub fn stored_records(&mut self) -> Result<Vec<Vec<u8>>, SessionError> {
        if version_5::is_of(self.identity()) {
            return version_5::records(&mut self.0);
        }
        let records = self.0.stored_records()?;
        if records.is_empty() {
            let none = "it has no settings memory (the controller board: set the option byte DBANK, docs/LAB_GUIDE.md)";
            return Err(self.0.no_records(none));
        }
        Ok(records)
    }

    /// The session with the device.
    ///
    /// # Errors
    /// Another protocol; a link that breaks; a description that cannot be used.
    pub fn into_session(self) -> Result<Session, SessionError> {
        let is_known = self.has_this_protocol();
        let mut session = self.0;
        if !is_known {
            return Err(session.other_protocol());
        }
        session.description = match session.request("describe itself", Request::Describe)? {
            Reply::Description(description) => description,
            _ => return Err(SessionError::UnexpectedReply { what: "describe itself" }),
        };
        session.signals = session.read_signals()?;
        session.settings = session.read_settings()?.0;
        // Bytes that were in transit before belong to an earlier session.
        session.bad_frames = 0;
        Ok(session)
    }
}

/// A session whose device has not answered yet.
fn unidentified(link: Box<dyn Link>, name: String, timeout: Duration) -> Session {
    let nobody = Identity { protocol: 0, schema: [0; 8], firmware: Default::default(), board: Default::default() };
    let nothing = Description {
        tick_hz: 0.0,
        clock: Clock::RealTime,
        plant: PlantKind::Real,
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
        option_bytes: None,
        supply_v: None,
    };
    let now = Instant::now();
    Session {
        link,
        name,
        timeout,
        speed: Speed::REAL_TIME,
        reader: Reader::default(),
        bytes: Vec::new(),
        reports: Default::default(),
        reply: None,
        seq: 0,
        counters: None,
        bad_frames: 0,
        stale_messages: 0,
        unasked: 0,
        granted_until: None,
        clock_tick: 0,
        heard: now,
        spoke: now,
        repeated: now,
        identity: nobody,
        description: nothing,
        signals: Vec::new(),
        settings: Settings::default(),
        settings_file: None,
        has_accepted_settings: false,
    }
}

impl Session {
    /// Opens the link, identifies the device and checks that both sides have the same protocol.
    ///
    /// # Errors
    /// An unreachable link, a silent device, another protocol.
    pub fn open(address: &Address, timeout: Duration) -> Result<Self, SessionError> {
        AnyBoard::open(address, timeout)?.into_session()
    }

    /// As [`Session::open`], over an open link; `name` is its name in errors.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub fn over(link: Box<dyn Link>, name: String, timeout: Duration) -> Result<Self, SessionError> {
        AnyBoard::over(link, name, timeout)?.into_session()
    }

    /// The bytes of every page of the device's settings memory; empty if it has no such memory.
    ///
    /// # Errors
    /// As [`Session::request`]; more bytes than any board has.
    pub fn stored_records(&mut self) -> Result<Vec<Vec<u8>>, SessionError> {
        let mut pages = Vec::new();
        for page in 0..MAX_PAGES {
            let bytes = self.stored_page(page)?;
            if bytes.is_empty() {
                break;
            }
            pages.push(bytes);
        }
        Ok(pages)
    }

    fn stored_page(&mut self, page: u8) -> Result<Vec<u8>, SessionError> {
        const WHAT: &str = "report the settings that it keeps";
        let mut all = Vec::new();
        loop {
            match self.request(WHAT, Request::StoredSettings { page, from: all.len() as u16 })? {
                Reply::Stored(StoredPart { length, bytes }) if length <= MAX_BYTES => {
                    let is_empty = bytes.is_empty();
                    all.extend(bytes);
                    if all.len() == usize::from(length) {
                        return Ok(all);
                    }
                    if is_empty || all.len() > usize::from(length) {
                        return Err(self.unusable(format!("{} bytes of a settings page of {length}", all.len())));
                    }
                }
                _ => return Err(SessionError::UnexpectedReply { what: WHAT }),
            }
        }
    }

    fn read_signals(&mut self) -> Result<Vec<Signal>, SessionError> {
        const WHAT: &str = "list its signals";
        let mut table = Vec::new();
        while table.len() < usize::from(self.description.signals) {
            match self.request(WHAT, Request::Signals { from: table.len() as u8 })? {
                Reply::Signals(part) if !part.is_empty() => table.extend(part),
                _ => return Err(SessionError::UnexpectedReply { what: WHAT }),
            }
        }
        self.check_signals(&table)?;
        Ok(table)
    }

    fn other_protocol(&self) -> SessionError {
        let it = &self.identity;
        SessionError::Version {
            link: self.name.clone(),
            device_version: it.protocol,
            device_schema: hex(&it.schema),
            firmware: it.firmware.to_string(),
            board: it.board.to_string(),
            version: VERSION,
            schema: hex(&SCHEMA),
            program: env!("CARGO_PKG_VERSION"),
        }
    }
}
