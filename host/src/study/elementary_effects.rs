//! Morris's elementary effects: what a step of half the range of one input changes, from many places.
//!
//! Each trajectory begins at a random point and takes a step in each input, in a random order (Morris, Technometrics 33, 1991). An effect is the
//! change over the step as a share of the range. The mean of their magnitudes is µ* (Campolongo, Cariboni and Saltelli 2007); a standard deviation
//! as large as µ* says that the effect of an input is not linear, or depends on the others.

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::bootstrap::{IntervalEstimate, estimates};

/// Levels of an input, in the middles of equal parts of its range, so that the ends of a distribution, which are rare, do not decide.
const LEVELS: u64 = 4;

/// A step, as a share of the range: half the levels, so that each is as often met.
const STEP: f64 = 0.5;

/// Points of a trajectory.
#[must_use]
pub const fn points_per_trajectory(inputs: usize) -> usize {
    inputs + 1
}

/// The shares of the inputs at all points, trajectory by trajectory.
#[must_use]
pub fn shares(trajectories: usize, inputs: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut below = |count: u64| ((random.next_u64() >> 32) * count) >> 32;
    let mut all = Vec::with_capacity(trajectories * points_per_trajectory(inputs));
    for _ in 0..trajectories {
        let mut point: Vec<f64> = (0..inputs).map(|_| (below(LEVELS) as f64 + 0.5) / LEVELS as f64).collect();
        let mut order: Vec<usize> = (0..inputs).collect();
        // Fisher and Yates.
        for last in (1..inputs).rev() {
            order.swap(last, below(last as u64 + 1) as usize);
        }
        all.push(point.clone());
        for input in order {
            point[input] += if point[input] < STEP { STEP } else { -STEP };
            all.push(point.clone());
        }
    }
    all
}

/// For each input the mean of its effects, the mean of their magnitudes (µ*) and their standard deviation (σ), from the values at the points
/// of [`shares`]. Trajectories with a value that is not a number are left out; the number of the others is returned too.
#[must_use]
pub fn effects(shares: &[Vec<f64>], values: &[f64], inputs: usize) -> (Vec<[IntervalEstimate; 3]>, usize) {
    let points = points_per_trajectory(inputs);
    let whole = |(_, values): &(&[Vec<f64>], &[f64])| values.iter().all(|value| value.is_finite());
    let terms = |(shares, values): (&[Vec<f64>], &[f64])| {
        let mut terms = vec![0.0; 1 + 3 * inputs];
        terms[0] = 1.0;
        for (shares, values) in shares.windows(2).zip(values.windows(2)) {
            let step = |input: &usize| shares[1][*input] - shares[0][*input];
            let Some(input) = (0..inputs).find(|input| step(input) != 0.0) else { continue };
            let effect = (values[1] - values[0]) / step(&input);
            terms[1 + 3 * input..4 + 3 * input].copy_from_slice(&[effect, effect.abs(), effect * effect]);
        }
        terms
    };
    let terms: Vec<Vec<f64>> =
        shares.chunks_exact(points).zip(values.chunks_exact(points)).filter(whole).map(terms).collect();
    let found = estimates(&terms, of_sums);
    (found.chunks_exact(3).map(|all| [all[0], all[1], all[2]]).collect(), terms.len())
}

/// Mean, mean magnitude and standard deviation of each input's effects.
fn of_sums(sums: &[f64]) -> Vec<f64> {
    let count = sums[0];
    let of = |input: &[f64]| {
        let mean = input[0] / count;
        let variance = (input[2] - count * mean * mean).max(0.0) / (count - 1.0);
        [mean, input[1] / count, variance.sqrt()]
    };
    sums[1..].chunks_exact(3).flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(of: impl Fn(&[f64]) -> f64, trajectories: usize, inputs: usize) -> Vec<[IntervalEstimate; 3]> {
        let shares = shares(trajectories, inputs, 3);
        let values: Vec<f64> = shares.iter().map(|shares| of(shares)).collect();
        effects(&shares, &values, inputs).0
    }

    #[test]
    fn the_effects_of_a_linear_function_are_its_coefficients_without_spread() {
        let coefficients = [3.0, -0.5, 0.0, 20.0];
        let linear = |shares: &[f64]| shares.iter().zip(coefficients).map(|(x, c)| x * c).sum();
        for (found, coefficient) in found(linear, 10, 4).iter().zip(coefficients) {
            for (estimate, exact) in found.iter().zip([coefficient, coefficient.abs(), 0.0]) {
                // Rounding of values of 20, and the root of what is left of a difference of their squares.
                let most = if exact == 0.0 { 1e-6 } else { 1e-13 };
                assert!((estimate.value - exact).abs() < most, "{} and not {exact}", estimate.value);
                assert!(estimate.interval_95.iter().all(|end| (end - exact).abs() < most));
            }
        }
    }

    #[test]
    fn the_effects_of_a_product_spread_as_its_other_factor() {
        // x·y: the effect of x is y, which is 1/8, 3/8, 5/8 or 7/8: its mean is 1/2, its variance 5/64.
        let trajectories = 4000;
        let product = found(|shares| shares[0] * shares[1], trajectories, 2);
        for [mean, magnitude, deviation] in product {
            let variance: f64 = 5.0 / 64.0;
            let standard_error = (variance / trajectories as f64).sqrt();
            assert!((mean.value - 0.5).abs() < 4.0 * standard_error && magnitude == mean, "{mean:?}");
            assert!((deviation.value - variance.sqrt()).abs() < 4.0 * standard_error, "{deviation:?}");
            assert!(mean.interval_95[0] < 0.5 && 0.5 < mean.interval_95[1]);
        }
    }

    #[test]
    fn every_point_is_in_the_middle_of_a_part_and_one_step_from_the_last() {
        for trajectory in shares(50, 5, 7).chunks_exact(6) {
            let mut moved = Vec::new();
            for pair in trajectory.windows(2) {
                let steps: Vec<(usize, f64)> =
                    (0..5).map(|input| (input, pair[1][input] - pair[0][input])).filter(|step| step.1 != 0.0).collect();
                assert!(steps.len() == 1 && steps[0].1.abs() == 0.5, "{steps:?}");
                moved.push(steps[0].0);
            }
            moved.sort_unstable();
            assert_eq!(moved, [0, 1, 2, 3, 4], "each input moves once");
            assert!(trajectory.iter().flatten().all(|share| [0.125, 0.375, 0.625, 0.875].contains(share)));
        }
    }

    #[test]
    fn a_trajectory_with_a_missing_value_is_left_out() {
        let shares = shares(20, 2, 1);
        let mut values: Vec<f64> = shares.iter().map(|shares| shares[0]).collect();
        values[4] = f64::NAN;
        assert_eq!(effects(&shares, &values, 2).1, 19);
    }
}
