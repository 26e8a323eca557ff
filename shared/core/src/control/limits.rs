//! The interlocks: what ends an experiment at once, and the record of why.

use crate::model::{Invalid, positive};
use crate::rig::Sensors;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Displacements that must not be reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Limits {
    /// Largest |x| of the structure, m; within the sensor's range.
    pub structure_m: f32,
    /// Largest |z| of the base, m.
    pub base_m: f32,
}

impl Default for Limits {
    /// The source document's lasers read ±80 mm.
    fn default() -> Self {
        Self { structure_m: 0.08, base_m: 0.08 }
    }
}

/// Why the drive was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Cause {
    /// |x| reached its limit.
    StructureDisplacement,
    /// |z| reached its limit.
    BaseDisplacement,
    /// A sensor value is not a number.
    SensorInvalid,
    /// The structure did not come to rest in the time given.
    RestTimeout,
    /// The closed loop of the base amplitude swung up.
    BaseRunaway,
}

impl Cause {
    /// In words, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::StructureDisplacement => "the structure reached its displacement limit",
            Self::BaseDisplacement => "the base reached its displacement limit",
            Self::SensorInvalid => "a sensor gave no number",
            Self::RestTimeout => "the structure did not come to rest in time",
            Self::BaseRunaway => {
                "the base ran away from its demanded amplitude: check the signs of drive and z, and the calibration"
            }
        }
    }
}

/// A latched fault: it stays until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Fault {
    /// What happened.
    pub cause: Cause,
    /// The tick it happened in.
    pub tick: u32,
    /// The value that broke the limit (m for displacements, s for a time-out).
    pub value: f32,
    /// The limit.
    pub limit: f32,
}

impl Limits {
    /// Checks that both limits are numbers above zero.
    ///
    /// # Errors
    /// Names the limit that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("limits.structure_m", f64::from(self.structure_m))?;
        positive("limits.base_m", f64::from(self.base_m))
    }

    /// The fault in this tick's samples, if there is one.
    #[must_use]
    pub fn check(&self, sensors: &Sensors, tick: u32) -> Option<Fault> {
        let (x, z) = (sensors.peak_x_m(), sensors.peak_z_m());
        let fault = |cause, value, limit| Some(Fault { cause, tick, value, limit });
        if !sensors.all_finite() {
            return fault(Cause::SensorInvalid, 0.0, 0.0);
        }
        if x >= self.structure_m {
            return fault(Cause::StructureDisplacement, x, self.structure_m);
        }
        if z >= self.base_m {
            return fault(Cause::BaseDisplacement, z, self.base_m);
        }
        None
    }
}
