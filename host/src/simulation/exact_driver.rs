//! Runs a case with the exact driver: excitation in closed form, every event at its instant.

use damprig_core::integrator::exact::Exact;
use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::io::Invalid;
use damprig_motion::stop::run_viewed;

use super::Case;
use super::collector::{Collector, RunOptions, run_in_parts};
use super::motion::Viewer;
use super::result::Summary;

/// Runs the case.
///
/// # Errors
/// Names a value that is not physical.
pub(super) fn run<V: Viewer>(
    case: &Case,
    wanted: Wanted,
    collector: &mut Collector<'_, V>,
    options: RunOptions,
) -> Result<(Summary, ExactState), Invalid> {
    let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial)?;
    let mut response = Response::new(wanted);
    run_in_parts(case.run.duration_s, options, collector, |until_s, collector, go_on| {
        run_viewed(&mut motion, until_s, &mut response, &mut collector.all(), go_on);
        motion.time_s()
    });
    response.finish(motion.time_s());
    let steady = response.steady_m();
    let contact = if response.peak_contact_force_n().is_some() { response.first_contact() } else { None };
    let summary = Summary {
        simulated_s: motion.time_s(),
        rms_x_m: response.rms_x_m(),
        rms_x_minus_z_m: None,
        max_abs_x_m: response.max_abs_x_m(),
        max_abs_x_minus_z_m: response.max_abs_x_minus_z_m(),
        impact_count: response.impact_count(),
        accumulation_count: response.accumulation_count(),
        steady_max_abs_x_m: steady.map(|s| s.0),
        steady_mean_cycle_max_abs_x_m: steady.map(|s| s.1),
        unresolved: motion.unresolved(),
        record_start_jump_m_per_s: None,
        peak_contact_force_n: response.peak_contact_force_n(),
        first_contact_duration_s: contact.map(|c| c.0),
        first_contact_restitution: contact.map(|c| c.1),
    };
    Ok((summary, *motion.state()))
}
