//! Runs a case on a recorded base motion with the sampled driver, one sample interval after the other.

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::Wanted;
use damprig_core::integrator::sampled::Sampled;
use damprig_core::io::Invalid;
use damprig_motion::sampled_run::SampledRun;

use super::Case;
use super::collector::{Collector, RunOptions, run_in_parts};
use super::motion::Viewer;
use super::result::Summary;
use crate::motion_record::Record;

/// Sample intervals between two calls of `go_on`; each has at most 255 steps.
const INTERVALS_PER_CHECK: u64 = 64;

/// Runs the case on its record.
///
/// # Errors
/// Names a value that is not physical, or a natural frequency too high for the record's sample rate.
pub(super) fn run<V: Viewer>(
    case: &Case,
    record: &Record,
    wanted: Wanted,
    collector: &mut Collector<'_, V>,
    options: RunOptions,
) -> Result<(Summary, ExactState), Invalid> {
    let steps = Sampled::<f64>::steps_per_sample(&case.set_up, record.step_s)?;
    let duration_s = case.run.duration_s;
    let times_s = [record.step_s / f64::from(steps), duration_s];
    let mut run = SampledRun::new(&case.set_up, &case.initial, times_s, wanted)?;
    let mut play = record.play();
    let mut interval = 0_u64;
    run_in_parts(duration_s, options, collector, |until_s, collector, go_on| {
        let mut viewer = collector.all();
        while interval as f64 * record.step_s < until_s {
            if interval % INTERVALS_PER_CHECK == INTERVALS_PER_CHECK - 1 && !go_on(run.reached_s()) {
                break;
            }
            let segment = play.next_segment();
            for part in 0..steps {
                run.step(&segment.part(part, steps), &mut viewer);
            }
            interval += 1;
        }
        run.reached_s()
    });
    let (reached_s, end, unresolved) = (run.reached_s(), run.state(), run.unresolved());
    let response = run.into_response();
    Ok((Summary::of(case, &response, reached_s, unresolved), end))
}

#[cfg(test)]
mod tests {
    use crate::input::Source;
    use crate::simulation::{Case, RunOptions, simulate};

    #[test]
    fn a_run_on_a_record_is_stopped_within_a_part() {
        let folder = tempfile::tempdir().expect("a folder");
        let rows: String = (0..2001).map(|n| format!("{},{}\n", f64::from(n) * 0.005, 0.001)).collect();
        std::fs::write(folder.path().join("motion.csv"), format!("time_s,acceleration_g\n{rows}")).expect("a file");
        let text = r#"structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0 }
                      base = { kind = "record", file = "motion.csv", quantity = "acceleration", unit = "g" }
                      run = { duration_s = 10 }"#;
        let file = folder.path().join("case.toml");
        std::fs::write(&file, text).expect("a file");
        let case = Case::parse(&Source::read(&file).expect("a text"), "case").expect("a case");
        let mut left = 5;
        let mut go_on = |_: f64| {
            left -= 1;
            left > 0
        };
        // With a single part, a check between parts would never happen.
        let options = RunOptions { keep: false, longest_part_s: 1e9, go_on: &mut go_on };
        let answer = simulate(&case, &mut (), options).expect("it is physical");
        let stopped_at_s = answer.stopped_at_s.expect("it was stopped");
        assert!(stopped_at_s > 0.3 && stopped_at_s < 2.0, "{stopped_at_s}");
    }
}
