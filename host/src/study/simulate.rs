//! Simulates cases and gives their metrics.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Exact;
use damprig_core::integrator::exact::response::Wanted;
use damprig_motion::stop::{Stop, response_and_motion, response_from};

use super::linear;
use super::metric::{self, CountedResults, Periodicity};
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::simulation::analysis::{AnalysedPeriods, ForcedResponse};
use crate::simulation::result::Summary;
use crate::simulation::{Case, RunOptions, cost, many_particles, multi_degree, simulate};

/// Asked now and then, also inside a simulation, whether to go on.
pub type GoOn<'a> = &'a (dyn Fn() -> bool + Sync);

/// What is counted of each simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulationRecord {
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
pub(crate) struct Counted {
    /// Length of a cycle, s.
    pub cycle_s: f64,
    /// First counted cycle.
    pub first_cycle: f64,
    /// End of the simulation, s.
    pub end_s: f64,
}

impl Counted {
    pub fn of(case: &Case, record: Option<SimulationRecord>) -> Self {
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
}

/// The metrics of a case, and how often the event search was given up.
pub type CaseMetrics = (Vec<f64>, f64);

/// Simulates cases: their metrics, in their order.
///
/// # Errors
/// A case that the integrator refuses, or that `go_on` said no.
pub fn metrics_of_all(
    cases: &[Case],
    record: Option<SimulationRecord>,
    metrics: &[Quantity],
    go_on: GoOn,
) -> Result<Vec<CaseMetrics>, Failure> {
    cases.iter().map(|case| metrics_of(case, record, metrics, go_on)).collect()
}

fn metrics_of(
    case: &Case,
    record: Option<SimulationRecord>,
    metrics: &[Quantity],
    go_on: GoOn,
) -> Result<CaseMetrics, Failure> {
    let needs_analysis = metrics.iter().any(|metric| metric::needs_analysis(*metric));
    let analysed = if needs_analysis { analysed(case, record) } else { None };
    let (figures, there) = figures(case, record, metrics, analysed.as_ref(), go_on)?;
    let driven =
        analysed.zip(there).map(|((case, periods), there)| ForcedResponse::at_end(&case, there, periods, &mut ()));
    let periodicity = needs_analysis.then(|| Periodicity::of(driven));
    Ok((values(case, &figures, metrics, periodicity.as_ref()), f64::from(figures.summary.unresolved)))
}

fn values(case: &Case, figures: &CountedResults, metrics: &[Quantity], periodicity: Option<&Periodicity>) -> Vec<f64> {
    let reference_m = case.reference_m().map_or(f64::NAN, |(reference_m, _)| reference_m);
    metrics.iter().map(|metric| figures.value(*metric, reference_m, periodicity)).collect()
}

/// The case whose end is analysed, with its last periods; `None` where nothing is periodic.
fn analysed(case: &Case, record: Option<SimulationRecord>) -> Option<(Case, AnalysedPeriods)> {
    let turning = case.drive_period_s().map(|period_s| TAU / period_s).filter(|_| case.record.is_none())?;
    let mut case = case.without_hertz();
    case.run.duration_s = Counted::of(&case, record).end_s;
    let periods = AnalysedPeriods::of(&case, turning)?;
    Some((case, periods))
}

/// Simulates a case; with the motion at the start of the periods that are analysed.
fn figures(
    case: &Case,
    record: Option<SimulationRecord>,
    metrics: &[Quantity],
    analysed: Option<&(Case, AnalysedPeriods)>,
    go_on: GoOn,
) -> Result<(CountedResults, Option<Exact>), Failure> {
    let counted = Counted::of(case, record);
    let (first_cycle, end_s) = (counted.first_cycle as u64, counted.end_s);
    let of = |summary, spheres| (CountedResults { summary, cycles: counted.cycles(), spheres }, None);
    if let Some(damper) = &case.many_particles {
        let simulated = many_particles::counted(case, damper, first_cycle, end_s, go_on)?;
        let (response, spheres) = simulated.ok_or_else(Failure::stopped)?;
        return Ok(of(Summary::of(case, &response, end_s, 0), Some(spheres)));
    }
    if case.record.is_some() {
        return Ok((figures_on_record(case, go_on)?, None));
    }
    if let Some(summary) = linear::settled(case, &counted) {
        return Ok(of(summary, None));
    }
    let from_s = counted.first_cycle * counted.cycle_s;
    let wanted = Wanted {
        cycle_s: Some(counted.cycle_s),
        steady_from_cycle: Some(first_cycle),
        whole_run: metrics.iter().any(|metric| metric::needs_whole_run(*metric)),
    };
    if let Some(several) = &case.multi_degree {
        let simulated = multi_degree::driver::counted(case, several, (first_cycle, from_s), end_s, wanted, go_on);
        return Ok(of(simulated?.ok_or_else(Failure::stopped)?, None));
    }
    let new = |case: &Case| Exact::new(&case.set_up, &case.excitation, &case.initial);
    let mut motion = new(case)?;
    let from = (first_cycle, from_s);
    // The analysis has hard walls in place of Hertz contact: another motion.
    let (own, other) = match analysed {
        Some(analysed) if analysed.0.set_up == case.set_up => (Some(analysed), None),
        other => (None, other),
    };
    let (response, there) = match own {
        Some((_, periods)) => response_and_motion(&mut motion, from, (periods.start_s, end_s), wanted, go_on)
            .map(|(response, there)| (response, Some(there))),
        None => response_from(&mut motion, from, end_s, wanted, go_on).map(|response| (response, None)),
    }
    .ok_or_else(Failure::stopped)?;
    let there = match other {
        None => there,
        Some((case, periods)) => {
            let (mut go_on, mut motion) = (|_: f64| go_on(), new(case)?);
            let mut stop = Stop::unless(&mut go_on);
            motion.run(periods.start_s, &mut stop);
            Some(motion).filter(|_| !stop.is_stopped())
        }
    };
    let (figures, _) = of(Summary::of(case, &response, end_s, motion.unresolved()), None);
    Ok((figures, there))
}

fn figures_on_record(case: &Case, go_on: GoOn) -> Result<CountedResults, Failure> {
    let mut goes_on = |_: f64| go_on();
    let longest_part_s = cost::longest_part_s(case, None)?;
    let options = RunOptions { keep: false, longest_part_s, go_on: &mut goes_on };
    let result = simulate(case, &mut (), options)?;
    if result.stopped_at_s.is_some() {
        return Err(Failure::stopped());
    }
    Ok(CountedResults { summary: result.summary, cycles: case.run.duration_s / case.cycle_s(), spheres: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Source;

    #[test]
    fn a_simulation_of_a_billion_cycles_is_stopped_within_it() {
        let start = std::time::Instant::now();
        for friction in ["0", "0.01"] {
            let text = format!(
                "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n\
                 base = {{ kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }}\n\
                 particle = {{ mass_ratio = 0.1, clearance_m = 0.03, friction_coefficient = {friction}, \
                 wall = {{ kind = \"restitution\", coefficient = 0.5 }} }}\nrun = {{ duration_s = 8 }}\n"
            );
            let case =
                Case::parse(&Source::new("case.toml", text.as_str()), "case").unwrap_or_else(|why| panic!("{why}"));
            let record =
                Some(SimulationRecord { cycles: Some(1e9), duration_s: None, settle_cycles: 1e9, settle_s: 0.0 });
            let metrics = [Quantity::XOverZ, Quantity::CycleSpread];
            let asked = std::sync::atomic::AtomicU32::new(0);
            let go_on = || asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) < 3;
            assert_eq!(metrics_of_all(&[case], record, &metrics, &go_on), Err(Failure::stopped()));
        }
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    }
}
