//! What a run will cost, told before it starts: the first moments of the motion are run and timed.

use std::time::{Duration, Instant};

use damprig_core::integrator::exact::Exact;
use damprig_core::io::Invalid;

use super::Case;
use super::motion::{Piece, Viewer};
use super::result::{Request, simulate};

/// How long the trial may take.
const TRIAL: Duration = Duration::from_millis(30);

/// Arcs or steps of a record between two looks at the clock, unless events crowd.
const STEPS_A_CLOCK: f64 = 1_000.0;

/// Runs with fewer arcs than this are not worth a trial: they take less than a second.
const FEW_ARCS: f64 = 200_000.0;

/// Arcs of a soft contact in a natural period from which on the wall counts as stiff.
const STIFF: f64 = 50_000.0;

/// What a run will cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Arcs in all.
    pub arcs: f64,
    /// Seconds of computing, without what is written.
    pub seconds: f64,
    /// The longest arc in contact with a soft wall, s, when it is short next to the motion.
    pub stiff_arc_s: Option<f64>,
}

/// Counts arcs.
#[derive(Default)]
struct Count(u64);

impl Viewer for Count {
    fn piece(&mut self, _: &impl Piece) {
        self.0 += 1;
    }
}

/// Estimates the cost of a case.
///
/// # Errors
/// Names a value that is not physical.
pub fn estimate(case: &Case) -> Result<Cost, Invalid> {
    // Of a case on a record it knows the set-up only, which is what makes a wall stiff.
    let motion = Exact::new(&case.set_up, &case.excitation, &case.initial)?;
    let (arc_s, duration_s) = (motion.shortest_arc_s(), case.run.duration_s);
    let is_stiff = case.has_soft_wall() && arc_s * STIFF < case.natural_period_s();
    let stiff_arc_s = is_stiff.then_some(arc_s);
    let least_s = case.record.as_ref().map_or(arc_s, |record| record.step_s.min(arc_s));
    // Impacts may be more than all arcs without them.
    if duration_s / least_s < FEW_ARCS && case.set_up.particle.is_none() {
        return Ok(Cost { stiff_arc_s, ..Cost::default() });
    }
    let (start, mut count) = (Instant::now(), Count::default());
    let mut trial = case.clone();
    trial.run.sample_times_s.clear();
    let request =
        Request { keep: false, longest_part_s: STEPS_A_CLOCK * least_s, go_on: &mut |_| start.elapsed() < TRIAL };
    let reached_s = simulate(&trial, &mut count, request)?.summary.simulated_s;
    // A flood of impacts at the very start may not have let time pass at all.
    let whole = duration_s / reached_s.max(duration_s * 1e-30);
    Ok(Cost { arcs: count.0 as f64 * whole, seconds: start.elapsed().as_secs_f64() * whole, stiff_arc_s })
}

/// How often a run looks up from its work, s of simulated time: about two thousand times, but not after each of a few
/// arcs, and not after so many arcs or rows that Ctrl-C is not answered at once.
///
/// # Errors
/// Names a value that is not physical.
pub fn longest_part_s(case: &Case, rate_hz: Option<f64>) -> Result<f64, Invalid> {
    let arc_s = match &case.record {
        Some(record) => record.step_s,
        None => Exact::new(&case.set_up, &case.excitation, &case.initial)?.shortest_arc_s(),
    };
    let part_s = (case.run.duration_s / 2_000.0).clamp(10_000.0 * arc_s, 300_000.0 * arc_s);
    Ok(rate_hz.map_or(part_s, |rate_hz| part_s.min(200_000.0 / rate_hz)))
}
