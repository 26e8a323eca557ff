//! An electrodynamic shaker that feels its load: what it is made of.
//!
//! ```text
//! m z″ + c z′ + k z = Bl·i + reaction,   voltage mode: i = (u − Bl z′)/R,   current mode: i is the demand
//! ```
//! In voltage mode the back-emf damps the table by (Bl)²/R, so far above its suspension's frequency the shaker is a
//! source of *velocity* with a finite resistance: a structure at resonance pulls it down. The coil's inductance is left
//! out: L/R of such coils is of the order of 1 ms, 2 % of phase at 3 Hz. How the table moves is
//! [`super::table`]'s business.

use core::f64::consts::TAU;
use damprig_core::io::{Invalid, not_negative, positive};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// What the amplifier holds to its input.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Amplifier {
    /// The coil's voltage.
    Voltage {
        /// R of coil and leads, Ω; greater than 0.
        coil_resistance_ohm: f64,
        /// The voltage stops at ± this, V; greater than 0.
        limit_v: f64,
    },
    /// The coil's current.
    Current,
}

/// The shaker.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Shaker {
    /// Armature, table and fixture, kg; greater than 0.
    pub moving_mass_kg: f64,
    /// Of the table's suspension, N/m; 0 or greater.
    pub suspension_stiffness_n_per_m: f64,
    /// Of the table's suspension, without the coil's share, N·s/m; 0 or greater.
    pub suspension_damping_n_s_per_m: f64,
    /// Bl, N/A (which is V·s/m); greater than 0.
    pub force_factor_n_per_a: f64,
    /// The amplifier.
    pub amplifier: Amplifier,
    /// The coil's current stops at ± this, A, so the force at Bl times this; greater than 0.
    pub current_limit_a: f64,
    /// The table travels within ± this, m, and stops at either end without bounce; greater than 0.
    pub half_stroke_m: f64,
    /// The drive's gain is set so that the table *without load* moves by the demanded amplitude at this frequency, Hz;
    /// greater than 0.
    pub calibrated_at_hz: f64,
}

impl Default for Shaker {
    /// Assumed values of the size of a long-stroke seismic shaker (135 N, 158 mm peak to peak) with a light slip
    /// table; the source document does not give its own.
    fn default() -> Self {
        Self {
            moving_mass_kg: 5.0,
            suspension_stiffness_n_per_m: 200.0,
            suspension_damping_n_s_per_m: 5.0,
            force_factor_n_per_a: 30.0,
            amplifier: Amplifier::Voltage { coil_resistance_ohm: 1.5, limit_v: 20.0 },
            current_limit_a: 4.5,
            half_stroke_m: 0.079,
            calibrated_at_hz: 2.5,
        }
    }
}

impl Shaker {
    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        positive("shaker.moving_mass_kg", self.moving_mass_kg)?;
        not_negative("shaker.suspension_stiffness_n_per_m", self.suspension_stiffness_n_per_m)?;
        not_negative("shaker.suspension_damping_n_s_per_m", self.suspension_damping_n_s_per_m)?;
        positive("shaker.force_factor_n_per_a", self.force_factor_n_per_a)?;
        if let Amplifier::Voltage { coil_resistance_ohm, limit_v } = self.amplifier {
            positive("shaker.coil_resistance_ohm", coil_resistance_ohm)?;
            positive("shaker.limit_v", limit_v)?;
        }
        positive("shaker.current_limit_a", self.current_limit_a)?;
        positive("shaker.half_stroke_m", self.half_stroke_m)?;
        positive("shaker.calibrated_at_hz", self.calibrated_at_hz)
    }

    /// (Bl)²/R of the coil in voltage mode, N·s/m; 0 in current mode.
    #[must_use]
    pub fn back_emf_damping_n_s_per_m(&self) -> f64 {
        match self.amplifier {
            Amplifier::Voltage { coil_resistance_ohm, .. } => {
                self.force_factor_n_per_a * self.force_factor_n_per_a / coil_resistance_ohm
            }
            Amplifier::Current => 0.0,
        }
    }

    /// Real and imaginary part of the force per displacement of the table without load at ω (rad/s), N/m:
    /// k − mω² + jω(c + (Bl)²/R).
    #[must_use]
    pub fn dynamic_stiffness_n_per_m(&self, omega: f64) -> (f64, f64) {
        let damping = self.suspension_damping_n_s_per_m + self.back_emf_damping_n_s_per_m();
        (self.suspension_stiffness_n_per_m - self.moving_mass_kg * omega * omega, omega * damping)
    }

    /// Force on the blocked table per demanded displacement, N/m: the calibration.
    #[must_use]
    pub fn force_per_drive_n_per_m(&self) -> f64 {
        let (re, im) = self.dynamic_stiffness_n_per_m(TAU * self.calibrated_at_hz);
        libm::sqrt(re * re + im * im)
    }

    /// Largest force of the blocked table, N: what the amplifier's voltage or current allows.
    #[must_use]
    pub fn blocked_force_limit_n(&self) -> f64 {
        let by_current = self.force_factor_n_per_a * self.current_limit_a;
        match self.amplifier {
            Amplifier::Voltage { coil_resistance_ohm, limit_v } => {
                by_current.min(self.force_factor_n_per_a * limit_v / coil_resistance_ohm)
            }
            Amplifier::Current => by_current,
        }
    }
}
