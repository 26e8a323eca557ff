//! Reads the settings of a firmware with protocol version 5, the last one that cannot report the bytes that it keeps.
//!
//! The messages are declared here as they were, as far as they are needed: this program's own have moved on. This file can go
//! when such firmware is no longer in use.

use std::time::Instant;

use damprig_core::settings::{Settings, Source};
use damprig_device::settings_record::{RECORD_BYTES, encode};
use damprig_protocol::Identity;
use damprig_protocol::frame::{LONGEST, Reader, wrap};
use serde::Deserialize;

use super::{Session, SessionError, TURN};

const SCHEMA: [u8; 8] = [0x21, 0xa1, 0x19, 0x63, 0x0a, 0xbf, 0xe2, 0x68];

#[derive(Deserialize)]
#[allow(clippy::large_enum_variant)]
enum FromDevice {
    Reply { seq: u16, answer: Result<Reply, ()> },
}

#[derive(Deserialize)]
#[allow(clippy::large_enum_variant, dead_code)] // Only the place of the eighth variant counts.
enum Reply {
    Identity,
    Done,
    Description,
    Status,
    Result,
    Signals,
    Snippet,
    Settings { settings: Settings, source: Source },
}

/// Whether the device has this protocol.
pub(super) fn is_of(identity: &Identity) -> bool {
    identity.protocol == 5 && identity.schema == SCHEMA
}

/// The settings that the board keeps, as a page of its settings memory would have them; an erased page if it is as delivered.
///
/// # Errors
/// A silent device; settings that are not saved.
pub(super) fn records(session: &mut Session) -> Result<Vec<Vec<u8>>, SessionError> {
    let page = match settings(session)? {
        (_, Source::Default) => Some([0xff; RECORD_BYTES]),
        (_, Source::Damaged) => Some([0; RECORD_BYTES]),
        (settings, Source::Stored) => encode(0, &settings),
        _ => None,
    };
    let unsaved = "those in use are changed and not saved; save them with the damprig of its version";
    page.map(|page| vec![page.to_vec()]).ok_or_else(|| session.no_records(unsaved))
}

fn settings(session: &mut Session) -> Result<(Settings, Source), SessionError> {
    let wanted = session.next_seq();
    // A request with this number, one byte in a new session, to be served at once, of the eighteenth kind.
    let mut frame = [0; LONGEST];
    let length = wrap(&[0, wanted as u8 & 0x7f, 0, 17], &mut frame).unwrap_or(0);
    let (mut reader, begun) = (Reader::default(), Instant::now());
    while begun.elapsed() < session.timeout {
        session.send_bytes(&frame[..length])?;
        let sent = Instant::now();
        while sent.elapsed() < session.repeat_after() {
            let mut bytes = Vec::new();
            let link = session.name.clone();
            session.link.receive(&mut bytes, TURN).map_err(|error| SessionError::Broken { link, error })?;
            for message in bytes.into_iter().filter_map(|byte| reader.push::<FromDevice>(byte)) {
                if let Ok(FromDevice::Reply { seq, answer: Ok(Reply::Settings { settings, source }) }) = message
                    && seq == wanted
                {
                    session.check_settings(&settings)?;
                    return Ok((settings, source));
                }
            }
        }
    }
    Err(session.silent())
}
