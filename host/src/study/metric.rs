//! The quantities that a study computes at each point, and what each needs.

use damprig_core::integrator::exact::Excitation;

use crate::input::key::names;
use crate::quantity::Quantity;
use crate::simulation::Case;
use crate::simulation::analysis::{ForcedResponse, MotionKind};
use crate::simulation::many_particles::SpheresFigures;
use crate::simulation::result::Summary;
use crate::simulation::wall_force;

/// The metrics of a study, as keys list them.
pub const METRICS: [Quantity; 15] = [
    Quantity::XOverZ,
    Quantity::MaxXOverZ,
    Quantity::RmsOverZ,
    Quantity::MeanCycleMaxM,
    Quantity::MaxAbsXM,
    Quantity::MaxAbsXMinusZM,
    Quantity::RmsXM,
    Quantity::CycleSpread,
    Quantity::ImpactsPerCycle,
    Quantity::PeakContactForceN,
    Quantity::HarvestedPowerW,
    Quantity::PeriodCycles,
    Quantity::LargestMultiplier,
    Quantity::LossFactor,
    Quantity::CollectiveMotion,
];

/// Their names, in the same order.
pub const METRIC_NAMES: &[&str] = names!(METRICS, metric => metric.name());

/// Whether a metric needs the analysis of the periodic motion, which costs more than the simulation itself.
#[must_use]
pub const fn needs_analysis(metric: Quantity) -> bool {
    matches!(metric, Quantity::PeriodCycles | Quantity::LargestMultiplier)
}

/// Whether a metric needs more than the cycle maxima and impacts: the mean square, x − z or contact forces.
#[must_use]
pub const fn needs_whole_run(metric: Quantity) -> bool {
    matches!(metric, Quantity::RmsOverZ | Quantity::RmsXM | Quantity::MaxAbsXMinusZM | Quantity::PeakContactForceN)
}

/// Whether a metric is that of impacts, which not every damper has.
#[must_use]
pub const fn needs_impacts(metric: Quantity) -> bool {
    matches!(
        metric,
        Quantity::ImpactsPerCycle
            | Quantity::PeakContactForceN
            | Quantity::HarvestedPowerW
            | Quantity::PeriodCycles
            | Quantity::LargestMultiplier
    )
}

/// Why a case cannot have a metric, if it cannot.
#[must_use]
pub fn refusal(metric: Quantity, case: &Case) -> Option<&'static str> {
    let is_sine = matches!(case.excitation, Excitation::Sine { .. });
    match metric {
        Quantity::LossFactor | Quantity::CollectiveMotion if case.many_particles.is_none() => {
            Some("it is that of a many-particle damper; the case has no `many_particles`")
        }
        Quantity::PeriodCycles | Quantity::LargestMultiplier if case.many_particles.is_some() => {
            Some("spheres in a box have no periodic motion whose every event is found exactly")
        }
        Quantity::HarvestedPowerW if !case.harvests() => {
            Some("it is that of piezoelectric walls; the case has none, `kind = \"piezoelectric\"`")
        }
        _ if metric.is_ratio() && case.reference_m().is_none() => {
            Some("the case has neither Z nor x0; take `max_abs_x_m` or `rms_x_m`")
        }
        Quantity::PeriodCycles | Quantity::LargestMultiplier if case.multi_degree.is_some() => Some(
            "the periodic motions of a structure with several places, of piezoelectric walls, or with a force beside a moving base, are not analysed",
        ),
        Quantity::ImpactsPerCycle if !case.has_impacts() => Some("the case has no particle"),
        Quantity::PeakContactForceN if !wall_force::is_known(case) => Some(
            "an impact on a hard wall takes no time; give each hard wall `contact_time_s` or `hertz_stiffness_n_per_m15`, or the walls \
             `kind = \"voigt\"` or \"hertz\"",
        ),
        Quantity::PeriodCycles | Quantity::LargestMultiplier if !is_sine => {
            Some("only a sine of the base has periodic motions")
        }
        Quantity::PeriodCycles | Quantity::LargestMultiplier if case.set_up.particle.is_none() => {
            Some("it is that of an impact damper's motion; the case has no particle")
        }
        Quantity::XOverZ | Quantity::MeanCycleMaxM | Quantity::CycleSpread if case.record.is_some() => {
            Some("a record has no cycles; take `max_abs_x_m` or `rms_x_m`")
        }
        _ => None,
    }
}

/// Results of the counted part of one simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct CountedResults {
    /// Its summary; steady cycles are the counted ones.
    pub summary: Summary,
    /// Counted cycles, with their fraction.
    pub cycles: f64,
    /// What a many-particle damper has besides.
    pub spheres: Option<SpheresFigures>,
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
    /// Of a driven motion, if there is one; not a number where it does not repeat.
    pub fn of(driven: Option<ForcedResponse>) -> Self {
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

impl CountedResults {
    /// The value of a metric, not a number if there is none. `reference_m`: Z, P/k or x0.
    #[must_use]
    pub fn value(&self, metric: Quantity, reference_m: f64, periodicity: Option<&Periodicity>) -> f64 {
        let Self { summary, cycles, spheres } = self;
        let mean_cycle_max_m = summary.steady_mean_cycle_max_abs_x_m.unwrap_or(f64::NAN);
        match metric {
            Quantity::XOverZ => mean_cycle_max_m / reference_m,
            Quantity::MaxXOverZ => summary.max_abs_x_m / reference_m,
            Quantity::RmsOverZ => summary.rms_x_m / reference_m,
            Quantity::MeanCycleMaxM => mean_cycle_max_m,
            Quantity::MaxAbsXM => summary.max_abs_x_m,
            Quantity::MaxAbsXMinusZM => summary.max_abs_x_minus_z_m,
            Quantity::RmsXM => summary.rms_x_m,
            Quantity::CycleSpread => summary.steady_max_abs_x_m.unwrap_or(f64::NAN) / mean_cycle_max_m - 1.0,
            Quantity::ImpactsPerCycle => summary.impact_count as f64 / cycles,
            // A wall that was never touched has exerted no force.
            Quantity::PeakContactForceN => summary.peak_contact_force_n.unwrap_or(0.0),
            Quantity::HarvestedPowerW => summary.harvested_power_w.unwrap_or(f64::NAN),
            Quantity::PeriodCycles => periodicity.map_or(f64::NAN, |found| found.period_cycles),
            Quantity::LossFactor => spheres.as_ref().map_or(f64::NAN, SpheresFigures::loss_factor),
            Quantity::CollectiveMotion => spheres.as_ref().map_or(f64::NAN, SpheresFigures::collective_motion),
            Quantity::LargestMultiplier => periodicity.map_or(f64::NAN, |found| found.largest_multiplier),
            // Not one of METRICS.
            _ => f64::NAN,
        }
    }
}
