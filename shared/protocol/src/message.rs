//! The message tables.

use damprig_core::control::limits::{Fault, Limits};
use damprig_core::control::stepped_sine::SteppedSine;
use damprig_core::measure::point::PointResult;
use damprig_core::model::Invalid;
use damprig_core::plant::PlantConfig;
use damprig_core::rig::{Refusal, State, Status};
use heapless::{String, Vec};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most telemetry signals that a board may have.
pub const MOST_SIGNALS: usize = 8;

/// Most values (rows × signals) in one telemetry message.
pub const MOST_VALUES: usize = 64;

/// From the host.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum ToDevice {
    /// Asks for something; gets exactly one reply.
    Request(Request),
    /// A simulated board may run its clock up to (not including) this tick.
    Grant {
        /// The first tick that may not run yet.
        until_tick: u32,
    },
}

/// A question or a command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Request {
    /// Returned with the reply; a repeated number is the same request again.
    pub seq: u16,
    /// On a simulated board: the tick before which it is carried out; at once if none is given.
    pub at_tick: Option<u32>,
    /// What is asked.
    pub ask: Ask,
}

/// What a host may ask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum Ask {
    /// Who is there? Never changes its place in this list.
    Identify,
    /// What are your signals and bounds?
    Describe,
    /// State, tick and counters.
    Status,
    /// Set the interlocks.
    SetLimits(Limits),
    /// Set the simulated plant (simulated boards only).
    SetPlant(PlantConfig),
    /// Set the experiment.
    Configure(SteppedSine),
    /// Send one row of telemetry every so many ticks; 0 for none.
    SetTelemetry {
        /// Ticks from row to row.
        every_ticks: u16,
    },
    /// Begin the experiment: the tick restarts at 0, a simulated plant from its start.
    Start,
    /// End the experiment.
    Stop,
    /// A result that did not arrive.
    Result {
        /// Its place in the frequency list.
        index: u16,
    },
    /// Forget a latched fault.
    ClearFault,
}

/// From the device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum FromDevice {
    /// To the request of the same number.
    Reply {
        /// The request's number.
        seq: u16,
        /// The answer, or why there is none.
        answer: Result<Answer, Refused>,
    },
    /// Something happened.
    Event {
        /// Counts events since power-on.
        seq: u16,
        /// In which tick.
        tick: u32,
        /// What.
        event: Happening,
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
pub enum Answer {
    /// To [`Ask::Identify`].
    Identity(Identity),
    /// Carried out.
    Done,
    /// To [`Ask::Describe`].
    Description(Description),
    /// To [`Ask::Status`].
    Status {
        /// The rig's.
        status: Status,
        /// The link's.
        counters: Counters,
    },
    /// To [`Ask::Result`].
    Result(PointResult),
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
    /// The host's, by [`ToDevice::Grant`].
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
    pub name: String<16>,
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
    /// Telemetry signals in order.
    pub signals: Vec<Signal, MOST_SIGNALS>,
}

/// What went wrong on the link, counted since power-on.
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
    /// Row after row, the signals of each in their order.
    pub values: Vec<f32, MOST_VALUES>,
}

/// What a device reports unasked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Happening {
    /// A point is complete.
    Point(PointResult),
    /// The experiment is complete.
    Finished {
        /// Points completed.
        points: u16,
        /// Telemetry rows that found no room since the start.
        rows_dropped: u32,
    },
    /// An interlock ended the experiment.
    Fault(Fault),
}

/// Why a request was not carried out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Refused {
    /// A parameter is out of range.
    Invalid {
        /// Its name with its unit.
        parameter: String<40>,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: String<96>,
    },
    /// It makes no sense in this state.
    WrongState {
        /// The state.
        state: State,
        /// What to do.
        advice: String<48>,
    },
    /// This board cannot do it.
    NotHere {
        /// Why.
        why: String<64>,
    },
}

/// As much of `text` as fits.
#[must_use]
pub fn clipped<const N: usize>(text: &str) -> String<N> {
    let mut clipped = String::new();
    for character in text.chars() {
        if clipped.push(character).is_err() {
            break;
        }
    }
    clipped
}

impl From<Refusal> for Refused {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Invalid(Invalid { parameter, value, allowed }) => {
                Self::Invalid { parameter: clipped(parameter), value, allowed: clipped(allowed) }
            }
            Refusal::WrongState { state, advice } => Self::WrongState { state, advice: clipped(advice) },
            Refusal::NotHere(why) => Self::NotHere { why: clipped(why) },
        }
    }
}

impl core::fmt::Display for Refused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Invalid { parameter, value, allowed } => {
                write!(f, "{parameter} = {value} is not allowed: must be {allowed}")
            }
            Self::WrongState { state, advice } => write!(f, "not while the rig is {}: {advice}", state.text()),
            Self::NotHere { why } => f.write_str(why),
        }
    }
}
