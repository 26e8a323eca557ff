//! Received bytes to messages; what is no message is counted.

use damprig_protocol::ask::ToDevice;
use damprig_protocol::frame::Reader;
use serde::de::DeserializeOwned;

/// Finds messages in the received bytes.
#[derive(Clone, Debug, Default)]
pub struct Intake {
    reader: Reader,
    bad_frames: u32,
}

impl Intake {
    /// Takes one byte; the message that it completes, if any.
    pub fn push<P: DeserializeOwned>(&mut self, byte: u8) -> Option<ToDevice<P>> {
        match self.reader.push(byte)? {
            Ok(message) => Some(message),
            Err(_) => {
                self.bad_frames = self.bad_frames.saturating_add(1);
                None
            }
        }
    }

    /// Frames that were too long, did not decode or failed their checksum, since power-on.
    #[must_use]
    pub fn bad_frames(&self) -> u32 {
        self.bad_frames
    }
}
