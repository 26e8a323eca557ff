//! Configuration of an electrodynamic shaker that feels its load.
//!
//! ```text
//! m z″ + c z′ + k z = Bl·i + reaction,   voltage mode: i = (u − Bl z′)/R,   current mode: i is the demand
//! ```
//! In voltage mode the back-emf damps the table by (Bl)²/R. Far above its suspension's frequency the shaker is
//! therefore a source of *velocity* with a finite resistance: a structure at resonance reduces its amplitude. The
//! coil's inductance is neglected: L/R of such coils is of the order of 1 ms, a phase error of 2 % at 3 Hz.
//! [`super::table`] computes the table's motion.

use core::f64::consts::TAU;
use damprig_core::io::{Invalid, not_negative, positive};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The quantity that the amplifier controls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Amplifier {
    /// The coil's voltage.
    Voltage {
        /// Resistance R of coil and leads, Ω; greater than 0.
        coil_resistance_ohm: f64,
        /// Limit of the voltage's magnitude, V; greater than 0.
        limit_v: f64,
    },
    /// The coil's current.
    Current,
}

/// The shaker.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Shaker {
    /// Mass of armature, table and fixture, kg; greater than 0.
    pub moving_mass_kg: f64,
    /// Stiffness of the table's suspension, N/m; 0 or greater.
    pub suspension_stiffness_n_per_m: f64,
    /// Damping of the table's suspension, without the back-emf, N·s/m; 0 or greater.
    pub suspension_damping_n_s_per_m: f64,
    /// Force factor Bl, N/A (equal to V·s/m); greater than 0.
    pub force_factor_n_per_a: f64,
    /// The amplifier.
    pub amplifier: Amplifier,
    /// Limit of the magnitude of the coil's current, A; greater than 0. It limits the force to Bl times this value.
    pub current_limit_a: f64,
    /// The table's travel is limited to ± this, m; it stops at either end without rebound. Greater than 0.
    pub half_stroke_m: f64,
    /// Calibration frequency, Hz; greater than 0. The drive's gain is set so that the table *without load* moves by
    /// the demanded amplitude at this frequency.
    pub calibrated_at_hz: f64,
}

impl Default for Shaker {
    /// Assumed values of the size of a long-stroke seismic shaker (135 N, 158 mm peak to peak) with a light slip
    /// table; the source document does not describe its shaker.
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
    /// Names the first value that is not.
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

    /// Back-emf damping (Bl)²/R in voltage mode, N·s/m; 0 in current mode.
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

    /// Calibration: force on the blocked table per demanded displacement, N/m.
    #[must_use]
    pub fn force_per_drive_n_per_m(&self) -> f64 {
        let (re, im) = self.dynamic_stiffness_n_per_m(TAU * self.calibrated_at_hz);
        libm::sqrt(re * re + im * im)
    }

    /// Largest force on the blocked table, N, limited by the amplifier's voltage or current.
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
