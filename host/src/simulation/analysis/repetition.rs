//! Whether the last periods of a motion repeat: their states at the section, and their largest |x|.

use damprig_core::integrator::exact::ExactState;

use crate::simulation::statistics::STEADY;

/// Fewest periods that are compared, in a run that has as many.
const COMPARED: usize = 20;

/// The repetition of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Repetition {
    /// The smallest number of periods after which it repeats within the tolerance.
    pub(super) after: Option<usize>,
    /// The largest relative difference between periods that should be equal; without a repetition, the least of them.
    pub(super) within: f64,
}

impl Repetition {
    /// Of the last periods' states and largest |x|, oldest first. Displacements are relative to the size of the structure's
    /// motion, those of the second mass to the larger of both.
    pub(super) fn of(states: &[ExactState], maxima_m: &[f64], angular_frequency_rad_per_s: f64) -> Self {
        let largest = |value: fn(&ExactState) -> f64| states.iter().map(|s| value(s).abs()).fold(0.0, f64::max);
        let turning = angular_frequency_rad_per_s;
        let own = largest(|s| s.x_m).max(largest(|s| s.v_m_per_s) / turning);
        let second = own.max(largest(|s| s.offset_m)).max(largest(|s| s.slide_m_per_s) / turning);
        let columns: [(Vec<f64>, f64); 5] = [
            (states.iter().map(|s| s.x_m).collect(), own),
            (states.iter().map(|s| s.v_m_per_s).collect(), own * turning),
            (states.iter().map(|s| s.offset_m).collect(), second),
            (states.iter().map(|s| s.slide_m_per_s).collect(), second * turning),
            (maxima_m.to_vec(), maxima_m.iter().copied().fold(0.0, f64::max)),
        ];
        let mut least = f64::INFINITY;
        for after in 1..=states.len() / 2 {
            let within = columns.iter().map(|(values, scale)| spread(values, after) / scale.max(f64::MIN_POSITIVE));
            let within = within.fold(0.0, f64::max);
            if within <= STEADY {
                return Self { after: Some(after), within };
            }
            least = least.min(within);
        }
        Self { after: None, within: least }
    }
}

/// The largest difference between values that are a multiple of `after` apart, among the last ones.
fn spread(values: &[f64], after: usize) -> f64 {
    let last = &values[values.len() - values.len().min(COMPARED.max(2 * after))..];
    let classes = (0..after).map(|first| {
        let class = last.iter().skip(first).step_by(after);
        let (low, high) = class.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
        high - low
    });
    classes.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(maxima_m: &[f64]) -> Repetition {
        let states: Vec<ExactState> =
            maxima_m.iter().map(|x_m| ExactState { x_m: *x_m, ..ExactState::default() }).collect();
        Repetition::of(&states, maxima_m, 1.0)
    }

    #[test]
    fn a_pattern_of_three_repeats_after_three_and_a_slow_drift_does_not_repeat() {
        let pattern: Vec<f64> = (0..64).map(|n| [1.0, 2.0, 5.0][n % 3]).collect();
        assert_eq!(of(&pattern), Repetition { after: Some(3), within: 0.0 });
        // Two successive periods differ by less than the tolerance, twenty do not.
        let drift: Vec<f64> = (0..64).map(|n| 1.0 + 2e-4 * n as f64).collect();
        let answer = of(&drift);
        assert!(answer.after.is_none() && answer.within > STEADY, "{answer:?}");
        // Only the end counts: what was long ago is forgotten.
        let settled: Vec<f64> = (0..64).map(|n| if n < 30 { 2.0 } else { 1.0 }).collect();
        assert_eq!(of(&settled).after, Some(1));
    }
}
