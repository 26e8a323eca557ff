//! The dampers, experiments and values of a new file as arguments.

use clap::{Args, ValueEnum};
use damprig_core::model::Material;

use crate::cli::arguments::{not_negative, positive};
use crate::file_keys::new_file::{CaseValues, Excitation, MountedDamper, Sensors};

/// Dampers, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(super) enum DamperArg {
    /// No damper
    Bare,
    /// Single-particle impact damper
    Spid,
    /// Friction damper
    Fd,
    /// Impact and friction damper
    Hybrid,
    /// Tuned mass damper
    Tmd,
}

impl From<DamperArg> for MountedDamper {
    fn from(argument: DamperArg) -> Self {
        match argument {
            DamperArg::Bare => Self::Bare,
            DamperArg::Spid => Self::Spid,
            DamperArg::Fd => Self::Fd,
            DamperArg::Hybrid => Self::Hybrid,
            DamperArg::Tmd => Self::Tmd,
        }
    }
}

/// Experiments, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(super) enum ExperimentArg {
    /// One frequency after another; in a case a sine at resonance
    SteppedSine,
    /// The structure is released
    FreeVibration,
    /// A pulse of the base
    Impulse,
    /// Band-limited noise of the base
    Noise,
}

/// Materials of walls, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(super) enum WallArg {
    /// Steel on aluminium
    Steel,
    /// Rubber
    Rubber,
    /// Anti-vibration pad
    AntiVibrationPad,
    /// Acrylic foam
    AcrylicFoam,
    /// Polyurethane foam
    PuFoam,
}

/// e of steel on aluminium: table 3-2 of the source document.
const STEEL: f64 = 0.82;

impl WallArg {
    /// The material of a soft wall.
    fn soft(self) -> Option<Material> {
        match self {
            Self::Steel => None,
            Self::Rubber => Some(Material::Rubber),
            Self::AntiVibrationPad => Some(Material::AntiVibrationPad),
            Self::AcrylicFoam => Some(Material::AcrylicFoam),
            Self::PuFoam => Some(Material::PuFoam),
        }
    }
}

/// Simulated sensors, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(super) enum SensorsArg {
    /// No errors
    Ideal,
    /// The errors of a data sheet, and noise
    DataSheet,
}

impl From<ExperimentArg> for Excitation {
    fn from(argument: ExperimentArg) -> Self {
        match argument {
            ExperimentArg::SteppedSine => Self::SteppedSine,
            ExperimentArg::FreeVibration => Self::FreeVibration,
            ExperimentArg::Impulse => Self::Impulse,
            ExperimentArg::Noise => Self::Noise,
        }
    }
}

/// Values of structure and dampers.
#[derive(Clone, Debug, Default, PartialEq, Args)]
pub(super) struct ValueArgs {
    /// M, the structure's mass [default: 1.6]
    #[arg(long, value_name = "KG", value_parser = positive)]
    mass_kg: Option<f64>,

    /// fn, the natural frequency [default: 2.5]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    natural_frequency_hz: Option<f64>,

    /// ζ, the damping ratio [default: 0.0038]
    #[arg(long, value_name = "RATIO", value_parser = not_negative)]
    damping_ratio: Option<f64>,

    /// Z, the base amplitude [default: 0.0015]
    #[arg(long, value_name = "M", value_parser = positive)]
    base_amplitude_m: Option<f64>,

    /// m/M of particle and tuned mass [default: 0.1]
    #[arg(long, value_name = "RATIO", value_parser = positive)]
    mass_ratio: Option<f64>,

    /// d/Z of the particle [default: 5]
    #[arg(long, value_name = "RATIO", value_parser = positive)]
    clearance_ratio: Option<f64>,

    /// d of the particle, half of its free travel
    #[arg(long, value_name = "M", value_parser = positive, conflicts_with = "clearance_ratio")]
    clearance_m: Option<f64>,

    /// e, the coefficient of restitution of the walls [default: 0.47]
    #[arg(long, value_name = "E", value_parser = not_negative)]
    restitution: Option<f64>,

    /// Walls of this material: steel is hard with e = 0.82, the others are soft
    #[arg(long, value_name = "MATERIAL", conflicts_with = "restitution")]
    wall: Option<WallArg>,

    /// γF of the friction damper [default: 0.6]
    #[arg(long, value_name = "RATIO", value_parser = not_negative)]
    friction_ratio: Option<f64>,

    /// Friction dampers whose spring the rig adjusts to γF
    #[arg(long, conflicts_with = "case")]
    friction_spring: bool,

    /// Errors of a campaign's simulated sensors [default: steps of 10 µm and noise]
    #[arg(long, value_name = "KIND", conflicts_with = "case")]
    sensors: Option<SensorsArg>,
}

impl ValueArgs {
    /// The values of a new file.
    pub(super) fn values(&self) -> CaseValues {
        let default = CaseValues::default();
        CaseValues {
            mass_kg: self.mass_kg.unwrap_or(default.mass_kg),
            natural_frequency_hz: self.natural_frequency_hz.unwrap_or(default.natural_frequency_hz),
            damping_ratio: self.damping_ratio.unwrap_or(default.damping_ratio),
            base_amplitude_m: self.base_amplitude_m.unwrap_or(default.base_amplitude_m),
            fitted: default.fitted,
            mass_ratio: self.mass_ratio.unwrap_or(default.mass_ratio),
            clearance_ratio: self.clearance_ratio.unwrap_or(default.clearance_ratio),
            clearance_m: self.clearance_m,
            restitution: match self.wall {
                Some(WallArg::Steel) => STEEL,
                _ => self.restitution.unwrap_or(default.restitution),
            },
            wall: self.wall.and_then(WallArg::soft),
            friction_ratio: self.friction_ratio.unwrap_or(default.friction_ratio),
            has_spring: self.friction_spring,
            sensors: match self.sensors {
                None => default.sensors,
                Some(SensorsArg::Ideal) => Sensors::Ideal,
                Some(SensorsArg::DataSheet) => Sensors::DataSheet,
            },
            record: default.record,
        }
    }
}
