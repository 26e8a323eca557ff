//! The rig's state machine: takes samples and commands, returns actuator values, replies and events.
//!
//! All functions are synchronous; time is the tick. On the board a high-priority task calls [`Rig::tick`] at
//! [`crate::io::TICK_HZ`]; the virtual rig calls it as fast as it can. In a tick the interlocks follow the
//! measurement of impacts and base; the spring and the drive come after them and obey them in the same tick.
//! [`crate::io`] has the input and output types, [`command`] the commands, `handle` carries them out; `activity` has
//! the states, [`signals`] the telemetry, [`damper`] the dampers' part of a tick. `damprig-protocol` carries commands
//! and results to and from a host.

mod activity;
pub mod command;
pub mod damper;
mod event_queue;
mod handle;
mod rejected;
pub mod signals;

use crate::control::experiment::{Driving, Experiment, ExperimentRunner};
use crate::control::fault::Fault;
use crate::control::friction_spring::SpringEvent;
use crate::control::outcome::{Outcome, StageProgress, TickInputs};
use crate::control::safety::{Allowed, ExperimentLimits, Safety, Signs};
use crate::control::transient::playback::RecordId;
use crate::io::{Actuators, DriveRange, DriveScale, Motor, Readings, Sensor, Sensors};
use crate::measure::point::PointResult;
use crate::measure::snippet::Snippet;
use crate::measure::transient::TransientResult;
use crate::settings::Settings;
use activity::{Activity, ActivityPhase};
pub use command::{Brake, Command, Event, RigState, Status};
use damper::Dampers;
use event_queue::EventQueue;
use heapless::Deque;
pub use rejected::{Rejected, clipped};
pub use signals::{MOTION_SIGNALS, SIGNAL_DOCS, SIGNALS, Signals};

/// Number of results that the rig keeps for a host that missed one.
pub const KEPT_RESULTS: usize = 8;

/// The rig.
#[derive(Clone, Debug)]
pub struct Rig {
    /// Settings of the board. They are in force unless the experiment tightens limits or describes its spring.
    settings: Settings,
    /// The configured experiment and its limits.
    experiment: Option<Experiment>,
    limits: ExperimentLimits,
    activity: Activity,
    safety: Safety,
    dampers: Dampers,
    tick: u32,
    points: u16,
    results: Deque<PointResult, KEPT_RESULTS>,
    transient: Option<TransientResult>,
    /// Largest |demanded base displacement| since the start, m.
    largest_drive_m: f32,
    begins_from_rest: Option<u16>,
    host_heard: bool,
    drive: DriveRange,
    /// The emergency stop was pressed in the last tick.
    emergency_stop: bool,
    brake: Brake,
    events: EventQueue,
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
            settings: Settings::default(),
            experiment: None,
            limits: ExperimentLimits::default(),
            activity: Activity::Idle,
            safety: Safety::default(),
            dampers: Dampers::default(),
            tick: 0,
            points: 0,
            results: Deque::new(),
            transient: None,
            largest_drive_m: 0.0,
            begins_from_rest: None,
            host_heard: false,
            drive: DriveScale::default().range(),
            emergency_stop: false,
            brake: Brake::Open,
            events: EventQueue::default(),
            signals: Signals::default(),
        }
    }

    /// Settings of the board.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Present status of the rig.
    #[must_use]
    pub fn status(&self) -> Status {
        Status {
            state: self.state(),
            tick: self.tick,
            points: self.points,
            held: self.activity.runner().is_some_and(ExperimentRunner::is_held),
            fault: self.activity.fault(),
            safe: self.safety.stage(),
            sensors: self.safety.sensors(),
            brake: self.brake,
            spring: self.dampers.spring.status(),
            events_lost: self.events.lost(),
        }
    }

    /// State of the rig.
    #[must_use]
    pub fn state(&self) -> RigState {
        self.activity.state()
    }

    /// Index of the point that began to wait for rest in the last tick, or whose structure was to be held in it. A real
    /// structure comes to rest, or is held by a person; a simulated plant is reset to the point's start.
    #[must_use]
    pub fn begins_from_rest(&self) -> Option<u16> {
        self.begins_from_rest
    }

    /// Number of the next tick, counted from the last start.
    #[must_use]
    pub fn next_tick(&self) -> u32 {
        self.tick
    }

    /// Telemetry of the last tick.
    #[must_use]
    pub fn signals(&self) -> &Signals {
        &self.signals
    }

    /// A result of the present experiment by its index in the whole experiment, if it is still kept.
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

    /// The recorder of an impact's shape, and the scale of its counts.
    #[must_use]
    pub fn snippet(&self) -> (&Snippet, &crate::io::ForceScale) {
        (self.dampers.meter.snippet(), self.dampers.meter.scale())
    }

    /// Notes that a message from the host was received.
    pub fn hear_host(&mut self) {
        self.host_heard = true;
    }

    /// The events in the queue.
    pub fn events(&self) -> impl Iterator<Item = &Event> {
        self.events.iter()
    }

    /// Takes the oldest event. Call it after every tick until it returns `None`: the queue holds one tick's events. An
    /// event that finds no room is dropped and counted in [`Status::events_lost`].
    pub fn pop_event(&mut self) -> Option<Event> {
        self.events.pop()
    }

    /// Runs one control tick; `record` is the record for a playback. [`Rig::pop_event`] returns the events of the tick.
    pub fn tick(&mut self, sensors: &Sensors, record: &[i16]) -> Actuators {
        let (tick, readings) = (self.tick, sensors.readings);
        let frequency_hz = self.activity.runner().map_or(0.0, ExperimentRunner::frequency_hz);
        self.dampers.measure(tick, sensors, frequency_hz, &mut self.events);
        let allowed = self.check_interlocks(sensors, frequency_hz);
        self.brake = self.dampers.brake(allowed.brake_n);
        let motor = self.run_spring(sensors);
        let mut actuators = Actuators { motor, ..Actuators::default() };
        self.run_experiment(&readings, record, &allowed, &mut actuators);
        self.dampers.update_twin(tick, &readings);
        let reference = self.activity.runner().and_then(ExperimentRunner::reference);
        self.dampers.update_motion(&readings, reference);
        if self.begins_from_rest.is_some() {
            self.dampers.put_back(tick);
        }
        self.fill_signals(&readings, &actuators, frequency_hz);
        self.tick = tick.wrapping_add(1);
        actuators
    }

    fn check_interlocks(&mut self, sensors: &Sensors, frequency_hz: f32) -> Allowed {
        let signs = self.signs(sensors, frequency_hz);
        let (allowed, fault) = self.safety.tick(&sensors.readings, &signs);
        if let Some(fault) = fault {
            self.trip(fault);
        }
        allowed
    }

    /// Runs the friction spring's tick. A fault of the spring ends an experiment.
    fn run_spring(&mut self, sensors: &Sensors) -> Motor {
        let force_sensor = self.safety.verdict(Sensor::SpringForce);
        let (motor, event) = self.dampers.tick_spring(self.tick, sensors, force_sensor);
        if let Some(event) = event {
            self.events.push(Event::Spring(event));
        }
        if let Some(SpringEvent::Fault(fault)) = event
            && self.activity.runner().is_some()
        {
            self.latch(fault);
        }
        motor
    }

    /// Runs the experiment's tick: the drive, within what the interlocks permit.
    fn run_experiment(&mut self, readings: &Readings, record: &[i16], allowed: &Allowed, actuators: &mut Actuators) {
        self.begins_from_rest = None;
        let (impacts, clipped) = (self.dampers.impacts(), self.safety.clipped_now());
        let now = TickInputs { tick: self.tick, readings, impacts, clipped };
        let Activity::Experiment { runner, phase } = &mut self.activity else { return };
        let (drive_m, outcome) = if let ActivityPhase::Running = phase {
            let driven = runner.tick(record, &now);
            self.begins_from_rest = runner.begins_from_rest();
            driven
        } else {
            (runner.fade(record), Outcome::Running)
        };
        actuators.drive_enabled = allowed.relay;
        actuators.drive_m = drive_m * allowed.drive;
        self.largest_drive_m = self.largest_drive_m.max(libm::fabsf(actuators.drive_m));
        if runner.cycle_ended() {
            self.dampers.end_cycle();
        }
        let is_silent = runner.is_silent();
        self.record(outcome);
        if !matches!(self.state(), RigState::Running(_)) && is_silent || !allowed.relay {
            actuators.drive_enabled = false;
            self.end_drive();
        }
    }

    fn signs(&mut self, sensors: &Sensors, frequency_hz: f32) -> Signs {
        let meter = &self.dampers.meter;
        let wall_rails = meter.rails();
        // A reading at a rail is not a force.
        let force_n = |wall: usize| if wall_rails[wall].is_all() { 0.0 } else { meter.highest_n()[wall] };
        let (low, high) = (force_n(0), force_n(1));
        self.emergency_stop = sensors.emergency_stop;
        let drive = self.activity.runner().map_or(Driving::default(), ExperimentRunner::driving);
        Signs {
            tick: self.tick,
            driving: drive.on,
            swinging: drive.swinging,
            drive_m: drive.demanded_m.map_or(self.largest_drive_m, |now_m| now_m.min(self.largest_drive_m)),
            frequency_hz,
            running: self.activity.runner().is_some(),
            wall_rails,
            wall_drift: meter.drift_n(),
            wall_force_n: if low > high { low } else { high },
            saturated: drive.saturated,
            base_foreseen_m: drive.base_foreseen_m,
            emergency_stop: sensors.emergency_stop,
            host_heard: core::mem::take(&mut self.host_heard),
        }
    }

    /// Latches a fault that the experiment or the spring detected, unless a fault is already latched.
    fn latch(&mut self, fault: Fault) {
        if self.safety.latch(fault) {
            self.trip(fault);
        }
    }

    /// Reacts to a fault that is already latched: the drive is released. The interlocks' output of each tick determines
    /// whether the brake closes.
    fn trip(&mut self, fault: Fault) {
        self.activity.trip(fault);
        self.events.push(Event::Fault(fault));
    }

    /// Records the outcome of the experiment's tick.
    fn record(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Running => {}
            Outcome::Failed(fault) => self.latch(fault),
            Outcome::Point(result) | Outcome::Finished(result) => {
                self.points += 1;
                if self.results.is_full() {
                    self.results.pop_front();
                }
                // Cannot fail: room was made above.
                let _ = self.results.push_back(result);
                self.events.push(Event::Point(result));
                if matches!(outcome, Outcome::Finished(_)) {
                    self.activity.stop(true);
                }
            }
            Outcome::Transient(result) => {
                self.points += 1;
                self.transient = Some(result);
                self.events.push(Event::Transient(result));
                self.activity.stop(true);
            }
        }
    }

    /// The drive has faded out: the board's own settings are in force again, unless a fault is latched.
    fn end_drive(&mut self) {
        if let Some(fault) = self.activity.fault() {
            self.activity = Activity::Faulted(fault);
            return;
        }
        let is_complete =
            matches!(self.activity, Activity::Experiment { phase: ActivityPhase::Stopping { is_complete: true }, .. });
        self.activity = Activity::Idle;
        self.end_experiment();
        if is_complete {
            self.events.push(Event::Finished { points: self.points, rows_dropped: 0 });
        }
    }

    fn fill_signals(&mut self, readings: &Readings, actuators: &Actuators, frequency_hz: f32) {
        let dampers = &self.dampers;
        let spring = &dampers.spring;
        let twin = dampers.twin_signals();
        let [low, high] = dampers.meter.highest_n();
        let number = |flag: bool| if flag { 1.0 } else { 0.0 };
        let (stage, progress) = match (self.state(), self.activity.runner()) {
            (RigState::Running(stage), Some(runner)) => (1.0 + f32::from(stage as u8), runner.progress()),
            _ => (0.0, StageProgress::default()),
        };
        let motion = dampers.motion();
        self.signals = Signals {
            x: readings.x.mean_m,
            z: readings.z.mean_m,
            drive: actuators.drive_m,
            frequency: frequency_hz,
            x_peak: readings.x.peak_m,
            base_amplitude: dampers.base_amplitude_m.unwrap_or(0.0),
            spring_force: readings.spring_n - spring.bias_n(),
            spring_position: spring.position_now_m(),
            spring_target: spring.target_force_n(),
            spring_stage: f32::from(spring.stage() as u8),
            wall_low: low,
            wall_high: high,
            impacts: dampers.impacts() as f32,
            impacts_in_cycle: dampers.impacts_in_cycle as f32,
            twin_x: twin.x_m,
            twin_residual: twin.residual_rms_m,
            twin_predicted: twin.predicted as f32,
            twin_detected: twin.detected as f32,
            twin_missing: twin.missing as f32,
            twin_alarm: number(twin.alarm),
            safety: f32::from(self.safety.stage() as u8),
            x_amplitude: motion.x_amplitude_m,
            x_phase: motion.x_phase_rad,
            z_amplitude: motion.z_amplitude_m,
            z_phase: motion.z_phase_rad,
            x_over_z_lock_in: motion.x_over_z,
            x_velocity: dampers.x_velocity_m_per_s,
            particle_offset: twin.particle_offset_m,
            particle_velocity: twin.particle_velocity_m_per_s,
            stage,
            stage_left: progress.left_s,
            dwells: f32::from(progress.dwells),
        };
    }
}
