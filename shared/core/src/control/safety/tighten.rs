//! Limits of one experiment: each may tighten a limit of the board, none may loosen one.
//!
//! The board's [`SafetyConfig`] is the base. An experiment states some of the [`ExperimentLimits`].
//! [`SafetyConfig::tightened`] merges them and rejects a value that is looser than the board's. The sensor checks
//! (`frozen_s`, `resolution_m`, the sensor range) and the rest level after a fault are set by the board alone.

use super::SafetyConfig;
use crate::io::Invalid;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Limits that an experiment states; `None` keeps the board's limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ExperimentLimits {
    /// Largest |x| of the structure, m; at most the board's.
    pub structure_m: Option<f32>,
    /// Largest |z| of the base, m; at most the board's.
    pub base_m: Option<f32>,
    /// Number of half-cycles by which the structure's amplitude is predicted; at least the board's.
    pub half_cycles_ahead: Option<f32>,
    /// Largest force on a wall, N; at most the board's.
    pub wall_force_n: Option<f32>,
    /// Longest time for which the drive may be saturated, s; greater than 0, at most the board's unless that is 0 (no
    /// limit).
    pub saturated_s: Option<f32>,
    /// Longest time without a message from the host, s; greater than 0, at most the board's unless that is 0 (no
    /// limit).
    pub host_silent_s: Option<f32>,
    /// Normal force of the friction damper used as a brake, N; at least the board's.
    pub brake_n: Option<f32>,
}

/// A limit of an experiment that is looser than the board's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Looser {
    /// The board's setting.
    pub setting: &'static str,
    /// The value that the experiment states.
    pub value: f32,
    /// The board's value.
    pub board: f32,
}

/// Why the limits of an experiment were rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LimitsRejected {
    /// A limit is looser than the board's.
    Looser(Looser),
    /// A limit is out of range.
    Invalid(Invalid),
}

impl From<Invalid> for LimitsRejected {
    fn from(invalid: Invalid) -> Self {
        Self::Invalid(invalid)
    }
}

/// The direction in which a limit becomes tighter.
#[derive(Clone, Copy)]
enum Tighter {
    Smaller,
    Larger,
    /// Smaller is tighter, and 0 switches the limit off.
    SmallerNotOff,
}

impl Tighter {
    /// The value is looser than the board's. NaN is always looser.
    fn is_looser(self, value: f32, board: f32) -> bool {
        let holds = match self {
            Self::Smaller => value <= board,
            Self::Larger => value >= board,
            Self::SmallerNotOff => value == board || value > 0.0 && (board == 0.0 || value < board),
        };
        !holds
    }
}

impl SafetyConfig {
    /// These settings with the limits that an experiment states.
    ///
    /// # Errors
    /// The first limit that is looser than in these settings, with both values; otherwise the first limit that is out
    /// of range.
    pub fn tightened(&self, limits: &ExperimentLimits) -> Result<Self, LimitsRejected> {
        let mut acting = *self;
        let SafetyConfig { limits: own, half_cycles_ahead, wall_force_n, saturated_s, host_silent_s, brake_n, .. } =
            &mut acting;
        for (setting, board, stated, tighter) in [
            ("safety.limits.structure_m", &mut own.structure_m, limits.structure_m, Tighter::Smaller),
            ("safety.limits.base_m", &mut own.base_m, limits.base_m, Tighter::Smaller),
            ("safety.half_cycles_ahead", half_cycles_ahead, limits.half_cycles_ahead, Tighter::Larger),
            ("safety.wall_force_n", wall_force_n, limits.wall_force_n, Tighter::Smaller),
            ("safety.saturated_s", saturated_s, limits.saturated_s, Tighter::SmallerNotOff),
            ("safety.host_silent_s", host_silent_s, limits.host_silent_s, Tighter::SmallerNotOff),
            ("safety.brake_n", brake_n, limits.brake_n, Tighter::Larger),
        ] {
            let Some(value) = stated else { continue };
            if tighter.is_looser(value, *board) {
                return Err(LimitsRejected::Looser(Looser { setting, value, board: *board }));
            }
            *board = value;
        }
        acting.validate()?;
        Ok(acting)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::safety::Limits;

    fn settings() -> SafetyConfig {
        SafetyConfig {
            limits: Limits { structure_m: 0.08, base_m: 0.05 },
            half_cycles_ahead: 6.0,
            wall_force_n: 300.0,
            saturated_s: 0.0,
            host_silent_s: 10.0,
            brake_n: 2.0,
            ..SafetyConfig::default()
        }
    }

    fn some(value: f32) -> Option<f32> {
        Some(value)
    }

    #[test]
    fn stated_limits_are_in_force_and_the_others_stay_the_boards() {
        assert_eq!(settings().tightened(&ExperimentLimits::default()), Ok(settings()));
        let limits = ExperimentLimits {
            structure_m: some(0.02),
            half_cycles_ahead: some(8.0),
            saturated_s: some(1.0),
            host_silent_s: some(5.0),
            brake_n: some(2.0),
            ..ExperimentLimits::default()
        };
        let acting = settings().tightened(&limits).unwrap();
        assert_eq!((acting.limits.structure_m, acting.limits.base_m), (0.02, 0.05));
        assert_eq!((acting.half_cycles_ahead, acting.saturated_s, acting.host_silent_s), (8.0, 1.0, 5.0));
        assert_eq!((acting.wall_force_n, acting.brake_n), (300.0, 2.0));
    }

    #[test]
    fn a_looser_limit_is_rejected_with_both_values() {
        let none = ExperimentLimits::default();
        for (limits, setting, value, board) in [
            (ExperimentLimits { structure_m: some(0.081), ..none }, "safety.limits.structure_m", 0.081, 0.08),
            (ExperimentLimits { base_m: some(0.08), ..none }, "safety.limits.base_m", 0.08, 0.05),
            (ExperimentLimits { half_cycles_ahead: some(0.0), ..none }, "safety.half_cycles_ahead", 0.0, 6.0),
            (ExperimentLimits { wall_force_n: some(450.0), ..none }, "safety.wall_force_n", 450.0, 300.0),
            (ExperimentLimits { host_silent_s: some(0.0), ..none }, "safety.host_silent_s", 0.0, 10.0),
            (ExperimentLimits { host_silent_s: some(11.0), ..none }, "safety.host_silent_s", 11.0, 10.0),
            (ExperimentLimits { brake_n: some(1.0), ..none }, "safety.brake_n", 1.0, 2.0),
        ] {
            let looser = Looser { setting, value, board };
            assert_eq!(settings().tightened(&limits), Err(LimitsRejected::Looser(looser)));
        }
        let nan = ExperimentLimits { wall_force_n: some(f32::NAN), ..none };
        assert!(matches!(settings().tightened(&nan), Err(LimitsRejected::Looser(_))));
    }

    #[test]
    fn a_limit_out_of_range_is_named() {
        let none = ExperimentLimits::default();
        for (limits, parameter) in [
            (ExperimentLimits { base_m: some(-1.0), ..none }, "safety.limits.base_m"),
            (ExperimentLimits { half_cycles_ahead: some(21.0), ..none }, "safety.half_cycles_ahead"),
            // Below the rest level the rig could never start again.
            (ExperimentLimits { structure_m: some(1e-3), ..none }, "safety.restart_m"),
        ] {
            let Err(LimitsRejected::Invalid(invalid)) = settings().tightened(&limits) else { panic!("{limits:?}") };
            assert_eq!(invalid.parameter, parameter);
        }
    }
}
