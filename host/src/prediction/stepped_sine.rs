//! Predicts one stepped sine of one set-up: from point to point, as the controller measures it.

use std::f64::consts::TAU;

use damprig_core::integrator::base::BaseSegment;
use damprig_core::io::Invalid;
use damprig_core::model::Initial;
use damprig_motion::rig_model::RigMotion;
use damprig_motion::watch::{Detection, WatchedMotion};

use super::{Swing, steps_per_period, wall_force};
use crate::campaign::{CampaignSetUp, PointStart, SteppedSine};

/// Mean over whole cycles of max |x|, from the first cycle after the settling time.
struct CycleMaxima {
    settle_steps: f64,
    steps_per_cycle: f64,
    /// Cycle that the present maximum belongs to.
    cycle: u64,
    present_m: f64,
    sum_m: f64,
    cycles: u32,
}

impl CycleMaxima {
    fn new(settle_steps: f64, steps_per_cycle: f64) -> Self {
        Self { settle_steps, steps_per_cycle, cycle: 0, present_m: 0.0, sum_m: 0.0, cycles: 0 }
    }

    /// Adds |x| after a number of steps.
    fn push(&mut self, steps: u64, x_m: f64) {
        let since = steps as f64 - self.settle_steps;
        if since <= 0.0 {
            return;
        }
        self.present_m = self.present_m.max(x_m);
        let cycle = (since / self.steps_per_cycle) as u64;
        if cycle > self.cycle {
            self.sum_m += std::mem::take(&mut self.present_m);
            (self.cycle, self.cycles) = (cycle, self.cycles + 1);
        }
    }

    /// The mean; none before the first whole cycle.
    fn mean_m(&self) -> Option<f64> {
        (self.cycles > 0).then(|| self.sum_m / f64::from(self.cycles))
    }
}

/// Cycles before the last possible dwell of a point and in it. The controller begins a dwell at the start of a cycle, the
/// first after the settling time, and measures as many whole cycles as the dwell holds.
pub(super) fn whole_cycles(experiment: &SteppedSine, frequency_hz: f64) -> [f64; 2] {
    // The rounding of a decimal fraction is no further cycle.
    let settle = (experiment.settle_s * frequency_hz - 1e-6).ceil().max(0.0);
    let dwell = (experiment.dwell_s * frequency_hz + 1e-6).floor();
    let dwells = (experiment.longest_dwell_s() * frequency_hz / dwell + 1e-6).floor().max(1.0);
    [settle + (dwells - 1.0) * dwell, dwell]
}

/// A predicted stepped sine.
pub(super) struct PredictedSweep {
    pub swing: Swing,
    /// Frequency and X/Z (cycle maxima) of each point.
    pub points: Vec<(f64, f64)>,
    /// Largest |x| of all dwells, m.
    pub dwell_max_x_m: f64,
}

impl PredictedSweep {
    /// Adds further points of the same experiment.
    pub fn add(&mut self, further: Self) {
        self.swing = self.swing.or(further.swing);
        self.points.extend(further.points);
        self.dwell_max_x_m = self.dwell_max_x_m.max(further.dwell_max_x_m);
    }

    /// Of several starts of the particle: the largest displacements and forces, and the median of X/Z at each point.
    pub fn of_starts(all: &[Self]) -> Self {
        let swing = all.iter().fold(Swing::NOTHING, |largest, one| largest.or(one.swing));
        let dwell_max_x_m = all.iter().map(|one| one.dwell_max_x_m).fold(0.0, f64::max);
        let points = all.iter().map(|one| one.points.len()).min().unwrap_or(0);
        let median = |place: usize| {
            let mut ratios: Vec<f64> = all.iter().map(|one| one.points[place].1).collect();
            ratios.sort_by(f64::total_cmp);
            (all[0].points[place].0, ratios[ratios.len() / 2])
        };
        Self { swing, points: (0..points).map(median).collect(), dwell_max_x_m }
    }
}

/// One experiment on one set-up with base amplitude Z, at most `most_steps` steps of each point.
pub(super) fn simulate(
    set_up: &CampaignSetUp,
    experiment: &SteppedSine,
    base_amplitude_m: f64,
    (most_steps, detection): (u64, &Detection),
) -> Result<PredictedSweep, Invalid> {
    let model = set_up.rig_model_at(base_amplitude_m);
    let initial = Initial { y_m: set_up.spec.particle_start_m(base_amplitude_m), ..Initial::default() };
    let mut largest = Swing::NOTHING;
    let mut points = Vec::new();
    let mut dwell_max_x_m = 0.0_f64;
    let mut carried: Option<RigMotion> = None;
    for &frequency_hz in &experiment.frequencies_hz {
        let steps = steps_per_period(set_up, frequency_hz);
        let step_s = 1.0 / (frequency_hz * steps);
        let mut watched = WatchedMotion::new(&model, step_s, &initial, detection)?;
        if let Some(before) = carried.take() {
            watched.motion = before.counted_in(&model.set_up, step_s)?;
        }
        let [settle_steps, dwell_steps] = whole_cycles(experiment, frequency_hz).map(|cycles| cycles * steps);
        let wanted = (settle_steps + dwell_steps) as u64;
        let count = wanted.min(most_steps);
        if count < wanted {
            let predicted_s = count as f64 * step_s;
            largest.predicted_s = Some(largest.predicted_s.map_or(predicted_s, |least| least.min(predicted_s)));
        }
        let mut maxima = CycleMaxima::new(settle_steps, steps);
        let at = |step: u64| {
            let angle = TAU * (step as f64 % steps) / steps;
            (base_amplitude_m * angle.sin(), base_amplitude_m * angle.cos() * TAU / steps)
        };
        let mut start = at(0);
        for step in 0..count {
            let end = at(step + 1);
            let x = watched.step(&BaseSegment::hermite(start.0, end.0, start.1, end.1));
            start = end;
            maxima.push(step + 1, x);
            if step as f64 >= settle_steps {
                dwell_max_x_m = dwell_max_x_m.max(x);
            }
            if x > largest.max_x_m {
                (largest.max_x_m, largest.frequency_hz) = (x, frequency_hz);
            }
        }
        watched.motion.refused().map_or(Ok(()), Err)?;
        points.extend(maxima.mean_m().map(|x_m| (frequency_hz, x_m / base_amplitude_m)));
        largest.wall_force_n = wall_force::larger(largest.wall_force_n, watched.watch.largest_force_n);
        if experiment.start == PointStart::CarryOver {
            carried = Some(watched.motion);
        }
    }
    Ok(PredictedSweep { swing: largest, points, dwell_max_x_m })
}
