//! Controller of the friction damper's spring: homing, touch-off, and targets held by force feedback.
//!
//! A stepper moves the seat of a spring whose other end presses a block against the structure: F_N = k_s Δs. Δs is
//! counted from the *zero reading*, the seat position at which the force begins. The **touch-off** measures it. The
//! seat approaches until the force rises, then takes eight settled readings further up and fits a line through them.
//! The line's zero crossing is the zero reading, its slope the measured k_s, its scatter gives the standard error of
//! the zero reading. The controller approaches every target along this line and then corrects the position by the
//! measured force. A settled force off the line is a fault, because a motor without an encoder shows lost steps in no
//! other way.
//!
//! While the force sensor is at a rail, its force is ignored and the motor brakes to a standstill. The emergency stop
//! switches the motor off in its tick. The position is then unknown, so the spring must be homed again.
//!
//! [`config`] holds the constants, [`ramp`] the motor's motion, `press` the approach to a target and its holding.
//! Pulses and pins are in the board's code. Backlash is not modelled: the spring keeps the nut on one flank.

pub mod config;
mod homing;
mod line;
mod messages;
mod press;
pub mod ramp;
mod touch_off;

use crate::control::fault::{Fault, FaultCause, SafePath, SpringFaultCause};
use crate::control::safety::rails::SensorVerdict;
use crate::io::{Invalid, Motor};
pub use config::{SpringConfig, SpringSetUp};
pub use messages::{
    SpringCommand, SpringEvent, SpringInputs, SpringRejected, SpringStage, SpringStatus, Target, ZeroReading,
};
use press::Press;
use ramp::{Ramp, RampLimits};
use touch_off::TouchOff;

/// Time for which the structure must have been quiet before a step, s: more than a period from 2 Hz up.
const QUIET_HOLD_S: f32 = 0.5;

const TOUCH_OFF_FIRST: &str = "find the zero reading first (touch off)";

/// State of the spring, with the position data known in it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum SpringState {
    /// The position is unknown.
    Unhomed,
    /// Moving towards the limit switch, with the lowest force reading so far, N.
    SeekSwitch {
        lowest_n: f32,
    },
    /// Leaving the switch slowly; its edge is the origin.
    LeaveSwitch,
    /// Moving to the position where the block waits.
    BackOff,
    /// At rest, without a zero reading.
    Homed,
    TouchOff(TouchOff),
    /// At rest, with a zero reading.
    Ready(ZeroReading),
    Press(Press),
    /// Moving away from the structure.
    Release(Option<ZeroReading>),
}

/// A running mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    sum: f32,
    count: u32,
}

impl Mean {
    /// Adds a value; returns the mean once there are `count` values.
    fn push(&mut self, value: f32, count: u32) -> Option<f32> {
        self.sum += value;
        self.count += 1;
        (self.count >= count).then(|| self.sum / self.count as f32)
    }
}

/// Constants of the drive in steps and ticks.
#[derive(Clone, Copy, Debug)]
struct Scaled {
    fast: RampLimits,
    search: RampLimits,
    travel: i32,
    back_off: i32,
    settle: u32,
    average: u32,
    quiet: u32,
}

/// Controller of the friction damper's spring.
#[derive(Clone, Copy, Debug)]
pub struct FrictionSpring {
    config: SpringConfig,
    scaled: Scaled,
    ramp: Ramp,
    state: SpringState,
    tick: u32,
    /// Force reading without contact, N.
    bias_n: f32,
    /// Last averaged force, N.
    force_n: f32,
    /// A step is waiting for a quiet structure.
    waiting: bool,
    quiet_ticks: u32,
    fault: Option<Fault>,
}

impl Default for FrictionSpring {
    /// Unknown position, with the default constants.
    fn default() -> Self {
        Self::of(&SpringConfig::default())
    }
}

impl FrictionSpring {
    /// Unknown position, with the motor off.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(config: &SpringConfig) -> Result<Self, Invalid> {
        config.validate()?;
        Ok(Self::of(config))
    }

    /// Makes a controller from checked constants.
    fn of(config: &SpringConfig) -> Self {
        let ramp_limits = |rate| RampLimits::new(rate, config.acceleration_hz_per_s);
        let scaled = Scaled {
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
            scaled,
            ramp: Ramp::default(),
            state: SpringState::Unhomed,
            tick: 0,
            bias_n: 0.0,
            force_n: 0.0,
            waiting: false,
            quiet_ticks: 0,
            fault: None,
        }
    }

    /// Puts the board's spring, friction coefficient and structure in force again. Position, state and zero reading
    /// stay.
    pub fn end_set_up(&mut self, board: &SpringConfig) {
        let SpringConfig { stiffness_n_per_m, friction_coefficient, structure_stiffness_n_per_m, .. } = *board;
        self.config =
            SpringConfig { stiffness_n_per_m, friction_coefficient, structure_stiffness_n_per_m, ..self.config };
    }

    /// The constants of the drive.
    #[must_use]
    pub fn config(&self) -> &SpringConfig {
        &self.config
    }

    /// The present stage.
    #[must_use]
    pub fn stage(&self) -> SpringStage {
        match self.state {
            _ if self.fault.is_some() => SpringStage::Faulted,
            SpringState::Unhomed => SpringStage::Unhomed,
            SpringState::SeekSwitch { .. } | SpringState::LeaveSwitch | SpringState::BackOff => SpringStage::Homing,
            SpringState::Homed => SpringStage::Homed,
            SpringState::TouchOff(_) => SpringStage::TouchingOff,
            SpringState::Ready(_) => SpringStage::Ready,
            SpringState::Press(Press { on_target: false, .. }) => SpringStage::Setting,
            SpringState::Press(_) => SpringStage::Holding,
            SpringState::Release(_) => SpringStage::Releasing,
        }
    }

    fn press(&self) -> Option<&Press> {
        if let SpringState::Press(press) = &self.state { Some(press) } else { None }
    }

    fn zero(&self) -> Option<ZeroReading> {
        match self.state {
            SpringState::Ready(zero) | SpringState::Press(Press { zero, .. }) => Some(zero),
            SpringState::Release(zero) => zero,
            _ => None,
        }
    }

    fn is_homed(&self) -> bool {
        !matches!(self.state, SpringState::Unhomed | SpringState::SeekSwitch { .. } | SpringState::LeaveSwitch)
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

    /// Demanded force, N; 0 without a target.
    #[must_use]
    pub fn target_force_n(&self) -> f32 {
        self.press().map_or(0.0, |press| press.target_force_n)
    }

    /// The spring presses as a brake.
    #[must_use]
    pub fn is_braking(&self) -> bool {
        self.press().is_some_and(|press| press.braking)
    }

    /// Status of the spring.
    #[must_use]
    pub fn status(&self) -> SpringStatus {
        SpringStatus {
            stage: self.stage(),
            position_m: self.position_now_m(),
            force_n: self.force_n,
            target_force_n: self.target_force_n(),
            saturated: self.press().is_some_and(|press| press.saturated),
            waiting: self.waiting || self.press().is_some_and(|press| press.without_z),
            zero: self.zero(),
            fault: self.fault,
        }
    }

    fn position_m(&self, steps: i32) -> f32 {
        steps as f32 * self.config.step_m
    }

    /// Carries out a command.
    ///
    /// # Errors
    /// A target out of range, or a command that is not possible in this stage; the controller is then unchanged.
    pub fn handle(&mut self, command: SpringCommand) -> Result<(), SpringRejected> {
        let stage = self.stage();
        let reject = |advice| Err(SpringRejected::WrongStage { stage, advice });
        match (command, stage) {
            (SpringCommand::ClearFault, SpringStage::Faulted) => {
                if matches!(self.state, SpringState::Release(_)) {
                    return reject("wait until the block has moved away");
                }
                self.fault = None;
            }
            (SpringCommand::ClearFault, _) => {}
            (_, SpringStage::Faulted) => return reject("clear the spring's fault first"),
            (SpringCommand::Halt, _) => self.stand(),
            (_, SpringStage::Homing | SpringStage::TouchingOff | SpringStage::Releasing) => {
                return reject("wait until it is done, or halt");
            }
            (SpringCommand::Home, _) => {
                self.ramp.declare(0);
                self.state = SpringState::SeekSwitch { lowest_n: f32::INFINITY };
            }
            (_, SpringStage::Unhomed) => return reject("home the spring first"),
            (SpringCommand::Release, _) => self.state = SpringState::Release(self.zero()),
            (SpringCommand::TouchOff, SpringStage::Setting | SpringStage::Holding) => {
                return reject("release the spring first");
            }
            (SpringCommand::TouchOff, _) => self.state = SpringState::TouchOff(TouchOff::new()),
            (SpringCommand::Set(target), _) => {
                let Some(zero) = self.zero() else { return reject(TOUCH_OFF_FIRST) };
                let position = self.check(&zero, target)?;
                self.begin(zero, target, position, false);
            }
        }
        Ok(())
    }

    /// Presses at once as a brake with `force_n` (at most the working force), even while the structure moves. Without a
    /// zero reading or with a fault it returns false and does nothing.
    pub fn brake(&mut self, force_n: f32) -> bool {
        let Some(zero) = self.zero().filter(|_| self.fault.is_none() && force_n >= 0.0) else { return false };
        let force_n = force_n.min(self.config.working_force_n());
        let position = self.config.steps(zero.zero_m + force_n / zero.stiffness_n_per_m).min(self.scaled.travel);
        self.begin(zero, Target::Force { force_n }, position, true);
        true
    }

    /// Abandons the target or the task; the ramp brakes.
    fn stand(&mut self) {
        self.state = match (self.is_homed(), self.zero()) {
            (false, _) => SpringState::Unhomed,
            (true, None) => SpringState::Homed,
            (true, Some(zero)) => SpringState::Ready(zero),
        };
    }

    /// Switches the motor off at once. The position is then unknown.
    fn de_energise(&mut self) {
        self.state = SpringState::Unhomed;
        self.ramp.halt();
        self.waiting = false;
    }

    /// Runs one tick. It gives at most one event.
    pub fn tick(&mut self, inputs: &SpringInputs) -> (Motor, Option<SpringEvent>) {
        self.tick = inputs.tick;
        if inputs.emergency_stop {
            self.de_energise();
            return (Motor::default(), None);
        }
        let force_n = inputs.force_n - self.bias_n;
        let found = if self.fault.is_none() { self.find_fault(inputs, force_n) } else { None };
        let (steps, event) = match found {
            Some((cause, value, limit)) => (0, Some(self.trip(cause, value, limit))),
            None if inputs.force_sensor == SensorVerdict::AtRail && self.fault.is_none() => {
                (self.ramp.tick(&self.scaled.fast, None), None)
            }
            None => self.work(inputs, force_n),
        };
        // A screw of this pitch is self-locking: the motor may be off where the position is unknown or no longer
        // needed.
        let enabled = match self.state {
            SpringState::Unhomed => !self.ramp.is_still(),
            SpringState::Homed | SpringState::Ready(_) => !self.ramp.is_still() || self.fault.is_none(),
            _ => true,
        };
        (Motor { steps, enabled }, event)
    }

    /// Detects the faults that are possible in every state: the cause, the value and the limit.
    fn find_fault(&mut self, inputs: &SpringInputs, force_n: f32) -> Option<(SpringFaultCause, f32, f32)> {
        let moving = inputs.max_abs_x_m >= self.config.quiet_m || inputs.max_abs_x_m.is_nan();
        self.quiet_ticks = if moving { 0 } else { self.quiet_ticks.saturating_add(1) };
        // An unplugged sensor is no fault before homing: the rig may have no friction damper.
        if self.state == SpringState::Unhomed {
            return None;
        }
        match inputs.force_sensor {
            SensorVerdict::Reads if inputs.force_n.is_nan() => {
                return Some((SpringFaultCause::SensorLost, inputs.force_n, 0.0));
            }
            SensorVerdict::Reads => {}
            // The reading is not a force, and the sensor is not lost yet.
            SensorVerdict::AtRail => return None,
            SensorVerdict::Lost { reading, edge } => return Some((SpringFaultCause::SensorLost, reading, edge)),
        }
        if force_n >= self.config.largest_force_n {
            return Some((SpringFaultCause::ForceAboveLargest, force_n, self.config.largest_force_n));
        }
        let tolerance_n = self.config.follow_tolerance_n;
        if let SpringState::SeekSwitch { lowest_n } = &mut self.state {
            *lowest_n = lowest_n.min(inputs.force_n);
            let rise_n = inputs.force_n - *lowest_n;
            if rise_n > tolerance_n {
                return Some((SpringFaultCause::WrongDirection, rise_n, tolerance_n));
            }
        }
        let has_bias = match &self.state {
            SpringState::TouchOff(touch_off) => touch_off.has_bias(),
            _ => self.zero().is_some(),
        };
        if has_bias && force_n < -tolerance_n {
            return Some((SpringFaultCause::WrongSign, force_n, -tolerance_n));
        }
        if inputs.at_switch && self.is_homed() && self.state != SpringState::BackOff {
            return Some((SpringFaultCause::LimitReached, self.position_now_m(), 0.0));
        }
        None
    }

    /// Latches a fault and starts the reaction to it.
    fn trip(&mut self, cause: SpringFaultCause, value: f32, limit: f32) -> SpringEvent {
        let fault = Fault { cause: FaultCause::Spring(cause), tick: self.tick, value, limit };
        self.fault = Some(fault);
        match cause.safe_path() {
            SafePath::Release if self.is_homed() => self.state = SpringState::Release(None),
            _ => self.de_energise(),
        }
        SpringEvent::Fault(fault)
    }

    /// The structure moves too much for a step.
    fn must_wait(&self) -> bool {
        self.config.quiet_m > 0.0 && !self.is_braking() && self.quiet_ticks < self.scaled.quiet
    }

    fn work(&mut self, inputs: &SpringInputs, force_n: f32) -> (i8, Option<SpringEvent>) {
        self.waiting = false;
        match self.state {
            SpringState::Unhomed | SpringState::Homed | SpringState::Ready(_) => {
                (self.ramp.tick(&self.scaled.fast, None), None)
            }
            SpringState::SeekSwitch { .. } => self.seek_switch(inputs.at_switch),
            SpringState::LeaveSwitch => self.leave_switch(inputs.at_switch),
            SpringState::BackOff => self.back_off(),
            SpringState::TouchOff(touch_off) => self.touch_off(touch_off, inputs.force_n),
            SpringState::Press(press) => self.hold(press, inputs, force_n),
            SpringState::Release(zero) => (self.release(zero, inputs.at_switch), None),
        }
    }

    /// One tick of a move that waits for a quiet structure.
    fn go(&mut self, position: i32, limits: RampLimits) -> i8 {
        self.waiting = self.must_wait();
        self.ramp.tick(&limits, (!self.waiting).then_some(position))
    }
}
