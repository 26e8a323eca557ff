//! Brings a record to the device: in chunks, from where the device is, until it says that the whole is right.

use damprig_protocol::Reply;
use damprig_protocol::Request;
use damprig_protocol::upload::{CHUNK_BYTES, Progress, UploadStage, checksum};

use crate::session::{Session, SessionError};

/// Answers that do not bring an upload on, after which it is given up.
const FRUITLESS: u32 = 8;

/// Looks at an upload that is being checked: on a real board each waits for a moment.
const MOST_LOOKS: u32 = 600;

/// Times that the whole may arrive damaged.
const MOST_DAMAGED: u32 = 3;

const WHAT: &str = "take a record";

impl Session {
    /// Uploads `bytes` (of even length), unless the device has exactly them; `go_on` is asked now and then.
    ///
    /// # Errors
    /// As [`Session::ask`]; an upload that does not come to its end; `go_on` said no.
    pub fn upload(&mut self, bytes: &[u8], go_on: &mut dyn FnMut() -> bool) -> Result<(), SessionError> {
        let begin = Request::BeginUpload { bytes: bytes.len() as u32, crc32: checksum(0, bytes) };
        let (mut damaged, mut fruitless, mut looks) = (0, 0, 0);
        let mut progress = self.progress(begin.clone())?;
        loop {
            if !go_on() {
                return Err(SessionError::Interrupted);
            }
            let before = progress.there;
            progress = match progress.stage {
                UploadStage::Whole => return Ok(()),
                UploadStage::Receiving => self.progress(chunk(bytes, progress.there))?,
                UploadStage::Checking => {
                    // Time passes on the device; nothing else is reported of an idle rig.
                    self.next_report()?;
                    looks += 1;
                    self.progress(chunk(bytes, bytes.len() as u32))?
                }
                UploadStage::Damaged => {
                    damaged += 1;
                    self.progress(begin.clone())?
                }
            };
            fruitless =
                if progress.there == before && progress.stage == UploadStage::Receiving { fruitless + 1 } else { 0 };
            let why = if fruitless >= FRUITLESS {
                format!("{} of {} bytes are there, and no more are taken", progress.there, bytes.len())
            } else if looks >= MOST_LOOKS {
                "the device did not come to the end of its check".to_string()
            } else if damaged >= MOST_DAMAGED {
                format!("its checksum was wrong {damaged} times")
            } else {
                continue;
            };
            return Err(SessionError::Upload { why });
        }
    }

    fn progress(&mut self, ask: Request) -> Result<Progress, SessionError> {
        match self.ask(WHAT, ask)? {
            Reply::Upload(progress) => Ok(progress),
            _ => Err(SessionError::Confused { what: WHAT }),
        }
    }
}

fn chunk(bytes: &[u8], from: u32) -> Request {
    let rest = bytes.get(from as usize..).unwrap_or_default();
    Request::UploadChunk { offset: from, data: rest.iter().take(CHUNK_BYTES).copied().collect() }
}
