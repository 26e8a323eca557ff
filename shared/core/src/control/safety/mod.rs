//! The way to the safe state: what ends a drive, what happens then, and when it may begin again.
//!
//! [`Safety`] looks at every tick's signs and latches the first cause. From then on the drive fades to zero (or stops at
//! once where a fade could harm), the relay opens, the friction damper closes as a brake if so configured, and the rig is
//! *safe* only when |x| has stayed below a stated level: a structure of ζ = 0.0038 rings for half a minute, and a shaker
//! that starts under a ringing structure is no defined start. Only then can the cause be cleared.
//!
//! The displacement limits themselves are [`super::limits`]'. A stuck processor is the watchdog's, and a broken board the
//! hardware's: the relay is off without either.

pub mod envelope;
pub mod watch;

use super::friction_spring::Cause as SpringCause;
use super::limits::Limits;
use crate::model::{Invalid, not_negative, positive, require};
use crate::rig::{Readings, TICK_HZ};
use envelope::Envelope;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};
use watch::{Defect, Watch};

/// How long |x| must stay below the restart level, s: longer than a half-cycle from 1 Hz up.
const CALM_S: f32 = 0.5;

/// Time over which the drive fades, s.
const FADE_S: f32 = 0.2;

/// What the interlocks know.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SafetyConfig {
    /// The displacement limits.
    pub limits: Limits,
    /// Half-cycles ahead for which the structure's amplitude is foreseen; 0 to 20, 0 for none.
    pub half_cycles_ahead: f32,
    /// Displacement sensors' range, m: readings at or beyond ± this are no displacement.
    pub sensor_range_m: f32,
    /// Time of identical samples, while driven, that makes a sensor frozen, s; 0 never.
    pub frozen_s: f32,
    /// Force on a wall that must not be reached, N.
    pub wall_force_n: f32,
    /// Time for which the drive may be saturated, s.
    pub saturated_s: f32,
    /// Time without a word from the host after which the drive ends, s; 0 for any.
    pub host_silent_s: f32,
    /// |x| below which a restart is allowed, m.
    pub restart_m: f32,
    /// Normal force of the friction damper as a brake, N; 0 for none.
    pub brake_n: f32,
}

impl Default for SafetyConfig {
    /// The lasers' ±80 mm; an assumed wall sensor of 460 N.
    fn default() -> Self {
        Self {
            limits: Limits::default(),
            half_cycles_ahead: 6.0,
            sensor_range_m: 0.085,
            frozen_s: 0.5,
            wall_force_n: 450.0,
            saturated_s: 0.5,
            host_silent_s: 0.0,
            restart_m: 1e-3,
            brake_n: 0.0,
        }
    }
}

impl SafetyConfig {
    /// Checks every value.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        self.limits.validate()?;
        for (name, value) in [
            ("safety.sensor_range_m", self.sensor_range_m),
            ("safety.wall_force_n", self.wall_force_n),
            ("safety.saturated_s", self.saturated_s),
            ("safety.restart_m", self.restart_m),
        ] {
            positive(name, f64::from(value))?;
        }
        for (name, value) in [
            ("safety.frozen_s", self.frozen_s),
            ("safety.host_silent_s", self.host_silent_s),
            ("safety.brake_n", self.brake_n),
            ("safety.half_cycles_ahead", self.half_cycles_ahead),
        ] {
            not_negative(name, f64::from(value))?;
        }
        let (ahead, restart) = (f64::from(self.half_cycles_ahead), f64::from(self.restart_m));
        require(self.half_cycles_ahead <= 20.0, "safety.half_cycles_ahead", ahead, "from 0 to 20")?;
        require(self.restart_m < self.limits.structure_m, "safety.restart_m", restart, "below limits.structure_m")
    }
}

/// What ended a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Danger {
    /// The emergency stop is pressed.
    EmergencyStop,
    /// A displacement sample is not a number.
    SensorInvalid,
    /// A displacement sensor reads a rail (m).
    SensorOutOfRange,
    /// A displacement sensor gives the same number for ever (s).
    SensorFrozen,
    /// |z| reached its limit (m).
    BaseDisplacement,
    /// |x| reached its limit (m).
    StructureDisplacement,
    /// |x| would reach its limit within a few half-cycles (m).
    StructureForeseen,
    /// A wall's force reached its limit (N).
    WallForce,
    /// The drive was at its limit for too long (s).
    DriveSaturated,
    /// Nothing was heard of the host for too long (s).
    HostSilent,
    /// The structure did not come to rest in the time given (m).
    RestTimeout,
    /// The closed loop of the base amplitude swung up (m).
    BaseRunaway,
    /// The friction damper's spring faulted while the rig was driven.
    Spring(SpringCause),
    /// Nobody released the structure for a free vibration in the time given (m).
    ReleaseTimeout,
}

impl Danger {
    /// In words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::EmergencyStop => "the emergency stop is pressed",
            Self::SensorInvalid => "a displacement sensor gave no number",
            Self::SensorOutOfRange => "a displacement sensor reads its rail: check its cable and distance",
            Self::SensorFrozen => "a displacement sensor does not change while the rig is driven: check its supply",
            Self::BaseDisplacement => "the base reached its displacement limit",
            Self::StructureDisplacement => "the structure reached its displacement limit",
            Self::StructureForeseen => "the structure's growing vibration would have passed its limit",
            Self::WallForce => "the force on a wall reached its limit",
            Self::DriveSaturated => "the drive was at its limit for too long: ask for less",
            Self::HostSilent => "nothing was heard of the host for too long",
            Self::RestTimeout => "the structure did not come to rest in time",
            Self::BaseRunaway => {
                "the base ran away from its demanded amplitude: check the signs of drive and z, and the calibration"
            }
            Self::Spring(cause) => cause.text(),
            Self::ReleaseTimeout => "the structure was not held beyond the level and released in time",
        }
    }

    /// The drive stops within the tick: a fade would go on with what is already wrong.
    #[must_use]
    pub fn cuts_at_once(self) -> bool {
        matches!(self, Self::EmergencyStop | Self::BaseDisplacement | Self::BaseRunaway)
    }
}

/// The latched cause.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Trip {
    /// What.
    pub danger: Danger,
    /// The value that broke the limit, in the danger's unit.
    pub value: f32,
    /// The limit.
    pub limit: f32,
}

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
    /// The drive is on in this tick.
    pub driving: bool,
    /// It is strong enough to see both displacements move.
    pub swinging: bool,
    /// Largest force on either wall, N.
    pub wall_force_n: f32,
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
    /// The friction damper should press with this, N.
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
    config: SafetyConfig,
    longest: Longest,
    x: Watch,
    z: Watch,
    envelope: Envelope,
    saturated_ticks: u32,
    silent_ticks: u32,
    calm_ticks: u32,
    trip: Option<Trip>,
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
        let longest = Longest {
            frozen: ticks(config.frozen_s),
            saturated: ticks(config.saturated_s),
            silent: ticks(config.host_silent_s),
        };
        Self {
            config,
            longest,
            x: Watch::default(),
            z: Watch::default(),
            envelope: Envelope::default(),
            saturated_ticks: 0,
            silent_ticks: 0,
            calm_ticks: 0,
            trip: None,
            stage: SafeStage::Clear,
            fade: 1.0,
        }
    }

    /// The latched cause.
    #[must_use]
    pub fn trip(&self) -> Option<&Trip> {
        self.trip.as_ref()
    }

    /// How far the way to the safe state has been gone.
    #[must_use]
    pub fn stage(&self) -> SafeStage {
        self.stage
    }

    /// Forgets the cause.
    ///
    /// # Errors
    /// The rig is not safe yet.
    pub fn clear(&mut self) -> Result<(), NotSafe> {
        let advice = match self.stage {
            SafeStage::Clear => return Ok(()),
            SafeStage::Fading => "wait until the drive is silent",
            SafeStage::Ringing => "wait for rest; release the emergency stop",
            SafeStage::Safe => {
                *self = Self { x: self.x, z: self.z, ..Self::of(self.config) };
                return Ok(());
            }
        };
        Err(NotSafe { stage: self.stage, advice })
    }

    /// One tick. Returns what is allowed, and the cause in the tick in which it is latched.
    pub fn tick(&mut self, readings: &Readings, signs: &Signs) -> (Allowed, Option<Trip>) {
        let found = self.look(readings, signs);
        let latched = found.filter(|trip| self.latch(*trip));
        if self.trip.is_some() {
            self.go_on(readings, signs, found);
        }
        let running = matches!(self.stage, SafeStage::Clear | SafeStage::Fading);
        let braking = self.trip.is_some() && self.config.brake_n > 0.0;
        let brake_n = braking.then_some(self.config.brake_n);
        (Allowed { drive: if running { self.fade } else { 0.0 }, relay: running, brake_n }, latched)
    }

    /// Latches a cause that another part found; false, and nothing changes, if one is latched already.
    pub fn latch(&mut self, trip: Trip) -> bool {
        let first = self.trip.is_none();
        if first {
            self.trip = Some(trip);
            self.stage = SafeStage::Fading;
        }
        first
    }

    /// Goes on under other constants; what is latched stays latched.
    pub fn adopt(&mut self, other: &Self) {
        (self.config, self.longest) = (other.config, other.longest);
    }

    /// The constants.
    #[must_use]
    pub fn config(&self) -> &SafetyConfig {
        &self.config
    }

    /// The first danger of this tick.
    fn look(&mut self, readings: &Readings, signs: &Signs) -> Option<Trip> {
        let config = &self.config;
        let trip = |danger, value, limit| Some(Trip { danger, value, limit });
        if !signs.swinging {
            // What is not driven may stand.
            self.x.forgive();
            self.z.forgive();
        }
        let Longest { frozen, saturated, silent } = self.longest;
        let defect = [
            (self.x.push(&readings.x, config.sensor_range_m, frozen), readings.x.peak_m),
            (self.z.push(&readings.z, config.sensor_range_m, frozen), readings.z.peak_m),
        ];
        let foreseen = self.envelope.push(readings.x.mean_m, config.half_cycles_ahead);
        self.saturated_ticks = if signs.saturated { self.saturated_ticks.saturating_add(1) } else { 0 };
        self.silent_ticks = if signs.host_heard { 0 } else { self.silent_ticks.saturating_add(1) };
        if signs.emergency_stop {
            return trip(Danger::EmergencyStop, 0.0, 0.0);
        }
        for (defect, value) in defect {
            match defect {
                None => {}
                Some(Defect::NotANumber) => return trip(Danger::SensorInvalid, 0.0, 0.0),
                Some(Defect::OutOfRange) => return trip(Danger::SensorOutOfRange, value, config.sensor_range_m),
                Some(Defect::Frozen) => return trip(Danger::SensorFrozen, config.frozen_s, config.frozen_s),
            }
        }
        let (x, z, limits) = (readings.x.peak_m, readings.z.peak_m, &config.limits);
        if z >= limits.base_m {
            return trip(Danger::BaseDisplacement, z, limits.base_m);
        }
        if x >= limits.structure_m {
            return trip(Danger::StructureDisplacement, x, limits.structure_m);
        }
        if signs.driving && config.half_cycles_ahead > 0.0 && foreseen >= limits.structure_m {
            return trip(Danger::StructureForeseen, foreseen, limits.structure_m);
        }
        if signs.wall_force_n >= config.wall_force_n || signs.wall_force_n.is_nan() {
            return trip(Danger::WallForce, signs.wall_force_n, config.wall_force_n);
        }
        if signs.driving && self.saturated_ticks > saturated {
            return trip(Danger::DriveSaturated, config.saturated_s, config.saturated_s);
        }
        if signs.driving && config.host_silent_s > 0.0 && self.silent_ticks > silent {
            return trip(Danger::HostSilent, config.host_silent_s, config.host_silent_s);
        }
        None
    }

    /// One tick of the way from a cause to the safe state.
    fn go_on(&mut self, readings: &Readings, signs: &Signs, found: Option<Trip>) {
        let at_once = |trip: Option<Trip>| trip.is_some_and(|trip| trip.danger.cuts_at_once());
        if self.stage == SafeStage::Fading {
            self.fade -= 1.0 / (FADE_S * TICK_HZ);
            if self.fade <= 0.0 || at_once(self.trip) || at_once(found) {
                self.fade = 0.0;
                self.stage = SafeStage::Ringing;
            }
        }
        let x = readings.x.peak_m;
        // A sensor that cannot be believed says nothing about rest.
        let calm = x < self.config.restart_m && found.is_none() && !signs.emergency_stop;
        self.calm_ticks = if calm { self.calm_ticks.saturating_add(1) } else { 0 };
        if self.stage != SafeStage::Fading {
            self.stage = if self.calm_ticks >= ticks(CALM_S) { SafeStage::Safe } else { SafeStage::Ringing };
        }
    }
}
