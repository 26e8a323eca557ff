//! Estimates the computing time of a run by timing its first moments.

use std::time::{Duration, Instant};

use damprig_core::integrator::exact::Exact;
use damprig_core::io::Invalid;

use super::Case;
use super::collector::RunOptions;
use super::motion::{Piece, Viewer};
use super::simulate::simulate;

/// Longest duration of the trial.
const TRIAL: Duration = Duration::from_millis(30);

/// Longest duration of the trial of a run that seems long: a flood of events may end soon.
const LONG_TRIAL: Duration = Duration::from_secs(1);

/// Computing time above which a run is said to take long, s.
pub const LONG_S: f64 = 10.0;

/// Computing time above which a trial goes on, s. Less than [`LONG_S`]: a falling estimate does not end the trial just where it would still be told.
const UNCLEAR_S: f64 = 0.5 * LONG_S;

/// Arcs or record steps between two readings of the clock.
const STEPS_PER_CLOCK: f64 = 1_000.0;

/// Runs with fewer arcs take less than a second and need no trial.
const FEW_ARCS: f64 = 200_000.0;

/// A wall counts as stiff if its contact needs at least this many arcs per natural period.
const STIFF: f64 = 50_000.0;

/// Estimated cost of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Arcs of the whole run; steps with spheres.
    pub arcs: f64,
    /// Computing time without output files, s.
    pub seconds: f64,
    /// Longest arc in contact with a stiff soft wall, s.
    pub stiff_arc_s: Option<f64>,
    /// Simulated time of the trial from which arcs and seconds are extrapolated, s.
    pub trial_s: f64,
}

/// Counts arcs.
#[derive(Default)]
struct ArcCounter(u64);

impl Viewer for ArcCounter {
    fn piece(&mut self, _: &dyn Piece) {
        self.0 += 1;
    }
}

/// Computing time on a usual core, s, as measured in studies: of a cycle with what a case has, of a cycle for each mode of a structure with several
/// places without and with Hertz walls, of a step for each sphere, and of a step of a record.
const CYCLE_S: f64 = 4e-7;
const FRICTION_CYCLE_S: f64 = 2e-6;
const TUNED_CYCLE_S: f64 = 4e-6;
const SOFT_CYCLE_S: f64 = 6e-6;
const MODE_CYCLE_S: f64 = 1e-5;
const HERTZ_CYCLE_S: f64 = 2e-5;
const HERTZ_MODE_CYCLE_S: f64 = 1e-4;
const SPHERE_STEP_S: f64 = 5e-7;
const RECORD_STEP_S: f64 = 1e-7;

/// Computing time of `duration_s` of a case on a usual core, s, within a factor of about three (five with many impacts a cycle): from what it has and without a trial,
/// so that every machine says the same.
#[must_use]
pub fn usual_s(case: &Case, duration_s: f64) -> f64 {
    let (set_up, cycles) = (&case.set_up, duration_s / case.cycle_s());
    if let Some(damper) = &case.many_particles {
        return duration_s / damper.step_s(&set_up.structure) * damper.count as f64 * SPHERE_STEP_S;
    }
    if let Some(several) = &case.multi_degree {
        let modes = several.set_up.structure.modes.len() as f64;
        // A contact in every mode, and the forces of its pieces, which cost as much as some.
        let hertz_cycle_s = if case.has_hertz_walls() { (modes + 4.0) * HERTZ_MODE_CYCLE_S } else { 0.0 };
        return cycles * (modes * MODE_CYCLE_S + hertz_cycle_s);
    }
    let steps = case.record.as_ref().map_or(0.0, |record| duration_s / record.step_s);
    let has_friction = set_up.friction_damper.is_some()
        || set_up.particle.as_ref().is_some_and(|particle| particle.friction_coefficient > 0.0);
    let cycle_s = CYCLE_S
        + if has_friction { FRICTION_CYCLE_S } else { 0.0 }
        + if set_up.tmd.is_some() { TUNED_CYCLE_S } else { 0.0 }
        + if set_up.has_soft_walls() { SOFT_CYCLE_S } else { 0.0 }
        + if set_up.has_hertz_walls() { HERTZ_CYCLE_S } else { 0.0 };
    cycles * cycle_s + steps * RECORD_STEP_S
}

/// Estimates the cost of a case.
///
/// # Errors
/// Names a value that is not physical.
pub fn estimate(case: &Case) -> Result<Cost, Invalid> {
    if let Some(damper) = &case.many_particles {
        let step_s = damper.step_s(&case.set_up.structure);
        return Ok(Cost { arcs: (case.run.duration_s / step_s).ceil(), ..trial(case, step_s, None)? });
    }
    if let Some(several) = &case.multi_degree {
        return trial(case, several.shortest_s(), None);
    }
    // Stiffness depends on the set-up alone, so this also holds for a case on a record.
    let motion = Exact::new(&case.set_up, &case.excitation, &case.initial)?;
    let (arc_s, duration_s) = (motion.shortest_arc_s(), case.run.duration_s);
    let is_stiff = case.set_up.has_soft_walls() && arc_s * STIFF < case.natural_period_s();
    let stiff_arc_s = is_stiff.then_some(arc_s);
    let least_s = case.record.as_ref().map_or(arc_s, |record| record.step_s.min(arc_s));
    // Impacts may outnumber all other arcs.
    if duration_s / least_s < FEW_ARCS && case.set_up.particle.is_none() {
        return Ok(Cost { stiff_arc_s, ..Cost::default() });
    }
    trial(case, least_s, stiff_arc_s)
}

/// Times the first moments of a run whose pieces take about `least_s`, s.
fn trial(case: &Case, least_s: f64, stiff_arc_s: Option<f64>) -> Result<Cost, Invalid> {
    let duration_s = case.run.duration_s;
    let (mut start, mut count) = (Instant::now(), ArcCounter::default());
    let mut set_up_s = 0.0;
    let mut trial = case.clone();
    trial.run.sample_times_s.clear();
    let mut marks: Vec<(f64, f64)> = vec![(0.0, 0.0)];
    let mut go_on = |t_s: f64| {
        // Spheres are put into their box before the first step, once whatever the duration.
        if marks.len() == 1 && t_s == 0.0 {
            set_up_s = start.elapsed().as_secs_f64();
            start = Instant::now();
            marks.push((0.0, 0.0));
            return true;
        }
        let elapsed = start.elapsed();
        marks.push((elapsed.as_secs_f64(), t_s));
        elapsed < TRIAL || (elapsed < LONG_TRIAL && whole_s(&marks, elapsed.as_secs_f64(), t_s, duration_s) > UNCLEAR_S)
    };
    let options = RunOptions { keep: false, longest_part_s: STEPS_PER_CLOCK * least_s, go_on: &mut go_on };
    let trial_s = simulate(&trial, &mut count, options)?.summary.simulated_s;
    let spent_s = start.elapsed().as_secs_f64();
    let seconds = whole_s(&marks, spent_s, trial_s, duration_s);
    Ok(Cost { arcs: count.0 as f64 * seconds / spent_s, seconds: set_up_s + seconds, stiff_arc_s, trial_s })
}

/// Computing time of a run of `duration_s` of which `trial_s` took `spent_s`, s. `marks` are computing and simulated time during the trial.
fn whole_s(marks: &[(f64, f64)], spent_s: f64, trial_s: f64, duration_s: f64) -> f64 {
    // The second half of the trial is nearer to the rest of the run than the first.
    let (from_s, from_t_s) = marks.iter().rev().find(|(s, _)| *s <= 0.5 * spent_s).copied().unwrap_or_default();
    // Very many impacts may leave the reached time where it was.
    let reached_s = (trial_s - from_t_s).max(duration_s * 1e-30);
    spent_s + (duration_s - trial_s).max(0.0) * (spent_s - from_s) / reached_s
}

/// Simulated time between two progress checks, s: a two-thousandth of the run, but at least 10 000 and at most 300 000
/// arcs, and at most 200 000 output rows, so that Ctrl-C is answered at once.
///
/// # Errors
/// Names a value that is not physical.
pub fn longest_part_s(case: &Case, rate_hz: Option<f64>) -> Result<f64, Invalid> {
    let arc_s = match (&case.record, &case.many_particles) {
        _ if let Some(several) = &case.multi_degree => several.shortest_s(),
        (Some(record), _) => record.step_s,
        (None, Some(damper)) => damper.step_s(&case.set_up.structure),
        (None, None) => Exact::new(&case.set_up, &case.excitation, &case.initial)?.shortest_arc_s(),
    };
    let part_s = (case.run.duration_s / 2_000.0).clamp(10_000.0 * arc_s, 300_000.0 * arc_s);
    Ok(rate_hz.map_or(part_s, |rate_hz| part_s.min(200_000.0 / rate_hz)))
}
