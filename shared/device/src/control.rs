//! The tick task's whole work: one tick of the rig, what comes out of it, and an order after it.

use crate::lanes::{Lanes, Row, Saying};
use crate::orders::{Order, Selection, Work};
use crate::store::Store;
use damprig_core::io::{Actuators, Sensors, TICK_HZ, WALL_SUBSAMPLES};
use damprig_core::measure::snippet::SNIPPET;
use damprig_core::plant::PlantConfig;
use damprig_core::rig::{Command, Event, Refusal, Rig, SIGNALS, State};
use damprig_core::settings::{Prepared, Settings, Source};
use damprig_protocol::{
    Answer, Clock, ClockSource, Counters, Crash, Description, Happening, Identity, MOST_SIGNALS, PlantKind, Reset,
    SAMPLES_TOLD, SCHEMA, Timing, VERSION, clipped,
};
use heapless::{Deque, Vec};

/// Numbers of served requests that are kept, to know a repetition: a late copy may come after some that followed it.
const SERVED_KEPT: usize = 8;

/// What the rig drives, as far as orders can touch it; `P` is what a simulated plant is made of.
pub trait Bench<P = PlantConfig> {
    /// Real, or simulated in which precision.
    const PLANT: PlantKind;

    /// Whose clock counts the ticks.
    const CLOCK: Clock;

    /// Sets a simulated plant.
    ///
    /// # Errors
    /// A value that is not physical, or a plant that cannot be set.
    fn set_plant(&mut self, config: &P) -> Result<(), Refusal>;

    /// Puts a simulated plant back to its start, its noise too.
    ///
    /// # Errors
    /// A simulated plant has not been set.
    fn restart(&mut self) -> Result<(), Refusal>;

    /// Saves the settings, or begins to.
    ///
    /// # Errors
    /// They cannot be saved.
    fn save(&mut self, settings: &Settings) -> Result<Saving, Refusal>;

    /// How a saving has ended that was begun, once.
    fn saved(&mut self) -> Option<Result<(), Refusal>> {
        None
    }
}

/// What has become of settings that are to be saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saving {
    /// They are saved.
    Done,
    /// They will be; [`Bench::saved`] tells.
    Begun,
}

/// A real structure: nothing about it can be set from a host.
#[derive(Clone, Copy, Debug, Default)]
pub struct RealPlant;

impl<P> Bench<P> for RealPlant {
    const PLANT: PlantKind = PlantKind::Real;
    const CLOCK: Clock = Clock::RealTime;

    fn set_plant(&mut self, _: &P) -> Result<(), Refusal> {
        Err(Refusal::NotHere("this board drives a real structure: its plant cannot be set"))
    }

    fn restart(&mut self) -> Result<(), Refusal> {
        Ok(())
    }

    fn save(&mut self, _: &Settings) -> Result<Saving, Refusal> {
        Err(Refusal::NotHere("this board has no flash to save to"))
    }
}

/// Who this device says it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name {
    /// The firmware's version.
    pub firmware: &'static str,
    /// The board.
    pub board: &'static str,
    /// Revision of the source; empty where it is not known.
    pub revision: &'static str,
    /// How it was built.
    pub profile: &'static str,
}

impl Name {
    /// Without a revision.
    #[must_use]
    pub const fn new(firmware: &'static str, board: &'static str) -> Self {
        Self { firmware, board, revision: "", profile: "" }
    }
}

/// How the board came up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Birth {
    /// What counts its ticks.
    pub clock_source: ClockSource,
    /// Why it started.
    pub reset: Reset,
    /// What ended an earlier run.
    pub last_crash: Option<Crash>,
}

impl Default for Birth {
    /// A simulated board's.
    fn default() -> Self {
        Self { clock_source: ClockSource::Granted, reset: Reset::Unknown, last_crash: None }
    }
}

/// Owns the rig.
#[derive(Clone, Debug)]
pub struct Control {
    /// Made once: texts take time to copy.
    identity: Identity,
    /// But for what a bench and the settings say.
    description: Description,
    rig: Rig,
    settings_source: Source,
    /// The number of the request to save that waits for its answer.
    saving: Option<u16>,
    selection: Selection,
    served: Deque<u16, SERVED_KEPT>,
    last_refused: Option<Refusal>,
    event_seq: u16,
    counters: Counters,
    rows_dropped_before_start: u32,
}

impl Control {
    /// An idle rig on the board called `name`.
    #[must_use]
    pub fn new(name: Name, birth: Birth) -> Self {
        Self {
            identity: Identity {
                protocol: VERSION,
                schema: SCHEMA,
                firmware: clipped(name.firmware),
                board: clipped(name.board),
            },
            description: Description {
                tick_hz: TICK_HZ,
                clock: Clock::RealTime,
                plant: PlantKind::Real,
                most_points: damprig_core::control::stepped_sine::MOST_POINTS as u16,
                signals: SIGNALS.len() as u8,
                most_signals: MOST_SIGNALS as u8,
                force_rate_hz: TICK_HZ * WALL_SUBSAMPLES as f32,
                clock_source: birth.clock_source,
                revision: clipped(name.revision),
                profile: clipped(name.profile),
                reset: birth.reset,
                last_crash: birth.last_crash,
                settings: Source::Default,
            },
            rig: Rig::new(),
            settings_source: Source::Default,
            saving: None,
            selection: Selection::default(),
            served: Deque::new(),
            last_refused: None,
            event_seq: 0,
            counters: Counters::default(),
            rows_dropped_before_start: 0,
        }
    }

    /// Takes over settings that were kept, before the first tick. Out of range they become those as delivered.
    pub fn start_with(&mut self, settings: &Settings, source: Source) {
        match Prepared::new(settings) {
            Ok(prepared) if self.rig.adopt(&prepared).is_ok() => self.settings_source = source,
            _ => self.settings_source = Source::Damaged,
        }
    }

    /// The settings in use.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        self.rig.settings()
    }

    /// The rig, to look at.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The tick that comes next.
    #[must_use]
    pub fn next_tick(&self) -> u32 {
        self.rig.next_tick()
    }

    /// Takes over what other tasks have counted.
    pub fn note(&mut self, bad_frames: u32, requests_dropped: u32) {
        self.counters.bad_frames = bad_frames;
        self.counters.requests_dropped = requests_dropped;
    }

    /// Takes over how the board keeps its ticks.
    pub fn note_timing(&mut self, timing: Timing) {
        self.counters.timing = timing;
    }

    /// Takes one order: answers it. What is left in its place has been served.
    pub fn serve<P>(
        &mut self,
        order: &mut Order<P>,
        bench: &mut impl Bench<P>,
        store: &mut Store,
        lanes: &mut impl Lanes,
    ) {
        self.hear();
        if order.at_tick.is_some_and(|at| at > self.next_tick()) {
            self.refuse(order.seq, Refusal::NotHere("only a simulated board lets a request wait for its tick"), lanes);
            return;
        }
        self.carry_out(order, bench, store, lanes);
    }

    /// Something was heard of the host.
    pub(crate) fn hear(&mut self) {
        self.rig.hear_host();
    }

    /// Answers that a request is not carried out.
    pub(crate) fn refuse(&mut self, seq: u16, why: Refusal, lanes: &mut impl Lanes) {
        self.say(Saying::Reply { seq, answer: Err(why) }, lanes);
    }

    /// Answers. A number that was served is answered again but not carried out again: not the last one, whose reply may
    /// have been lost, nor one before it, of which a copy was late on the way.
    fn carry_out<P>(
        &mut self,
        order: &mut Order<P>,
        bench: &mut impl Bench<P>,
        store: &mut Store,
        lanes: &mut impl Lanes,
    ) {
        // Not by `==`: comparing whole questions costs 3.5 KB of flash.
        if matches!(order.work, Work::Identify) {
            // A conversation begins, and counts its requests anew.
            self.served.clear();
        }
        if self.saving == Some(order.seq) {
            // A copy: the reply comes when it is saved.
            return;
        }
        let repeated = self.served.iter().any(|seq| *seq == order.seq);
        let is_last = self.served.back() == Some(&order.seq);
        // Questions have no effect: a repetition is answered afresh.
        let is_question = order.work.is_question();
        let answer = if repeated && is_last && !is_question {
            let done = if order.work.is_upload() { Answer::Upload(store.progress()) } else { Answer::Done };
            self.last_refused.map_or(Ok(done), Err)
        } else if repeated && !is_question {
            // Nobody waits for this answer any more.
            Ok(Answer::Done)
        } else {
            self.answer(order.seq, &mut order.work, bench, store)
        };
        if !repeated {
            if self.served.is_full() {
                self.served.pop_front();
            }
            // Cannot fail: room was made above.
            let _ = self.served.push_back(order.seq);
            self.last_refused = answer.as_ref().err().copied();
        }
        if self.saving != Some(order.seq) {
            self.say(Saying::Reply { seq: order.seq, answer }, lanes);
        }
    }

    /// Saves the settings, or begins to: then the reply waits.
    fn save<P>(&mut self, seq: u16, bench: &mut impl Bench<P>) -> Result<Answer, Refusal> {
        self.rig.must_be_idle()?;
        match bench.save(self.settings())? {
            Saving::Done => self.settings_source = Source::Stored,
            Saving::Begun => self.saving = Some(seq),
        }
        Ok(Answer::Done)
    }

    /// Answers a request to save that has ended; to be called in every tick of a board that takes its time to save.
    pub fn end_saving<P>(&mut self, bench: &mut impl Bench<P>, lanes: &mut impl Lanes) {
        if let Some(seq) = self.saving
            && let Some(outcome) = bench.saved()
        {
            self.saving = None;
            if outcome.is_ok() {
                self.settings_source = Source::Stored;
            }
            let answer = outcome.map(|()| Answer::Done);
            self.last_refused = answer.as_ref().err().copied();
            self.say(Saying::Reply { seq, answer }, lanes);
        }
    }

    fn answer<P>(
        &mut self,
        seq: u16,
        work: &mut Work<P>,
        bench: &mut impl Bench<P>,
        store: &mut Store,
    ) -> Result<Answer, Refusal> {
        match work {
            Work::Identify => Ok(Answer::Identity(self.identity.clone())),
            Work::Describe => Ok(Answer::Description(self.describe(bench))),
            Work::Status => Ok(Answer::Status { status: self.rig.status(), counters: self.counters }),
            Work::Signals(part) => Ok(Answer::Signals(core::mem::take(part))),
            Work::Result { index } => match self.rig.result(*index) {
                Some(result) => Ok(Answer::Result(*result)),
                None => Err(Refusal::NotHere("that result is not kept (any more)")),
            },
            Work::Snippet { from } => self.snippet(*from),
            Work::Transient => match self.rig.transient() {
                Some(result) => Ok(Answer::Transient(*result)),
                None => Err(Refusal::NotHere("there is no such result since the last start")),
            },
            Work::BeginUpload { bytes, crc32 } => {
                self.rig.must_be_idle()?;
                store.begin(*bytes, *crc32);
                Ok(Answer::Upload(store.progress()))
            }
            Work::UploadChunk { offset, data } => {
                self.rig.must_be_idle()?;
                store.take(*offset, data)?;
                Ok(Answer::Upload(store.progress()))
            }
            Work::SetTelemetry(selection) => {
                self.selection = *selection;
                Ok(Answer::Done)
            }
            Work::Settings => Ok(Answer::Settings { settings: *self.settings(), source: self.settings_source }),
            // Nothing begins while the flash is written to.
            _ if self.saving.is_some() => Err(Refusal::NotHere("the settings are being saved: ask again")),
            Work::SetSettings(prepared) => {
                self.rig.adopt(prepared)?;
                self.settings_source = Source::Host;
                Ok(Answer::Done)
            }
            Work::SaveSettings => self.save(seq, bench),
            Work::SetPlant(config) => {
                self.rig.must_be_idle()?;
                bench.set_plant(config)?;
                self.rig.replace_spring()?;
                Ok(Answer::Done)
            }
            Work::Command(command) => {
                if let Command::Configure(Some(experiment)) = command {
                    let wanted = experiment.record();
                    self.rig.check_drive(experiment, wanted.and_then(|wanted| store.peak_counts(&wanted)))?;
                }
                if matches!(command, Command::Start) {
                    let wanted = self.rig.wanted_record();
                    self.rig.could_start(wanted.and_then(|wanted| store.peak_counts(&wanted)))?;
                    if wanted.is_some_and(|wanted| !store.holds(&wanted)) {
                        return Err(Refusal::NotHere("upload the record that this playback names first"));
                    }
                    bench.restart()?;
                    self.rows_dropped_before_start = self.counters.rows_dropped;
                }
                self.rig.handle(command)?;
                Ok(Answer::Done)
            }
            Work::Refuse(invalid) => Err(Refusal::Invalid(*invalid)),
        }
    }

    fn snippet(&self, from: u16) -> Result<Answer, Refusal> {
        let (snippet, scale) = self.rig.snippet();
        let mut samples = Vec::new();
        // Never more than there is room for.
        let _ = samples.resize_default(SAMPLES_TOLD);
        let Some((copied, side)) = snippet.copy(usize::from(from), &mut samples) else {
            return Err(Refusal::NotHere(if snippet.is_armed() {
                "no impact has come since the snippet was armed"
            } else {
                "no snippet was armed"
            }));
        };
        samples.truncate(copied);
        Ok(Answer::Snippet { scale: *scale, side, length: SNIPPET as u16, samples })
    }

    fn describe<P, B: Bench<P>>(&self, _: &B) -> Description {
        Description { clock: B::CLOCK, plant: B::PLANT, settings: self.settings_source, ..self.description.clone() }
    }

    /// One tick of the rig, to which the store lends its record.
    pub fn tick(&mut self, sensors: &Sensors, store: &mut Store, lanes: &mut impl Lanes) -> Actuators {
        let tick = self.next_tick();
        if self.rig.state() == State::Idle {
            store.check();
        }
        let actuators = self.rig.tick(sensors, store.record());
        let ends = self.rig.events().any(|event| matches!(event, Event::Finished { .. } | Event::Fault(_)));
        let every_ticks = self.selection.every_ticks;
        if every_ticks > 0 && tick.is_multiple_of(u32::from(every_ticks)) {
            let (chosen, values) = (self.selection.chosen, self.rig.signals());
            match lanes.row(Row { tick, every_ticks, chosen, values, last: ends }) {
                Ok(waiting) => keep_most(&mut self.counters.most_rows_waiting, waiting),
                Err(()) => self.counters.rows_dropped = self.counters.rows_dropped.saturating_add(1),
            }
        }
        while let Some(event) = self.rig.pop_event() {
            if let Some(event) = self.happening(&event) {
                let seq = self.event_seq;
                self.event_seq = seq.wrapping_add(1);
                self.say(Saying::Event { seq, tick, event }, lanes);
            }
        }
        actuators
    }

    /// What the host is told of an event.
    fn happening(&self, event: &Event) -> Option<Happening> {
        Some(match *event {
            Event::Point(result) => Happening::Point(result),
            Event::Fault(fault) => Happening::Fault(fault),
            Event::Finished { points } => Happening::Finished {
                points,
                rows_dropped: self.counters.rows_dropped - self.rows_dropped_before_start,
            },
            Event::Spring(happening) => Happening::Spring(happening),
            Event::Transient(result) => Happening::Transient(result),
            Event::Impact(record) => return self.selection.impacts.then_some(Happening::Impact(record)),
        })
    }

    fn say(&mut self, saying: Saying, lanes: &mut impl Lanes) {
        match lanes.urgent(saying) {
            Ok(waiting) => keep_most(&mut self.counters.most_replies_waiting, waiting),
            Err(()) => self.counters.replies_dropped = self.counters.replies_dropped.saturating_add(1),
        }
    }
}

fn keep_most(most: &mut u8, now: usize) {
    *most = (*most).max(now.min(usize::from(u8::MAX)) as u8);
}
