//! Simulates cases and gives their metrics: many at once in vector lanes where the case allows it, one by one otherwise.

use damprig_batch::Point;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::Wall;

use super::metric::{Figures, Metric, Periodicity};
use crate::input::Refusal;
use crate::simulation::{Case, RunOptions, simulate};

/// What is counted of each simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Counted cycles, or else
    pub cycles: Option<f64>,
    /// counted time, s.
    pub duration_s: Option<f64>,
    /// Cycles simulated before.
    pub settle_cycles: f64,
    /// Time simulated before, s; rounded up to whole cycles.
    pub settle_s: f64,
}

/// The counted part of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Counted {
    /// Length of a cycle, s.
    pub cycle_s: f64,
    /// First counted cycle.
    pub first_cycle: f64,
    /// End of the simulation, s.
    pub end_s: f64,
}

impl Counted {
    pub fn of(case: &Case, record: Option<Record>) -> Self {
        let cycle_s = case.cycle_s();
        let Some(record) = record else {
            let first_cycle = case.run.steady_from_cycle.unwrap_or(0) as f64;
            return Self { cycle_s, first_cycle, end_s: case.run.duration_s };
        };
        let first_cycle = record.settle_cycles.max((record.settle_s / cycle_s - 1e-9).ceil());
        let length_s = record.cycles.map_or(record.duration_s.unwrap_or(0.0), |cycles| cycles * cycle_s);
        // A whole number of cycles ends on a cycle.
        let end_s = match record.cycles {
            Some(cycles) => (first_cycle + cycles) * cycle_s,
            None => first_cycle * cycle_s + length_s,
        };
        Self { cycle_s, first_cycle, end_s }
    }

    /// The number of counted cycles, with their fraction.
    pub fn cycles(&self) -> f64 {
        self.end_s / self.cycle_s - self.first_cycle
    }

    /// Whether the simulation ends with a cycle.
    pub fn is_whole(&self) -> bool {
        let cycles = self.end_s / self.cycle_s;
        (cycles - cycles.round()).abs() < 1e-9
    }
}

/// The metrics of a case, and how often the event search was given up.
pub type Simulated = (Vec<f64>, f64);

/// Simulates cases: their metrics, in their order.
///
/// # Errors
/// A case that the integrator refuses.
pub fn metrics_of_all(cases: &[Case], record: Option<Record>, metrics: &[Metric]) -> Result<Vec<Simulated>, Refusal> {
    let lanes: Vec<Option<Point>> = cases.iter().map(|case| point(case, record, metrics)).collect();
    let points: Vec<Point> = lanes.iter().copied().flatten().collect();
    let outcomes = damprig_batch::simulate(&points, 1).map_err(|invalid| Refusal(invalid.invalid.to_string()))?;
    let mut outcomes = outcomes.into_iter();
    let simulated = |(case, lane): (&Case, &Option<Point>)| match lane.and_then(|_| outcomes.next()) {
        Some(outcome) => {
            let counted = Counted::of(case, record);
            let figures = Figures {
                mean_cycle_max_m: outcome.steady_mean_m.unwrap_or(f64::NAN),
                largest_cycle_max_m: outcome.steady_max_m.unwrap_or(f64::NAN),
                max_abs_x_m: outcome.steady_max_m.unwrap_or(f64::NAN),
                max_abs_x_minus_z_m: f64::NAN,
                rms_x_m: outcome.rms_x_m,
                impacts: outcome.impacts as f64,
                cycles: counted.cycles(),
                peak_contact_force_n: 0.0,
            };
            Ok((values(case, &figures, metrics, None), f64::from(outcome.unresolved)))
        }
        None => metrics_of(case, record, metrics),
    };
    cases.iter().zip(&lanes).map(simulated).collect()
}

/// The case as a point for the lanes, if it is a particle that flies without friction between hard walls under a sine, and if the
/// lanes compute what the metrics need.
fn point(case: &Case, record: Option<Record>, metrics: &[Metric]) -> Option<Point> {
    let set_up = &case.set_up;
    let particle = set_up.particle.filter(|particle| particle.friction_coefficient == 0.0)?;
    let is_regular = matches!(particle.wall, Wall::Restitution { .. })
        && set_up.friction_damper.is_none()
        && set_up.tmd.is_none()
        && case.record.is_none()
        && case.run.cycle_s.is_none()
        && matches!(case.excitation, Excitation::Sine { .. } | Excitation::ForceSine { .. });
    let counted = Counted::of(case, record);
    let has = |metric: &Metric| match metric {
        Metric::XOverZ | Metric::MeanCycleMax | Metric::CycleSpread => true,
        Metric::MaxXOverZ | Metric::MaxAbsX => counted.is_whole(),
        // The lanes count them from the start.
        Metric::RmsOverZ | Metric::RmsX | Metric::ImpactsPerCycle => counted.is_whole() && counted.first_cycle == 0.0,
        _ => false,
    };
    let cycles = (counted.end_s / counted.cycle_s + 1e-9).floor();
    (is_regular && metrics.iter().all(has) && cycles >= 1.0).then_some(Point {
        set_up: *set_up,
        excitation: case.excitation,
        initial: case.initial,
        cycles: cycles as u64,
        steady_from_cycle: counted.first_cycle as u64,
    })
}

/// Simulates a case by itself.
fn metrics_of(case: &Case, record: Option<Record>, metrics: &[Metric]) -> Result<Simulated, Refusal> {
    let (figures, given_up) = figures(case, record, metrics)?;
    let needs_analysis = metrics.iter().any(|metric| metric.needs_analysis());
    let periodicity = needs_analysis.then(|| periodicity(case, record));
    Ok((values(case, &figures, metrics, periodicity.as_ref()), given_up))
}

fn values(case: &Case, figures: &Figures, metrics: &[Metric], periodicity: Option<&Periodicity>) -> Vec<f64> {
    let reference_m = case.reference_m().map_or(f64::NAN, |(reference_m, _)| reference_m);
    metrics.iter().map(|metric| metric.value(figures, reference_m, periodicity)).collect()
}

/// Simulates a case; also how often the event search was given up.
fn figures(case: &Case, record: Option<Record>, metrics: &[Metric]) -> Result<(Figures, f64), Refusal> {
    if case.record.is_some() {
        return figures_on_record(case);
    }
    let invalid = |invalid: damprig_core::io::Invalid| Refusal(invalid.to_string());
    let counted = Counted::of(case, record);
    let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial).map_err(invalid)?;
    let from_s = counted.first_cycle * counted.cycle_s;
    motion.run(from_s, &mut ());
    let first_cycle = counted.first_cycle as u64;
    let wanted = Wanted {
        cycle_s: Some(counted.cycle_s),
        steady_from_cycle: Some(first_cycle),
        whole_run: metrics.iter().any(|metric| metric.needs_whole_run()),
    };
    let mut response = Response::new(wanted);
    response.skip_to(first_cycle);
    motion.run(counted.end_s, &mut response);
    response.finish(motion.time_s());
    let (largest_cycle_max_m, mean_cycle_max_m) = response.steady_m().unwrap_or((f64::NAN, f64::NAN));
    let figures = Figures {
        mean_cycle_max_m,
        largest_cycle_max_m,
        max_abs_x_m: response.max_abs_x_m(),
        max_abs_x_minus_z_m: response.max_abs_x_minus_z_m(),
        rms_x_m: response.rms_x_m(),
        impacts: response.impact_count() as f64,
        cycles: counted.cycles(),
        // A soft wall that was never touched has exerted no force.
        peak_contact_force_n: response.peak_contact_force_n().unwrap_or(0.0),
    };
    Ok((figures, f64::from(motion.unresolved())))
}

fn figures_on_record(case: &Case) -> Result<(Figures, f64), Refusal> {
    let mut go_on = |_: f64| true;
    let options = RunOptions { keep: false, longest_part_s: case.run.duration_s, go_on: &mut go_on };
    let summary = simulate(case, &mut (), options).map_err(|invalid| Refusal(invalid.to_string()))?.summary;
    let figures = Figures {
        mean_cycle_max_m: f64::NAN,
        largest_cycle_max_m: f64::NAN,
        max_abs_x_m: summary.max_abs_x_m,
        max_abs_x_minus_z_m: summary.max_abs_x_minus_z_m,
        rms_x_m: summary.rms_x_m,
        impacts: summary.impact_count as f64,
        cycles: case.run.duration_s / case.cycle_s(),
        peak_contact_force_n: summary.peak_contact_force_n.unwrap_or(0.0),
    };
    Ok((figures, f64::from(summary.unresolved)))
}

fn periodicity(case: &Case, record: Option<Record>) -> Periodicity {
    let mut case = case.clone();
    case.run.duration_s = Counted::of(&case, record).end_s;
    Periodicity::of(&case)
}
