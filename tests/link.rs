//! Damaged frames on the link: no damaged message is accepted, the stream resynchronises, all losses are counted.

use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{FromDevice, NumberedRequest, Request, Telemetry, ToDevice};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;
use serde::de::DeserializeOwned;

const FRAMES: u32 = 1_000_000;

/// Damaged frames per thousand.
const DAMAGED_PER_MILLE: u32 = 300;

#[derive(Default)]
struct Tally {
    accepted: u32,
    wrong: u32,
    bad: u32,
    untouched_but_lost: u32,
    /// Frames truncated to nothing; only the sequence numbers reveal them.
    vanished: u32,
    runs_of_lost: u32,
}

/// Sends a million numbered messages over a line that flips bits and inserts, deletes and truncates bytes.
fn send_over_a_bad_line<T>(seed: u64, message: impl Fn(u32) -> T, number: impl Fn(&T) -> Option<u32>) -> Tally
where
    T: Serialize + DeserializeOwned + PartialEq,
{
    let mut random = SmallRng::seed_from_u64(seed);
    let mut reader = Reader::default();
    let mut tally = Tally::default();
    let mut buffer = [0; LONGEST];
    let mut bytes = vec![];
    // Whether the zero before this frame arrived, so that the reader is in step.
    let mut in_step = true;
    let mut last_was_lost = false;
    for n in 0..FRAMES {
        let length = frame::encode(&message(n), &mut buffer).expect("fits");
        bytes.clear();
        bytes.extend_from_slice(&buffer[..length]);
        let damaged = random.random_range(0..1000) < DAMAGED_PER_MILLE;
        if damaged {
            for _ in 0..random.random_range(1..4) {
                damage(&mut bytes, &mut random);
            }
        }
        tally.vanished += u32::from(bytes.is_empty());
        let mut arrived = false;
        for &byte in &bytes {
            match reader.push::<T>(byte) {
                Some(Ok(received)) if number(&received).is_some_and(|n| message(n) == received) => {
                    tally.accepted += 1;
                    arrived = number(&received) == Some(n);
                }
                Some(Ok(_)) => tally.wrong += 1,
                Some(Err(_)) => tally.bad += 1,
                None => {}
            }
        }
        if !arrived {
            tally.untouched_but_lost += u32::from(!damaged && in_step);
            tally.runs_of_lost += u32::from(!last_was_lost);
        }
        last_was_lost = !arrived;
        in_step = bytes.last().map_or(in_step, |&byte| byte == 0);
    }
    tally
}

fn damage(bytes: &mut Vec<u8>, random: &mut SmallRng) {
    if bytes.is_empty() {
        return;
    }
    let at = random.random_range(0..bytes.len());
    match random.random_range(0..4) {
        0 => bytes[at] ^= 1 << random.random_range(0..8),
        1 => bytes.insert(at, random.random()),
        2 => drop(bytes.remove(at)),
        _ => bytes.truncate(at),
    }
}

fn check(tally: &Tally) {
    println!(
        "{FRAMES} frames: {} accepted, {} wrong, {} counted as bad, {} runs of lost frames",
        tally.accepted, tally.wrong, tally.bad, tally.runs_of_lost
    );
    assert_eq!(tally.wrong, 0, "a damaged frame was accepted");
    assert_eq!(tally.untouched_but_lost, 0, "a clean frame after a clean delimiter was lost");
    assert!(tally.bad + tally.vanished >= tally.runs_of_lost, "a loss was not counted");
    assert!(tally.accepted > FRAMES / 2);
}

#[test]
fn no_damaged_request_of_a_million_is_accepted() {
    let message = |n: u32| {
        ToDevice::Request(NumberedRequest {
            seq: n as u16,
            at_tick: Some(n),
            request: if n.is_multiple_of(2) {
                Request::Stop
            } else {
                Request::SetTelemetry { every_ticks: (n >> 3) as u16, signals: Default::default(), impacts: false }
            },
        })
    };
    let number = |message: &ToDevice| match message {
        ToDevice::Request(request) => request.at_tick,
        ToDevice::Grant { .. } => None,
    };
    check(&send_over_a_bad_line(1, message, number));
}

#[test]
fn no_damaged_telemetry_frame_of_a_million_gives_a_wrong_sample() {
    let message = |n: u32| {
        let values = (0..8).map(|k| f32::from_bits(n.wrapping_mul(2_654_435_761).wrapping_add(k) >> 2)).collect();
        FromDevice::Telemetry(Telemetry { seq: n, first_tick: n.wrapping_mul(5), every_ticks: 5, width: 8, values })
    };
    let number = |message: &FromDevice| match message {
        FromDevice::Telemetry(telemetry) => Some(telemetry.seq),
        _ => None,
    };
    check(&send_over_a_bad_line(2, message, number));
}

#[test]
fn eight_signals_at_1_khz_leave_two_fifths_of_the_line_free() {
    use damprig_protocol::MAX_VALUES;
    const SIGNALS: usize = 8;
    let rows = MAX_VALUES / SIGNALS;
    let mut random = SmallRng::seed_from_u64(3);
    let (mut bytes, mut count) = (0, 0);
    // The largest numbers that a message may carry, and values without a pattern.
    for n in 0..1000 {
        let values = (0..rows * SIGNALS).map(|_| f32::from_bits(random.random::<u32>() >> 2)).collect();
        let (seq, first_tick) = (u32::MAX - n, u32::MAX - 8 * n);
        let message =
            FromDevice::Telemetry(Telemetry { seq, first_tick, every_ticks: 1, width: SIGNALS as u8, values });
        bytes += frame::encode(&message, &mut [0; LONGEST]).expect("fits");
        count += rows;
    }
    let bytes_per_s = bytes as f64 / count as f64 * 1000.0;
    let share = bytes_per_s / (f64::from(damprig_device::outbox::BAUD) / 10.0);
    println!("{SIGNALS} signals at 1 kHz: {bytes_per_s:.0} bytes a second, {:.1} % of the line", 100.0 * share);
    assert!(share < 0.6, "{share}");
}
