//! Persistent rig configuration: sensor scales, limits, and the constants of the friction damper and of impact
//! detection.
//!
//! The board keeps the settings through a power cut; `damprig-device` and the firmware store them. Every experiment
//! starts from these settings. While it lasts, an experiment may tighten limits and describe its friction damper's
//! spring; it may change nothing else.

mod calibrated;
mod source;

pub use calibrated::{Calibrated, ForceRecord, ImpulseRecord, LengthRecord, Period};
pub use source::Source;

use crate::control::friction_spring::{FrictionSpring, SpringConfig};
use crate::control::safety::{Safety, SafetyConfig};
use crate::io::{Calibration, Invalid, WALL_SUBSAMPLES, WALL_USABLE, require};
use crate::measure::impacts::{ImpactConfig, ImpactSettings};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The settings of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Settings {
    /// Scales of the converters' counts. A simulated board's displacements and spring force come in SI units; there
    /// only the walls' scale and the drive's range have an effect.
    pub calibration: Calibration,
    /// Limits and times of the interlocks.
    pub safety: SafetyConfig,
    /// Constants of the friction damper's drive.
    pub spring: SpringConfig,
    /// Thresholds of impact detection.
    pub impacts: ImpactConfig,
    /// When each channel was calibrated. Settings that were recorded before there was such a table lack it.
    #[serde(default)]
    pub calibrated: Calibrated,
}

impl Default for Settings {
    /// The rig as delivered: every value is assumed, none is measured.
    fn default() -> Self {
        Self {
            calibration: Calibration::default(),
            safety: SafetyConfig::default(),
            spring: SpringConfig::default(),
            impacts: ImpactConfig::default(),
            calibrated: Calibrated::default(),
        }
    }
}

impl Settings {
    /// Checks every value, and that each limit lies inside its sensor's usable span. A limit beyond that span would
    /// never trip.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        let Self { calibration, safety, spring, impacts, calibrated } = self;
        calibration.validate()?;
        safety.validate()?;
        spring.validate()?;
        impacts.validate()?;
        calibrated.validate()?;
        let walls = WALL_USABLE.map(|counts| calibration.walls.to_force_n(f32::from(counts)));
        for (name, limit, most) in [
            ("safety.limits.structure_m", safety.limits.structure_m, calibration.x.usable_m().amplitude()),
            ("safety.limits.base_m", safety.limits.base_m, calibration.z.usable_m().amplitude()),
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

/// Checked settings with everything derived from them. Adopting them is a plain copy.
#[derive(Clone, Debug)]
pub struct Prepared {
    pub(crate) safety: Safety,
    pub(crate) spring: FrictionSpring,
    pub(crate) impacts: ImpactSettings,
}

impl Prepared {
    /// Checks and prepares the settings. Too slow for the control tick.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn new(settings: &Settings) -> Result<Self, Invalid> {
        settings.validate()?;
        Ok(Self {
            safety: Safety::new(&settings.safety)?,
            spring: FrictionSpring::new(&settings.spring)?,
            impacts: ImpactSettings::new(&settings.impacts, &settings.calibration.walls, WALL_SUBSAMPLES as u8)?,
        })
    }
}
