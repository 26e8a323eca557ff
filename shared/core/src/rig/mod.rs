//! The rig's one decision maker: samples and commands in, actuator values, replies and events out.
//!
//! Plain synchronous functions; time is the tick. On the board a high-priority task calls [`Rig::tick`] at
//! [`TICK_HZ`]; the virtual rig calls it as fast as it can. The interlocks come first in a tick, so that the spring and the drive
//! do in it what they allow. [`channels`] names the sensors, [`sensors`] holds what goes in and comes out, [`words`] the
//! commands, [`signals`] the telemetry, [`damper`] the dampers' part of a tick. What carries commands and results to
//! a host is in `damprig-protocol`.

pub mod calibration;
pub mod channels;
pub mod damper;
pub mod sensors;
pub mod signals;
pub mod words;

use crate::control::drive::DriveRange;
use crate::control::experiment::{Driving, Experiment, Now, Outcome, Runner, Stage};
use crate::control::friction_spring::{SpringCommand, Stage as SpringStage};
use crate::control::limits::Fault;
use crate::control::safety::{Danger, SafeStage, Safety, Signs, Trip};
use crate::control::transient::playback::RecordId;
use crate::measure::point::PointResult;
use crate::measure::snippet::Snippet;
use crate::measure::transient::TransientResult;
use crate::settings::Prepared;
use crate::twin::Twin;
use calibration::DriveScale;
use channels::Sensor;
use damper::Dampers;
use heapless::Deque;
pub use sensors::{Actuators, CountedBlock, Reading, Readings, SUBSAMPLES, Sensors, TICK_HZ, WALL_SUBSAMPLES};
pub use signals::{MOTION_SIGNALS, SIGNALS, Signals};
pub use words::{Brake, Command, Event, Refusal, State, Status};

/// Results that the rig keeps for a host that missed one.
pub const KEPT_RESULTS: usize = 8;

/// Ticks that an order waits for one that is free, at most: longer than most contacts take.
pub const LONGEST_WAIT: u8 = 32;

/// The rig.
#[derive(Clone, Debug)]
pub struct Rig {
    experiment: Option<Experiment>,
    runner: Option<Runner>,
    safety: Safety,
    dampers: Dampers,
    state: State,
    tick: u32,
    points: u16,
    results: Deque<PointResult, KEPT_RESULTS>,
    transient: Option<TransientResult>,
    fault: Option<Fault>,
    finishing: bool,
    host_heard: bool,
    drive: DriveRange,
    /// In the last tick.
    emergency_stop: bool,
    brake: Brake,
    /// An order waits for a tick that has time for it; since how many ticks.
    order_waits: Option<u8>,
    has_time: bool,
    waiting: Option<Event>,
    signals: Signals,
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
            experiment: None,
            runner: None,
            safety: Safety::default(),
            dampers: Dampers::default(),
            state: State::Idle,
            tick: 0,
            points: 0,
            results: Deque::new(),
            transient: None,
            fault: None,
            finishing: false,
            host_heard: false,
            drive: DriveScale::default().range(),
            emergency_stop: false,
            brake: Brake::Open,
            order_waits: None,
            has_time: false,
            waiting: None,
            signals: [0.0; SIGNALS.len()],
        }
    }

    /// The present state.
    #[must_use]
    pub fn status(&self) -> Status {
        Status {
            state: self.state,
            tick: self.tick,
            points: self.points,
            fault: self.fault,
            safe: self.safety.stage(),
            sensors: self.safety.sensors(),
            brake: self.brake,
            spring: self.dampers.spring.status(),
            events_lost: self.dampers.lost(),
        }
    }

    /// What the rig is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.state
    }

    /// The tick that comes next, counted from the last start.
    #[must_use]
    pub fn next_tick(&self) -> u32 {
        self.tick
    }

    /// The last tick's telemetry, in the order of [`SIGNALS`].
    #[must_use]
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// A result of the present experiment by its place in the whole, while it is kept.
    #[must_use]
    pub fn result(&self, index: u16) -> Option<&PointResult> {
        self.results.iter().find(|result| result.index == index)
    }

    /// The result of the last record or free vibration since the last start.
    #[must_use]
    pub fn transient(&self) -> Option<&TransientResult> {
        self.transient.as_ref()
    }

    /// The record that the configured experiment plays.
    #[must_use]
    pub fn wanted_record(&self) -> Option<RecordId> {
        self.experiment.as_ref().and_then(Experiment::record)
    }

    /// The recorder of an impact's shape, and what its counts mean.
    #[must_use]
    pub fn snippet(&self) -> (&Snippet, &crate::measure::impacts::ForceScale) {
        (self.dampers.meter.snippet(), self.dampers.meter.scale())
    }

    /// Something was heard of the host.
    pub fn hear_host(&mut self) {
        self.host_heard = true;
    }

    /// An order waits to be served after a tick that leaves time for it.
    pub fn expect_order(&mut self) {
        self.order_waits.get_or_insert(0);
    }

    /// It has been served, or waits no longer.
    pub fn forget_order(&mut self) {
        self.order_waits = None;
    }

    /// Whether the last tick has left time to serve the order that was expected. After [`LONGEST_WAIT`] ticks it is said to
    /// have.
    #[must_use]
    pub fn has_time(&self) -> bool {
        self.has_time
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

    /// Carries out a command. An experiment is taken out of it, which is cheaper than copying it; a twin is copied, which is cheaper
    /// than moving it about.
    ///
    /// # Errors
    /// A parameter out of range, or a command that makes no sense now; rig and command are as they were.
    #[inline(never)]
    pub fn handle(&mut self, command: &mut Command) -> Result<(), Refusal> {
        match command {
            Command::SetSafety(safety) => {
                // What latched a fault may be a limit that was set wrong.
                if self.state != State::Faulted || self.runner.is_some() {
                    self.must_be_idle()?;
                }
                self.safety.adopt(safety);
            }
            Command::SetSpring(spring) => {
                self.must_be_idle()?;
                self.dampers.spring = *spring;
            }
            Command::SetImpacts(settings) => {
                self.must_be_idle()?;
                // The scale is the board's.
                let settings = settings.on(self.dampers.meter.scale());
                self.dampers.meter.adopt(&settings);
            }
            Command::SetTwin(twin) => {
                self.must_be_idle()?;
                self.dampers.twin = twin.as_ref().map(Twin::of);
            }
            Command::Configure(experiment) => {
                self.must_be_idle()?;
                if let Some(experiment) = experiment.as_ref() {
                    self.check_drive(experiment, None)?;
                }
                self.experiment = experiment.take();
            }
            Command::Start => self.start()?,
            Command::Stop => {
                if let Some(runner) = &mut self.runner {
                    runner.release_drive();
                    if self.state != State::Faulted {
                        self.state = State::Stopping;
                    }
                }
            }
            Command::ClearFault => self.clear_fault()?,
            Command::Spring(command) => self.ask_spring(*command)?,
            Command::ArmSnippet => self.dampers.meter.arm_snippet(),
        }
        Ok(())
    }

    /// Whether the drive can deliver what an experiment asks of it; `record_peak_counts` is the largest |sample| of the record
    /// that it plays, where that is there.
    ///
    /// # Errors
    /// It asks for more.
    pub fn check_drive(&self, experiment: &Experiment, record_peak_counts: Option<u16>) -> Result<(), Refusal> {
        match experiment.largest_drive_m(record_peak_counts) {
            Some((parameter, amplitude_m)) => Ok(self.drive.allow(parameter, amplitude_m)?),
            None => Ok(()),
        }
    }

    /// Takes settings over: drive, interlocks, the friction damper's drive, which has to be homed again, and how impacts are
    /// found.
    ///
    /// # Errors
    /// As [`Rig::must_be_idle`].
    pub fn adopt(&mut self, prepared: &Prepared) -> Result<(), Refusal> {
        self.must_be_idle()?;
        self.drive = prepared.settings.calibration.drive.range();
        self.safety.adopt(&prepared.safety);
        self.dampers.spring = prepared.spring;
        self.dampers.meter.adopt(&prepared.impacts);
        Ok(())
    }

    /// Whether the configured experiment could begin now; `record_peak_counts` is the largest |sample| of the record that is
    /// there.
    ///
    /// # Errors
    /// As [`Rig::handle`] of a start.
    pub fn could_start(&self, record_peak_counts: Option<u16>) -> Result<(), Refusal> {
        self.must_be_idle()?;
        let Some(experiment) = &self.experiment else {
            return Err(Refusal::WrongState { state: self.state, advice: "configure an experiment first" });
        };
        // The settings may have changed since it was configured.
        self.check_drive(experiment, record_peak_counts)?;
        match self.dampers.spring.stage() {
            SpringStage::Faulted => {
                Err(Refusal::WrongStage { stage: SpringStage::Faulted, advice: "clear the spring's fault first" })
            }
            stage @ (SpringStage::Homing | SpringStage::TouchingOff | SpringStage::Releasing) => {
                Err(Refusal::WrongStage { stage, advice: "wait until it is done, or halt" })
            }
            _ => Ok(()),
        }
    }

    #[inline(never)]
    fn start(&mut self) -> Result<(), Refusal> {
        self.could_start(None)?;
        self.runner = self.experiment.as_ref().map(|experiment| Runner::new(experiment, &self.drive));
        self.state = State::Running(Stage::Rest);
        self.tick = 0;
        self.points = 0;
        self.results.clear();
        self.transient = None;
        self.finishing = false;
        self.safety.restart();
        self.dampers.restart();
        Ok(())
    }

    fn clear_fault(&mut self) -> Result<(), Refusal> {
        let state = self.state;
        self.safety.clear().map_err(|not_safe| Refusal::WrongState { state, advice: not_safe.advice })?;
        self.fault = None;
        if self.state == State::Faulted {
            self.state = State::Idle;
            self.brake = Brake::Open;
            self.dampers.let_go();
        }
        Ok(())
    }

    #[inline(never)]
    fn ask_spring(&mut self, command: SpringCommand) -> Result<(), Refusal> {
        let searches = matches!(command, SpringCommand::Home | SpringCommand::TouchOff);
        let moves = searches || matches!(command, SpringCommand::Set(_));
        let state = self.state;
        if self.emergency_stop && (moves || command == SpringCommand::Release) {
            return Err(Refusal::WrongState { state, advice: "release the emergency stop first" });
        }
        if self.brake != Brake::Open && matches!(command, SpringCommand::Release | SpringCommand::Halt) {
            return Err(Refusal::WrongState { state, advice: "the brake closes: clear the fault first" });
        }
        match self.state {
            State::Running(_) | State::Stopping if searches => self.must_be_idle()?,
            State::Faulted if moves => self.must_be_idle()?,
            _ => {}
        }
        Ok(self.dampers.spring.handle(command)?)
    }

    /// One control tick; `record` is lent to it for a playback. At most one event results. Not inlined: what
    /// calls it is built for size.
    #[inline(never)]
    pub fn tick(&mut self, sensors: &Sensors, record: &[i16]) -> (Actuators, Option<Event>) {
        let tick = self.tick;
        let readings = sensors.readings;
        let frequency_hz = self.runner.as_ref().map_or(0.0, Runner::frequency_hz);
        let pulses = self.dampers.measure(tick, sensors, &readings, frequency_hz);
        let signs = self.signs(sensors);
        let (allowed, trip) = self.safety.tick(&readings, &signs);
        let mut event = None;
        if let Some(Trip { danger: cause, value, limit }) = trip {
            event = Some(self.trip(Fault { cause, tick, value, limit }));
        }
        self.brake = self.dampers.brake(allowed.brake_n);
        let force_sensor = self.safety.verdict(Sensor::SpringForce);
        let (motor, spring_fault) = self.dampers.tick_spring(sensors, force_sensor, pulses);
        if let Some((cause, value, limit)) = spring_fault
            && self.runner.is_some()
            && self.safety.latch(Trip { danger: Danger::Spring(cause), value, limit })
        {
            event = Some(self.trip(Fault { cause: Danger::Spring(cause), tick, value, limit }));
        }
        let mut actuators = Actuators { motor, ..Actuators::default() };
        let clipped = self.safety.clipped_now();
        let now = Now { tick, readings: &readings, impacts: self.dampers.impacts(), clipped };
        let mut outcome = Outcome::Running;
        if let (Some(runner), Some(experiment)) = (&mut self.runner, &self.experiment) {
            let drive = if let State::Running(_) = self.state {
                let drive = runner.tick(experiment, record, &now, &mut outcome);
                actuators.put_plant_back = runner.wants_plant_put_back();
                self.state = State::Running(runner.stage());
                drive
            } else {
                runner.fade(experiment, record, &mut outcome)
            };
            actuators.drive_enabled = allowed.relay;
            actuators.drive_m = drive * allowed.drive;
            if runner.cycle_ended() {
                self.dampers.end_cycle();
            }
            let is_over = !matches!(self.state, State::Running(_)) && runner.is_silent();
            if is_over || !allowed.relay {
                self.runner = None;
                actuators.drive_enabled = false;
                if event.is_none() {
                    event = self.come_to_rest();
                }
            }
        }
        if actuators.put_plant_back.is_some() {
            self.dampers.put_back(tick);
        }
        // One dear thing a tick: news, an order and the twin wait for one without, in this order.
        let evaluates = self.runner.as_ref().is_some_and(|runner| runner.is_evaluating() || runner.cycle_ended())
            || !matches!(outcome, Outcome::Running);
        let tells = self.waiting.is_some() || self.dampers.is_to_tell(pulses);
        let is_free = !pulses && !evaluates && !tells && event.is_none() && !self.dampers.spring.has_decided();
        self.has_time = self.leave_time(is_free);
        self.dampers.follow(is_free && !self.has_time);
        if !matches!(outcome, Outcome::Running)
            && let Some(recorded) = self.record(outcome)
        {
            self.waiting = event.replace(recorded);
        }
        // Events are large: looked at before they are moved about.
        if event.is_none() && self.waiting.is_some() {
            event = self.waiting.take();
        } else if event.is_none() && tells {
            event = self.dampers.pop();
        }
        self.fill_signals(&readings, &actuators, frequency_hz);
        self.tick = self.tick.wrapping_add(1);
        (actuators, event)
    }

    /// Whether there is an order to serve after this tick: one has come, and the tick is free, or it has waited for long. A
    /// twin that orders keep from its work goes first.
    fn leave_time(&mut self, is_free: bool) -> bool {
        let Some(waited) = &mut self.order_waits else { return false };
        *waited += 1;
        let serves = is_free && !self.dampers.twin_lags() || *waited >= LONGEST_WAIT;
        if serves {
            self.order_waits = None;
        }
        serves
    }

    fn signs(&mut self, sensors: &Sensors) -> Signs {
        let meter = &self.dampers.meter;
        let wall_rails = meter.rails();
        // What is at a rail is no force.
        let force_n = |wall: usize| if wall_rails[wall].is_all() { 0.0 } else { meter.highest_n()[wall] };
        let (low, high) = (force_n(0), force_n(1));
        self.emergency_stop = sensors.emergency_stop;
        let drive = self.runner.as_ref().map_or(Driving::default(), Runner::driving);
        Signs {
            driving: drive.on,
            swinging: drive.swinging,
            running: self.runner.is_some(),
            wall_rails,
            wall_drift: meter.drift_n(),
            wall_force_n: if low > high { low } else { high },
            saturated: drive.saturated,
            emergency_stop: sensors.emergency_stop,
            host_heard: core::mem::take(&mut self.host_heard),
        }
    }

    /// The cause is latched already: the drive is let go.
    #[inline(never)]
    fn trip(&mut self, fault: Fault) -> Event {
        self.fault = Some(fault);
        self.state = State::Faulted;
        if let Some(runner) = &mut self.runner {
            runner.release_drive();
        }
        Event::Fault(fault)
    }

    #[inline(never)]
    fn record(&mut self, outcome: Outcome) -> Option<Event> {
        match outcome {
            Outcome::Running => None,
            Outcome::Failed(fault) => {
                let Fault { cause: danger, value, limit, .. } = fault;
                self.safety.latch(Trip { danger, value, limit }).then(|| self.trip(fault))
            }
            Outcome::Point(result) | Outcome::Finished(result) => {
                self.points += 1;
                if self.results.is_full() {
                    self.results.pop_front();
                }
                // Cannot fail: room was made above.
                let _ = self.results.push_back(result);
                if matches!(outcome, Outcome::Finished(_)) {
                    self.finish();
                }
                Some(Event::Point(result))
            }
            Outcome::Transient(result) => {
                self.points += 1;
                self.transient = Some(result);
                self.finish();
                Some(Event::Transient(result))
            }
        }
    }

    /// Everything is measured: the drive may fade.
    fn finish(&mut self) {
        self.finishing = true;
        if self.state != State::Faulted {
            self.state = State::Stopping;
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

    fn fill_signals(&mut self, readings: &Readings, actuators: &Actuators, frequency_hz: f32) {
        let dampers = &self.dampers;
        let spring = &dampers.spring;
        let twin = dampers.twin_signals();
        let [low, high] = dampers.meter.highest_n();
        let number = |flag: bool| if flag { 1.0 } else { 0.0 };
        self.signals = [
            readings.x.mean_m,
            readings.z.mean_m,
            actuators.drive_m,
            frequency_hz,
            readings.x.peak_m,
            dampers.base_amplitude_m.unwrap_or(0.0),
            readings.spring_n - spring.bias_n(),
            spring.position_now_m(),
            spring.target_force_n(),
            f32::from(spring.stage() as u8),
            low,
            high,
            dampers.impacts() as f32,
            dampers.impacts_in_cycle as f32,
            twin.x_m,
            twin.residual_rms_m,
            twin.predicted as f32,
            twin.detected as f32,
            twin.missing as f32,
            number(twin.alarm),
            f32::from(self.safety.stage() as u8),
        ];
    }

    /// How far the way to the safe state has been gone.
    #[must_use]
    pub fn safe_stage(&self) -> SafeStage {
        self.safety.stage()
    }
}
