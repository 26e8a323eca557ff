//! Constants of a friction-damper drive. They are checked once and stay constant while the drive works.

use crate::io::{Invalid, TICK_HZ, not_negative, positive, require};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most steps in one tick that are requested of a board's pulse timer.
pub const MAX_STEPS_PER_TICK: u8 = 16;

/// Targets may reach this part of [`SpringConfig::largest_force_n`]. The rest is a margin in which the force may vary
/// before it is a fault.
pub const WORKING_PART: f32 = 0.9;

/// Constants of the stepper, screw, spring and force sensor. Positions count from the limit switch towards the
/// structure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SpringConfig {
    /// Travel of the block's seat per motor step, m.
    pub step_m: f32,
    /// Farthest position from the limit switch, m.
    pub travel_m: f32,
    /// Position of the seat when the block is released, m from the limit switch.
    pub back_off_m: f32,
    /// Highest rate, steps/s; at most [`MAX_STEPS_PER_TICK`] per tick.
    pub rate_hz: f32,
    /// Rate of the searches for the switch and for the touch, steps/s: low enough for the motor to stop at once.
    pub search_rate_hz: f32,
    /// Change of the rate, steps/s²; at least 16.
    pub acceleration_hz_per_s: f32,
    /// Nominal k_s of the spring, N/m; the touch-off measures the actual value.
    pub stiffness_n_per_m: f32,
    /// μ_e between block and structure.
    pub friction_coefficient: f32,
    /// k of the structure, N/m, for friction ratios.
    pub structure_stiffness_n_per_m: f32,
    /// Rise of the force that counts as a touch, N: well above the noise of a tick's mean.
    pub touch_force_n: f32,
    /// Further rise of the force over which the touch-off measures the spring, N.
    pub touch_span_n: f32,
    /// Force errors up to this are not corrected, N; at least the force of one step.
    pub dead_band_n: f32,
    /// Limit of the force, N; inside the force sensor's usable span.
    pub largest_force_n: f32,
    /// Largest deviation of a settled force from the spring's line, N. A larger one is a stall or a slipped block.
    pub follow_tolerance_n: f32,
    /// Time from the end of a move until the force is used, s.
    pub settle_s: f32,
    /// Time over which a force is averaged, s.
    pub average_s: f32,
    /// Limit of |x| for a quiet structure, m. No step towards the structure and no correction is made within half a
    /// second of |x| above it. 0 switches the check off.
    pub quiet_m: f32,
}

impl Default for SpringConfig {
    /// Assumed, because the source document specifies neither spring nor screw: 200 steps per turn of a 1 mm screw and
    /// a spring of 500 N/m. They give γF = 0.6 at Z = 3 mm (2.4 N with μe = 0.3) after 4.7 mm. Structure: 1.6 kg at 2.5
    /// Hz.
    fn default() -> Self {
        Self {
            step_m: 5e-6,
            travel_m: 0.04,
            back_off_m: 1e-3,
            rate_hz: 1000.0,
            search_rate_hz: 400.0,
            acceleration_hz_per_s: 4000.0,
            stiffness_n_per_m: 500.0,
            friction_coefficient: 0.3,
            structure_stiffness_n_per_m: 394.78,
            touch_force_n: 0.1,
            touch_span_n: 1.0,
            dead_band_n: 0.02,
            largest_force_n: 15.0,
            follow_tolerance_n: 0.5,
            settle_s: 0.05,
            average_s: 0.1,
            quiet_m: 0.0,
        }
    }
}

/// Properties of spring, block and structure that a set-up describes. Everything else, limits included, is set by the
/// board alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SpringSetUp {
    /// k_s of the spring, N/m; `None` for the board's.
    pub stiffness_n_per_m: Option<f32>,
    /// μ_e between block and structure; `None` for the board's.
    pub friction_coefficient: Option<f32>,
    /// k of the structure, N/m.
    pub structure_stiffness_n_per_m: f32,
}

impl SpringConfig {
    /// These settings with the set-up's properties.
    #[must_use]
    pub fn for_set_up(&self, set_up: &SpringSetUp) -> Self {
        Self {
            stiffness_n_per_m: set_up.stiffness_n_per_m.unwrap_or(self.stiffness_n_per_m),
            friction_coefficient: set_up.friction_coefficient.unwrap_or(self.friction_coefficient),
            structure_stiffness_n_per_m: set_up.structure_stiffness_n_per_m,
            ..*self
        }
    }

    /// Checks every value, and the relations between values.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), Invalid> {
        for (name, value) in [
            ("spring.step_m", self.step_m),
            ("spring.travel_m", self.travel_m),
            ("spring.back_off_m", self.back_off_m),
            ("spring.rate_hz", self.rate_hz),
            ("spring.search_rate_hz", self.search_rate_hz),
            ("spring.acceleration_hz_per_s", self.acceleration_hz_per_s),
            ("spring.stiffness_n_per_m", self.stiffness_n_per_m),
            ("spring.friction_coefficient", self.friction_coefficient),
            ("spring.structure_stiffness_n_per_m", self.structure_stiffness_n_per_m),
            ("spring.touch_force_n", self.touch_force_n),
            ("spring.touch_span_n", self.touch_span_n),
            ("spring.dead_band_n", self.dead_band_n),
            ("spring.largest_force_n", self.largest_force_n),
            ("spring.follow_tolerance_n", self.follow_tolerance_n),
            ("spring.settle_s", self.settle_s),
            ("spring.average_s", self.average_s),
        ] {
            positive(name, f64::from(value))?;
        }
        not_negative("spring.quiet_m", f64::from(self.quiet_m))?;
        let ask = |ok, name, value: f32, allowed| require(ok, name, f64::from(value), allowed);
        ask(
            self.travel_m / self.step_m <= 1e6,
            "spring.step_m",
            self.step_m,
            "at least a millionth of spring.travel_m",
        )?;
        ask(self.back_off_m < self.travel_m, "spring.back_off_m", self.back_off_m, "below spring.travel_m")?;
        ask(
            self.rate_hz <= f32::from(MAX_STEPS_PER_TICK) * TICK_HZ,
            "spring.rate_hz",
            self.rate_hz,
            "at most 16 steps per tick (16 000 per second)",
        )?;
        ask(
            self.search_rate_hz <= self.rate_hz,
            "spring.search_rate_hz",
            self.search_rate_hz,
            "at most spring.rate_hz",
        )?;
        ask(
            (16.0..=1e7).contains(&self.acceleration_hz_per_s),
            "spring.acceleration_hz_per_s",
            self.acceleration_hz_per_s,
            "from 16 to 10⁷ steps/s²",
        )?;
        ask(
            self.dead_band_n >= self.step_m * self.stiffness_n_per_m,
            "spring.dead_band_n",
            self.dead_band_n,
            "at least spring.step_m × spring.stiffness_n_per_m, the force of one step",
        )?;
        ask(
            self.follow_tolerance_n > self.dead_band_n,
            "spring.follow_tolerance_n",
            self.follow_tolerance_n,
            "above spring.dead_band_n",
        )?;
        // The touch is detected three ticks late, the ramp then takes v²/2a to stop, and the spring may be twice as
        // stiff.
        let stop_steps = self.search_rate_hz * (self.search_rate_hz / (2.0 * self.acceleration_hz_per_s) + 0.005);
        let overshoot = 2.0 * stop_steps * self.step_m * self.stiffness_n_per_m;
        ask(
            self.touch_force_n + 2.0 * self.touch_span_n + overshoot < self.largest_force_n,
            "spring.touch_span_n",
            self.touch_span_n,
            "small enough for a touch at spring.search_rate_hz to stay below spring.largest_force_n",
        )?;
        // From the touch to the last reading the seat compresses the spring, which may be half as stiff.
        let climb_m = 2.0 * (self.touch_force_n + self.touch_span_n) / self.stiffness_n_per_m;
        ask(
            climb_m < self.travel_m - self.back_off_m,
            "spring.stiffness_n_per_m",
            self.stiffness_n_per_m,
            "high enough for a touch-off within spring.travel_m (spring.touch_force_n and spring.touch_span_n)",
        )?;
        for (name, value) in [("spring.settle_s", self.settle_s), ("spring.average_s", self.average_s)] {
            ask((1.0 / TICK_HZ..=10.0).contains(&value), name, value, "from one tick to 10 s")?;
        }
        Ok(())
    }

    /// The largest force that a target may demand, N.
    #[must_use]
    pub fn working_force_n(&self) -> f32 {
        WORKING_PART * self.largest_force_n
    }

    /// The normal force of a friction ratio at base amplitude Z: F_N = γF k Z/μe, N.
    #[must_use]
    pub fn force_of_ratio_n(&self, ratio: f32, base_amplitude_m: f32) -> f32 {
        ratio * self.structure_stiffness_n_per_m * base_amplitude_m / self.friction_coefficient
    }

    /// The nearest number of whole steps to a length, within ±10⁶.
    pub(super) fn steps(&self, length_m: f32) -> i32 {
        nearest(length_m / self.step_m)
    }

    /// The nearest number of whole ticks to a time, at least one.
    pub(super) fn ticks(seconds: f32) -> u32 {
        nearest(seconds * TICK_HZ).max(1) as u32
    }
}

/// The nearest integer, within ±10⁶; 0 for NaN.
pub(super) fn nearest(value: f32) -> i32 {
    let value = if value < 0.0 { value - 0.5 } else { value + 0.5 };
    // A cast saturates and turns NaN into 0.
    (value as i32).clamp(-1_000_000, 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_valid_and_give_the_documented_force() {
        let config = SpringConfig::default();
        config.validate().unwrap();
        assert!((config.force_of_ratio_n(0.6, 3e-3) - 2.37).abs() < 0.01);
    }

    #[test]
    fn every_invalid_value_is_rejected_by_name() {
        let good = SpringConfig::default();
        for (bad, name) in [
            (SpringConfig { step_m: 0.0, ..good }, "spring.step_m"),
            (SpringConfig { step_m: f32::NAN, ..good }, "spring.step_m"),
            (SpringConfig { step_m: 1e-9, ..good }, "spring.step_m"),
            (SpringConfig { rate_hz: 16_001.0, ..good }, "spring.rate_hz"),
            (SpringConfig { search_rate_hz: 1001.0, ..good }, "spring.search_rate_hz"),
            (SpringConfig { acceleration_hz_per_s: 10.0, ..good }, "spring.acceleration_hz_per_s"),
            (SpringConfig { back_off_m: 0.05, ..good }, "spring.back_off_m"),
            (SpringConfig { dead_band_n: 1e-3, ..good }, "spring.dead_band_n"),
            (SpringConfig { follow_tolerance_n: 0.01, ..good }, "spring.follow_tolerance_n"),
            (SpringConfig { touch_span_n: 8.0, ..good }, "spring.touch_span_n"),
            (SpringConfig { stiffness_n_per_m: 50.0, ..good }, "spring.stiffness_n_per_m"),
            (SpringConfig { average_s: 11.0, ..good }, "spring.average_s"),
            (SpringConfig { quiet_m: -1.0, ..good }, "spring.quiet_m"),
        ] {
            assert_eq!(bad.validate().unwrap_err().parameter, name);
        }
    }
}
