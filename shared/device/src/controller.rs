//! The controller: owns the rig, serves requests, and queues replies, events and telemetry rows.

use crate::board::{Board, DeviceInfo, Saving, Simulated};
use crate::queues::{Chosen, Losses, Outgoing, Row, StreamItem};
use crate::upload_buffer::UploadBuffer;
use damprig_core::control::experiment::Experiment;
use damprig_core::control::stepped_sine::SteppedSinePlan;
use damprig_core::control::transient::{free_vibration, playback};
use damprig_core::io::{Actuators, Invalid, Sensors, TICK_HZ, WALL_SUBSAMPLES};
use damprig_core::measure::snippet::SNIPPET;
use damprig_core::rig::{Command, Event, Rejected, Rig, RigState, SIGNALS};
use damprig_core::settings::{Settings, Source};
use damprig_protocol::upload::MAX_BYTES;
use damprig_protocol::{
    Clock, ClockSource, Counters, Crash, Description, FromDevice, Identity, MAX_SIGNALS, MAX_VALUES, NumberedRequest,
    PlantKind, Reply, Request, Reset, SAMPLES_TOLD, SCHEMA, SIGNALS_TOLD, Signal, Timing, VERSION, clipped,
};
use heapless::{Deque, Vec};

// The values of all signals fit into one reply.
const _: () = assert!(SIGNALS.len() <= MAX_VALUES);

/// Numbers of served requests that are kept to recognise a repetition: a late copy may arrive after some later
/// requests.
const SERVED_KEPT: usize = 8;

/// The selected telemetry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Selection {
    /// Ticks from row to row; 0 for no rows.
    every_ticks: u16,
    chosen: Chosen,
    /// Send every impact as an event.
    impacts: bool,
}

/// How the board started.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BootInfo {
    /// Source of the board's clock.
    pub clock_source: ClockSource,
    /// Cause of the last reset.
    pub reset: Reset,
    /// The last crash of the firmware since power-on, if any.
    pub last_crash: Option<Crash>,
    /// The controller's option bytes.
    pub option_bytes: Option<u32>,
    /// Supply of the converters and of the drive's output, V.
    pub supply_v: Option<f32>,
}

impl Default for BootInfo {
    /// For a simulated board.
    fn default() -> Self {
        Self {
            clock_source: ClockSource::Granted,
            reset: Reset::Unknown,
            last_crash: None,
            option_bytes: None,
            supply_v: None,
        }
    }
}

/// Owns the rig, serves requests and queues messages.
#[derive(Clone, Debug)]
pub struct Controller {
    identity: Identity,
    /// Without clock, plant and source of the settings, which [`Controller::describe`] adds.
    description: Description,
    rig: Rig,
    settings_source: Source,
    /// The host of this session has accepted the settings in use.
    is_accepted: bool,
    /// Sequence number of the save request whose reply is pending.
    saving: Option<u16>,
    selection: Selection,
    served: Deque<u16, SERVED_KEPT>,
    last_rejected: Option<Rejected>,
    event_seq: u16,
    counters: Counters,
    rows_dropped_before_start: u32,
}

impl Controller {
    /// Makes a controller with an idle rig on the board that `info` describes.
    #[must_use]
    pub fn new(info: DeviceInfo, boot: BootInfo) -> Self {
        Self {
            identity: Identity {
                protocol: VERSION,
                schema: SCHEMA,
                firmware: clipped(info.firmware),
                board: clipped(info.board),
            },
            description: Description {
                tick_hz: TICK_HZ,
                clock: Clock::RealTime,
                plant: PlantKind::Real,
                most_points: damprig_core::control::stepped_sine::MAX_POINTS as u16,
                signals: SIGNALS.len() as u8,
                most_signals: MAX_SIGNALS as u8,
                force_rate_hz: TICK_HZ * WALL_SUBSAMPLES as f32,
                clock_source: boot.clock_source,
                revision: clipped(info.revision),
                profile: clipped(info.profile),
                reset: boot.reset,
                last_crash: boot.last_crash,
                settings: Source::Default,
                option_bytes: boot.option_bytes,
                supply_v: boot.supply_v,
            },
            rig: Rig::new(),
            settings_source: Source::Default,
            is_accepted: false,
            saving: None,
            selection: Selection::default(),
            served: Deque::new(),
            last_rejected: None,
            event_seq: 0,
            counters: Counters::default(),
            rows_dropped_before_start: 0,
        }
    }

    /// Adopts stored settings before the first tick. Invalid ones are replaced by the defaults.
    pub fn start_with(&mut self, settings: &Settings, source: Source) {
        let adopted = self.rig.handle(Command::SetSettings(*settings));
        self.settings_source = if adopted.is_ok() { source } else { Source::Damaged };
    }

    /// The settings in use.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        self.rig.settings()
    }

    /// The rig.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The next tick.
    #[must_use]
    pub fn next_tick(&self) -> u32 {
        self.rig.next_tick()
    }

    /// Counts of what was lost, and the timing.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Notes that the host is connected.
    pub fn hear_host(&mut self) {
        self.rig.hear_host();
    }

    /// Takes the counts of the receiving side.
    pub fn note_losses(&mut self, losses: Losses) {
        self.counters.bad_frames = losses.bad_frames;
        self.counters.requests_dropped = losses.requests_dropped;
    }

    /// Takes the timing of the board.
    pub fn note_timing(&mut self, timing: Timing) {
        self.counters.timing = timing;
    }

    /// Serves one request: carries it out and replies, or lets the board keep it for its tick.
    ///
    /// A request with the number of an earlier one is answered again and not carried out again: the reply may have been lost, or
    /// a copy may have been delayed.
    pub fn serve(
        &mut self,
        request: &NumberedRequest,
        board: &mut impl Board,
        upload: &mut UploadBuffer,
        outgoing: &mut impl Outgoing,
    ) {
        let seq = request.seq;
        self.hear_host();
        if request.at_tick.is_some_and(|at| at > self.next_tick()) {
            if let Err(why) = board.defer(request) {
                self.queue(FromDevice::Reply { seq, answer: Err(why) }, outgoing);
            }
            return;
        }
        if matches!(request.request, Request::Identify) {
            // A new session restarts the sequence numbers.
            self.served.clear();
            self.is_accepted = false;
        }
        if self.saving == Some(seq) {
            // A copy: the reply is sent when the save has ended.
            return;
        }
        let is_last = self.served.back() == Some(&seq);
        let is_repeated = self.served.iter().any(|served| *served == seq) && !is_question(&request.request);
        let reply = if is_repeated && is_last {
            let done = if is_upload(&request.request) { Reply::Upload(upload.progress()) } else { Reply::Done };
            self.last_rejected.clone().map_or(Ok(done), Err)
        } else if is_repeated {
            // The reply to an older request is no longer expected.
            Ok(Reply::Done)
        } else {
            self.answer(request, board, upload, outgoing)
        };
        if !is_repeated && !self.served.iter().any(|served| *served == seq) {
            if self.served.is_full() {
                self.served.pop_front();
            }
            // Cannot fail: room was made above.
            let _ = self.served.push_back(seq);
            self.last_rejected = reply.as_ref().err().cloned();
        }
        if self.saving != Some(seq) {
            self.queue(FromDevice::Reply { seq, answer: reply }, outgoing);
        }
    }

    fn save(&mut self, seq: u16, board: &mut impl Board) -> Result<Reply, Rejected> {
        self.rig.must_be_idle()?;
        match board.save(self.settings())? {
            Saving::Done => self.settings_source = Source::Stored,
            // The reply is sent when the save has ended.
            Saving::Begun => self.saving = Some(seq),
        }
        Ok(Reply::Done)
    }

    /// Replies to a save request once the save has ended.
    pub fn end_saving(&mut self, board: &mut impl Board, outgoing: &mut impl Outgoing) {
        if let Some(seq) = self.saving
            && let Some(outcome) = board.saved()
        {
            self.saving = None;
            if outcome.is_ok() {
                self.settings_source = Source::Stored;
            }
            let answer = outcome.map(|()| Reply::Done);
            self.last_rejected = answer.as_ref().err().cloned();
            self.queue(FromDevice::Reply { seq, answer }, outgoing);
        }
    }

    fn answer<B: Board>(
        &mut self,
        request: &NumberedRequest,
        board: &mut B,
        upload: &mut UploadBuffer,
        outgoing: &mut impl Outgoing,
    ) -> Result<Reply, Rejected> {
        let command = match &request.request {
            Request::Identify => return Ok(Reply::Identity(self.identity.clone())),
            Request::StoredSettings { page, from } => return Ok(Reply::Stored(board.stored_settings(*page, *from))),
            Request::Describe => return Ok(Reply::Description(self.describe(board))),
            Request::Status => return Ok(Reply::Status { status: self.rig.status(), counters: self.counters }),
            Request::Signals { from } => return Ok(Reply::Signals(signals(*from))),
            Request::Result { index } => {
                let result = self.rig.result(*index).copied();
                return result.map(Reply::Result).ok_or(Rejected::not_here("that result is not kept (any more)"));
            }
            Request::Snippet { from } => return self.snippet(*from),
            Request::Transient => {
                let result = self.rig.transient().copied();
                let why = Rejected::not_here("there is no such result since the last start");
                return result.map(Reply::Transient).ok_or(why);
            }
            Request::SignalValues => {
                return Ok(Reply::SignalValues(self.rig.signals().values().into_iter().collect()));
            }
            Request::BeginUpload { bytes, crc32 } => {
                self.rig.must_be_idle()?;
                check_upload(*bytes)?;
                upload.begin(*bytes, *crc32);
                return Ok(Reply::Upload(upload.progress()));
            }
            Request::UploadChunk { offset, data } => {
                self.rig.must_be_idle()?;
                check_chunk(*offset, data)?;
                upload.take(*offset, data)?;
                return Ok(Reply::Upload(upload.progress()));
            }
            Request::SetTelemetry { every_ticks, signals, impacts } => {
                self.selection = Selection::new(*every_ticks, signals, *impacts)?;
                return Ok(Reply::Done);
            }
            Request::Settings => {
                return Ok(Reply::Settings { settings: *self.settings(), source: self.settings_source });
            }
            _ if self.saving.is_some() => return Err(Rejected::not_here("the settings are being saved: ask again")),
            Request::SaveSettings => return self.save(request.seq, board),
            Request::Simulator(message) => {
                if board.simulate(message, &self.rig)? == Simulated::PlantChanged {
                    return Ok(Reply::Done);
                }
                Command::ReplaceSpring
            }
            Request::AcceptSettings => {
                self.is_accepted = true;
                return Ok(Reply::Done);
            }
            Request::SetSettings(settings) => Command::SetSettings(*settings),
            Request::SetLimits(limits) => Command::SetLimits(*limits),
            Request::SetSpring(set_up) => Command::SetSpring(*set_up),
            Request::SetTwin(config) => Command::SetTwin(*config),
            Request::Configure(sine) => {
                Command::Configure(Experiment::SteppedSine(SteppedSinePlan::new(sine.clone())?))
            }
            Request::ConfigurePlayback(config) => {
                Command::Configure(Experiment::Playback(playback::PlaybackPlan::new(*config)?))
            }
            Request::ConfigureFreeVibration(config) => {
                Command::Configure(Experiment::FreeVibration(free_vibration::FreeVibrationPlan::new(*config)?))
            }
            Request::Start => return self.start(board, upload, outgoing),
            Request::Stop => Command::Stop,
            Request::Hold(held) => Command::Hold(*held),
            Request::ClearFault => Command::ClearFault,
            Request::Spring(command) => {
                if command.moves() {
                    self.must_have_consent()?;
                }
                Command::Spring(*command)
            }
            Request::ArmSnippet => Command::ArmSnippet,
        };
        if let Command::Configure(experiment) = &command {
            let record = experiment.record();
            self.rig.check_drive(experiment, record.and_then(|record| upload.peak_counts(&record)))?;
        }
        let sets = matches!(command, Command::SetSettings(_));
        self.rig.handle(command)?;
        if sets {
            self.settings_source = self.settings_source.once_set();
        }
        Ok(Reply::Done)
    }

    /// Refuses to move anything while settings that somebody saved do not act, unless the host has accepted this.
    fn must_have_consent(&self) -> Result<(), Rejected> {
        if self.settings_source.needs_consent() && !self.is_accepted {
            return Err(Rejected::not_here("the saved settings do not act: restore them, or accept these"));
        }
        Ok(())
    }

    /// Starts the configured experiment: ticks count from 0, rows that wait are dropped.
    fn start(
        &mut self,
        board: &mut impl Board,
        upload: &UploadBuffer,
        outgoing: &mut impl Outgoing,
    ) -> Result<Reply, Rejected> {
        let record = self.rig.wanted_record();
        self.rig.could_start(record.and_then(|record| upload.peak_counts(&record)))?;
        self.must_have_consent()?;
        if record.is_some_and(|record| !upload.holds(&record)) {
            return Err(Rejected::not_here("upload the record that this playback names first"));
        }
        board.can_start()?;
        self.rig.handle(Command::Start)?;
        self.rows_dropped_before_start = self.counters.rows_dropped;
        outgoing.clear_stream();
        // Cannot fail: the queue is empty.
        let _ = outgoing.stream(StreamItem::Started);
        board.started();
        Ok(Reply::Done)
    }

    fn snippet(&self, from: u16) -> Result<Reply, Rejected> {
        let (snippet, scale) = self.rig.snippet();
        let mut samples = Vec::new();
        // Cannot fail: the length is the capacity.
        let _ = samples.resize_default(SAMPLES_TOLD);
        let Some((copied, side)) = snippet.copy(usize::from(from), &mut samples) else {
            return Err(Rejected::not_here(if snippet.is_armed() {
                "no impact has come since the snippet was armed"
            } else {
                "no snippet was armed"
            }));
        };
        samples.truncate(copied);
        Ok(Reply::Snippet { scale: *scale, side, length: SNIPPET as u16, samples })
    }

    fn describe<B: Board>(&self, board: &B) -> Description {
        Description {
            clock: board.clock(),
            plant: B::PLANT,
            settings: self.settings_source,
            ..self.description.clone()
        }
    }

    /// One tick of the rig. The upload buffer lends it the record of a playback.
    pub fn tick(&mut self, sensors: &Sensors, upload: &mut UploadBuffer, outgoing: &mut impl Outgoing) -> Actuators {
        let tick = self.next_tick();
        if self.rig.state() == RigState::Idle {
            upload.check();
        }
        let actuators = self.rig.tick(sensors, upload.record());
        let last = self.rig.events().any(|event| matches!(event, Event::Finished { .. } | Event::Fault(_)));
        let Selection { every_ticks, chosen, .. } = self.selection;
        if every_ticks > 0 && tick.is_multiple_of(u32::from(every_ticks)) {
            let row = Row { tick, every_ticks, chosen, values: *self.rig.signals(), last };
            match outgoing.stream(StreamItem::Row(row)) {
                Ok(waiting) => keep_most(&mut self.counters.most_rows_waiting, waiting),
                Err(()) => self.counters.rows_dropped = self.counters.rows_dropped.saturating_add(1),
            }
        }
        while let Some(mut event) = self.rig.pop_event() {
            match &mut event {
                Event::Impact(_) if !self.selection.impacts => continue,
                Event::Finished { rows_dropped, .. } => {
                    *rows_dropped = self.counters.rows_dropped - self.rows_dropped_before_start;
                }
                _ => {}
            }
            let seq = self.event_seq;
            self.event_seq = seq.wrapping_add(1);
            self.queue(FromDevice::Event { seq, tick, event }, outgoing);
        }
        actuators
    }

    fn queue(&mut self, message: FromDevice, outgoing: &mut impl Outgoing) {
        match outgoing.message(message) {
            Ok(waiting) => keep_most(&mut self.counters.most_replies_waiting, waiting),
            Err(()) => self.counters.replies_dropped = self.counters.replies_dropped.saturating_add(1),
        }
    }
}

impl Selection {
    fn new(every_ticks: u16, signals: &Vec<u8, MAX_SIGNALS>, impacts: bool) -> Result<Self, Invalid> {
        if let Some(&place) = signals.iter().find(|&&place| usize::from(place) >= SIGNALS.len()) {
            let allowed = "a place in the signal table";
            return Err(Invalid { parameter: "telemetry.signals", value: f64::from(place), allowed });
        }
        let chosen = if signals.is_empty() { Chosen::default() } else { Chosen::new(signals) };
        Ok(Self { every_ticks, chosen, impacts })
    }
}

/// Whether the request has no effect. A repetition of such a request is served again.
fn is_question(ask: &Request) -> bool {
    matches!(
        ask,
        Request::Identify
            | Request::Describe
            | Request::Status
            | Request::Signals { .. }
            | Request::Result { .. }
            | Request::Snippet { .. }
            | Request::Transient
            | Request::Settings
            | Request::StoredSettings { .. }
            | Request::SignalValues
    )
}

/// Whether the request is part of an upload. A repetition is answered with the upload's progress.
fn is_upload(ask: &Request) -> bool {
    matches!(ask, Request::BeginUpload { .. } | Request::UploadChunk { .. })
}

fn check_upload(bytes: u32) -> Result<(), Invalid> {
    if bytes == 0 || bytes > MAX_BYTES || !bytes.is_multiple_of(2) {
        let allowed = "an even number from 2 to 40960: the record buffer holds 20480 samples of two bytes";
        return Err(Invalid { parameter: "upload.bytes", value: f64::from(bytes), allowed });
    }
    Ok(())
}

fn check_chunk(offset: u32, data: &[u8]) -> Result<(), Invalid> {
    let odd = |parameter, value| Err(Invalid { parameter, value, allowed: "even: a sample has two bytes" });
    if !offset.is_multiple_of(2) {
        return odd("upload.offset", f64::from(offset));
    }
    if !data.len().is_multiple_of(2) {
        return odd("upload.data", data.len() as f64);
    }
    Ok(())
}

/// Part of the signal table: as many entries from `from` on as fit a message.
fn signals(from: u8) -> Vec<Signal, SIGNALS_TOLD> {
    let rest = SIGNALS.get(usize::from(from)..).unwrap_or_default();
    let named = rest.iter().map(|(name, unit)| Signal { name: clipped(name), unit: clipped(unit) });
    named.take(SIGNALS_TOLD).collect()
}

fn keep_most(most: &mut u8, now: usize) {
    *most = (*most).max(now.min(usize::from(u8::MAX)) as u8);
}
