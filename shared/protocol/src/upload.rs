//! Uploads: what is too long for a message goes in chunks, and counts only when the checksum of the whole is right.
//!
//! [`crate::Request::BeginUpload`] names the upload by its length and checksum and is answered with how much *of exactly this
//! one* is there, so that it goes on after a broken link, or after another program began it. A chunk that does not follow what
//! is there is not taken; every answer says where to go on. Once all is there the device checks the whole, a few bytes a
//! tick; an upload that does not agree with its checksum is dropped and has to begin again.

use crc::{CRC_32_ISO_HDLC, Crc};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Longest upload, bytes: the controller's record buffer.
pub const MOST_BYTES: u32 = 40 * 1024;

/// Most bytes in a chunk.
pub const CHUNK_BYTES: usize = 128;

/// A controller has better uses for the table's 1 KiB of flash: its line is slow.
#[cfg(target_os = "none")]
type Table = crc::NoTable;
#[cfg(not(target_os = "none"))]
type Table = crc::Table<1>;

const CRC: Crc<u32, Table> = Crc::<u32, Table>::new(&CRC_32_ISO_HDLC);

/// CRC-32 (ISO-HDLC) of `before` and then `bytes`, where `checksum` is that of `before`; 0 for none.
#[must_use]
pub fn checksum(checksum: u32, bytes: &[u8]) -> u32 {
    let mut digest = CRC.digest_with_initial((checksum ^ CRC_32_ISO_HDLC.xorout).reverse_bits());
    digest.update(bytes);
    digest.finalize()
}

/// How far an upload has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Progress {
    /// Bytes that are there: the next chunk's offset.
    pub there: u32,
    /// What is to be done.
    pub stage: UploadStage,
}

/// The stages of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum UploadStage {
    /// More chunks are to come.
    Receiving,
    /// All is there; the device looks at the checksum.
    Checking,
    /// All is there and right.
    Whole,
    /// All was there and not right; it was dropped and has to begin again.
    Damaged,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checksum_in_parts_is_that_of_the_whole() {
        // The check value of the CRC catalogue.
        assert_eq!(checksum(0, b"123456789"), 0xcbf4_3926);
        assert_eq!(checksum(checksum(checksum(0, b"1234"), b""), b"56789"), 0xcbf4_3926);
    }
}
