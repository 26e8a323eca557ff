//! What any bytes may do to either side of the link.
//!
//! [`device`] and [`host`] are what the fuzzer runs (`fuzz/`) and what `tests/run` replays without one, on the seeds that
//! are kept in `fuzz/seeds` and on mutations of them. Where seeds come from is [`seeds`]'s.
#![forbid(unsafe_code)]

pub mod messages;
pub mod mutation;
pub mod seeds;

use damprig_device::board::DeviceInfo;
use damprig_protocol::frame::{self, LONGEST, LONGEST_BODY, Reader};
use damprig_protocol::{FromDevice, NumberedRequest, Reply, Request, ToDevice};
use damprig_simulator::device::{Progress, SimulatedDevice};

/// A piece of what a board receives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// Bytes as they come from the line.
    Raw(Vec<u8>),
    /// A body, to be sent as a frame with a right checksum: so the fuzzer gets past the CRC and into the messages and
    /// everything behind them.
    Body(Vec<u8>),
}

/// Pieces as an input of [`device`]: two bytes each, little endian, whose lowest bit tells a body and the others the
/// length, then so many bytes.
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
    // A grant may be for a month: a few hundred ticks of it are enough.
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
            let length = frame::wrap(body, &mut buffer).expect("a body is no longer than it may be");
            board.receive(&buffer[..length]);
        }
    }
}

/// What a board says when it gets these pieces one after the other, each with a few hundred ticks of its credit.
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

/// Any bytes into a board, as [`join`] writes them: it must neither panic nor stop answering.
///
/// # Panics
/// It did.
pub fn device(data: &[u8]) {
    let mut board = Box::new(SimulatedDevice::<f32>::new(DeviceInfo::new("fuzz", "fuzz")));
    for piece in split(data) {
        receive(&mut board, &piece);
        run(&mut board);
    }
    // Whatever happened, a clean request is answered: take back any credit, end any half frame, ask.
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

/// Any bytes into a host's reader, as they are and as the body of a frame with a right checksum: it must not panic, and
/// a clean frame after them must be read.
///
/// # Panics
/// It did, or the frame was not.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_split_as_they_were_joined_and_any_rest_is_a_piece() {
        let pieces = [Piece::Raw(vec![1, 2, 3]), Piece::Body(vec![0; 301]), Piece::Raw(vec![])];
        assert_eq!(split(&join(&pieces)), pieces);
        assert_eq!(split(&[0x09, 0x00, 5]), [Piece::Body(vec![5])], "cut short");
    }
}
