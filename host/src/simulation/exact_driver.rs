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
    let summary = Summary::of(case, &response, motion.time_s(), motion.unresolved());
    Ok((Summary { passed_wall_by_m: motion.passed_wall_by_m(), ..summary }, *motion.state()))
}
