//! The messages from the host to a device: requests, and the ticks granted to an emulated or virtual board.

use damprig_core::control::friction_spring::{SpringCommand, SpringSetUp};
use damprig_core::control::safety::ExperimentLimits;
use damprig_core::control::stepped_sine::SteppedSine;
use damprig_core::control::transient::{FreeVibration, Playback};
use damprig_core::settings::Settings;
use damprig_core::twin::TwinConfig;
use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::MOST_SIGNALS;
use crate::upload::CHUNK_BYTES;

/// Longest message to the simulator, bytes.
pub const SIMULATOR_BYTES: usize = 480;

/// From the host.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum ToDevice {
    /// Asks for something; gets exactly one reply.
    Request(NumberedRequest),
    /// A simulated board may run its clock up to (not including) this tick.
    Grant {
        /// The first tick that may not run yet.
        until_tick: u32,
    },
}

/// A question or a command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct NumberedRequest {
    /// Returned with the reply; a repeated number is the same request again.
    pub seq: u16,
    /// On a simulated board: the tick before which it is carried out; at once if none is given.
    pub at_tick: Option<u32>,
    /// What is asked.
    pub request: Request,
}

/// What a host may ask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum Request {
    /// Who is there? Never changes its place in this list.
    Identify,
    /// What are your signals and bounds?
    Describe,
    /// State, tick and counters.
    Status,
    /// Tighten limits of the board for the configured experiment, from its start until the rig is idle again without a
    /// latched fault. A limit looser than the board's is refused. Configuring an experiment ends earlier ones.
    SetLimits(ExperimentLimits),
    /// A message to the simulator behind a simulated board, as `damprig-simulator` encodes it. A real board rejects it.
    Simulator(Vec<u8, SIMULATOR_BYTES>),
    /// Set the experiment.
    Configure(SteppedSine),
    /// Send one row of telemetry every so many ticks, and say when impacts happen.
    SetTelemetry {
        /// Ticks from row to row; 0 for none.
        every_ticks: u16,
        /// What a row holds: places in the signal table, in any order. Empty for the motion alone.
        signals: Vec<u8, MOST_SIGNALS>,
        /// Every impact is an event.
        impacts: bool,
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
    /// A part of the signal table.
    Signals {
        /// The first place wanted.
        from: u8,
    },
    /// Describe the set-up to the friction damper's drive, until its experiment has ended. The drive has to be homed again.
    SetSpring(SpringSetUp),
    /// Home, touch off, press, release, halt.
    Spring(SpringCommand),
    /// Let a twin of this set-up run along, or none.
    SetTwin(Option<TwinConfig>),
    /// Record the shape of the next impact.
    ArmSnippet,
    /// A part of the last recorded shape.
    Snippet {
        /// The first sample wanted.
        from: u16,
    },
    /// The settings in use.
    Settings,
    /// Use these settings from now on; they are not saved.
    SetSettings(Settings),
    /// Keep the settings in use over power cuts. The reply comes when that is done.
    SaveSettings,
    /// Make room for an upload, or go on with exactly this one. Idle only.
    BeginUpload {
        /// Its length: even, at most [`crate::upload::MOST_BYTES`].
        bytes: u32,
        /// Its [`crate::upload::checksum`].
        crc32: u32,
    },
    /// A part of the upload that was begun last. Idle only.
    UploadChunk {
        /// Its place, even; taken only where it goes on with what is there.
        offset: u32,
        /// An even number of bytes; none to ask how far the upload has come.
        data: Vec<u8, CHUNK_BYTES>,
    },
    /// Set a playback of the uploaded record as the experiment.
    ConfigurePlayback(Playback),
    /// Set a free vibration as the experiment.
    ConfigureFreeVibration(FreeVibration),
    /// The result of the last record or free vibration, if it did not arrive.
    Transient,
}
