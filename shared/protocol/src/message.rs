//! Messages from a device to the host: replies, events, telemetry and clock. Requests are in [`crate::Request`].

use damprig_core::io::ForceScale;
use damprig_core::measure::point::PointResult;
use damprig_core::measure::transient::TransientResult;
use damprig_core::rig::Status;
use damprig_core::settings::{Settings, Source};
use heapless::{String, Vec};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::upload::Progress;
use crate::{Event, Rejected};

/// Maximum number of telemetry signals in a row.
pub const MAX_SIGNALS: usize = 16;

/// Maximum number of entries of the signal table in one reply.
pub const SIGNALS_TOLD: usize = 4;

/// Maximum number of snippet samples in one reply.
pub const SAMPLES_TOLD: usize = 32;

/// Maximum number of bytes of the settings memory in one reply.
pub const STORED_TOLD: usize = 128;

/// Number of call addresses in a [`Crash`].
pub const CALLS_TOLD: usize = 6;

/// Maximum number of values (rows × signals) in one telemetry message, and of entries in the signal table.
pub const MAX_VALUES: usize = 64;

/// A message from the device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum FromDevice {
    /// Reply to the request with the same sequence number.
    Reply {
        /// Sequence number of the request.
        seq: u16,
        /// The reply, or why the request was rejected.
        answer: Result<Reply, Rejected>,
    },
    /// An event of the rig.
    Event {
        /// Number of the event since power-on, modulo 2¹⁶.
        seq: u16,
        /// Tick in which it occurred.
        tick: u32,
        /// The event.
        event: Event,
    },
    /// Rows of telemetry.
    Telemetry(Telemetry),
    /// A simulated board has used up its tick credit.
    Clock {
        /// The first tick that has not run.
        tick: u32,
    },
}

/// Replies to requests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum Reply {
    /// Reply to [`Request::Identify`](crate::Request::Identify).
    Identity(Identity),
    /// Reply to [`Request::StoredSettings`](crate::Request::StoredSettings). This variant always stays second.
    Stored(StoredPart),
    /// The request was carried out.
    Done,
    /// Reply to [`Request::Describe`](crate::Request::Describe).
    Description(Description),
    /// Reply to [`Request::Status`](crate::Request::Status).
    Status {
        /// Status of the rig.
        status: Status,
        /// Counters of the link and of the timing.
        counters: Counters,
    },
    /// Reply to [`Request::Result`](crate::Request::Result).
    Result(PointResult),
    /// Reply to [`Request::Signals`](crate::Request::Signals): entries of the signal table from the requested one on,
    /// as many as fit.
    Signals(Vec<Signal, SIGNALS_TOLD>),
    /// Reply to [`Request::Snippet`](crate::Request::Snippet).
    Snippet {
        /// Conversion of the samples from converter counts to force.
        scale: ForceScale,
        /// +1 for the wall at +d, −1 for the one at −d.
        side: i8,
        /// Number of samples in the whole snippet.
        length: u16,
        /// Samples in converter counts, from the requested one on, as many as fit.
        samples: Vec<u16, SAMPLES_TOLD>,
    },
    /// Reply to [`Request::Settings`](crate::Request::Settings).
    Settings {
        /// The settings in use.
        settings: Settings,
        /// Where the settings come from.
        source: Source,
    },
    /// Reply to [`Request::BeginUpload`](crate::Request::BeginUpload) and
    /// [`Request::UploadChunk`](crate::Request::UploadChunk).
    Upload(Progress),
    /// Reply to [`Request::Transient`](crate::Request::Transient).
    Transient(TransientResult),
    /// Reply to [`Request::SignalValues`](crate::Request::SignalValues): a value for each entry of the signal table, in
    /// its order.
    SignalValues(Vec<f32, MAX_VALUES>),
}

/// Identity of a device. The layout of this type never changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Identity {
    /// Version of the protocol, [`crate::VERSION`].
    pub protocol: u16,
    /// Hash of the message layouts, [`crate::SCHEMA`].
    pub schema: [u8; 8],
    /// Version of the firmware.
    pub firmware: String<32>,
    /// Name of the board.
    pub board: String<32>,
}

/// Bytes of a page of the settings memory, from the requested one on, as many as fit. The layout of this type never
/// changes; `damprig-device` has the layout of the bytes (`settings_record`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct StoredPart {
    /// Length of the page's record, bytes; 0 if there is no such page.
    pub length: u16,
    /// The bytes.
    pub bytes: Vec<u8, STORED_TOLD>,
}

impl StoredPart {
    /// There is no such page.
    pub const NONE: Self = Self { length: 0, bytes: Vec::new() };
}

/// The clock that counts the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Clock {
    /// The board's own clock.
    RealTime,
    /// Ticks are granted by the host with [`ToDevice::Grant`](crate::ToDevice::Grant).
    Granted,
}

/// The plant that the rig drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum PlantKind {
    /// A real structure.
    Real,
    /// A simulation in `f32`.
    SimulatedF32,
    /// A simulation in `f64`.
    SimulatedF64,
}

/// A telemetry signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Signal {
    /// Name of the signal.
    pub name: String<24>,
    /// Unit, as `m` or `Hz`.
    pub unit: String<8>,
}

/// Properties of a device: clock, plant, capacities, firmware build, and the state in which it started.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Description {
    /// Control ticks per second, Hz.
    pub tick_hz: f32,
    /// The clock that counts the ticks.
    pub clock: Clock,
    /// The plant that the rig drives.
    pub plant: PlantKind,
    /// Maximum number of frequencies in one experiment.
    pub most_points: u16,
    /// Number of entries in the signal table ([`Request::Signals`](crate::Request::Signals)).
    pub signals: u8,
    /// Maximum number of signals in a row of telemetry.
    pub most_signals: u8,
    /// Sample rate of each wall force, Hz.
    pub force_rate_hz: f32,
    /// Source of the board's clock.
    pub clock_source: ClockSource,
    /// Revision of the firmware's source; empty if unknown.
    pub revision: String<16>,
    /// Build profile of the firmware.
    pub profile: String<8>,
    /// Cause of the last reset.
    pub reset: Reset,
    /// The last crash of the firmware since power-on, if any.
    pub last_crash: Option<Crash>,
    /// Where the settings in use come from.
    pub settings: Source,
    /// The controller's option bytes (FLASH_OPTR); none on a simulated board.
    pub option_bytes: Option<u32>,
    /// Supply of the converters and of the drive's output, measured at the start, V; none on a simulated board.
    pub supply_v: Option<f32>,
}

/// Source of the board's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ClockSource {
    /// Ticks are granted by the host.
    Granted,
    /// The crystal, ± 50 ppm.
    Crystal,
    /// The internal oscillator, ± 1 %: the crystal did not start.
    InternalOscillator,
}

/// Cause of a reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Reset {
    /// Unknown: a simulated board, or none of the other causes.
    #[default]
    Unknown,
    /// Power-on, or a brown-out of the supply.
    Power,
    /// The reset button, or the debugger.
    Pin,
    /// Requested by the firmware after a panic or a processor fault.
    Software,
    /// The watchdog.
    Watchdog,
}

/// A crash of the firmware. The record survives a reset, but not a power-off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Crash {
    /// Cause of the crash.
    pub cause: CrashCause,
    /// Tick of the rig at the crash.
    pub tick: u32,
    /// Call stack: return addresses in the program, innermost first; 0 where unknown.
    pub calls: [u32; CALLS_TOLD],
    /// Number of crashes since power-on.
    pub count: u32,
}

impl core::fmt::Display for Crash {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { cause, tick, calls, count } = self;
        write!(f, "{} in tick {tick} ({count} since the supply came on)", cause.text())?;
        for (n, call) in calls.iter().take_while(|call| **call != 0).enumerate() {
            write!(f, "{} 0x{call:08x}", if n == 0 { ", at" } else { "," })?;
        }
        Ok(())
    }
}

/// Cause of a crash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum CrashCause {
    /// A panic.
    Panic,
    /// A processor fault.
    HardFault,
    /// The control task missed its ticks.
    ControlStalled,
    /// The communication tasks did not run.
    CommunicationStalled,
    /// A watchdog reset without a recorded cause.
    Watchdog,
    /// The crystal oscillator stopped.
    ClockFailed,
    /// The supply fell below the board's minimum voltage.
    SupplyLow,
    /// The program flash has an error that its error correction cannot repair.
    ProgramDamaged,
    /// A non-maskable interrupt with an unknown cause.
    UnknownNmi,
    /// The stack was too small.
    StackOverflow,
}

impl CrashCause {
    /// Description of the cause for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Panic => "the firmware panicked",
            Self::HardFault => "the processor met a fault",
            Self::ControlStalled => "the control tick did not come",
            Self::CommunicationStalled => "the line's tasks did not run",
            Self::Watchdog => "the watchdog reset the board",
            Self::ClockFailed => "the crystal stopped",
            Self::SupplyLow => "the supply fell below 2.9 V",
            Self::ProgramDamaged => "the program's flash is damaged: flash the board again",
            Self::UnknownNmi => "a non-maskable interrupt of no known cause came",
            Self::StackOverflow => "the stack overflowed",
        }
    }
}

/// Counters of lost messages and of the timing, since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Counters {
    /// Frames that were too long, did not decode or failed their checksum.
    pub bad_frames: u32,
    /// Requests dropped because their queue was full.
    pub requests_dropped: u32,
    /// Replies and events dropped because their queue was full.
    pub replies_dropped: u32,
    /// Telemetry rows dropped because their queue was full.
    pub rows_dropped: u32,
    /// Largest number of replies and events that were queued at once.
    pub most_replies_waiting: u8,
    /// Largest number of telemetry rows that were queued at once.
    pub most_rows_waiting: u8,
    /// Timing of the ticks.
    pub timing: Timing,
}

/// Timing of the ticks on the board. On a simulated board all are 0 but the overruns of one with its own clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Timing {
    /// Sample blocks that were overwritten before a tick had read them.
    pub overruns: u32,
    /// Duration of the longest tick, µs.
    pub longest_tick_us: u16,
    /// Largest deviation of the start of a tick from its nominal time, µs.
    pub largest_jitter_us: u16,
    /// Longest time for which interrupts were masked, in units of 0.1 µs.
    pub longest_masked_tenths_us: u16,
}

/// A batch of telemetry rows, evenly spaced.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Telemetry {
    /// Number of the message since the last start.
    pub seq: u32,
    /// Tick of the first row.
    pub first_tick: u32,
    /// Ticks from row to row.
    pub every_ticks: u16,
    /// Number of signals in a row.
    pub width: u8,
    /// Values row by row; within a row in the order of the selected signals.
    pub values: Vec<f32, MAX_VALUES>,
}
