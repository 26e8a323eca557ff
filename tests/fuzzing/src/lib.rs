//! Fuzz targets of both sides of the link: arbitrary bytes into a board ([`device`]) and into a host ([`host`]), and whole runs
//! over a link that changes messages ([`crafted_run`]); and arbitrary bytes as a measured file ([`file()`]).
//!
//! The fuzzer runs them (`fuzz/`). `tests/run` replays them without a fuzzer, on the seeds in `fuzz/seeds` and on
//! mutations of them. [`seeds`] generates seeds.
#![forbid(unsafe_code)]

pub mod crafted_run;
pub mod messages;
pub mod mutation;
pub mod seeds;

use damprig::signal_file::SignalAxis;
use damprig_device::board::DeviceInfo;
use damprig_protocol::frame::{self, LONGEST, LONGEST_BODY, Reader};
use damprig_protocol::{FromDevice, NumberedRequest, Reply, Request, ToDevice};
use damprig_simulator::device::{Progress, SimulatedDevice};

/// A piece of the input of a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// Bytes as received from the line.
    Raw(Vec<u8>),
    /// A body, to be sent as a frame with a correct checksum. The fuzzer thus gets past the CRC to the messages and the
    /// code behind them.
    Body(Vec<u8>),
}

/// Encodes pieces as an input of [`device`]: two bytes each, little endian, whose lowest bit marks a body and whose
/// other bits are the length, followed by that many bytes.
///
/// # Panics
/// A piece is longer than 32 767 bytes.
#[must_use]
pub fn join(pieces: &[Piece]) -> Vec<u8> {
    let mut out = Vec::new();
    for piece in pieces {
        let (bytes, kind) = match piece {
            Piece::Raw(bytes) => (bytes, 0),
            Piece::Body(bytes) => (bytes, 1),
        };
        let length = u16::try_from(bytes.len() << 1).expect("a short piece");
        out.extend_from_slice(&(length | kind).to_le_bytes());
        out.extend_from_slice(bytes);
    }
    out
}

fn split(mut data: &[u8]) -> Vec<Piece> {
    let mut pieces = Vec::new();
    while let Some((head, rest)) = data.split_first_chunk::<2>() {
        let head = u16::from_le_bytes(*head);
        let is_body = head & 1 == 1;
        let most = if is_body { LONGEST_BODY } else { usize::MAX };
        let (piece, rest) = rest.split_at(rest.len().min(usize::from(head >> 1)).min(most));
        pieces.push(if is_body { Piece::Body(piece.to_vec()) } else { Piece::Raw(piece.to_vec()) });
        data = rest;
    }
    pieces
}

fn run(board: &mut SimulatedDevice<f32>) -> Vec<u8> {
    let mut out = vec![];
    // A grant may last a month; a few hundred of its ticks are enough.
    for _ in 0..4 {
        if board.run(100, |bytes| out.extend_from_slice(bytes)) == Progress::Standing {
            break;
        }
    }
    out
}

fn receive(board: &mut SimulatedDevice<f32>, piece: &Piece) {
    match piece {
        Piece::Raw(bytes) => board.receive(bytes),
        Piece::Body(body) => {
            let mut buffer = [0; LONGEST];
            let length = frame::wrap(body, &mut buffer).expect("the body fits a frame");
            board.receive(&buffer[..length]);
        }
    }
}

/// Output of a board that receives these pieces one after the other and runs a few hundred ticks of its credit after
/// each.
#[must_use]
pub fn said(pieces: &[Piece]) -> Vec<u8> {
    let mut board = Box::new(SimulatedDevice::<f32>::new(DeviceInfo::new("fuzz", "fuzz")));
    let mut out = Vec::new();
    for piece in pieces {
        receive(&mut board, piece);
        out.extend(run(&mut board));
    }
    out
}

/// Feeds bytes into a board, encoded as by [`join`]: it must not panic and must keep answering.
///
/// # Panics
/// The board panicked or stopped answering.
pub fn device(data: &[u8]) {
    let mut board = Box::new(SimulatedDevice::<f32>::new(DeviceInfo::new("fuzz", "fuzz")));
    for piece in split(data) {
        receive(&mut board, &piece);
        run(&mut board);
    }
    // A clean request must be answered after any input: take back any credit, end any partial frame, send a request.
    let mut buffer = [0; LONGEST];
    board.receive(&[0]);
    for message in [
        ToDevice::Grant { until_tick: 0 },
        ToDevice::Request(NumberedRequest { seq: 54321, at_tick: None, request: Request::Identify }),
    ] {
        let length = frame::encode(&message, &mut buffer).expect("fits");
        board.receive(&buffer[..length]);
    }
    let mut reader = Reader::default();
    let answered = run(&mut board)
        .into_iter()
        .filter_map(|byte| reader.push::<FromDevice>(byte))
        .any(|message| matches!(message, Ok(FromDevice::Reply { seq: 54321, answer: Ok(Reply::Identity(_)) })));
    assert!(answered, "the board no longer answers");
}

/// Feeds bytes into a host's reader, raw and as the body of a frame with a correct checksum: it must not panic, and
/// must read a clean frame after them.
///
/// # Panics
/// The reader panicked, or did not read the clean frame.
pub fn host(data: &[u8]) {
    let mut reader = Reader::default();
    let mut buffer = [0; LONGEST];
    let wrapped = frame::wrap(data, &mut buffer).unwrap_or(0);
    for &byte in data.iter().chain(&[0]).chain(&buffer[..wrapped]) {
        let _ = reader.push::<FromDevice>(byte);
    }
    let message = FromDevice::Clock { tick: 7 };
    let length = frame::encode(&message, &mut buffer).expect("fits");
    let read = buffer[..length].iter().filter_map(|&byte| reader.push(byte)).next();
    assert_eq!(read, Some(Ok(message)));
}

/// Reads bytes as a measured file of any kind: it must not panic, and what it reads has a place for every value.
///
/// # Panics
/// The reader panicked, or read a signal that contradicts itself.
pub fn file(data: &[u8]) {
    let Ok(contents) = damprig::signal_file::parse(data) else { return };
    for signal in &contents.signals {
        if let SignalAxis::Times(places) | SignalAxis::Frequencies(places) = &signal.axis {
            assert_eq!(places.len(), signal.values.len(), "{}", signal.name);
        }
        if let Some(imaginary) = &signal.imaginary {
            assert_eq!(imaginary.len(), signal.values.len(), "{}", signal.name);
        }
        if let Ok(even) = signal.evenly() {
            assert!(even.step_s > 0.0 && even.values.iter().all(|value| value.is_finite()), "{}", signal.name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_pieces_are_split_again_and_a_truncated_one_is_the_last() {
        let pieces = [Piece::Raw(vec![1, 2, 3]), Piece::Body(vec![0; 301]), Piece::Raw(vec![])];
        assert_eq!(split(&join(&pieces)), pieces);
        assert_eq!(split(&[0x09, 0x00, 5]), [Piece::Body(vec![5])], "cut short");
    }
}
