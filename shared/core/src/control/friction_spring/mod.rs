//! The friction damper's spring: homing, the zero reading, and targets held by force feedback.
//!
//! A stepper moves the seat of a spring whose other end presses a block against the structure: F_N = k_s Δs, with Δs
//! counted from where the force begins. The source document found that *zero reading* by eye; here the **touch-off**
//! does: the seat approaches until the force rises, then takes eight settled readings further up and puts a line
//! through them. The line's foot is the zero, its slope the measured k_s, its scatter the zero's stated error.
//! Every target then starts from the line and is corrected by what the force sensor says; a settled force off the line
//! is a fault, because a motor without an encoder has no other way to notice lost steps.
//!
//! A force whose sensor is at a rail is not judged, and the motor brakes to a standstill meanwhile. The emergency stop switches
//! the motor off in its tick; the position is then unknown, so the spring has to be homed again.
//!
//! Plain functions of one tick: [`Inputs`] in, [`Motor`] out. [`config`] holds the constants, [`ramp`] the motor's
//! motion, [`words`] what goes in and out. Pulses and pins are the board's; the rig's other interlocks are in
//! [`super::limits`]. Backlash has no model: the spring keeps the nut on one flank.

pub mod config;
mod homing;
mod line;
pub mod ramp;
mod touch_off;
pub mod words;

use crate::control::safety::rails::Verdict;
use crate::io::{Invalid, Motor, not_negative, require};
use config::nearest;
pub use config::{SpringConfig, SpringSetUp};
use ramp::{Ramp, RampLimits};
use touch_off::TouchOff;
pub use words::{
    Cause, Happening, Inputs, Refusal, SafePath, SpringCommand, SpringFault, SpringStatus, Stage, Target, Touch,
};

/// How long the structure must have been quiet before a step, s: more than a period down to 2 Hz.
const QUIET_HOLD_S: f32 = 0.5;

/// What the controller works at.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Task {
    /// Nothing.
    Stand,
    /// Towards the switch.
    SeekSwitch,
    /// Off the switch, slowly: the edge is the origin.
    LeaveSwitch,
    /// To where the block waits.
    BackOff,
    TouchOff(TouchOff),
    /// To a position, then to keep the target there.
    Move(i32),
    Settle(u32),
    Average(Mean),
    /// Away from the structure.
    Release,
}

/// A running mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    sum: f32,
    count: u32,
}

impl Mean {
    /// Takes a value; the mean once there are `count`.
    fn push(&mut self, value: f32, count: u32) -> Option<f32> {
        self.sum += value;
        self.count += 1;
        (self.count >= count).then(|| self.sum / self.count as f32)
    }
}

/// The constants in the units of the tick.
#[derive(Clone, Copy, Debug)]
struct Paces {
    fast: RampLimits,
    search: RampLimits,
    travel: i32,
    back_off: i32,
    settle: u32,
    average: u32,
    quiet: u32,
}

/// The controller.
#[derive(Clone, Copy, Debug)]
pub struct FrictionSpring {
    config: SpringConfig,
    paces: Paces,
    ramp: Ramp,
    task: Task,
    homed: bool,
    /// Force reading without contact, N.
    bias_n: f32,
    /// Lowest force reading of the present homing, N.
    lowest_n: f32,
    touch: Option<Touch>,
    target: Option<Target>,
    on_target: bool,
    braking: bool,
    saturated: bool,
    waiting: bool,
    /// A ratio waits for a measured Z.
    without_z: bool,
    target_force_n: f32,
    force_n: f32,
    quiet_ticks: u32,
    fault: Option<SpringFault>,
}

impl Default for FrictionSpring {
    /// At an unknown position, with the default constants.
    fn default() -> Self {
        Self::of(&SpringConfig::default())
    }
}

impl FrictionSpring {
    /// At an unknown position, with the motor off.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(config: &SpringConfig) -> Result<Self, Invalid> {
        config.validate()?;
        Ok(Self::of(config))
    }

    /// From checked constants.
    fn of(config: &SpringConfig) -> Self {
        let ramp_limits = |rate| RampLimits::new(rate, config.acceleration_hz_per_s);
        let paces = Paces {
            fast: ramp_limits(config.rate_hz),
            search: ramp_limits(config.search_rate_hz),
            travel: config.steps(config.travel_m),
            back_off: config.steps(config.back_off_m),
            settle: SpringConfig::ticks(config.settle_s),
            average: SpringConfig::ticks(config.average_s),
            quiet: SpringConfig::ticks(QUIET_HOLD_S),
        };
        Self {
            config: *config,
            paces,
            ramp: Ramp::default(),
            task: Task::Stand,
            homed: false,
            bias_n: 0.0,
            lowest_n: f32::INFINITY,
            touch: None,
            target: None,
            on_target: false,
            braking: false,
            saturated: false,
            waiting: false,
            without_z: false,
            target_force_n: 0.0,
            force_n: 0.0,
            quiet_ticks: 0,
            fault: None,
        }
    }

    /// The set-up is no longer the experiment's: its properties are the board's again. Position, task and zero reading stay.
    pub fn end_set_up(&mut self, board: &SpringConfig) {
        let SpringConfig { stiffness_n_per_m, friction_coefficient, structure_stiffness_n_per_m, .. } = *board;
        self.config =
            SpringConfig { stiffness_n_per_m, friction_coefficient, structure_stiffness_n_per_m, ..self.config };
    }

    /// The constants.
    #[must_use]
    pub fn config(&self) -> &SpringConfig {
        &self.config
    }

    /// What it is doing.
    #[must_use]
    pub fn stage(&self) -> Stage {
        match self.task {
            _ if self.fault.is_some() => Stage::Faulted,
            Task::SeekSwitch | Task::LeaveSwitch | Task::BackOff => Stage::Homing,
            Task::TouchOff(_) => Stage::TouchingOff,
            Task::Release => Stage::Releasing,
            Task::Move(_) | Task::Settle(_) | Task::Average(_) if !self.on_target => Stage::Setting,
            Task::Move(_) | Task::Settle(_) | Task::Average(_) => Stage::Holding,
            Task::Stand if !self.homed => Stage::Unhomed,
            Task::Stand if self.touch.is_none() => Stage::Homed,
            Task::Stand => Stage::Ready,
        }
    }

    /// Force reading without contact, N.
    #[must_use]
    pub fn bias_n(&self) -> f32 {
        self.bias_n
    }

    /// Seat position from the limit switch, m.
    #[must_use]
    pub fn position_now_m(&self) -> f32 {
        self.position_m(self.ramp.steps())
    }

    /// Force asked for at present, N; 0 without a target.
    #[must_use]
    pub fn target_force_n(&self) -> f32 {
        self.target_force_n
    }

    /// It presses as a brake.
    #[must_use]
    pub fn is_braking(&self) -> bool {
        self.braking
    }

    /// A summary.
    #[must_use]
    pub fn status(&self) -> SpringStatus {
        SpringStatus {
            stage: self.stage(),
            position_m: self.position_m(self.ramp.steps()),
            force_n: self.force_n,
            target_force_n: self.target_force_n,
            saturated: self.saturated,
            waiting: self.waiting || self.without_z,
            touch: self.touch,
            fault: self.fault,
        }
    }

    fn position_m(&self, steps: i32) -> f32 {
        steps as f32 * self.config.step_m
    }

    /// Carries out a command.
    ///
    /// # Errors
    /// A target out of range, or a command that makes no sense at this stage; the controller is as it was.
    pub fn handle(&mut self, command: SpringCommand) -> Result<(), Refusal> {
        let stage = self.stage();
        let refuse = |advice| Err(Refusal::WrongStage { stage, advice });
        match (command, stage) {
            (SpringCommand::ClearFault, Stage::Faulted) => {
                if self.task != Task::Stand {
                    return refuse("wait until the block has moved away");
                }
                self.fault = None;
            }
            (SpringCommand::ClearFault, _) => {}
            (_, Stage::Faulted) => return refuse("clear the spring's fault first"),
            (SpringCommand::Halt, _) => self.stand(),
            (_, Stage::Homing | Stage::TouchingOff | Stage::Releasing) => {
                return refuse("wait until it is done, or halt");
            }
            (SpringCommand::Home, _) => {
                self.homed = false;
                self.touch = None;
                self.stand();
                self.ramp.declare(0);
                self.lowest_n = f32::INFINITY;
                self.task = Task::SeekSwitch;
            }
            (_, Stage::Unhomed) => return refuse("home the spring first"),
            (SpringCommand::Release, _) => {
                self.stand();
                self.task = Task::Release;
            }
            (SpringCommand::TouchOff, Stage::Setting | Stage::Holding) => return refuse("release the spring first"),
            (SpringCommand::TouchOff, _) => {
                self.touch = None;
                self.task = Task::TouchOff(TouchOff::new());
            }
            (SpringCommand::Set(_), Stage::Homed) => return refuse("find the zero reading first (touch off)"),
            (SpringCommand::Set(target), _) => {
                let position = self.check(target)?;
                self.begin(target, position);
            }
        }
        Ok(())
    }

    /// The friction damper as a brake: presses with `force_n` (within the working force) at once, also while the
    /// structure moves. False, and nothing happens, without a zero reading or with a fault.
    pub fn brake(&mut self, force_n: f32) -> bool {
        let Some(touch) = self.touch.filter(|_| self.fault.is_none() && force_n >= 0.0) else { return false };
        if !matches!(self.stage(), Stage::Ready | Stage::Setting | Stage::Holding | Stage::Releasing) {
            return false;
        }
        let force_n = force_n.min(self.config.working_force_n());
        let position = self.config.steps(touch.zero_m + force_n / touch.stiffness_n_per_m).min(self.paces.travel);
        self.begin(Target::Force { force_n }, position);
        self.braking = true;
        true
    }

    /// Refuses a target that cannot be; returns the position to start from, steps.
    fn check(&self, target: Target) -> Result<i32, Refusal> {
        let stage = self.stage();
        let Some(touch) = self.touch else {
            return Err(Refusal::WrongStage { stage, advice: "find the zero reading first (touch off)" });
        };
        let (name, value, deflection_m) = match target {
            Target::Deflection { deflection_m } => ("deflection_m", deflection_m, deflection_m),
            Target::Force { force_n } => ("force_n", force_n, force_n / touch.stiffness_n_per_m),
            // Its force is limited when Z is known.
            Target::FrictionRatio { ratio } => ("friction_ratio", ratio, 0.0),
        };
        let value = f64::from(value);
        not_negative(name, value)?;
        let force_n = deflection_m * touch.stiffness_n_per_m;
        let allowed = "small enough for 0.9 of spring.largest_force_n";
        require(force_n <= self.config.working_force_n(), name, value, allowed)?;
        let end_m = touch.zero_m + deflection_m;
        require(end_m <= self.config.travel_m, name, value, "small enough to stay within spring.travel_m")?;
        match target {
            // From where it stands: the first average says how far to go.
            Target::FrictionRatio { .. } => Ok(self.ramp.steps().max(self.config.steps(touch.zero_m))),
            _ => Ok(self.config.steps(end_m)),
        }
    }

    fn begin(&mut self, target: Target, position: i32) {
        self.target = Some(target);
        self.on_target = false;
        self.braking = false;
        self.saturated = false;
        self.without_z = false;
        self.target_force_n = match target {
            Target::Force { force_n } => force_n,
            Target::Deflection { deflection_m } => {
                deflection_m * self.touch.map_or(0.0, |touch| touch.stiffness_n_per_m)
            }
            Target::FrictionRatio { .. } => 0.0,
        };
        self.task = Task::Move(position);
    }

    /// No target, no motion: the ramp brakes.
    fn stand(&mut self) {
        self.task = Task::Stand;
        self.target = None;
        self.on_target = false;
        self.braking = false;
        self.saturated = false;
        self.without_z = false;
        self.target_force_n = 0.0;
    }

    /// Switches the motor off at once. Where it stands is then unknown.
    fn de_energise(&mut self) {
        self.stand();
        self.ramp.halt();
        self.homed = false;
        self.touch = None;
        self.waiting = false;
    }

    /// One tick. At most one happening results.
    pub fn tick(&mut self, inputs: &Inputs) -> (Motor, Option<Happening>) {
        if inputs.emergency_stop {
            self.de_energise();
            return (Motor::default(), None);
        }
        let force_n = inputs.force_n - self.bias_n;
        let found = if self.fault.is_none() { self.watch(inputs, force_n) } else { None };
        let (steps, happening) = match found {
            Some(fault) => (0, Some(self.trip(fault))),
            None if inputs.force_sensor == Verdict::AtRail && self.fault.is_none() => {
                (self.ramp.tick(&self.paces.fast, None), None)
            }
            None => self.work(inputs, force_n),
        };
        // A screw of this pitch holds itself: the motor need not be on where the position is unknown or done with.
        let enabled = self.task != Task::Stand || !self.ramp.is_still() || (self.homed && self.fault.is_none());
        (Motor { steps, enabled }, happening)
    }

    /// What must not be, whatever the task.
    fn watch(&mut self, inputs: &Inputs, force_n: f32) -> Option<SpringFault> {
        let moving = inputs.x_peak_m >= self.config.quiet_m || inputs.x_peak_m.is_nan();
        self.quiet_ticks = if moving { 0 } else { self.quiet_ticks.saturating_add(1) };
        let fault = |cause, value, limit| Some(SpringFault { cause, value, limit });
        // While nothing has been asked of it yet, a sensor that is not plugged in is nobody's business.
        if self.task == Task::Stand && !self.homed {
            return None;
        }
        match inputs.force_sensor {
            Verdict::Reads if inputs.force_n.is_nan() => return fault(Cause::SensorLost, inputs.force_n, 0.0),
            Verdict::Reads => {}
            // What it reads is no force: wait for what it comes to.
            Verdict::AtRail => return None,
            Verdict::Lost { reading, edge } => return fault(Cause::SensorLost, reading, edge),
        }
        if force_n >= self.config.largest_force_n {
            return fault(Cause::ForceAboveLargest, force_n, self.config.largest_force_n);
        }
        let tolerance_n = self.config.follow_tolerance_n;
        if self.task == Task::SeekSwitch {
            self.lowest_n = self.lowest_n.min(inputs.force_n);
            if inputs.force_n - self.lowest_n > tolerance_n {
                return fault(Cause::WrongDirection, inputs.force_n - self.lowest_n, tolerance_n);
            }
        }
        let has_bias = match &self.task {
            Task::TouchOff(touch_off) => touch_off.has_bias(),
            _ => self.touch.is_some(),
        };
        if has_bias && force_n < -tolerance_n {
            return fault(Cause::WrongSign, force_n, -tolerance_n);
        }
        let homing = matches!(self.task, Task::SeekSwitch | Task::LeaveSwitch | Task::BackOff);
        if inputs.at_switch && self.homed && !homing {
            return fault(Cause::LimitReached, self.position_m(self.ramp.steps()), 0.0);
        }
        None
    }

    fn trip(&mut self, fault: SpringFault) -> Happening {
        self.stand();
        self.fault = Some(fault);
        self.touch = None;
        match fault.cause.safe_path() {
            SafePath::Release if self.homed => self.task = Task::Release,
            _ => self.de_energise(),
        }
        Happening::Fault(fault)
    }

    /// A step would disturb, or be disturbed by, a structure that moves this much.
    fn must_wait(&self) -> bool {
        self.config.quiet_m > 0.0 && !self.braking && self.quiet_ticks < self.paces.quiet
    }

    fn work(&mut self, inputs: &Inputs, force_n: f32) -> (i8, Option<Happening>) {
        self.waiting = false;
        match self.task {
            Task::Stand => (self.ramp.tick(&self.paces.fast, None), None),
            Task::SeekSwitch | Task::LeaveSwitch | Task::BackOff => self.home(inputs.at_switch),
            Task::TouchOff(touch_off) => self.touch_off(touch_off, inputs.force_n),
            Task::Move(position) => {
                let steps = self.go(position, self.paces.fast);
                if self.ramp.is_at(position) {
                    self.task = Task::Settle(self.paces.settle);
                }
                (steps, None)
            }
            Task::Settle(left) => {
                self.task = if left > 1 { Task::Settle(left - 1) } else { Task::Average(Mean::default()) };
                (0, None)
            }
            Task::Average(mut mean) => {
                let averaged = mean.push(force_n, self.paces.average);
                self.task = Task::Average(mean);
                (0, averaged.and_then(|force_n| self.keep(force_n, inputs.base_amplitude_m)))
            }
            Task::Release => self.release(inputs.at_switch),
        }
    }

    /// A step of a move that waits for a quiet structure.
    fn go(&mut self, position: i32, pace: RampLimits) -> i8 {
        self.waiting = self.must_wait();
        self.ramp.tick(&pace, (!self.waiting).then_some(position))
    }

    /// Looks at a settled force: is it believable, and is it the one that was asked for?
    fn keep(&mut self, force_n: f32, base_amplitude_m: Option<f32>) -> Option<Happening> {
        self.force_n = force_n;
        self.task = Task::Average(Mean::default());
        self.without_z = false;
        let (touch, target) = (self.touch?, self.target?);
        let deflection_m = self.position_m(self.ramp.steps()) - touch.zero_m;
        let expected_n = (touch.stiffness_n_per_m * deflection_m).max(0.0);
        let tolerance_n = self.config.follow_tolerance_n;
        if libm::fabsf(force_n - expected_n) > tolerance_n {
            let (value, limit) = (force_n - expected_n, tolerance_n);
            return Some(self.trip(SpringFault { cause: Cause::ForceDoesNotFollow, value, limit }));
        }
        let asked_n = match target {
            Target::Deflection { .. } => None,
            Target::Force { force_n } => Some(force_n),
            Target::FrictionRatio { ratio } => {
                // Without a measured Z the force stays what it is.
                let Some(z_m) = base_amplitude_m.filter(|z| z.is_finite() && *z >= 0.0) else {
                    self.without_z = true;
                    return None;
                };
                Some(self.config.force_of_ratio_n(ratio, z_m))
            }
        };
        if let Some(asked_n) = asked_n {
            let end_n = touch.stiffness_n_per_m * (self.config.travel_m - touch.zero_m);
            let most_n = self.config.working_force_n().min(end_n);
            self.saturated = asked_n > most_n;
            self.target_force_n = asked_n.min(most_n);
            let error_n = self.target_force_n - force_n;
            // Where nothing presses, a force that is asked to be zero cannot be mended by backing off further.
            let out_of_contact = deflection_m <= 0.0 && error_n <= 0.0;
            if libm::fabsf(error_n) > self.config.dead_band_n && !out_of_contact {
                return self.correct(error_n / touch.stiffness_n_per_m);
            }
        }
        (!core::mem::replace(&mut self.on_target, true)).then_some(Happening::OnTarget { force_n })
    }

    fn correct(&mut self, by_m: f32) -> Option<Happening> {
        let position = self.ramp.steps() + nearest(by_m / self.config.step_m);
        if position > self.paces.travel {
            let (value, limit) = (self.position_m(position), self.config.travel_m);
            return Some(self.trip(SpringFault { cause: Cause::LimitReached, value, limit }));
        }
        self.task = Task::Move(position.max(self.paces.back_off));
        None
    }
}
