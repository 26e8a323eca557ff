//! Uploads a motion record to the device in chunks, each from the device's position, until it confirms the checksum.

use damprig_protocol::Reply;
use damprig_protocol::Request;
use damprig_protocol::upload::{CHUNK_BYTES, Progress, UploadStage, checksum};

use crate::client::session::{Session, SessionError};

/// Replies without progress after which an upload fails.
const MAX_FRUITLESS: u32 = 8;

/// Polls of an upload that the device is checking; on a real board each waits a short time.
const MAX_LOOKS: u32 = 600;

/// Times that the checksum may be wrong.
const MAX_DAMAGED: u32 = 3;

const WHAT: &str = "take a record";

impl Session {
    /// Uploads `bytes` (of even length), unless the device has them already; stops when `go_on` returns false.
    ///
    /// # Errors
    /// As [`Session::request`]; an upload that makes no progress; `go_on` returned false.
    pub fn upload(&mut self, bytes: &[u8], go_on: &mut dyn FnMut() -> bool) -> Result<(), SessionError> {
        let begin = Request::BeginUpload { bytes: bytes.len() as u32, crc32: checksum(0, bytes) };
        let (mut damaged, mut fruitless, mut looks) = (0, 0, 0);
        // Most bytes that the device has had.
        let mut most = 0;
        let mut progress = self.progress(begin.clone())?;
        loop {
            if !go_on() {
                return Err(SessionError::Interrupted);
            }
            progress = match progress.stage {
                UploadStage::Whole => return Ok(()),
                UploadStage::Receiving => self.progress(chunk(bytes, progress.there))?,
                UploadStage::Checking => {
                    // Lets time pass on the device; an idle rig reports nothing else.
                    self.next_report()?;
                    looks += 1;
                    self.progress(chunk(bytes, bytes.len() as u32))?
                }
                UploadStage::Damaged => {
                    damaged += 1;
                    most = 0;
                    self.progress(begin.clone())?
                }
            };
            fruitless =
                if progress.there <= most && progress.stage == UploadStage::Receiving { fruitless + 1 } else { 0 };
            most = most.max(progress.there);
            let why = if fruitless >= MAX_FRUITLESS {
                format!("the device has {} of {} bytes and accepts no more", progress.there, bytes.len())
            } else if looks >= MAX_LOOKS {
                "the device did not finish its check".to_string()
            } else if damaged >= MAX_DAMAGED {
                format!("its checksum was wrong {damaged} times")
            } else {
                continue;
            };
            return Err(SessionError::Upload { why });
        }
    }

    fn progress(&mut self, ask: Request) -> Result<Progress, SessionError> {
        match self.request(WHAT, ask)? {
            Reply::Upload(progress) => Ok(progress),
            _ => Err(SessionError::UnexpectedReply { what: WHAT }),
        }
    }
}

fn chunk(bytes: &[u8], from: u32) -> Request {
    let rest = bytes.get(from as usize..).unwrap_or_default();
    Request::UploadChunk { offset: from, data: rest.iter().take(CHUNK_BYTES).copied().collect() }
}
