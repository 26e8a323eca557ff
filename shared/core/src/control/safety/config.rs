//! Settings of the interlocks and their permitted ranges.

use crate::io::{Invalid, not_negative, positive, require};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Displacement limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Limits {
    /// Limit of |x| of the structure, m; inside the sensor's usable span.
    pub structure_m: f32,
    /// Limit of |z| of the base, m; inside the sensor's usable span.
    pub base_m: f32,
}

impl Default for Limits {
    /// Inside the usable span of ±78.4 mm of the source document's lasers, which read ±80 mm.
    fn default() -> Self {
        Self { structure_m: 0.078, base_m: 0.078 }
    }
}

impl Limits {
    /// Checks that both limits are finite numbers above zero.
    ///
    /// # Errors
    /// Names the first limit that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("safety.limits.structure_m", f64::from(self.structure_m))?;
        positive("safety.limits.base_m", f64::from(self.base_m))
    }
}

/// Shortest time after which a sensor may count as frozen, s. A record counts as moving for 0.25 s after its last visible
/// change, in which the sensors may rightly stand still.
pub const MIN_FROZEN_S: f32 = 0.3;

/// The settings of the interlocks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SafetyConfig {
    /// The displacement limits.
    pub limits: Limits,
    /// Number of half-cycles by which the structure's amplitude is predicted; 0 to 20, 0 for no prediction.
    pub half_cycles_ahead: f32,
    /// Smallest displacement that both sensors resolve, m. With a drive of less than five times this the frozen-sensor
    /// check is off.
    pub resolution_m: f32,
    /// Time of identical samples, while driven, after which a sensor counts as frozen, s; 0.3 or more; at
    /// least half a period of the drive is used; 0 for never.
    pub frozen_s: f32,
    /// Limit of the force on a wall, N.
    pub wall_force_n: f32,
    /// Longest time for which the drive may be saturated, s. With 0, saturation is reported with the result and does
    /// not end the drive.
    pub saturated_s: f32,
    /// Longest time without a message from the host before the drive ends, s; 0 for no limit.
    pub host_silent_s: f32,
    /// |x| below which a restart is permitted, m.
    pub restart_m: f32,
    /// Normal force of the friction damper used as a brake, N; 0 for no brake.
    pub brake_n: f32,
}

impl Default for SafetyConfig {
    /// Inside the usable span of the lasers (±78.4 mm, 10 µm resolution assumed) and of an assumed wall sensor (455 N).
    fn default() -> Self {
        Self {
            limits: Limits::default(),
            half_cycles_ahead: 6.0,
            resolution_m: 1e-5,
            frozen_s: 0.5,
            wall_force_n: 450.0,
            saturated_s: 0.0,
            host_silent_s: 10.0,
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
        for (name, value) in [("safety.wall_force_n", self.wall_force_n), ("safety.restart_m", self.restart_m)] {
            positive(name, f64::from(value))?;
        }
        for (name, value) in [
            ("safety.resolution_m", self.resolution_m),
            ("safety.frozen_s", self.frozen_s),
            ("safety.saturated_s", self.saturated_s),
            ("safety.host_silent_s", self.host_silent_s),
            ("safety.brake_n", self.brake_n),
            ("safety.half_cycles_ahead", self.half_cycles_ahead),
        ] {
            not_negative(name, f64::from(value))?;
        }
        let (ahead, restart) = (f64::from(self.half_cycles_ahead), f64::from(self.restart_m));
        let is_long_enough = self.frozen_s == 0.0 || self.frozen_s >= MIN_FROZEN_S;
        require(is_long_enough, "safety.frozen_s", f64::from(self.frozen_s), "0 for never, or 0.3 or more")?;
        require(self.half_cycles_ahead <= 20.0, "safety.half_cycles_ahead", ahead, "from 0 to 20")?;
        require(
            self.restart_m < self.limits.structure_m,
            "safety.restart_m",
            restart,
            "below safety.limits.structure_m",
        )
    }
}
