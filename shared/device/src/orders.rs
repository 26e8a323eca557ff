//! Requests made ready for the control tick: what they carry is checked, and what must be made of it is made.
//!
//! Looking at a hundred frequencies, or making a twin, takes longer than a tick has. So it is done where requests come in, by a
//! task that control does not wait for; the tick only swaps the result in, or refuses it for the state it is in.

use damprig_core::control::experiment::Experiment;
use damprig_core::control::stepped_sine::SteppedSinePlan;
use damprig_core::control::transient::{free_vibration, playback};
use damprig_core::io::Invalid;
use damprig_core::plant::PlantConfig;
use damprig_core::rig::{Command, MOTION_SIGNALS, SIGNALS};
use damprig_core::settings::Prepared;
use damprig_core::twin::TwinPlan;
use damprig_protocol::ask::{Ask, Request};
use damprig_protocol::upload::{CHUNK_BYTES, MOST_BYTES};
use damprig_protocol::{MOST_SIGNALS, SIGNALS_TOLD, Signal, clipped};
use heapless::Vec;

/// A request as the control tick takes it; `P` is what a simulated plant is made of, or what a real board makes of that.
#[derive(Clone, Debug)]
pub struct Order<P = PlantConfig> {
    /// The request's number.
    pub seq: u16,
    /// On a simulated board: the tick before which it is carried out.
    pub at_tick: Option<u32>,
    /// What to do.
    pub work: Work<P>,
}

/// What rows of telemetry hold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Selection {
    /// Ticks from row to row; 0 for none.
    pub every_ticks: u16,
    /// Which signals.
    pub chosen: Chosen,
    /// Every impact is an event.
    pub impacts: bool,
}

/// Places in the signal table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chosen {
    places: [u8; MOST_SIGNALS],
    width: u8,
}

impl Default for Chosen {
    /// The motion.
    fn default() -> Self {
        Self { width: MOTION_SIGNALS as u8, places: core::array::from_fn(|n| n as u8) }
    }
}

impl Chosen {
    /// These, whose order is the row's.
    #[must_use]
    pub fn new(signals: &Vec<u8, MOST_SIGNALS>) -> Self {
        let place = |n| signals.get(n).copied().unwrap_or_default();
        Self { width: signals.len() as u8, places: core::array::from_fn(place) }
    }

    /// The places.
    #[must_use]
    pub fn places(&self) -> &[u8] {
        &self.places[..usize::from(self.width).min(MOST_SIGNALS)]
    }
}

/// What an order is for.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum Work<P = PlantConfig> {
    /// Who is there?
    Identify,
    /// Bounds, clock, health of the last run.
    Describe,
    /// State and counters.
    Status,
    /// A part of the signal table, as it is answered: its texts take time to copy.
    Signals(Vec<Signal, SIGNALS_TOLD>),
    /// A result that did not arrive.
    Result {
        /// Its place.
        index: u16,
    },
    /// A part of the recorded shape.
    Snippet {
        /// The first sample wanted.
        from: u16,
    },
    /// The result of the last record or free vibration.
    Transient,
    /// A record comes.
    BeginUpload {
        /// Its length.
        bytes: u32,
        /// Its checksum.
        crc32: u32,
    },
    /// A part of it.
    UploadChunk {
        /// Its place.
        offset: u32,
        /// The bytes.
        data: Vec<u8, CHUNK_BYTES>,
    },
    /// What to send.
    SetTelemetry(Selection),
    /// A simulated plant.
    SetPlant(P),
    /// The settings in use.
    Settings,
    /// Settings to use.
    SetSettings(Prepared),
    /// Save the settings in use.
    SaveSettings,
    /// For the rig.
    Command(Command),
    /// Out of range.
    Refuse(Invalid),
}

impl<P> Order<P> {
    /// Checks and makes what the request asks for. Takes its time: not for the control tick.
    #[must_use]
    pub fn prepare(request: Request<P>) -> Self {
        let work = match Work::prepare(request.ask) {
            Ok(work) => work,
            Err(invalid) => Work::Refuse(invalid),
        };
        Self { seq: request.seq, at_tick: request.at_tick, work }
    }

    /// It begins an experiment.
    #[must_use]
    pub fn is_start(&self) -> bool {
        matches!(self.work, Work::Command(Command::Start))
    }
}

impl<P> Work<P> {
    fn prepare(ask: Ask<P>) -> Result<Self, Invalid> {
        Ok(Self::Command(match ask {
            Ask::Identify => return Ok(Self::Identify),
            Ask::Describe => return Ok(Self::Describe),
            Ask::Status => return Ok(Self::Status),
            Ask::Signals { from } => return Ok(Self::Signals(signals(from))),
            Ask::Result { index } => return Ok(Self::Result { index }),
            Ask::Snippet { from } => return Ok(Self::Snippet { from }),
            Ask::Settings => return Ok(Self::Settings),
            Ask::SetSettings(settings) => return Ok(Self::SetSettings(Prepared::new(&settings)?)),
            Ask::SaveSettings => return Ok(Self::SaveSettings),
            Ask::SetPlant(config) => return Ok(Self::SetPlant(config)),
            Ask::SetTelemetry { every_ticks, signals, impacts } => {
                return Ok(Self::SetTelemetry(select(every_ticks, signals, impacts)?));
            }
            // Both are checked against the board's settings, which are the rig's.
            Ask::SetLimits(limits) => Command::SetLimits(limits),
            Ask::SetSpring(set_up) => Command::SetSpring(set_up),
            Ask::SetTwin(None) => Command::SetTwin(None),
            Ask::SetTwin(Some(config)) => Command::SetTwin(Some(TwinPlan::new(&config)?)),
            Ask::Configure(sine) => Command::Configure(Some(Experiment::SteppedSine(SteppedSinePlan::new(sine)?))),
            Ask::Start => Command::Start,
            Ask::Stop => Command::Stop,
            Ask::ClearFault => Command::ClearFault,
            Ask::Spring(command) => Command::Spring(command),
            Ask::ArmSnippet => Command::ArmSnippet,
            Ask::Transient => return Ok(Self::Transient),
            Ask::BeginUpload { bytes, crc32 } => return begin_upload(bytes, crc32),
            Ask::UploadChunk { offset, data } => return chunk(offset, data),
            Ask::ConfigurePlayback(playback) => {
                Command::Configure(Some(Experiment::Playback(playback::PlaybackPlan::new(playback)?)))
            }
            Ask::ConfigureFreeVibration(free) => {
                Command::Configure(Some(Experiment::FreeVibration(free_vibration::FreeVibrationPlan::new(free)?)))
            }
        }))
    }

    /// It has no effect: a repetition is carried out afresh.
    pub(crate) fn is_question(&self) -> bool {
        matches!(
            self,
            Self::Identify
                | Self::Describe
                | Self::Status
                | Self::Signals(_)
                | Self::Result { .. }
                | Self::Snippet { .. }
                | Self::Transient
                | Self::Settings
        )
    }

    /// It is part of an upload: a repetition is answered with how far that has come.
    pub(crate) fn is_upload(&self) -> bool {
        matches!(self, Self::BeginUpload { .. } | Self::UploadChunk { .. })
    }
}

fn begin_upload<P>(bytes: u32, crc32: u32) -> Result<Work<P>, Invalid> {
    if bytes == 0 || bytes > MOST_BYTES || !bytes.is_multiple_of(2) {
        let allowed = "an even number from 2 to 40960: the record buffer holds 20480 samples of two bytes";
        return Err(Invalid { parameter: "upload.bytes", value: f64::from(bytes), allowed });
    }
    Ok(Work::BeginUpload { bytes, crc32 })
}

fn chunk<P>(offset: u32, data: Vec<u8, CHUNK_BYTES>) -> Result<Work<P>, Invalid> {
    let refuse = |parameter, value| Err(Invalid { parameter, value, allowed: "even: a sample has two bytes" });
    if !offset.is_multiple_of(2) {
        return refuse("upload.offset", f64::from(offset));
    }
    if !data.len().is_multiple_of(2) {
        return refuse("upload.data", data.len() as f64);
    }
    Ok(Work::UploadChunk { offset, data })
}

/// The signal table from a place on, as much as is told at once.
fn signals(from: u8) -> Vec<Signal, SIGNALS_TOLD> {
    let rest = SIGNALS.get(usize::from(from)..).unwrap_or_default();
    let named = rest.iter().map(|(name, unit)| Signal { name: clipped(name), unit: clipped(unit) });
    named.take(SIGNALS_TOLD).collect()
}

fn select(every_ticks: u16, signals: Vec<u8, MOST_SIGNALS>, impacts: bool) -> Result<Selection, Invalid> {
    for &place in &signals {
        if usize::from(place) >= SIGNALS.len() {
            let allowed = "a place in the signal table";
            return Err(Invalid { parameter: "telemetry.signals", value: f64::from(place), allowed });
        }
    }
    let chosen = if signals.is_empty() { Chosen::default() } else { Chosen::new(&signals) };
    Ok(Selection { every_ticks, chosen, impacts })
}
