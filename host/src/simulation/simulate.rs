//! Simulates a case: chooses the driver and gathers the result.

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::Wanted;
use damprig_core::io::Invalid;

use super::collector::{Collector, RunOptions};
use super::motion::Viewer;
use super::result::{SimulationResult, Summary};
use super::statistics::LastCyclesMeter;
use super::{Case, exact_driver, many_particles, multi_degree, sampled_driver};

/// Simulates a case. `viewer` sees the motion too.
///
/// # Errors
/// Names a value that is not physical.
pub fn simulate<V: Viewer>(case: &Case, viewer: &mut V, options: RunOptions) -> Result<SimulationResult, Invalid> {
    let mut collector = Collector::new(case, options.keep, viewer);
    let steady_from_cycle = case.run.steady_from_cycle;
    let cycle_s = case.run.cycle_s.or(steady_from_cycle.map(|_| case.cycle_s()));
    let wanted = Wanted { cycle_s, steady_from_cycle, whole_run: true };
    let mut spheres = None;
    let mut places = None;
    let (summary, end) = match (&case.many_particles, &case.record) {
        _ if let Some(several) = &case.multi_degree => {
            let (summary, end, result) = multi_degree::driver::run(case, several, wanted, &mut collector, options)?;
            places = Some(result);
            (summary, end)
        }
        (Some(damper), _) => {
            let (summary, end, result) = many_particles::driver::run(case, damper, wanted, &mut collector, options)?;
            spheres = Some(result);
            (summary, end)
        }
        (None, Some(record)) => sampled_driver::run(case, record, wanted, &mut collector, options)?,
        (None, None) => exact_driver::run(case, wanted, &mut collector, options)?,
    };
    let summary = Summary { contacts: collector.events.contact_figures, ..summary };
    let is_complete = summary.simulated_s >= case.run.duration_s;
    if is_complete {
        collector.samples.fill(end);
    }
    for (parameter, value) in [("rms_x_m", summary.rms_x_m), ("max_abs_x_m", summary.max_abs_x_m)] {
        if !value.is_finite() {
            let allowed = "finite: the case has values that are too large to compute with";
            return Err(Invalid { parameter, value, allowed });
        }
    }
    let states = &collector.samples.states;
    let column = |value: fn(&ExactState) -> f64| states.iter().map(value).collect();
    Ok(SimulationResult {
        x_m: column(|s| s.x_m),
        v_m_per_s: column(|s| s.v_m_per_s),
        y_m: column(ExactState::y_m),
        u_m_per_s: column(ExactState::u_m_per_s),
        impacts: collector.events.impacts.take().unwrap_or_default(),
        contacts: std::mem::take(&mut collector.events.contacts),
        accumulations: std::mem::take(&mut collector.events.accumulations),
        stopped_at_s: (!is_complete).then_some(summary.simulated_s),
        many_particles: spheres,
        multi_degree: places,
        last_cycles: collector.last_cycles.as_ref().filter(|_| is_complete).and_then(LastCyclesMeter::last_cycles),
        summary,
    })
}
