//! What a rig is before a host says anything: its sensors' scales, its limits, and the constants of its friction damper and
//! its walls.
//!
//! A board keeps them over power cuts; where and how is `damprig-device`'s and the firmware's. They are the base of every
//! experiment, which may tighten limits and describe its friction damper's spring while it lasts, and no more.

use crate::control::friction_spring::{FrictionSpring, SpringConfig};
use crate::control::safety::{Safety, SafetyConfig};
use crate::io::{Calibration, Invalid, WALL_SUBSAMPLES, WALL_USABLE, require};
use crate::measure::impacts::{ImpactConfig, ImpactSettings};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The settings of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Settings {
    /// What the converters' counts mean. A simulated board's displacements and spring force come in SI units: there only the
    /// walls' scale and the drive's range have an effect.
    pub calibration: Calibration,
    /// The interlocks.
    pub safety: SafetyConfig,
    /// The friction damper's drive.
    pub spring: SpringConfig,
    /// How impacts are found.
    pub impacts: ImpactConfig,
}

impl Default for Settings {
    /// The rig's as delivered: everything assumed, nothing measured.
    fn default() -> Self {
        Self {
            calibration: Calibration::default(),
            safety: SafetyConfig::default(),
            spring: SpringConfig::default(),
            impacts: ImpactConfig::default(),
        }
    }
}

impl Settings {
    /// Checks every value, and that each limit lies where its sensor can see it: a limit beyond the usable span would never trip.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        let Self { calibration, safety, spring, impacts } = self;
        calibration.validate()?;
        safety.validate()?;
        spring.validate()?;
        impacts.validate()?;
        let walls = WALL_USABLE.map(|counts| calibration.walls.to_force_n(f32::from(counts)));
        for (name, limit, most) in [
            ("limits.structure_m", safety.limits.structure_m, calibration.x.usable_m().amplitude()),
            ("limits.base_m", safety.limits.base_m, calibration.z.usable_m().amplitude()),
            ("safety.wall_force_n", safety.wall_force_n, walls.high),
            ("impacts.clip_n", impacts.clip_n, walls.high),
            ("impacts.offset_limit_n", impacts.offset_limit_n, walls.amplitude()),
            ("spring.largest_force_n", spring.largest_force_n, calibration.usable_spring_n().high),
        ] {
            let allowed = "inside the usable span of its sensor: 1 % of the span within its ends, as calibrated";
            require(limit < most, name, f64::from(limit), allowed)?;
        }
        let allowed = "at most 0.9 of spring.largest_force_n";
        require(safety.brake_n <= spring.working_force_n(), "safety.brake_n", f64::from(safety.brake_n), allowed)
    }
}

/// Where the settings in use come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Source {
    /// As delivered: nothing of this layout is stored.
    #[default]
    Default,
    /// What was saved last.
    Stored,
    /// As delivered, because what is stored is damaged.
    Damaged,
    /// A host set them since; they are not saved.
    Host,
}

/// Settings checked and made ready: to take them over is a move.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The settings.
    pub settings: Settings,
    pub(crate) safety: Safety,
    pub(crate) spring: FrictionSpring,
    pub(crate) impacts: ImpactSettings,
}

impl Prepared {
    /// Checks and prepares. Takes its time: not for the control tick.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(settings: &Settings) -> Result<Self, Invalid> {
        settings.validate()?;
        Ok(Self {
            settings: *settings,
            safety: Safety::new(&settings.safety)?,
            spring: FrictionSpring::new(&settings.spring)?,
            impacts: ImpactSettings::new(&settings.impacts, &settings.calibration.walls, WALL_SUBSAMPLES as u8)?,
        })
    }
}
