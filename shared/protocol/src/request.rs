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

use crate::MAX_SIGNALS;
use crate::upload::CHUNK_BYTES;

/// Longest message to the simulator, bytes.
pub const SIMULATOR_BYTES: usize = 600;

/// A message from the host.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub enum ToDevice {
    /// A request; it gets exactly one reply.
    Request(NumberedRequest),
    /// A simulated board may run its clock up to (not including) this tick.
    Grant {
        /// The first tick that may not run yet.
        until_tick: u32,
    },
}

/// A request with its sequence number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct NumberedRequest {
    /// Sequence number, returned with the reply. A repeated number marks a repetition of the same request.
    pub seq: u16,
    /// Tick before which a simulated board carries the request out; `None` for at once.
    pub at_tick: Option<u32>,
    /// The request.
    pub request: Request,
}

/// Requests to a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum Request {
    /// Ask for the device's identity. This variant always stays first.
    Identify,
    /// Ask for the bytes of a page of the settings memory, whatever their layout: to keep them before the firmware is
    /// replaced. Pages count from 0; beyond the last one the reply has length 0. This variant always stays second.
    StoredSettings {
        /// The page.
        page: u8,
        /// First byte wanted.
        from: u16,
    },
    /// Ask for the device's properties.
    Describe,
    /// Ask for state, tick and counters.
    Status,
    /// Tighten limits of the board for the configured experiment, from its start until the rig is idle again without
    /// a latched fault. A limit looser than the board's is rejected. Configuring an experiment removes earlier
    /// tightened limits.
    SetLimits(ExperimentLimits),
    /// A message to the simulator behind a simulated board, encoded by `damprig-simulator`. A real board rejects it.
    Simulator(Vec<u8, SIMULATOR_BYTES>),
    /// Configure a stepped sine as the experiment.
    Configure(SteppedSine),
    /// Select the telemetry: a row every so many ticks, and whether impacts are sent as events.
    SetTelemetry {
        /// Ticks from row to row; 0 for no rows.
        every_ticks: u16,
        /// Signals of a row: indices in the signal table, in any order. Empty for the motion signals alone.
        signals: Vec<u8, MAX_SIGNALS>,
        /// Send every impact as an event.
        impacts: bool,
    },
    /// Start the experiment. The tick count restarts at 0; a simulated plant starts from its initial state.
    Start,
    /// Stop the experiment.
    Stop,
    /// Ask for a point's result, for instance one whose event was lost.
    Result {
        /// Index in the frequency list.
        index: u16,
    },
    /// Clear a latched fault.
    ClearFault,
    /// Ask for a part of the signal table.
    Signals {
        /// First index wanted.
        from: u8,
    },
    /// Describe the set-up's friction spring to the spring's drive, until the experiment has ended. The drive must be
    /// homed again.
    SetSpring(SpringSetUp),
    /// Command the friction spring: home, touch off, press, release, halt.
    Spring(SpringCommand),
    /// Run a twin of this set-up, or none.
    SetTwin(Option<TwinConfig>),
    /// Record the force samples of the next impact.
    ArmSnippet,
    /// Ask for a part of the last recorded impact.
    Snippet {
        /// First sample wanted.
        from: u16,
    },
    /// Ask for the settings in use.
    Settings,
    /// Use these settings from now on, without saving them.
    SetSettings(Settings),
    /// Save the settings in use to non-volatile memory. The reply is sent when that is done.
    SaveSettings,
    /// Begin an upload, or continue one with the same length and checksum. Only when idle.
    BeginUpload {
        /// Length of the upload, bytes: even, at most [`crate::upload::MAX_BYTES`].
        bytes: u32,
        /// [`crate::upload::checksum`] of the upload.
        crc32: u32,
    },
    /// A chunk of the upload that was begun last. Only when idle.
    UploadChunk {
        /// Offset in the upload, bytes, even. The chunk is stored only if it continues the received part.
        offset: u32,
        /// An even number of bytes; empty to ask for the progress.
        data: Vec<u8, CHUNK_BYTES>,
    },
    /// Configure a playback of the uploaded record as the experiment.
    ConfigurePlayback(Playback),
    /// Configure a free vibration as the experiment.
    ConfigureFreeVibration(FreeVibration),
    /// Ask for the result of the last playback or free vibration, for instance if its event was lost.
    Transient,
    /// Ask for the values of all signals in the last tick. Allowed in every state.
    SignalValues,
    /// Hold a running stepped sine at its present point (`true`), or release it: see
    /// [`Command::Hold`](damprig_core::rig::Command::Hold).
    Hold(bool),
    /// Let the rig drive on the settings in use, although settings that somebody saved do not act
    /// ([`Source::needs_consent`](damprig_core::settings::Source::needs_consent)). Valid until the next
    /// [`Request::Identify`], that is for one session.
    AcceptSettings,
}
