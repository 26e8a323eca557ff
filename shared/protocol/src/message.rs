//! The message tables: what a device says. What a host asks is in [`crate::Request`].

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

/// Most telemetry signals in a row.
pub const MOST_SIGNALS: usize = 16;

/// Signals of the table in one answer.
pub const SIGNALS_TOLD: usize = 4;

/// Samples of a snippet in one answer.
pub const SAMPLES_TOLD: usize = 32;

/// Calls of a [`Crash`].
pub const CALLS_TOLD: usize = 6;

/// Most values (rows × signals) in one telemetry message.
pub const MOST_VALUES: usize = 64;

/// From the device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum FromDevice {
    /// To the request of the same number.
    Reply {
        /// The request's number.
        seq: u16,
        /// The answer, or why there is none.
        answer: Result<Reply, Rejected>,
    },
    /// Something happened.
    Event {
        /// Counts events since power-on.
        seq: u16,
        /// In which tick.
        tick: u32,
        /// What.
        event: Event,
    },
    /// Rows of signals.
    Telemetry(Telemetry),
    /// A simulated board has used up its credit.
    Clock {
        /// The first tick that has not run.
        tick: u32,
    },
}

/// What the device answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum Reply {
    /// To [`Request::Identify`](crate::Request::Identify).
    Identity(Identity),
    /// Carried out.
    Done,
    /// To [`Request::Describe`](crate::Request::Describe).
    Description(Description),
    /// To [`Request::Status`](crate::Request::Status).
    Status {
        /// The rig's.
        status: Status,
        /// The link's.
        counters: Counters,
    },
    /// To [`Request::Result`](crate::Request::Result).
    Result(PointResult),
    /// To [`Request::Signals`](crate::Request::Signals): the table from there on, as much as fits.
    Signals(Vec<Signal, SIGNALS_TOLD>),
    /// To [`Request::Snippet`](crate::Request::Snippet).
    Snippet {
        /// What the samples mean.
        scale: ForceScale,
        /// +1 for the wall at +d, −1 for the one at −d.
        side: i8,
        /// Samples of the whole shape.
        length: u16,
        /// Counts from there on, as many as fit.
        samples: Vec<u16, SAMPLES_TOLD>,
    },
    /// To [`Request::Settings`](crate::Request::Settings).
    Settings {
        /// The settings in use.
        settings: Settings,
        /// Where they come from.
        source: Source,
    },
    /// To [`Request::BeginUpload`](crate::Request::BeginUpload) and [`Request::UploadChunk`](crate::Request::UploadChunk).
    Upload(Progress),
    /// To [`Request::Transient`](crate::Request::Transient).
    Transient(TransientResult),
}

/// Who a device is. Its layout never changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Identity {
    /// [`crate::VERSION`].
    pub protocol: u16,
    /// [`crate::SCHEMA`].
    pub schema: [u8; 8],
    /// The firmware's version.
    pub firmware: String<32>,
    /// The board.
    pub board: String<32>,
}

/// Whose clock counts the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Clock {
    /// The board's own.
    RealTime,
    /// The host's, by [`ToDevice::Grant`](crate::ToDevice::Grant).
    Granted,
}

/// What moves when the rig drives.
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
    /// Name.
    pub name: String<24>,
    /// Unit.
    pub unit: String<8>,
}

/// What a device can do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Description {
    /// Control ticks per second.
    pub tick_hz: f32,
    /// Whose clock.
    pub clock: Clock,
    /// What is driven.
    pub plant: PlantKind,
    /// Most frequencies in one experiment.
    pub most_points: u16,
    /// Length of the signal table ([`Request::Signals`](crate::Request::Signals)).
    pub signals: u8,
    /// Most of them in a row.
    pub most_signals: u8,
    /// Samples of each wall force per second.
    pub force_rate_hz: f32,
    /// Where the ticks come from.
    pub clock_source: ClockSource,
    /// Revision of the firmware's source; empty where it is not known.
    pub revision: String<16>,
    /// How the firmware was built.
    pub profile: String<8>,
    /// Why the board started.
    pub reset: Reset,
    /// What ended an earlier run of the firmware.
    pub last_crash: Option<Crash>,
    /// Where the settings in use come from.
    pub settings: Source,
}

/// What counts a real board's ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ClockSource {
    /// The host's grants.
    Granted,
    /// The crystal, ± 50 ppm.
    Crystal,
    /// The internal oscillator, ± 1 %: the crystal did not start.
    InternalOscillator,
}

/// Why a board started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Reset {
    /// Nothing tells: a simulated board, or a cause that is none of these.
    #[default]
    Unknown,
    /// The supply came on or had sagged.
    Power,
    /// The reset button, or the debugger.
    Pin,
    /// The firmware asked for it: after a panic or a fault of the processor.
    Software,
    /// The watchdog.
    Watchdog,
}

/// What ended an earlier run of the firmware; it survives the reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Crash {
    /// What.
    pub cause: CrashCause,
    /// The rig's tick.
    pub tick: u32,
    /// Where in the program: addresses of the calls that led there, the innermost first; 0 where nothing tells.
    pub calls: [u32; CALLS_TOLD],
    /// Crashes since the supply came on.
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

/// What can end the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum CrashCause {
    /// A panic.
    Panic,
    /// A fault of the processor.
    HardFault,
    /// The control tick did not come.
    ControlStalled,
    /// The line's tasks did not run.
    CommunicationStalled,
    /// The watchdog bit, and nothing says why.
    Watchdog,
    /// The crystal stopped.
    ClockFailed,
    /// The supply fell below the level at which the board still works.
    SupplyLow,
    /// The program's flash has an error beyond its correction.
    ProgramDamaged,
    /// A non-maskable interrupt of no known cause.
    UnknownNmi,
}

impl CrashCause {
    /// In words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Panic => "the firmware panicked",
            Self::HardFault => "the processor met a fault",
            Self::ControlStalled => "the control tick did not come",
            Self::CommunicationStalled => "the line's tasks did not run",
            Self::Watchdog => "the watchdog bit",
            Self::ClockFailed => "the crystal stopped",
            Self::SupplyLow => "the supply fell below 2.9 V",
            Self::ProgramDamaged => "the program's flash is damaged: flash the board again",
            Self::UnknownNmi => "a non-maskable interrupt of no known cause came",
        }
    }
}

/// What went wrong on the link and in time, counted since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Counters {
    /// Frames that were too long, did not decode or failed their checksum.
    pub bad_frames: u32,
    /// Requests that found no room.
    pub requests_dropped: u32,
    /// Replies and events that found no room.
    pub replies_dropped: u32,
    /// Telemetry rows that found no room.
    pub rows_dropped: u32,
    /// Most replies and events that waited for the line at once.
    pub most_replies_waiting: u8,
    /// Most telemetry rows that waited for the line at once.
    pub most_rows_waiting: u8,
    /// The tick's time on the board.
    pub timing: Timing,
}

/// How a board keeps its ticks; all 0 on a simulated one, whose ticks take no time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Timing {
    /// Blocks of samples that were overwritten before a tick had read them.
    pub overruns: u32,
    /// Longest tick, µs.
    pub longest_tick_us: u16,
    /// Largest deviation of a tick's start from its place, µs.
    pub largest_jitter_us: u16,
    /// Longest time for which interrupts were masked, 0.1 µs.
    pub longest_masked_tenths_us: u16,
}

/// A batch of telemetry rows, evenly spaced.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Telemetry {
    /// Counts messages since the last start.
    pub seq: u32,
    /// Tick of the first row.
    pub first_tick: u32,
    /// Ticks from row to row.
    pub every_ticks: u16,
    /// Signals in a row.
    pub width: u8,
    /// Row after row, the signals of each in their order.
    pub values: Vec<f32, MOST_VALUES>,
}
