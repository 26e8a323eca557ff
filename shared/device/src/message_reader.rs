//! Reads messages from received bytes and counts bad frames.

use damprig_protocol::ToDevice;
use damprig_protocol::frame::Reader;

/// Reads messages from received bytes.
#[derive(Clone, Debug, Default)]
pub struct MessageReader {
    reader: Reader,
    bad_frames: u32,
}

impl MessageReader {
    /// Takes one byte; returns the message that it completes.
    pub fn push(&mut self, byte: u8) -> Option<ToDevice> {
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
