//! Frames on the byte stream: COBS encoding, CRC-32 checksum, terminated by a zero byte.

use crate::upload;
use serde::{Serialize, de::DeserializeOwned};

/// Longest body, bytes: enough for a stepped sine of 400 frequencies.
pub const LONGEST_BODY: usize = 1_728;

const CHECKSUM: usize = 4;

/// Longest frame with its terminating zero, bytes. COBS adds one byte for every 254 bytes or part of them.
pub const LONGEST: usize = LONGEST_BODY + CHECKSUM + (LONGEST_BODY + CHECKSUM).div_ceil(254) + 1;

/// Why a frame is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadFrame {
    /// Longer than [`LONGEST`].
    TooLong,
    /// Not valid COBS, or shorter than a checksum.
    Malformed,
    /// The checksum does not match.
    Checksum,
    /// The body is not a message of this protocol.
    Message,
}

/// Writes `message` as a frame into `out`; returns its length. `None` when it is longer than [`LONGEST`].
pub fn encode<T: Serialize>(message: &T, out: &mut [u8; LONGEST]) -> Option<usize> {
    let mut checked = [0; LONGEST_BODY + CHECKSUM];
    let length = postcard::to_slice(message, &mut checked[..LONGEST_BODY]).ok()?.len();
    seal(&mut checked, length, out)
}

/// Writes an arbitrary body as a frame into `out`; returns its length. `None` when it is longer than
/// [`LONGEST_BODY`].
pub fn wrap(body: &[u8], out: &mut [u8; LONGEST]) -> Option<usize> {
    let mut checked = [0; LONGEST_BODY + CHECKSUM];
    checked[..LONGEST_BODY].get_mut(..body.len())?.copy_from_slice(body);
    seal(&mut checked, body.len(), out)
}

/// Appends the checksum to a body of this length and encodes both as a frame.
fn seal(checked: &mut [u8; LONGEST_BODY + CHECKSUM], length: usize, out: &mut [u8; LONGEST]) -> Option<usize> {
    let (body, end) = checked.split_at_mut_checked(length)?;
    end.first_chunk_mut::<CHECKSUM>()?.copy_from_slice(&upload::checksum(0, body).to_le_bytes());
    let length = cobs::encode(checked.get(..length + CHECKSUM)?, out);
    *out.get_mut(length)? = 0;
    Some(length + 1)
}

/// Finds frames in a byte stream and decodes them.
#[derive(Clone, Debug)]
pub struct Reader {
    buffer: [u8; LONGEST],
    length: usize,
    too_long: bool,
}

impl Default for Reader {
    fn default() -> Self {
        Self { buffer: [0; LONGEST], length: 0, too_long: false }
    }
}

impl Reader {
    /// Takes one byte; returns the message or the error that it completes, if any. Empty frames are skipped.
    pub fn push<T: DeserializeOwned>(&mut self, byte: u8) -> Option<Result<T, BadFrame>> {
        if byte != 0 {
            if let Some(slot) = self.buffer.get_mut(self.length) {
                *slot = byte;
                self.length += 1;
            } else {
                self.too_long = true;
            }
            return None;
        }
        let length = core::mem::take(&mut self.length);
        if core::mem::take(&mut self.too_long) {
            return Some(Err(BadFrame::TooLong));
        }
        (length > 0).then(|| Self::decode(&mut self.buffer[..length]))
    }

    fn decode<T: DeserializeOwned>(frame: &mut [u8]) -> Result<T, BadFrame> {
        let length = cobs::decode_in_place(frame).map_err(|_| BadFrame::Malformed)?;
        let (body, checksum) =
            frame.get(..length).and_then(|whole| whole.split_last_chunk::<CHECKSUM>()).ok_or(BadFrame::Malformed)?;
        if upload::checksum(0, body) != u32::from_le_bytes(*checksum) {
            return Err(BadFrame::Checksum);
        }
        match postcard::take_from_bytes(body) {
            Ok((message, [])) => Ok(message),
            _ => Err(BadFrame::Message),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FromDevice, NumberedRequest, Request, Telemetry, ToDevice};

    fn request(seq: u16) -> ToDevice {
        ToDevice::Request(NumberedRequest { seq, at_tick: Some(99), request: Request::Start })
    }

    fn read_all(bytes: &[u8]) -> (heapless::Vec<ToDevice, 8>, usize) {
        let (mut reader, mut good, mut bad) = (Reader::default(), heapless::Vec::new(), 0);
        for &byte in bytes {
            match reader.push(byte) {
                Some(Ok(message)) => good.push(message).unwrap(),
                Some(Err(_)) => bad += 1,
                None => {}
            }
        }
        (good, bad)
    }

    #[test]
    fn a_message_decodes_to_what_was_encoded() {
        let mut out = [0; LONGEST];
        let length = encode(&request(5), &mut out).unwrap();
        assert_eq!(read_all(&out[..length]).0.as_slice(), [request(5)]);
    }

    #[test]
    fn every_single_bit_flip_is_noticed_and_the_next_frame_is_read() {
        let mut first = [0; LONGEST];
        let length = encode(&request(5), &mut first).unwrap();
        let mut second = [0; LONGEST];
        let second_length = encode(&request(6), &mut second).unwrap();
        for bit in 0..length * 8 {
            let mut stream = first;
            stream[bit / 8] ^= 1 << (bit % 8);
            stream[length..length + second_length].copy_from_slice(&second[..second_length]);
            let (good, bad) = read_all(&stream[..length + second_length]);
            // A flip in the terminating zero joins both frames into one invalid frame.
            let closing = bit / 8 == length - 1;
            let expected: &[ToDevice] = if closing { &[] } else { &[request(6)] };
            assert_eq!(good.as_slice(), expected, "bit {bit}");
            assert!(bad >= 1, "bit {bit}");
        }
    }

    #[test]
    fn an_endless_frame_is_counted_once_and_skipped() {
        let mut stream = [1; LONGEST * 2 + 40];
        let mut frame = [0; LONGEST];
        let length = encode(&request(5), &mut frame).unwrap();
        let end = LONGEST * 2;
        stream[end] = 0;
        stream[end + 1..end + 1 + length].copy_from_slice(&frame[..length]);
        let (good, bad) = read_all(&stream[..end + 1 + length]);
        assert_eq!((good.as_slice(), bad), ([request(5)].as_slice(), 1));
    }

    #[test]
    fn a_stepped_sine_of_the_most_points_with_every_loop_fits() {
        use damprig_core::control::base_loop::ClosedLoop;
        use damprig_core::control::phase_lock::PhaseLock;
        use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
        use damprig_core::control::stepped_sine::{DriveMode, MAX_POINTS, Points, Start, SteppedSine};
        let amplitudes = core::iter::repeat_n(2e-3, MAX_POINTS).collect();
        let response = KeptQuantity::Displacement { amplitude_m: 2e-3 };
        let sine = SteppedSine {
            start: Start::FromRest { level_m: 5e-4 },
            amplitude_m: 1e-3,
            drive: DriveMode::Response(ResponseLoop::new(response, Some(ClosedLoop::default()))),
            ramp_s: 0.0,
            settle_s: 1.0,
            dwell_s: 4.0,
            steady: Default::default(),
            first_index: u16::MAX,
            points: Points::Resonance { lock: PhaseLock::new(2.0, 3.0), amplitudes },
        };
        let request = NumberedRequest { seq: u16::MAX, at_tick: Some(u32::MAX), request: Request::Configure(sine) };
        assert!(encode(&ToDevice::Request(request), &mut [0; LONGEST]).is_some());
    }

    #[test]
    fn the_longest_telemetry_fits() {
        let values = core::iter::repeat_n(1.5, crate::MAX_VALUES).collect();
        let (seq, first_tick) = (u32::MAX, u32::MAX);
        let message = FromDevice::Telemetry(Telemetry { seq, first_tick, every_ticks: 9, width: 16, values });
        assert!(encode(&message, &mut [0; LONGEST]).is_some());
    }
}
