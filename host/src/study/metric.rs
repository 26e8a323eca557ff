//! What a study computes at each point.

use damprig_core::integrator::exact::{Excitation, Observer};

use crate::input::key::names;
use crate::simulation::Case;
use crate::simulation::analysis::{Analysis, MotionKind};

/// A result of one simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Metric {
    /// Mean of the cycle maxima over the reference length.
    XOverZ,
    /// Largest |x| over the reference length.
    MaxXOverZ,
    /// RMS of x over the reference length.
    RmsOverZ,
    /// Mean of the cycle maxima of |x|.
    MeanCycleMax,
    /// Largest |x|.
    MaxAbsX,
    /// Largest |x − z|.
    MaxAbsXMinusZ,
    /// RMS of x.
    RmsX,
    /// How much the largest cycle maximum is above their mean.
    CycleSpread,
    /// Impacts per cycle.
    ImpactsPerCycle,
    /// Largest force of a soft wall.
    PeakContactForce,
    /// Drive periods after which the motion repeats.
    Period,
    /// Magnitude of the largest Floquet multiplier.
    LargestMultiplier,
    /// Energy lost in a many-particle damper over 2π times the structure's.
    LossFactor,
    /// Share of the spheres' momentum that they have in common.
    CollectiveMotion,
}

/// Names of the metrics, in the order of [`Metric::ALL`].
pub const METRIC_NAMES: &[&str] = names!(Metric::ALL, metric => metric.name());

impl Metric {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::XOverZ,
        Self::MaxXOverZ,
        Self::RmsOverZ,
        Self::MeanCycleMax,
        Self::MaxAbsX,
        Self::MaxAbsXMinusZ,
        Self::RmsX,
        Self::CycleSpread,
        Self::ImpactsPerCycle,
        Self::PeakContactForce,
        Self::Period,
        Self::LargestMultiplier,
        Self::LossFactor,
        Self::CollectiveMotion,
    ];

    /// Name in study files and column in tables; its end is the unit.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::XOverZ => "x_over_z",
            Self::MaxXOverZ => "max_x_over_z",
            Self::RmsOverZ => "rms_over_z",
            Self::MeanCycleMax => "mean_cycle_max_m",
            Self::MaxAbsX => "max_abs_x_m",
            Self::MaxAbsXMinusZ => "max_abs_x_minus_z_m",
            Self::RmsX => "rms_x_m",
            Self::CycleSpread => "cycle_spread",
            Self::ImpactsPerCycle => "impacts_per_cycle",
            Self::PeakContactForce => "peak_contact_force_n",
            Self::Period => "period_cycles",
            Self::LargestMultiplier => "largest_multiplier",
            Self::LossFactor => "loss_factor",
            Self::CollectiveMotion => "collective_motion",
        }
    }

    /// Its meaning, in one line.
    #[must_use]
    pub const fn doc(self) -> &'static str {
        match self {
            Self::XOverZ => "X/Z: mean of the cycles' largest |x| over Z (P/k of a force, x0 of a free vibration)",
            Self::MaxXOverZ => "largest |x| over Z (P/k, x0)",
            Self::RmsOverZ => "RMS of x over Z (P/k, x0)",
            Self::MeanCycleMax => "mean of the cycles' largest |x|",
            Self::MaxAbsX => "largest |x|",
            Self::MaxAbsXMinusZ => "largest |x − z|",
            Self::RmsX => "RMS of x",
            Self::CycleSpread => "largest cycle maximum of |x| over their mean, minus 1: 0 if every cycle is the same",
            Self::ImpactsPerCycle => "impacts per cycle (first touches of soft walls)",
            Self::PeakContactForce => "largest force of a soft wall",
            Self::Period => "drive periods after which the motion repeats; missing if it does not within ten",
            Self::LargestMultiplier => {
                "magnitude of the largest Floquet multiplier of the periodic motion; below 1 it is stable"
            }
            Self::LossFactor => {
                "energy that the spheres lose in a cycle over 2π times the structure's largest kinetic energy in it"
            }
            Self::CollectiveMotion => "share of the spheres' momentum in the box that they have in common, 0 to 1",
        }
    }

    /// Whether it is a length over the case's reference length.
    #[must_use]
    pub const fn is_ratio(self) -> bool {
        matches!(self, Self::XOverZ | Self::MaxXOverZ | Self::RmsOverZ)
    }

    /// Its meaning for a case whose reference length has this symbol: `Z`, `(P/k)` or `x0`.
    #[must_use]
    pub fn meaning(self, reference: &str) -> String {
        match self {
            Self::XOverZ => format!("X/{reference}: mean of the cycles' largest |x| over {reference}"),
            Self::MaxXOverZ => format!("largest |x| over {reference}"),
            Self::RmsOverZ => format!("RMS of x over {reference}"),
            _ => self.doc().into(),
        }
    }

    /// Label of an axis or a colour scale. `reference` is the symbol of the reference length.
    #[must_use]
    pub fn label(self, reference: &str) -> String {
        let label = match self {
            Self::XOverZ => return format!("X/{reference} (cycle maxima)"),
            Self::MaxXOverZ => return format!("largest |x|/{reference}"),
            Self::RmsOverZ => return format!("RMS of x/{reference}"),
            Self::MeanCycleMax => "mean cycle maximum of |x| (m)",
            Self::MaxAbsX => "largest |x| (m)",
            Self::MaxAbsXMinusZ => "largest |x − z| (m)",
            Self::RmsX => "RMS of x (m)",
            Self::CycleSpread => "largest over mean cycle maximum − 1",
            Self::ImpactsPerCycle => "impacts per cycle",
            Self::PeakContactForce => "largest contact force (N)",
            Self::Period => "period (drive periods)",
            Self::LargestMultiplier => "largest multiplier",
            Self::LossFactor => "loss factor",
            Self::CollectiveMotion => "collective motion",
        };
        label.into()
    }

    /// Unit symbol; empty for a plain number.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::MeanCycleMax | Self::MaxAbsX | Self::MaxAbsXMinusZ | Self::RmsX => "m",
            Self::PeakContactForce => "N",
            Self::Period => "drive periods",
            _ => "",
        }
    }

    /// Whether it needs the analysis of the periodic motion, which costs more than the simulation itself.
    #[must_use]
    pub const fn needs_analysis(self) -> bool {
        matches!(self, Self::Period | Self::LargestMultiplier)
    }

    /// Whether it needs more than the cycle maxima and impacts: the mean square, x − z or contact forces.
    #[must_use]
    pub const fn needs_whole_run(self) -> bool {
        matches!(self, Self::RmsOverZ | Self::RmsX | Self::MaxAbsXMinusZ | Self::PeakContactForce)
    }

    /// Why a case cannot have it, if it cannot.
    #[must_use]
    pub fn refusal(self, case: &Case) -> Option<&'static str> {
        let is_sine = matches!(case.excitation, Excitation::Sine { .. });
        match self {
            Self::LossFactor | Self::CollectiveMotion if case.many_particles.is_none() => {
                Some("it is that of a many-particle damper; the case has no `many_particles`")
            }
            Self::Period | Self::LargestMultiplier if case.many_particles.is_some() => {
                Some("spheres in a box have no periodic motion whose every event is found exactly")
            }
            _ if self.is_ratio() && case.reference_m().is_none() => {
                Some("the case has neither Z nor x0; take `max_abs_x_m` or `rms_x_m`")
            }
            Self::ImpactsPerCycle if !case.has_impacts() => Some("the case has no particle"),
            Self::PeakContactForce if !case.set_up.has_soft_walls() => {
                Some("a hard wall's impact takes no time and has no finite force; give the walls `kind = \"voigt\"`")
            }
            Self::Period | Self::LargestMultiplier if !is_sine => Some("only a sine of the base has periodic motions"),
            Self::Period | Self::LargestMultiplier if case.set_up.particle.is_none() => {
                Some("it is that of an impact damper's motion; the case has no particle")
            }
            Self::XOverZ | Self::MeanCycleMax | Self::CycleSpread if case.record.is_some() => {
                Some("a record has no cycles; take `max_abs_x_m` or `rms_x_m`")
            }
            _ => None,
        }
    }
}

/// Results of the counted part of one simulation; not a number where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Mean of the cycles' largest |x|, m.
    pub mean_cycle_max_m: f64,
    /// Largest of them, m.
    pub largest_cycle_max_m: f64,
    /// Largest |x|, m.
    pub max_abs_x_m: f64,
    /// Largest |x − z|, m.
    pub max_abs_x_minus_z_m: f64,
    /// RMS of x, m.
    pub rms_x_m: f64,
    /// Impacts.
    pub impacts: f64,
    /// Counted cycles, with their fraction.
    pub cycles: f64,
    /// Largest force of a soft wall, N.
    pub peak_contact_force_n: f64,
    /// Loss factor of a many-particle damper.
    pub loss_factor: f64,
    /// Collective motion of its spheres.
    pub collective_motion: f64,
}

/// Period and largest multiplier of a case's motion after its transient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Periodicity {
    /// Drive periods after which it repeats.
    pub period_cycles: f64,
    /// Magnitude of the largest multiplier that is not neutral.
    pub largest_multiplier: f64,
}

impl Periodicity {
    /// Of a case; not a number where the motion does not repeat. `watch` sees the transient.
    pub fn of(case: &Case, watch: &mut impl Observer) -> Self {
        let driven = Analysis::watched(case, watch).and_then(|analysis| analysis.driven);
        let periodic = driven.filter(|driven| driven.motion == MotionKind::Periodic);
        let periods = periodic.as_ref().and_then(|driven| driven.repeats_after);
        let orbit = periodic.as_ref().and_then(|driven| driven.orbit.as_ref());
        // Of a particle that no impact reaches, neutral ones say nothing about the motion.
        let largest = orbit.and_then(|orbit| {
            let mut own = orbit.multipliers.iter().zip(&orbit.neutral).filter(|(_, is_neutral)| !**is_neutral);
            own.next().map(|([re, im], _)| re.hypot(*im))
        });
        Self {
            period_cycles: periods.map_or(f64::NAN, |periods| periods as f64),
            largest_multiplier: largest.unwrap_or(f64::NAN),
        }
    }
}

impl Metric {
    /// Its value, not a number if there is none. `reference_m`: Z, P/k or x0.
    #[must_use]
    pub fn value(self, figures: &Figures, reference_m: f64, periodicity: Option<&Periodicity>) -> f64 {
        match self {
            Self::XOverZ => figures.mean_cycle_max_m / reference_m,
            Self::MaxXOverZ => figures.max_abs_x_m / reference_m,
            Self::RmsOverZ => figures.rms_x_m / reference_m,
            Self::MeanCycleMax => figures.mean_cycle_max_m,
            Self::MaxAbsX => figures.max_abs_x_m,
            Self::MaxAbsXMinusZ => figures.max_abs_x_minus_z_m,
            Self::RmsX => figures.rms_x_m,
            Self::CycleSpread => figures.largest_cycle_max_m / figures.mean_cycle_max_m - 1.0,
            Self::ImpactsPerCycle => figures.impacts / figures.cycles,
            Self::PeakContactForce => figures.peak_contact_force_n,
            Self::Period => periodicity.map_or(f64::NAN, |found| found.period_cycles),
            Self::LossFactor => figures.loss_factor,
            Self::CollectiveMotion => figures.collective_motion,
            Self::LargestMultiplier => periodicity.map_or(f64::NAN, |found| found.largest_multiplier),
        }
    }
}
