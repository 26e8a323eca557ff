//! The way to the safe state: what ends a drive, what happens then, and when it may begin again.
//!
//! [`Safety`] looks at every tick's signs and latches the first cause. From then on the drive fades to zero (or stops at
//! once where a fade could harm), the relay opens, the friction damper closes as a brake if so configured, and the rig is
//! *safe* only when |x| has stayed below a stated level: a structure of ζ = 0.0038 rings for half a minute, and a shaker
//! that starts under a ringing structure is no defined start. Only then can the cause be cleared.
//!
//! The board's settings are the base of every limit. While an experiment runs, its [`ExperimentLimits`] may tighten some
//! of them ([`Safety::tighten`]); they end with the experiment, or with the clearing of the fault that ended it. Whether a
//! tripped rig is safe again is judged by the board's limits alone: a limit of an experiment, set too tight, must not keep
//! the rig from being cleared.
//!
//! While an experiment runs every sensor is watched: one that is lost ([`rails`]), frozen or has drifted ends the drive, and the
//! cause names it. While the rig is idle a lost sensor is told in the status and latches nothing. A displacement whose sensor
//! is at a rail is not judged: what it reads is no displacement. The friction damper's spring watches its own force.
//!
//! The displacement limits themselves are [`super::limits`]'. A stuck processor is the watchdog's, and a broken board the
//! hardware's: the relay is off without either.

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
use rails::{RailWatch, SensorHealth, Verdict};
use serde::{Deserialize, Serialize};
pub use tighten::{ExperimentLimits, LimitsRejected, Looser};
use watch::{Defect, Watch};

/// How long |x| must stay below the restart level, s: longer than a half-cycle from 1 Hz up.
const CALM_S: f32 = 0.5;

/// Time over which the drive fades, s.
const FADE_S: f32 = 0.2;

/// A drive of this many steps of the displacement sensors moves their readings.
const RESOLVED_STEPS: f32 = 5.0;

/// How far the way to the safe state has been gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SafeStage {
    /// No cause: the drive may run.
    Clear,
    /// The drive fades out.
    Fading,
    /// The drive is off and the relay open; the structure still rings, or the emergency stop is still pressed.
    Ringing,
    /// Safe: the cause may be cleared.
    Safe,
}

/// What the tick showed beside the displacements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Signs {
    /// The tick.
    pub tick: u32,
    /// The drive is on in this tick.
    pub driving: bool,
    /// It is strong enough to see both displacements move.
    pub swinging: bool,
    /// Largest |demanded base displacement| since the start, m.
    pub drive_m: f32,
    /// Its frequency, Hz; 0 where it has none.
    pub frequency_hz: f32,
    /// An experiment runs: every sensor is needed.
    pub running: bool,
    /// Largest force on either wall, N.
    pub wall_force_n: f32,
    /// What of the walls' blocks is at a rail.
    pub wall_rails: [Rail; 2],
    /// A wall sensor's zero, as far as it is off its calibration by more than may be followed, and what may be, N.
    pub wall_drift: [Option<(f32, f32)>; 2],
    /// The drive is at its limit.
    pub saturated: bool,
    /// The emergency stop is pressed.
    pub emergency_stop: bool,
    /// Something was heard of the host since the last tick.
    pub host_heard: bool,
}

/// What the interlocks allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// Factor on the drive, 0 to 1.
    pub drive: f32,
    /// The drive's relay may be closed.
    pub relay: bool,
    /// The friction damper has to press with this, N; in every tick until the fault is cleared.
    pub brake_n: Option<f32>,
}

/// A clearing that was refused: where the way to the safe state stands, and what to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotSafe {
    /// The stage.
    pub stage: SafeStage,
    /// What to do, in words.
    pub advice: &'static str,
}

/// The interlocks' state.
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    /// The board's settings.
    board: SafetyConfig,
    /// With the limits of the experiment in progress.
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

/// The longest times that are allowed, ticks.
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

    /// At least half a period of the drive: a sine may stand still at its turning points. 0 for never.
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
    /// Clear, with the default constants.
    fn default() -> Self {
        Self::of(SafetyConfig::default())
    }
}

impl Safety {
    /// Clear.
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

    /// The latched cause.
    #[must_use]
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// How far the way to the safe state has been gone.
    #[must_use]
    pub fn stage(&self) -> SafeStage {
        self.stage
    }

    /// Forgets the cause; the board's limits are in force again.
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

    /// The sensors' health.
    #[must_use]
    pub fn sensors(&self) -> SensorHealth {
        self.rails.health()
    }

    /// What a sensor is worth in this tick.
    #[must_use]
    pub fn verdict(&self, sensor: Sensor) -> Verdict {
        self.rails.verdict(sensor)
    }

    /// Sensors with a sample at a rail in this tick.
    #[must_use]
    pub fn clipped_now(&self) -> SensorSet {
        self.rails.clipped_now()
    }

    /// An experiment starts.
    pub fn restart(&mut self) {
        self.rails.restart();
    }

    /// One tick. Returns what is allowed, and the cause in the tick in which it is latched.
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
        // An emergency stop switches the motor off: nothing may press.
        let brakes = self.fault.is_some_and(|fault| fault.cause != FaultCause::EmergencyStop) && !signs.emergency_stop;
        let brake_n = (brakes && self.config.brake_n > 0.0).then_some(self.config.brake_n);
        (Allowed { drive: if running { self.fade } else { 0.0 }, relay: running, brake_n }, latched)
    }

    /// Latches a fault that another part found; false, and nothing changes, if one is latched already.
    pub fn latch(&mut self, fault: Fault) -> bool {
        let first = self.fault.is_none();
        if first {
            self.fault = Some(fault);
            self.stage = SafeStage::Fading;
        }
        first
    }

    /// Goes on under other settings of the board; what is latched stays latched.
    pub fn adopt(&mut self, other: &Self) {
        self.board = other.board;
        self.act_under(other.board);
    }

    /// Puts the limits of an experiment in force, on top of the board's.
    ///
    /// # Errors
    /// As [`SafetyConfig::tightened`]; nothing changes then.
    pub fn tighten(&mut self, limits: &ExperimentLimits) -> Result<(), LimitsRejected> {
        let tightened = self.board.tightened(limits)?;
        self.act_under(tightened);
        Ok(())
    }

    /// The experiment is over: the board's limits are in force again.
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
            // What is not driven, or by less than can be seen, may stand.
            self.x.forgive();
            self.z.forgive();
        }
        let Longest { saturated, silent, .. } = self.longest;
        let frozen = self.longest.frozen(signs.frequency_hz);
        let defects = [(Sensor::X, self.x.push(&readings.x, frozen)), (Sensor::Z, self.z.push(&readings.z, frozen))];
        // What is at a rail is no displacement to foresee from.
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

    /// One tick of the way from a cause to the safe state.
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
        // A sensor that cannot be believed says nothing about rest.
        let believed = found.is_none() && readings.x.rail == Rail::Clear;
        let calm = x < self.config.restart_m && believed && !signs.emergency_stop;
        self.calm_ticks = if calm { self.calm_ticks.saturating_add(1) } else { 0 };
        if self.stage != SafeStage::Fading {
            self.stage = if self.calm_ticks >= ticks(CALM_S) { SafeStage::Safe } else { SafeStage::Ringing };
        }
    }
}
