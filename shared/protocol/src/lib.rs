//! The messages between a rig and its host, and the frames that carry them.
//!
//! The protocol in one page:
//!
//! * A **frame** is `COBS(body ‖ CRC-32(body), little endian) ‖ 0x00`; see [`frame`]. A frame that is too long, does
//!   not decode or fails its checksum is counted and skipped, never acted on.
//! * A body is one [`ToDevice`] or [`FromDevice`] in [postcard](https://postcard.jamesmunns.com/wire-format).
//! * Every [`NumberedRequest`] has a sequence number and gets exactly one [`FromDevice::Reply`] with the same number. A request
//!   repeated with the same number is answered again but not carried out again.
//! * [`FromDevice::Event`] and [`FromDevice::Telemetry`] are sent without a request. Each has its own sequence
//!   number, so a gap shows what was lost. Replies and events are sent before telemetry.
//! * A simulated board runs its clock only as far as [`ToDevice::Grant`] allows, and sends [`FromDevice::Clock`] when
//!   it has used up the credit. A real board ignores grants.
//! * The board's settings are the base of every limit. [`Request::SetLimits`] tightens some of them for one
//!   experiment; a looser limit is answered with [`Rejected::Looser`]. The board itself ends the tightening.
//! * Records are [`upload`]ed in chunks. An upload continues after a broken link.
//! * [`Request::Identify`] with [`Reply::Identity`] and [`Request::StoredSettings`] with [`Reply::Stored`] never change: two
//!   versions can identify each other, and any later host can read the settings that a board keeps.
//!
//! # Known answers
//! The bytes are part of the contract:
//! ```
//! use damprig_protocol::{Request, NumberedRequest, ToDevice, frame};
//! let mut out = [0; frame::LONGEST];
//! let message = ToDevice::Request(NumberedRequest { seq: 7, at_tick: None, request: Request::Identify });
//! let length = frame::encode(&message, &mut out).unwrap();
//! // body 00 07 00 00 (request, seq 7, no tick, identify), then its CRC-32 in little endian
//! assert_eq!(out[..length], [0x01, 0x02, 0x07, 0x01, 0x05, 0x99, 0xc9, 0x0b, 0x24, 0x00]);
//!
//! // The bytes of page 1 of the settings memory from 256 = 80 02 on, and a page of 320 = c0 02 bytes that ends with 12 34
//! let request = Request::StoredSettings { page: 1, from: 256 };
//! let length = frame::encode(&ToDevice::Request(NumberedRequest { seq: 7, at_tick: None, request }), &mut out).unwrap();
//! assert_eq!(out[..length], [0x01, 0x02, 0x07, 0x09, 0x01, 0x01, 0x80, 0x02, 0xf3, 0x1b, 0x9a, 0xec, 0x00]);
//! use damprig_protocol::{FromDevice, Reply, StoredPart};
//! let part = StoredPart { length: 320, bytes: [0x12, 0x34].into_iter().collect() };
//! let length = frame::encode(&FromDevice::Reply { seq: 7, answer: Ok(Reply::Stored(part)) }, &mut out).unwrap();
//! assert_eq!(out[..length], [0x01, 0x02, 0x07, 0x0b, 0x01, 0xc0, 0x02, 0x02, 0x12, 0x34, 0x4a, 0xbe, 0x48, 0x3e, 0x00]);
//!
//! // Grant { until_tick: 1000 }: body 01 e8 07
//! let length = frame::encode(&ToDevice::Grant { until_tick: 1000 }, &mut out).unwrap();
//! assert_eq!(out[..length], [0x08, 0x01, 0xe8, 0x07, 0x62, 0x5f, 0x40, 0xf6, 0x00]);
//!
//! // One telemetry row: body 02, seq 1, first tick ac 02 = 300, every 5 ticks, 2 wide, 2 values in IEEE 754 little endian
//! use damprig_protocol::Telemetry;
//! let values = [1.5, -2.0].into_iter().collect();
//! let row = FromDevice::Telemetry(Telemetry { seq: 1, first_tick: 300, every_ticks: 5, width: 2, values });
//! let length = frame::encode(&row, &mut out).unwrap();
//! let expected = [
//!     0x08, 0x02, 0x01, 0xac, 0x02, 0x05, 0x02, 0x02, 0x01, 0x03, 0xc0,
//!     0x3f, 0x01, 0x01, 0x06, 0xc0, 0x2c, 0xbd, 0x66, 0x75, 0x00,
//! ];
//! assert_eq!(out[..length], expected);
//! ```
//!
//! The device side is in `damprig-device`, the host side in the `damprig` crate. The values carried are types of
//! `damprig-core`.

#![no_std]
#![forbid(unsafe_code)]

pub mod frame;
pub mod image;
mod message;
mod request;
pub mod upload;

pub use damprig_core::rig::{Event, Rejected, clipped};
pub use message::*;
pub use request::{NumberedRequest, Request, SIMULATOR_BYTES, ToDevice};

/// Version of the protocol. It increases with a change of meaning that [`SCHEMA`] does not show.
pub const VERSION: u16 = 5;

/// Hash of the layout of every message, names included. Two sides with different hashes cannot communicate.
pub const SCHEMA: [u8; 8] = schema();

const fn schema() -> [u8; 8] {
    use postcard_schema::key::Key;
    let to_device = Key::for_path::<ToDevice>("to_device").to_bytes();
    let from_device = Key::for_path::<FromDevice>("from_device").to_bytes();
    let mut both = [0; 8];
    let mut n = 0;
    while n < 8 {
        both[n] = to_device[n] ^ from_device[7 - n];
        n += 1;
    }
    both
}

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
