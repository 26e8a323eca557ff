//! Uploads: a record too long for one message is sent in chunks and accepted when the checksum of the whole matches.
//!
//! [`crate::Request::BeginUpload`] identifies the upload by its length and checksum. The reply says how much of
//! exactly this upload has been received, so an upload continues after a broken link, even from another program. A
//! chunk that does not continue the received part is ignored; every reply says where to continue. When everything has
//! been received the device verifies the checksum, a few bytes per tick. A damaged upload is dropped and must begin
//! again.

use crc::{CRC_32_ISO_HDLC, Crc};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Longest upload, bytes: the size of the controller's record buffer.
pub const MAX_BYTES: u32 = 40 * 1024;

/// Maximum number of bytes in a chunk.
pub const CHUNK_BYTES: usize = 128;

/// The controller computes the CRC without a table: its link is slow, and the table costs 1 KiB of flash.
#[cfg(target_os = "none")]
type Table = crc::NoTable;
#[cfg(not(target_os = "none"))]
type Table = crc::Table<1>;

const CRC: Crc<u32, Table> = Crc::<u32, Table>::new(&CRC_32_ISO_HDLC);

/// CRC-32 (ISO-HDLC) of a preceding part and `bytes`, where `checksum` is that of the preceding part; 0 if there is
/// none.
#[must_use]
pub fn checksum(checksum: u32, bytes: &[u8]) -> u32 {
    let mut digest = CRC.digest_with_initial((checksum ^ CRC_32_ISO_HDLC.xorout).reverse_bits());
    digest.update(bytes);
    digest.finalize()
}

/// Progress of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Progress {
    /// Bytes received: the offset of the next chunk.
    pub there: u32,
    /// Stage of the upload.
    pub stage: UploadStage,
}

/// Stages of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum UploadStage {
    /// More chunks are expected.
    Receiving,
    /// All bytes have been received; the device computes the checksum.
    Checking,
    /// All bytes have been received and the checksum matches.
    Whole,
    /// The checksum did not match. The upload was dropped and must begin again.
    Damaged,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_can_be_computed_in_parts() {
        // Check value of the CRC catalogue.
        assert_eq!(checksum(0, b"123456789"), 0xcbf4_3926);
        assert_eq!(checksum(checksum(checksum(0, b"1234"), b""), b"56789"), 0xcbf4_3926);
    }
}
