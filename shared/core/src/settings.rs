//! What a rig is before a host says anything: its sensors' scales, its limits, and the constants of its friction damper and
//! its walls.
//!
//! A board keeps them over power cuts; where and how is `damprig-device`'s and the firmware's. An experiment's own limits
//! and constants take their place in the rig while it lasts, and leave them as they are.

use crate::control::friction_spring::{FrictionSpring, SpringConfig};
use crate::control::safety::{Safety, SafetyConfig};
use crate::measure::impacts::{ImpactConfig, ImpactSettings};
use crate::model::Invalid;
use crate::rig::WALL_SUBSAMPLES;
use crate::rig::calibration::Calibration;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The settings of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Settings {
    /// What the converters' counts mean. A simulated board's displacements and spring force come in SI units: there only the
    /// walls' scale has an effect.
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
            // Sixteen 12-bit conversions added up, an output of 12 bits, ±5 mm of the shaker.
            calibration: Calibration::assumed(16 * 4_095, 4_095, 0.005),
            safety: SafetyConfig::default(),
            spring: SpringConfig::default(),
            impacts: ImpactConfig::default(),
        }
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
        settings.calibration.validate()?;
        Ok(Self {
            settings: *settings,
            safety: Safety::new(&settings.safety)?,
            spring: FrictionSpring::new(&settings.spring)?,
            impacts: ImpactSettings::new(&settings.impacts, &settings.calibration.walls, WALL_SUBSAMPLES as u8)?,
        })
    }
}
