//! The buffer of the uploaded record. A playback borrows the record from it.
//!
//! Bytes are accepted in order only. The checksum is computed while they arrive, eight samples per tick of an idle
//! rig. That takes 2.6 s for the longest record, about as long as the transfer. An upload is kept until another one
//! begins, even if the host disconnects.

use damprig_core::control::transient::playback::{MAX_SAMPLES, RecordId};
use damprig_core::rig::Rejected;
use damprig_protocol::upload::{MAX_BYTES, Progress, UploadStage, checksum};

/// Samples added to the checksum per tick.
const CHECKED_PER_TICK: u32 = 8;

const _: () = assert!(MAX_SAMPLES as u32 * 2 == MAX_BYTES);

/// The record as far as it has arrived. A new buffer is all zeros, so it is placed in `.bss`.
#[derive(Debug)]
pub struct UploadBuffer {
    samples: [i16; MAX_SAMPLES],
    /// Length in samples and checksum of the upload that was begun; 0 samples for none.
    wanted: u32,
    crc32: u32,
    there: u32,
    /// Largest |sample| received.
    peak: u16,
    checked: u32,
    running: u32,
    /// Samples that may be lent: all once the checksum matches, before that 0.
    whole: u32,
    damaged: bool,
}

impl Default for UploadBuffer {
    fn default() -> Self {
        Self::new()
    }
}

impl UploadBuffer {
    /// Makes an empty buffer.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            samples: [0; MAX_SAMPLES],
            wanted: 0,
            crc32: 0,
            there: 0,
            peak: 0,
            checked: 0,
            running: 0,
            whole: 0,
            damaged: false,
        }
    }

    /// Continues this upload, or begins it if it is another one. `bytes` is an even number up to the capacity.
    pub fn begin(&mut self, bytes: u32, crc32: u32) {
        let samples = bytes / 2;
        if (samples, crc32) != (self.wanted, self.crc32) || self.damaged {
            (self.wanted, self.crc32) = (samples, crc32);
            self.drop_all();
            self.damaged = false;
        }
    }

    fn drop_all(&mut self) {
        (self.there, self.peak, self.checked, self.running, self.whole) = (0, 0, 0, 0, 0);
    }

    /// Stores the bytes if they continue the received part; otherwise nothing changes.
    ///
    /// # Errors
    /// No upload was begun, or the bytes go beyond its end.
    pub fn take(&mut self, offset: u32, data: &[u8]) -> Result<(), Rejected> {
        if self.wanted == 0 {
            return Err(Rejected::not_here("no upload was begun (or the board was reset): begin it"));
        }
        let length = (data.len() / 2) as u32;
        let end = (offset / 2).saturating_add(length);
        if end > self.wanted {
            return Err(Rejected::not_here("the chunk goes beyond the end of its upload"));
        }
        if offset / 2 == self.there && !self.damaged {
            let free = self.samples.get_mut(self.there as usize..end as usize).unwrap_or_default();
            for (sample, bytes) in free.iter_mut().zip(data.as_chunks::<2>().0) {
                *sample = i16::from_le_bytes(*bytes);
                self.peak = self.peak.max(sample.unsigned_abs());
            }
            self.there = end;
        }
        Ok(())
    }

    /// Progress of the upload.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let stage = if self.damaged {
            UploadStage::Damaged
        } else if self.there < self.wanted || self.wanted == 0 {
            UploadStage::Receiving
        } else if self.checked < self.wanted {
            UploadStage::Checking
        } else {
            UploadStage::Whole
        };
        Progress { there: 2 * self.there, stage }
    }

    /// Adds some samples to the checksum. Called once per tick of an idle rig.
    #[inline]
    pub fn check(&mut self) {
        if self.checked < self.there {
            self.check_some();
        }
    }

    fn check_some(&mut self) {
        let end = self.there.min(self.checked + CHECKED_PER_TICK);
        let samples = self.samples.get(self.checked as usize..end as usize).unwrap_or_default();
        let mut bytes = [0; 2 * CHECKED_PER_TICK as usize];
        for (bytes, sample) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(samples) {
            *bytes = sample.to_le_bytes();
        }
        self.running = checksum(self.running, bytes.get(..2 * samples.len()).unwrap_or_default());
        self.checked = end;
        if self.checked < self.wanted {
            return;
        }
        if self.running == self.crc32 {
            self.whole = self.wanted;
        } else {
            self.drop_all();
            self.damaged = true;
        }
    }

    /// Whether this record has been received completely and its checksum matches.
    #[must_use]
    pub fn holds(&self, wanted: &RecordId) -> bool {
        self.whole > 0 && (u32::from(wanted.samples), wanted.crc32) == (self.wanted, self.crc32)
    }

    /// Largest |sample| of this record in counts; `None` unless [`UploadBuffer::holds`] it.
    #[must_use]
    pub fn peak_counts(&self, wanted: &RecordId) -> Option<u16> {
        self.holds(wanted).then_some(self.peak)
    }

    /// The complete record; empty until the checksum matches.
    #[must_use]
    pub fn record(&self) -> &[i16] {
        self.samples.get(..self.whole as usize).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::vec::Vec;

    fn record(samples: usize, seed: u32) -> Vec<u8> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        (0..2 * samples).map(|_| next()).collect()
    }

    fn settle(buffer: &mut UploadBuffer) -> UploadStage {
        (0..MAX_SAMPLES).for_each(|_| buffer.check());
        buffer.progress().stage
    }

    fn send(buffer: &mut UploadBuffer, bytes: &[u8]) {
        let from = buffer.progress().there as usize;
        for (n, chunk) in bytes[from..].chunks(128).enumerate() {
            buffer.take((from + n * 128) as u32, chunk).unwrap();
        }
    }

    #[test]
    fn a_record_received_in_chunks_is_lent_once_its_checksum_matches() {
        for samples in [1, 7, 64, 65, MAX_SAMPLES] {
            let (mut buffer, bytes) = (UploadBuffer::new(), record(samples, 5));
            let id = RecordId { samples: samples as u16, crc32: checksum(0, &bytes) };
            buffer.begin(bytes.len() as u32, id.crc32);
            send(&mut buffer, &bytes);
            assert_eq!(buffer.progress(), Progress { there: bytes.len() as u32, stage: UploadStage::Checking });
            assert!(!buffer.holds(&id) && buffer.record().is_empty());
            assert_eq!(settle(&mut buffer), UploadStage::Whole);
            let lent: Vec<u8> = buffer.record().iter().flat_map(|s| s.to_le_bytes()).collect();
            assert!(buffer.holds(&id) && lent == bytes);
            assert!(!buffer.holds(&RecordId { crc32: id.crc32 ^ 1, ..id }));
        }
    }

    #[test]
    fn a_chunk_out_of_order_or_repeated_changes_nothing() {
        let (mut buffer, bytes) = (UploadBuffer::new(), record(300, 9));
        buffer.begin(600, checksum(0, &bytes));
        buffer.take(0, &bytes[..128]).unwrap();
        for (offset, data) in [(256, &bytes[256..384]), (0, &bytes[..128]), (64, &bytes[64..192])] {
            buffer.take(offset, data).unwrap();
            assert_eq!(buffer.progress().there, 128, "at {offset}");
        }
        send(&mut buffer, &bytes);
        assert_eq!(settle(&mut buffer), UploadStage::Whole);
    }

    #[test]
    fn the_same_upload_continues_and_another_one_begins_at_zero() {
        let (mut buffer, bytes, other) = (UploadBuffer::new(), record(300, 9), record(300, 10));
        buffer.begin(600, checksum(0, &bytes));
        buffer.take(0, &bytes[..128]).unwrap();
        buffer.check();
        buffer.begin(600, checksum(0, &bytes));
        assert_eq!(buffer.progress().there, 128);
        buffer.begin(600, checksum(0, &other));
        assert_eq!(buffer.progress().there, 0);
        send(&mut buffer, &other);
        assert_eq!(settle(&mut buffer), UploadStage::Whole);
        buffer.begin(600, checksum(0, &other));
        assert_eq!(buffer.progress().stage, UploadStage::Whole, "a complete upload is kept");
    }

    #[test]
    fn a_record_with_a_wrong_checksum_is_dropped_and_can_be_uploaded_again() {
        let (mut buffer, bytes) = (UploadBuffer::new(), record(300, 9));
        let crc32 = checksum(0, &bytes);
        let mut wrong = bytes.clone();
        wrong[333] ^= 4;
        buffer.begin(600, crc32);
        send(&mut buffer, &wrong);
        assert_eq!(settle(&mut buffer), UploadStage::Damaged);
        assert!(buffer.record().is_empty());
        buffer.take(0, &bytes[..128]).unwrap();
        assert_eq!(buffer.progress().there, 0, "a new upload must begin first");
        buffer.begin(600, crc32);
        send(&mut buffer, &bytes);
        assert_eq!(settle(&mut buffer), UploadStage::Whole);
    }

    #[test]
    fn bytes_before_an_upload_begins_or_beyond_its_end_are_rejected() {
        let mut buffer = UploadBuffer::new();
        assert!(matches!(buffer.take(0, &[0; 4]), Err(Rejected::NotHere { why }) if why.contains("begin")));
        buffer.begin(6, 1);
        assert!(matches!(buffer.take(0, &[0; 8]), Err(Rejected::NotHere { why }) if why.contains("beyond")));
        assert!(buffer.take(u32::MAX - 1, &[0; 2]).is_err());
    }
}
