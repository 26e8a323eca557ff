//! The displacement limits, and the record of what ended a drive. Who watches them is [`super::safety`].

use super::safety::Danger;
use crate::io::{Invalid, positive};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Displacements that must not be reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Limits {
    /// Largest |x| of the structure, m; inside the sensor's usable span.
    pub structure_m: f32,
    /// Largest |z| of the base, m; inside the sensor's usable span.
    pub base_m: f32,
}

impl Default for Limits {
    /// Inside the usable ±78.4 mm of the source document's lasers, which read ±80 mm.
    fn default() -> Self {
        Self { structure_m: 0.078, base_m: 0.078 }
    }
}

/// A latched fault: it stays until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Fault {
    /// What happened.
    pub cause: Danger,
    /// The tick it happened in.
    pub tick: u32,
    /// The value that broke the limit, in the danger's unit.
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
}
