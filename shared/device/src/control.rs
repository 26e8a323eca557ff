//! The tick task's whole work: requests to the rig, one tick, and what comes out of it.

use damprig_core::plant::PlantConfig;
use damprig_core::rig::{Actuators, Command, Event, Refusal, Rig, SIGNALS, Sensors, TICK_HZ};
use damprig_protocol::{
    Answer, Ask, Clock, Counters, Description, FromDevice, Happening, Identity, PlantKind, Refused, Request, SCHEMA,
    Signal, VERSION, clipped,
};
use heapless::Deque;

/// Numbers of served requests that are kept, to know a repetition: a late copy may come after some that followed it.
const SERVED_KEPT: usize = 8;

/// What the rig drives, as far as requests can touch it.
pub trait Bench {
    /// Real, or simulated in which precision.
    const PLANT: PlantKind;

    /// Whose clock counts the ticks.
    const CLOCK: Clock;

    /// Sets a simulated plant.
    ///
    /// # Errors
    /// A value that is not physical, or a plant that cannot be set.
    fn set_plant(&mut self, config: &PlantConfig) -> Result<(), Refusal>;

    /// Puts a simulated plant back to its start, its noise too.
    ///
    /// # Errors
    /// A simulated plant has not been set.
    fn restart(&mut self) -> Result<(), Refusal>;
}

/// A real structure: nothing about it can be set from a host.
#[derive(Clone, Copy, Debug, Default)]
pub struct RealPlant;

impl Bench for RealPlant {
    const PLANT: PlantKind = PlantKind::Real;
    const CLOCK: Clock = Clock::RealTime;

    fn set_plant(&mut self, _: &PlantConfig) -> Result<(), Refusal> {
        Err(Refusal::NotHere("this board drives a real structure: its plant cannot be set"))
    }

    fn restart(&mut self) -> Result<(), Refusal> {
        Ok(())
    }
}

/// One row of telemetry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Its tick.
    pub tick: u32,
    /// Ticks between rows.
    pub every_ticks: u16,
    /// The signals in order.
    pub values: [f32; SIGNALS.len()],
    /// Nothing follows soon: do not wait for more rows before sending.
    pub last: bool,
}

/// Where control puts what it has to say. Neither may wait: a full lane says no, and control counts it.
pub trait Lanes {
    /// Replies, events and clock messages.
    ///
    /// # Errors
    /// There is no room.
    #[allow(clippy::result_unit_err)] // The only failure is "full", and the caller counts it.
    fn urgent(&mut self, message: FromDevice) -> Result<(), ()>;

    /// Telemetry.
    ///
    /// # Errors
    /// There is no room.
    #[allow(clippy::result_unit_err)]
    fn row(&mut self, row: Row) -> Result<(), ()>;
}

/// Who this device says it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name {
    /// The firmware's version.
    pub firmware: &'static str,
    /// The board.
    pub board: &'static str,
}

/// Owns the rig.
#[derive(Clone, Debug)]
pub struct Control {
    name: Name,
    rig: Rig,
    every_ticks: u16,
    scheduled: Option<Request>,
    served: Deque<u16, SERVED_KEPT>,
    last_refused: Option<Refused>,
    event_seq: u16,
    counters: Counters,
    rows_dropped_before_start: u32,
}

impl Control {
    /// An idle rig on the board called `name`.
    #[must_use]
    pub fn new(name: Name) -> Self {
        Self {
            name,
            rig: Rig::new(),
            every_ticks: 0,
            scheduled: None,
            served: Deque::new(),
            last_refused: None,
            event_seq: 0,
            counters: Counters::default(),
            rows_dropped_before_start: 0,
        }
    }

    /// The rig, to look at.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The tick that comes next.
    #[must_use]
    pub fn next_tick(&self) -> u32 {
        self.rig.status().tick
    }

    /// Takes over what other tasks have counted.
    pub fn note(&mut self, bad_frames: u32, requests_dropped: u32) {
        self.counters.bad_frames = bad_frames;
        self.counters.requests_dropped = requests_dropped;
    }

    /// Takes one request: answers it, or keeps it for its tick. One request at most waits for its tick.
    pub fn serve(&mut self, request: Request, bench: &mut impl Bench, lanes: &mut impl Lanes) {
        if request.at_tick.is_none_or(|at| at <= self.next_tick()) {
            self.carry_out(request, bench, lanes);
            return;
        }
        match &self.scheduled {
            None => self.scheduled = Some(request),
            Some(waiting) if waiting.seq == request.seq => {}
            Some(_) => {
                let why = Refusal::NotHere("another request already waits for its tick");
                self.say(FromDevice::Reply { seq: request.seq, answer: Err(why.into()) }, lanes);
            }
        }
    }

    /// Carries out the request that waited for this tick, if there is one.
    pub fn serve_scheduled(&mut self, bench: &mut impl Bench, lanes: &mut impl Lanes) {
        let tick = self.next_tick();
        if let Some(request) = self.scheduled.take_if(|request| request.at_tick.is_none_or(|at| at <= tick)) {
            self.carry_out(request, bench, lanes);
        }
    }

    /// Answers. A number that was served is answered again but not carried out again: not the last one, whose reply may
    /// have been lost, nor one before it, of which a copy was late on the way.
    fn carry_out(&mut self, request: Request, bench: &mut impl Bench, lanes: &mut impl Lanes) {
        // Not by `==`: comparing whole questions costs 3.5 KB of flash.
        if matches!(request.ask, Ask::Identify) {
            // A conversation begins, and counts its requests anew.
            self.served.clear();
        }
        let repeated = self.served.iter().any(|seq| *seq == request.seq);
        let is_last = self.served.back() == Some(&request.seq);
        // Questions have no effect: a repetition is answered afresh.
        let is_question = matches!(request.ask, Ask::Identify | Ask::Describe | Ask::Status | Ask::Result { .. });
        let answer = if repeated && is_last && !is_question {
            self.last_refused.clone().map_or(Ok(Answer::Done), Err)
        } else if repeated && !is_question {
            // Nobody waits for this answer any more.
            Ok(Answer::Done)
        } else {
            self.answer(request.ask, bench).map_err(Refused::from)
        };
        if !repeated {
            if self.served.is_full() {
                self.served.pop_front();
            }
            // Cannot fail: room was made above.
            let _ = self.served.push_back(request.seq);
            self.last_refused = answer.as_ref().err().cloned();
        }
        self.say(FromDevice::Reply { seq: request.seq, answer }, lanes);
    }

    fn answer(&mut self, ask: Ask, bench: &mut impl Bench) -> Result<Answer, Refusal> {
        let command = match ask {
            Ask::Identify => return Ok(Answer::Identity(self.identity())),
            Ask::Describe => return Ok(Answer::Description(describe(bench))),
            Ask::Status => return Ok(Answer::Status { status: self.rig.status(), counters: self.counters }),
            Ask::Result { index } => {
                return match self.rig.result(index) {
                    Some(result) => Ok(Answer::Result(*result)),
                    None => Err(Refusal::NotHere("that result is not kept (any more)")),
                };
            }
            Ask::SetTelemetry { every_ticks } => {
                self.every_ticks = every_ticks;
                return Ok(Answer::Done);
            }
            Ask::SetPlant(config) => {
                self.rig.must_be_idle()?;
                bench.set_plant(&config)?;
                return Ok(Answer::Done);
            }
            Ask::SetLimits(limits) => Command::SetLimits(limits),
            Ask::Configure(plan) => Command::Configure(plan),
            Ask::Start => Command::Start,
            Ask::Stop => Command::Stop,
            Ask::ClearFault => Command::ClearFault,
        };
        if command == Command::Start {
            self.rig.must_be_idle()?;
            bench.restart()?;
            // It waited for a tick of the count that ends here.
            self.scheduled = None;
            self.rows_dropped_before_start = self.counters.rows_dropped;
        }
        self.rig.handle(command)?;
        Ok(Answer::Done)
    }

    fn identity(&self) -> Identity {
        Identity {
            protocol: VERSION,
            schema: SCHEMA,
            firmware: clipped(self.name.firmware),
            board: clipped(self.name.board),
        }
    }

    /// One tick of the rig.
    pub fn tick(&mut self, sensors: &Sensors, lanes: &mut impl Lanes) -> Actuators {
        let tick = self.next_tick();
        let (actuators, event) = self.rig.tick(sensors);
        let ends = matches!(event, Some(Event::Finished { .. } | Event::Fault(_)));
        if self.every_ticks > 0 && tick.is_multiple_of(u32::from(self.every_ticks)) {
            let row = Row { tick, every_ticks: self.every_ticks, values: *self.rig.signals(), last: ends };
            if lanes.row(row).is_err() {
                self.counters.rows_dropped = self.counters.rows_dropped.saturating_add(1);
            }
        }
        if let Some(event) = event {
            let event = match event {
                Event::Point(result) => Happening::Point(result),
                Event::Fault(fault) => Happening::Fault(fault),
                Event::Finished { points } => Happening::Finished {
                    points,
                    rows_dropped: self.counters.rows_dropped - self.rows_dropped_before_start,
                },
            };
            let seq = self.event_seq;
            self.event_seq = seq.wrapping_add(1);
            self.say(FromDevice::Event { seq, tick, event }, lanes);
        }
        actuators
    }

    fn say(&mut self, message: FromDevice, lanes: &mut impl Lanes) {
        if lanes.urgent(message).is_err() {
            self.counters.replies_dropped = self.counters.replies_dropped.saturating_add(1);
        }
    }
}

fn describe<B: Bench>(_: &B) -> Description {
    Description {
        tick_hz: TICK_HZ,
        clock: B::CLOCK,
        plant: B::PLANT,
        most_points: damprig_core::control::stepped_sine::MOST_POINTS as u16,
        signals: SIGNALS.iter().map(|(name, unit)| Signal { name: clipped(name), unit: clipped(unit) }).collect(),
    }
}
