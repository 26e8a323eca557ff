//! What a host asks of a device.
//!
//! Generic over what a simulated plant is made of: a board with a real structure refuses [`Ask::SetPlant`] whatever it says, so it
//! reads [`PassedOver`] and is spared the kilobyte that takes the rest apart. Everybody else uses the names at the crate's top.

use core::fmt;

use damprig_core::control::friction_spring::{SpringCommand, SpringSetUp};
use damprig_core::control::safety::ExperimentLimits;
use damprig_core::control::stepped_sine::SteppedSine;
use damprig_core::control::transient::{FreeVibration, Playback};
use damprig_core::settings::Settings;
use damprig_core::twin::TwinConfig;
use heapless::Vec;
use postcard_schema::Schema;
use serde::de::{Deserializer, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};

use crate::MOST_SIGNALS;
use crate::frame::LONGEST_BODY;
use crate::upload::CHUNK_BYTES;

/// From the host.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum ToDevice<P> {
    /// Asks for something; gets exactly one reply.
    Request(Request<P>),
    /// A simulated board may run its clock up to (not including) this tick.
    Grant {
        /// The first tick that may not run yet.
        until_tick: u32,
    },
}

/// A question or a command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Request<P> {
    /// Returned with the reply; a repeated number is the same request again.
    pub seq: u16,
    /// On a simulated board: the tick before which it is carried out; at once if none is given.
    pub at_tick: Option<u32>,
    /// What is asked.
    pub ask: Ask<P>,
}

/// What a host may ask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)]
pub enum Ask<P> {
    /// Who is there? Never changes its place in this list.
    Identify,
    /// What are your signals and bounds?
    Describe,
    /// State, tick and counters.
    Status,
    /// Tighten limits of the board for the configured experiment, from its start until the rig is idle again without a
    /// latched fault. A limit looser than the board's is refused. Configuring an experiment ends earlier ones.
    SetLimits(ExperimentLimits),
    /// Set the simulated plant (simulated boards only).
    SetPlant(P),
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

/// The rest of a message, whatever it is: stands for the body of its last field where that is not looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassedOver;

impl<'de> Deserialize<'de> for PassedOver {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Rest;

        impl<'de> Visitor<'de> for Rest {
            type Value = PassedOver;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("anything")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut bytes: A) -> Result<PassedOver, A::Error> {
                // The end of the message is an error to it, and what is waited for here.
                while let Ok(Some(_)) = bytes.next_element::<u8>() {}
                Ok(PassedOver)
            }
        }

        deserializer.deserialize_tuple(LONGEST_BODY, Rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{self, LONGEST, Reader};
    use damprig_core::model::{SetUp, Structure};
    use damprig_core::plant::PlantConfig;

    fn read<P: serde::de::DeserializeOwned>(message: &ToDevice<PlantConfig>) -> Option<ToDevice<P>> {
        let mut frame = [0; LONGEST];
        let length = frame::encode(message, &mut frame).unwrap();
        let mut reader = Reader::default();
        frame[..length].iter().find_map(|&byte| reader.push(byte)).and_then(Result::ok)
    }

    #[test]
    fn a_board_that_passes_plants_over_reads_that_one_was_sent_and_every_other_question() {
        let plant = PlantConfig::ideal(SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)));
        let request = |ask| ToDevice::Request(Request { seq: 7, at_tick: None, ask });
        let sent = read::<PassedOver>(&request(Ask::SetPlant(plant)));
        assert_eq!(sent, Some(ToDevice::Request(Request { seq: 7, at_tick: None, ask: Ask::SetPlant(PassedOver) })));
        let start = read::<PassedOver>(&request(Ask::Start));
        assert_eq!(start, Some(ToDevice::Request(Request { seq: 7, at_tick: None, ask: Ask::Start })));
        assert_eq!(read::<PassedOver>(&ToDevice::Grant { until_tick: 9 }), Some(ToDevice::Grant { until_tick: 9 }));
        assert_eq!(read::<PlantConfig>(&request(Ask::SetPlant(plant))), Some(request(Ask::SetPlant(plant))));
    }
}
