//! The rig's one decision maker: samples and commands in, actuator values, replies and events out.
//!
//! Plain synchronous functions; time is the tick. On the board a high-priority task calls [`Rig::tick`] at
//! [`TICK_HZ`]; the virtual rig calls it as fast as it can. What carries commands and results to a host is in
//! `damprig-protocol`.

use crate::control::limits::{Fault, Limits};
use crate::control::stepped_sine::{Outcome, Runner, Stage, SteppedSine};
use crate::measure::point::PointResult;
use crate::model::Invalid;
use heapless::Deque;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Control ticks per second.
pub const TICK_HZ: f32 = 1000.0;

/// Samples per tick and channel: the converters run at 10 kHz.
pub const SUBSAMPLES: usize = 10;

/// Results that the rig keeps for a host that missed one.
pub const KEPT_RESULTS: usize = 8;

/// The telemetry signals, name and unit, in the order of [`Rig::signals`].
pub const SIGNALS: [(&str, &str); 4] = [("x", "m"), ("z", "m"), ("drive", "m"), ("frequency", "Hz")];

/// One tick's samples: the block that the converters took since the last tick, oldest first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// Structure displacement x, m.
    pub x_m: [f32; SUBSAMPLES],
    /// Base displacement z, m.
    pub z_m: [f32; SUBSAMPLES],
}

impl Sensors {
    /// Mean of the block's x, m: the decimated value that control and lock-in use.
    #[must_use]
    pub fn mean_x_m(&self) -> f32 {
        mean(&self.x_m)
    }

    /// Mean of the block's z, m.
    #[must_use]
    pub fn mean_z_m(&self) -> f32 {
        mean(&self.z_m)
    }

    /// max |x| over the block, m.
    #[must_use]
    pub fn peak_x_m(&self) -> f32 {
        peak(&self.x_m)
    }

    /// max |z| over the block, m.
    #[must_use]
    pub fn peak_z_m(&self) -> f32 {
        peak(&self.z_m)
    }

    /// Every sample is a number.
    #[must_use]
    pub fn all_finite(&self) -> bool {
        (self.mean_x_m() + self.mean_z_m()).is_finite()
    }
}

fn mean(block: &[f32; SUBSAMPLES]) -> f32 {
    let mut sum = 0.0;
    for sample in block {
        sum += sample;
    }
    sum * (1.0 / SUBSAMPLES as f32)
}

fn peak(block: &[f32; SUBSAMPLES]) -> f32 {
    let mut peak = 0.0;
    for &sample in block {
        let magnitude = if sample < 0.0 { -sample } else { sample };
        if magnitude > peak {
            peak = magnitude;
        }
    }
    peak
}

/// One tick's actuator values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Actuators {
    /// Demanded base displacement, m; the board's calibration turns it into a drive voltage.
    pub drive_m: f32,
    /// The drive's relay may be closed.
    pub drive_enabled: bool,
    /// A simulated plant goes back to its start for the point of this place; a real one cannot.
    pub put_plant_back: Option<u16>,
}

/// What the rig is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum State {
    /// Nothing; the drive is off.
    Idle,
    /// An experiment, at this stage of its present point.
    Running(Stage),
    /// The drive is fading out after a stop or the last point.
    Stopping,
    /// Stopped by an interlock until the fault is cleared.
    Faulted,
}

impl State {
    /// In words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Running(Stage::Rest) => "waiting for rest",
            Self::Running(Stage::Settle) => "settling",
            Self::Running(Stage::Dwell) => "measuring",
            Self::Stopping => "stopping",
            Self::Faulted => "faulted",
        }
    }
}

/// What a host may ask of the rig.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum Command {
    /// Set the interlocks' limits. Idle only.
    SetLimits(Limits),
    /// Set the experiment. Idle only.
    Configure(SteppedSine),
    /// Begin the configured experiment at tick 0. Idle only.
    Start,
    /// End the experiment: the drive fades out.
    Stop,
    /// Forget a latched fault, once the drive is silent.
    ClearFault,
}

/// Why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// A parameter is out of range.
    Invalid(Invalid),
    /// The command makes no sense in this state.
    WrongState {
        /// The state.
        state: State,
        /// What to do, in words.
        advice: &'static str,
    },
    /// This board cannot do it; why, in words.
    NotHere(&'static str),
}

impl From<Invalid> for Refusal {
    fn from(invalid: Invalid) -> Self {
        Self::Invalid(invalid)
    }
}

/// What a host should hear of without asking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A point is complete.
    Point(PointResult),
    /// The experiment is complete and the drive is silent.
    Finished {
        /// Points completed.
        points: u16,
    },
    /// An interlock ended the experiment.
    Fault(Fault),
}

/// A summary of the state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Status {
    /// What the rig is doing.
    pub state: State,
    /// Ticks since the last start.
    pub tick: u32,
    /// Points completed since the last start.
    pub points: u16,
    /// The latched fault.
    pub fault: Option<Fault>,
}

/// The rig.
#[derive(Clone, Debug)]
pub struct Rig {
    limits: Limits,
    plan: Option<SteppedSine>,
    runner: Option<Runner>,
    state: State,
    tick: u32,
    points: u16,
    results: Deque<PointResult, KEPT_RESULTS>,
    fault: Option<Fault>,
    finishing: bool,
    signals: [f32; SIGNALS.len()],
}

impl Default for Rig {
    fn default() -> Self {
        Self::new()
    }
}

impl Rig {
    /// An idle rig without an experiment.
    #[must_use]
    pub fn new() -> Self {
        Self {
            limits: Limits::default(),
            plan: None,
            runner: None,
            state: State::Idle,
            tick: 0,
            points: 0,
            results: Deque::new(),
            fault: None,
            finishing: false,
            signals: [0.0; SIGNALS.len()],
        }
    }

    /// The present state.
    #[must_use]
    pub fn status(&self) -> Status {
        Status { state: self.state, tick: self.tick, points: self.points, fault: self.fault }
    }

    /// The last tick's telemetry, in the order of [`SIGNALS`].
    #[must_use]
    pub fn signals(&self) -> &[f32; SIGNALS.len()] {
        &self.signals
    }

    /// A result of the present experiment by its place in the whole, while it is kept.
    #[must_use]
    pub fn result(&self, index: u16) -> Option<&PointResult> {
        self.results.iter().find(|result| result.index == index)
    }

    /// Refuses what may only be done while nothing moves.
    ///
    /// # Errors
    /// The rig is not idle: says which state it is in and what to do.
    pub fn must_be_idle(&self) -> Result<(), Refusal> {
        let state = self.state;
        match state {
            State::Idle => Ok(()),
            State::Faulted => Err(Refusal::WrongState { state, advice: "clear the fault first" }),
            _ => Err(Refusal::WrongState { state, advice: "stop the experiment first" }),
        }
    }

    /// Carries out a command.
    ///
    /// # Errors
    /// A parameter out of range, or a command that makes no sense now; the rig is as it was.
    pub fn handle(&mut self, command: Command) -> Result<(), Refusal> {
        match command {
            Command::SetLimits(limits) => {
                self.must_be_idle()?;
                limits.validate()?;
                self.limits = limits;
            }
            Command::Configure(plan) => {
                self.must_be_idle()?;
                plan.validate(TICK_HZ)?;
                self.plan = Some(plan);
            }
            Command::Start => {
                self.must_be_idle()?;
                let Some(plan) = self.plan.clone() else {
                    return Err(Refusal::WrongState { state: self.state, advice: "configure an experiment first" });
                };
                self.runner = Some(Runner::new(plan, TICK_HZ));
                self.state = State::Running(Stage::Rest);
                self.tick = 0;
                self.points = 0;
                self.results.clear();
                self.finishing = false;
            }
            Command::Stop => {
                if let Some(runner) = &mut self.runner {
                    runner.release_drive();
                    self.state = State::Stopping;
                }
            }
            Command::ClearFault => {
                if self.state == State::Faulted && self.runner.is_some() {
                    return Err(Refusal::WrongState { state: self.state, advice: "wait until the drive is silent" });
                }
                self.fault = None;
                if self.state == State::Faulted {
                    self.state = State::Idle;
                }
            }
        }
        Ok(())
    }

    /// One control tick. At most one event results.
    pub fn tick(&mut self, sensors: &Sensors) -> (Actuators, Option<Event>) {
        let tick = self.tick;
        let mut actuators = Actuators::default();
        let mut event = None;
        if self.fault.is_none()
            && let Some(fault) = self.limits.check(sensors, tick)
            && self.runner.is_some()
        {
            event = Some(self.trip(fault));
        }
        if let Some(runner) = &mut self.runner {
            actuators.drive_enabled = true;
            if let State::Running(_) = self.state {
                let (drive, outcome) = runner.tick(sensors, tick);
                actuators.drive_m = drive;
                actuators.put_plant_back = runner.wants_plant_put_back();
                self.state = State::Running(runner.stage());
                event = self.record(outcome);
            } else {
                actuators.drive_m = runner.fade();
                if runner.is_silent() {
                    self.runner = None;
                    actuators.drive_enabled = false;
                    event = event.or_else(|| self.come_to_rest());
                }
            }
        }
        let frequency = self.runner.as_ref().map_or(0.0, Runner::frequency_hz);
        self.signals = [sensors.mean_x_m(), sensors.mean_z_m(), actuators.drive_m, frequency];
        self.tick = self.tick.wrapping_add(1);
        (actuators, event)
    }

    fn trip(&mut self, fault: Fault) -> Event {
        self.fault = Some(fault);
        self.state = State::Faulted;
        if let Some(runner) = &mut self.runner {
            runner.release_drive();
        }
        Event::Fault(fault)
    }

    fn record(&mut self, outcome: Outcome) -> Option<Event> {
        match outcome {
            Outcome::Running => None,
            Outcome::Failed(fault) => Some(self.trip(fault)),
            Outcome::Point(result) | Outcome::Finished(result) => {
                self.points += 1;
                if self.results.is_full() {
                    self.results.pop_front();
                }
                // Cannot fail: room was made above.
                let _ = self.results.push_back(result);
                if matches!(outcome, Outcome::Finished(_)) {
                    self.finishing = true;
                    self.state = State::Stopping;
                }
                Some(Event::Point(result))
            }
        }
    }

    /// The drive has become silent: back to idle, unless a fault is latched.
    fn come_to_rest(&mut self) -> Option<Event> {
        if self.state == State::Faulted {
            return None;
        }
        self.state = State::Idle;
        core::mem::take(&mut self.finishing).then_some(Event::Finished { points: self.points })
    }
}
