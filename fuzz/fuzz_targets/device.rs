//! Any bytes into a board: it must neither panic nor stop answering.
//!
//! The input is a list of pieces, each a length byte and that many bytes. A piece whose length byte is even goes to the
//! board as it is; an odd one is first wrapped as a frame with a right checksum, so that the fuzzer gets past the CRC and
//! into the message tables and everything behind them.
#![no_main]

use damprig_device::control::Name;
use damprig_device::simulated::{Progress, Simulated};
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{Answer, Ask, FromDevice, Request, ToDevice};
use libfuzzer_sys::fuzz_target;

fn run(board: &mut Simulated<f32>) -> Vec<u8> {
    let mut out = vec![];
    // A grant may be for a month: a few hundred ticks of it are enough.
    for _ in 0..4 {
        if board.run(100, |bytes| out.extend_from_slice(bytes)) == Progress::Standing {
            break;
        }
    }
    out
}

fuzz_target!(|data: &[u8]| {
    let mut board = Simulated::<f32>::new(Name::new("fuzz", "fuzz"));
    let mut rest = data;
    while let Some((&length, tail)) = rest.split_first() {
        let (piece, tail) = tail.split_at(tail.len().min(usize::from(length)));
        rest = tail;
        if length & 1 == 0 {
            board.receive(piece);
        } else {
            let mut buffer = [0; LONGEST];
            let length = frame::wrap(piece, &mut buffer).expect("a piece is at most 255 bytes");
            board.receive(&buffer[..length]);
        }
        run(&mut board);
    }
    // Whatever happened, a clean request is answered: take back any credit, end any half frame, ask.
    let mut buffer = [0; LONGEST];
    board.receive(&[0]);
    for message in [
        ToDevice::Grant { until_tick: 0 },
        ToDevice::Request(Request { seq: 54321, at_tick: None, ask: Ask::Identify }),
    ] {
        let length = frame::encode(&message, &mut buffer).expect("fits");
        board.receive(&buffer[..length]);
    }
    let mut reader = Reader::default();
    let answered = run(&mut board).into_iter().filter_map(|byte| reader.push::<FromDevice>(byte)).any(|message| {
        matches!(message, Ok(FromDevice::Reply { seq: 54321, answer: Ok(Answer::Identity(_)) }))
    });
    assert!(answered, "the board no longer answers");
});
