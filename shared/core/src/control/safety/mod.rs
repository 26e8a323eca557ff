//! Interlocks: the faults that end a drive, the sequence to the safe state, and the conditions for clearing a fault.
//!
//! [`Safety`] checks the inputs of every tick and latches the first fault. From then on the drive fades to zero, or
//! stops at once where a fade could do harm. The relay then opens, and the friction damper closes as a brake if it is
//! so configured. The rig is *safe* only when |x| has stayed below a configured level: a structure of ζ = 0.0038 rings
//! for half a minute, and a drive that starts under a ringing structure has no defined start. Only then can the fault
//! be cleared.
//!
//! The board's settings are the base of every limit. While an experiment runs, its [`ExperimentLimits`] may tighten
//! some of them ([`Safety::tighten`]). These end with the experiment, or when the fault that ended it is cleared. After
//! a fault, once the drive is off, the board's limits alone are checked, so an experiment's limit that is set too tight
//! cannot keep the fault from being cleared.
//!
//! While an experiment runs every sensor is checked. A sensor that is lost ([`rails`]), frozen or has drifted ends the
//! drive, and the cause names the sensor. While the rig is idle a lost sensor is reported in the status and latches no
//! fault. Samples of a displacement at a rail are not checked against a limit, because they are not displacements. The
//! friction damper's spring checks its own force.
//!
//! The displacement limits are [`Limits`]. The watchdog handles a stuck processor, the hardware a broken board; in both
//! cases the relay is off.

mod config;
pub mod envelope;
pub mod rails;
mod tighten;
pub mod watch;

use super::fault::{Fault, FaultCause};
use crate::io::{Invalid, Rail, Readings, SENSORS, Sensor, SensorSet, TICK_HZ};
pub use config::{Limits, SafetyConfig};
use envelope::Envelope;
use postcard_schema::Schema;
use rails::{RailWatch, SensorHealth, SensorVerdict};
use serde::{Deserialize, Serialize};
pub use tighten::{ExperimentLimits, LimitsRejected, Looser};
use watch::{Defect, Watch};

/// Time for which |x| must stay below the restart level, s: longer than a half-cycle from 1 Hz up.
const CALM_S: f32 = 0.5;

/// Time of the fade-out of the drive, s.
const FADE_S: f32 = 0.2;

/// A drive of at least this many resolution steps of the displacement sensors changes their readings.
const RESOLVED_STEPS: f32 = 5.0;

/// Stage of the sequence to the safe state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SafeStage {
    /// No fault: the drive may run.
    Clear,
    /// The drive fades out.
    Fading,
    /// The drive is off and the relay open; the structure still rings, or the emergency stop is still pressed.
    Ringing,
    /// Safe: the fault can be cleared.
    Safe,
}

impl SafeStage {
    /// All stages; the index of each is its value in the signal `safety`.
    pub const ALL: [Self; 4] = [Self::Clear, Self::Fading, Self::Ringing, Self::Safe];

    /// The stage in words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            Self::Fading => "the drive fades out",
            Self::Ringing => "the drive is off; the structure rings, or the emergency stop is pressed",
            Self::Safe => "safe: the fault can be cleared",
        }
    }
}

/// Inputs of the interlocks in a tick, besides the readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Signs {
    /// The tick.
    pub tick: u32,
    /// The drive is on in this tick.
    pub driving: bool,
    /// The drive is strong enough for both displacements to move visibly.
    pub swinging: bool,
    /// Largest |demanded base displacement| since the start, m; where a loop demands what the response needs, no more than it
    /// demands now.
    pub drive_m: f32,
    /// Drive frequency, Hz; 0 if there is none.
    pub frequency_hz: f32,
    /// An experiment runs: every sensor is required.
    pub running: bool,
    /// Largest force on either wall, N.
    pub wall_force_n: f32,
    /// How much of the walls' blocks is at a rail.
    pub wall_rails: [Rail; 2],
    /// For each wall sensor whose zero has drifted beyond the limit: the mean idle reading and the limit, N.
    pub wall_drift: [Option<(f32, f32)>; 2],
    /// The drive is at its limit.
    pub saturated: bool,
    /// Base amplitude that the response's loop demands next, m; 0 of other drives.
    pub base_foreseen_m: f32,
    /// The emergency stop is pressed.
    pub emergency_stop: bool,
    /// A message from the host was received since the last tick.
    pub host_heard: bool,
}

/// What the interlocks permit in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// Factor on the drive, 0 to 1.
    pub drive: f32,
    /// The drive's relay may close.
    pub relay: bool,
    /// Force with which the friction damper must press as a brake, N. It is set in every tick until the fault is
    /// cleared.
    pub brake_n: Option<f32>,
}

/// Why a fault cannot be cleared yet: the stage of the sequence to the safe state, and what to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotSafe {
    /// The stage.
    pub stage: SafeStage,
    /// What to do, in words.
    pub advice: &'static str,
}

/// State of the interlocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    /// The board's settings.
    board: SafetyConfig,
    /// The settings in force: the board's with the limits of the present experiment.
    config: SafetyConfig,
    longest: Longest,
    rails: RailWatch,
    x: Watch,
    z: Watch,
    envelope: Envelope,
    saturated_ticks: u32,
    silent_ticks: u32,
    calm_ticks: u32,
    fault: Option<Fault>,
    stage: SafeStage,
    fade: f32,
}

/// The longest permitted times, ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Longest {
    frozen: u32,
    saturated: u32,
    silent: u32,
}

impl Longest {
    fn of(config: &SafetyConfig) -> Self {
        Self {
            frozen: ticks(config.frozen_s),
            saturated: ticks(config.saturated_s),
            silent: ticks(config.host_silent_s),
        }
    }

    /// The frozen-sensor time: at least half a period of the drive, because a sine hardly changes at its turning
    /// points. 0 for never.
    fn frozen(&self, frequency_hz: f32) -> u32 {
        let half = if frequency_hz > 0.0 { ticks(0.5 / frequency_hz) } else { 0 };
        if self.frozen == 0 { 0 } else { self.frozen.max(half) }
    }
}

fn ticks(seconds: f32) -> u32 {
    // A cast saturates.
    (seconds * TICK_HZ + 0.5) as u32
}

impl Default for Safety {
    /// No fault, with the default settings.
    fn default() -> Self {
        Self::of(SafetyConfig::default())
    }
}

impl Safety {
    /// No fault, with these settings.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(config: &SafetyConfig) -> Result<Self, Invalid> {
        config.validate()?;
        Ok(Self::of(*config))
    }

    fn of(config: SafetyConfig) -> Self {
        Self {
            board: config,
            config,
            longest: Longest::of(&config),
            rails: RailWatch::default(),
            x: Watch::default(),
            z: Watch::default(),
            envelope: Envelope::default(),
            saturated_ticks: 0,
            silent_ticks: 0,
            calm_ticks: 0,
            fault: None,
            stage: SafeStage::Clear,
            fade: 1.0,
        }
    }

    /// The latched fault.
    #[must_use]
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// Stage of the sequence to the safe state.
    #[must_use]
    pub fn stage(&self) -> SafeStage {
        self.stage
    }

    /// Clears the fault. The board's limits are in force again.
    ///
    /// # Errors
    /// The rig is not safe yet.
    pub fn clear(&mut self) -> Result<(), NotSafe> {
        let advice = match self.stage {
            SafeStage::Clear => return Ok(()),
            SafeStage::Fading => "wait until the drive is silent",
            SafeStage::Ringing => "wait for rest; release the emergency stop",
            SafeStage::Safe => {
                *self = Self { rails: self.rails, x: self.x, z: self.z, ..Self::of(self.board) };
                return Ok(());
            }
        };
        Err(NotSafe { stage: self.stage, advice })
    }

    /// Health of the sensors.
    #[must_use]
    pub fn sensors(&self) -> SensorHealth {
        self.rails.health()
    }

    /// Verdict on a sensor in this tick.
    #[must_use]
    pub fn verdict(&self, sensor: Sensor) -> SensorVerdict {
        self.rails.verdict(sensor)
    }

    /// Sensors with a sample at a rail in this tick.
    #[must_use]
    pub fn clipped_now(&self) -> SensorSet {
        self.rails.clipped_now()
    }

    /// Starts an experiment: clipping is recorded anew.
    pub fn restart(&mut self) {
        self.rails.restart();
    }

    /// Runs one tick. Returns what is permitted, and the fault in the tick in which it is latched.
    pub fn tick(&mut self, readings: &Readings, signs: &Signs) -> (Allowed, Option<Fault>) {
        let [low, high] = signs.wall_rails;
        let rails: [Rail; SENSORS] = [readings.x.rail, readings.z.rail, readings.spring_rail, low, high];
        self.rails.push(&rails);
        let found = self.look(readings, signs);
        let latched = found.filter(|fault| self.latch(*fault));
        if self.fault.is_some() {
            self.go_on(readings, signs, found);
        }
        let running = matches!(self.stage, SafeStage::Clear | SafeStage::Fading);
        // An emergency stop switches the motor off: the damper must not press.
        let brakes = self.fault.is_some_and(|fault| fault.cause != FaultCause::EmergencyStop) && !signs.emergency_stop;
        let brake_n = (brakes && self.config.brake_n > 0.0).then_some(self.config.brake_n);
        (Allowed { drive: if running { self.fade } else { 0.0 }, relay: running, brake_n }, latched)
    }

    /// Latches a fault that another part detected. Returns false and changes nothing if a fault is already latched.
    pub fn latch(&mut self, fault: Fault) -> bool {
        let first = self.fault.is_none();
        if first {
            self.fault = Some(fault);
            self.stage = SafeStage::Fading;
        }
        first
    }

    /// Adopts other settings of the board. A latched fault stays latched.
    pub fn adopt(&mut self, other: &Self) {
        self.board = other.board;
        self.act_under(other.board);
    }

    /// Puts the limits of an experiment in force, in addition to the board's.
    ///
    /// # Errors
    /// As [`SafetyConfig::tightened`]; nothing changes in that case.
    pub fn tighten(&mut self, limits: &ExperimentLimits) -> Result<(), LimitsRejected> {
        let tightened = self.board.tightened(limits)?;
        self.act_under(tightened);
        Ok(())
    }

    /// Ends the experiment: the board's limits are in force again.
    pub fn end_experiment(&mut self) {
        self.act_under(self.board);
    }

    fn act_under(&mut self, config: SafetyConfig) {
        (self.config, self.longest) = (config, Longest::of(&config));
    }

    /// The settings in force.
    #[must_use]
    pub fn config(&self) -> &SafetyConfig {
        &self.config
    }

    /// The first fault of this tick.
    fn look(&mut self, readings: &Readings, signs: &Signs) -> Option<Fault> {
        let is_driven = matches!(self.stage, SafeStage::Clear | SafeStage::Fading);
        let config = if is_driven { &self.config } else { &self.board };
        let fault = |cause, value, limit| Some(Fault { cause, tick: signs.tick, value, limit });
        if !signs.swinging || signs.drive_m < RESOLVED_STEPS * config.resolution_m {
            // A sensor may stand still without a drive, or with a drive below its resolution.
            self.x.forgive();
            self.z.forgive();
        }
        let Longest { saturated, silent, .. } = self.longest;
        let frozen = self.longest.frozen(signs.frequency_hz);
        let defects = [(Sensor::X, self.x.push(&readings.x, frozen)), (Sensor::Z, self.z.push(&readings.z, frozen))];
        // A reading at a rail is not a displacement and cannot be extrapolated.
        let foreseen = match readings.x.rail {
            Rail::Clear => self.envelope.push(readings.x.mean_m, config.half_cycles_ahead),
            Rail::Some | Rail::All { .. } => 0.0,
        };
        self.saturated_ticks = if signs.saturated { self.saturated_ticks.saturating_add(1) } else { 0 };
        self.silent_ticks = if signs.host_heard { 0 } else { self.silent_ticks.saturating_add(1) };
        if signs.emergency_stop {
            return fault(FaultCause::EmergencyStop, 0.0, 0.0);
        }
        if signs.running
            && let Some((sensor, reading, edge)) = self.rails.first_lost()
        {
            return fault(FaultCause::SensorAtRail(sensor), reading, edge);
        }
        for (sensor, defect) in defects {
            match defect {
                None => {}
                Some(Defect::NotANumber) => return fault(FaultCause::SensorInvalid(sensor), 0.0, 0.0),
                Some(Defect::Frozen) => {
                    let frozen_s = frozen as f32 / TICK_HZ;
                    return fault(FaultCause::SensorFrozen(sensor), frozen_s, frozen_s);
                }
            }
        }
        for (sensor, drift) in [Sensor::WallLow, Sensor::WallHigh].into_iter().zip(signs.wall_drift) {
            if let Some((value, limit)) = drift.filter(|_| signs.running) {
                return fault(FaultCause::SensorDrifted(sensor), value, limit);
            }
        }
        let (x, z, limits) = (readings.x.inside_peak_m, readings.z.inside_peak_m, &config.limits);
        if z >= limits.base_m {
            return fault(FaultCause::BaseDisplacement, z, limits.base_m);
        }
        if x >= limits.structure_m {
            return fault(FaultCause::StructureDisplacement, x, limits.structure_m);
        }
        if signs.driving && signs.base_foreseen_m >= limits.base_m {
            return fault(FaultCause::BaseForeseen, signs.base_foreseen_m, limits.base_m);
        }
        if signs.driving && config.half_cycles_ahead > 0.0 && foreseen >= limits.structure_m {
            return fault(FaultCause::StructureForeseen, foreseen, limits.structure_m);
        }
        if signs.wall_force_n >= config.wall_force_n || signs.wall_force_n.is_nan() {
            return fault(FaultCause::WallForce, signs.wall_force_n, config.wall_force_n);
        }
        if signs.driving && config.saturated_s > 0.0 && self.saturated_ticks > saturated {
            return fault(FaultCause::DriveSaturated, config.saturated_s, config.saturated_s);
        }
        if signs.driving && config.host_silent_s > 0.0 && self.silent_ticks > silent {
            return fault(FaultCause::HostSilent, config.host_silent_s, config.host_silent_s);
        }
        None
    }

    /// Runs one tick of the sequence from a fault to the safe state.
    fn go_on(&mut self, readings: &Readings, signs: &Signs, found: Option<Fault>) {
        let at_once = |fault: Option<Fault>| fault.is_some_and(|fault| fault.cause.cuts_at_once());
        if self.stage == SafeStage::Fading {
            self.fade -= 1.0 / (FADE_S * TICK_HZ);
            if self.fade <= 0.0 || at_once(self.fault) || at_once(found) {
                self.fade = 0.0;
                self.stage = SafeStage::Ringing;
            }
        }
        let x = readings.x.peak_m;
        // A sensor at a rail or with a fault gives no evidence of rest.
        let believed = found.is_none() && readings.x.rail == Rail::Clear;
        let calm = x < self.config.restart_m && believed && !signs.emergency_stop;
        self.calm_ticks = if calm { self.calm_ticks.saturating_add(1) } else { 0 };
        if self.stage != SafeStage::Fading {
            self.stage = if self.calm_ticks >= ticks(CALM_S) { SafeStage::Safe } else { SafeStage::Ringing };
        }
    }
}
