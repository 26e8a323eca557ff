//! A periodic orbit: its states, its multipliers and what is measured of it.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::ExactState;
use damprig_core::model::Initial;
use nalgebra::Complex;

use crate::boundary_problem::{BoundaryProblem, UNKNOWNS, eigenvalues};
use crate::flow::place::{OFFSET, PHASE, SLIDE, V, X};
use crate::flow::{N, STATE, Vector, complete, dot, exponential, times};
use crate::sequence::Guard;

/// A periodic orbit in SI units.
#[derive(Clone, Debug)]
pub struct Orbit {
    /// Values of the parameters.
    pub parameters: Vec<f64>,
    /// Drive periods after which it repeats.
    pub periods: u32,
    /// max |x| over the orbit, m.
    pub max_abs_x_m: f64,
    /// Mean over the drive periods of max |x| in each, m.
    pub mean_cycle_max_m: f64,
    /// max |y − x| over the orbit, m; 0 without a second mass.
    pub max_abs_y_minus_x_m: f64,
    /// Impacts on hard walls, or touches of soft ones, in the orbit.
    pub impacts: u32,
    /// The fastest approach speed of them, m/s; 0 without any.
    pub fastest_impact_m_per_s: f64,
    /// Floquet multipliers, largest magnitude first: two for a structure alone, four with a second mass.
    pub multipliers: Vec<Complex<f64>>,
    /// The state at the start of its first segment.
    pub start: ExactState,
    /// Phase of the drive there, rad, 0 to 2π.
    pub start_phase_rad: f64,
}

impl Orbit {
    /// Whether small disturbances decay: every multiplier is inside the unit circle.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.multipliers.iter().all(|m| m.norm() < 1.0)
    }

    /// The start as the initial state of a run; the drive's phase belongs to it.
    #[must_use]
    pub fn initial(&self) -> Initial {
        let s = &self.start;
        Initial { x_m: s.x_m, v_m_per_s: s.v_m_per_s, y_m: s.y_m(), u_m_per_s: s.u_m_per_s() }
    }
}

/// Two mirrored or repeated states are equal within this share of the motion. A fold is located to the root of its parameter's error.
const SYMMETRIC: f64 = 1e-4;

/// Longest step between samples of a segment: an angle of the drive, rad.
pub(crate) const SAMPLE_RAD: f64 = 0.1;

impl BoundaryProblem<'_> {
    /// The orbit of a solution.
    pub(crate) fn orbit(&self, unknowns: &[f64], values: &[f64]) -> Orbit {
        let (length, speed) = (self.system.length_m, self.system.length_m / self.system.time_s);
        let settings = self.settings(values);
        let equations = self.system.equations(&settings);
        let periods = self.sequence.periods;
        let mut cycle_peaks = vec![0.0_f64; periods as usize];
        let first = unknowns[PHASE];
        let (mut peak_offset, middle) = (0.0_f64, self.system.middle_m() / length);
        let (mut impacts, mut fastest) = (0, 0.0_f64);
        for (n, segment) in self.sequence.segments.iter().enumerate() {
            let (step, states, a) = self.samples(n, unknowns, &settings, SAMPLE_RAD);
            let mut see = |state: &Vector<f64>| {
                let cycle = ((state[PHASE] - first) / TAU).floor().clamp(0.0, f64::from(periods - 1)) as usize;
                cycle_peaks[cycle] = cycle_peaks[cycle].max(state[X].abs());
                peak_offset = peak_offset.max((state[OFFSET] + middle).abs());
            };
            for (k, state) in states.iter().enumerate() {
                see(state);
                let Some(next) = states.get(k + 1) else { break };
                for row in [V, SLIDE] {
                    if state[row] * next[row] < 0.0 {
                        see(&extremum(state, &a, row, step));
                    }
                }
            }
            if let (Guard::Wall(_), Some(end)) = (segment.end, states.last()) {
                impacts += 1;
                let approach = equations.rate(&equations.guard(&segment.phase, segment.end), &segment.phase);
                fastest = fastest.max(-dot(&approach, end));
            }
        }
        let mut multipliers = eigenvalues(&self.transition(unknowns, values));
        multipliers.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
        multipliers.truncate(self.system.size());
        Orbit {
            parameters: values.to_vec(),
            periods,
            max_abs_x_m: cycle_peaks.iter().copied().fold(0.0, f64::max) * length,
            mean_cycle_max_m: cycle_peaks.iter().sum::<f64>() / f64::from(periods) * length,
            max_abs_y_minus_x_m: peak_offset * length,
            impacts,
            fastest_impact_m_per_s: fastest * speed,
            multipliers,
            start: ExactState {
                x_m: unknowns[X] * length,
                v_m_per_s: unknowns[V] * speed,
                offset_m: unknowns[OFFSET] * length + self.system.middle_m(),
                slide_m_per_s: unknowns[SLIDE] * speed,
            },
            start_phase_rad: first.rem_euclid(TAU),
        }
    }

    /// Whether the orbit passes another one of half its period twice.
    pub(crate) fn is_doubled(&self, unknowns: &[f64]) -> bool {
        let segments = &self.sequence.segments;
        let half = segments.len() / 2;
        if !self.sequence.periods.is_multiple_of(2) || segments[..half] != segments[half..] {
            return false;
        }
        let (first, second) = unknowns.split_at(UNKNOWNS * half);
        let size = first.iter().map(|v| v.abs()).fold(1.0, f64::max);
        // The drive has turned between the halves.
        let is_same = |(n, (a, b)): (usize, (&f64, &f64))| n % UNKNOWNS == PHASE || (a - b).abs() <= SYMMETRIC * size;
        first.iter().zip(second).enumerate().all(is_same)
    }

    /// Whether the second half of the orbit mirrors the first: x(t + T/2) = −x(t), compared at the middle of the longest segment.
    pub(crate) fn is_symmetric(&self, unknowns: &[f64], values: &[f64]) -> bool {
        // The drive changes its sign over half an orbit only if that is an odd number of half turns.
        if self.sequence.periods.is_multiple_of(2) || !self.system.is_symmetric() {
            return false;
        }
        let equations = self.system.equations(&self.settings(values));
        let whole = TAU * f64::from(self.sequence.periods) / equations.turning;
        let durations = || unknowns.chunks(UNKNOWNS).map(|segment| segment[STATE]);
        let longest = durations().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((longest, duration)) = longest else { return false };
        let state = |after: f64| {
            let mut after = after.rem_euclid(whole);
            let within = |(_, duration): &(usize, f64)| {
                let is_within = after <= *duration;
                after -= if is_within { 0.0 } else { *duration };
                is_within
            };
            let (n, _) = durations().enumerate().find(within)?;
            let a = equations.matrix(&self.sequence.segments[n].phase);
            Some(times(&exponential(&a, after), &complete(&unknowns[UNKNOWNS * n..UNKNOWNS * n + STATE])))
        };
        let middle = durations().take(longest).sum::<f64>() + 0.5 * duration;
        let (Some(here), Some(there)) = (state(middle), state(middle + 0.5 * whole)) else { return false };
        let size = here[..4].iter().map(|v| v.abs()).fold(1.0, f64::max);
        (0..4).all(|k| (here[k] + there[k]).abs() <= SYMMETRIC * size)
    }
}

/// The state where the component `row` is zero, within a step from `state`.
fn extremum(state: &Vector<f64>, a: &[[f64; N]; N], row: usize, step: f64) -> Vector<f64> {
    let mut unit = [0.0; N];
    unit[row] = 1.0;
    let after = crate::checks::root_within(&unit, a, state, step).unwrap_or(0.0);
    times(&exponential(a, after), state)
}
