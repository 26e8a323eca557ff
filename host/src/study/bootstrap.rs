//! Uncertainty of an estimate by the bootstrap: what it would be of samples drawn from the sample itself (Efron 1979).

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::Serialize;

use super::over::quantile;

/// Samples drawn from the sample.
const RESAMPLES: u64 = 1000;

/// Most members of a sample; of more, neighbours are drawn together.
const MAX_MEMBERS: usize = 4096;

/// Seed of the draws.
const SEED: u64 = 1;

/// A value with an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IntervalEstimate {
    /// The value; not a number if it cannot be computed.
    pub value: f64,
    /// The 2.5 % and 97.5 % quantiles of the value over samples drawn from the sample.
    pub interval_95: [f64; 2],
}

/// Estimates that follow from sums over the members of a sample, of which the terms are `terms`.
#[must_use]
pub fn estimates(terms: &[Vec<f64>], of_sums: impl Fn(&[f64]) -> Vec<f64> + Sync) -> Vec<IntervalEstimate> {
    let Some(width) = terms.first().map(Vec::len) else { return Vec::new() };
    let sum = |members: &mut dyn Iterator<Item = &Vec<f64>>| {
        let mut sums = vec![0.0; width];
        members.for_each(|terms| sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term));
        sums
    };
    let members: Vec<Vec<f64>> =
        terms.chunks(terms.len().div_ceil(MAX_MEMBERS)).map(|chunk| sum(&mut chunk.iter())).collect();
    let resampled = |number: u64| {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED + number);
        // Bias below the number of members over 2³².
        let mut place = || ((random.next_u64() >> 32) as usize * members.len()) >> 32;
        of_sums(&sum(&mut (0..members.len()).map(|_| &members[place()])))
    };
    let all: Vec<Vec<f64>> = (0..RESAMPLES).into_par_iter().map(resampled).collect();
    let estimate = |(place, value): (usize, f64)| {
        let mut values: Vec<f64> = all.iter().map(|values| values[place]).collect();
        values.sort_by(f64::total_cmp);
        IntervalEstimate { value, interval_95: [0.025, 0.975].map(|share| quantile(&values, share)) }
    };
    of_sums(&sum(&mut members.iter())).into_iter().enumerate().map(estimate).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_a_mean_has_the_width_of_its_standard_error() {
        // 0 and 1 as often: the standard error of their mean is 1/(2√n). The bootstrap's own error with 1000 samples is about 5 %.
        let terms: Vec<Vec<f64>> = (0..400).map(|n| vec![1.0, f64::from(n % 2)]).collect();
        let mean = estimates(&terms, |sums| vec![sums[1] / sums[0]])[0];
        let [low, high] = mean.interval_95;
        assert_eq!(mean.value, 0.5);
        let expected = 2.0 * 1.96 / (2.0 * 400.0_f64.sqrt());
        assert!(((high - low) / expected - 1.0).abs() < 0.15, "{low} to {high}, expected width {expected}");
    }

    #[test]
    fn neighbours_of_a_large_sample_are_drawn_together_and_the_estimate_is_that_of_all() {
        let mut random = fastrand::Rng::with_seed(1);
        let terms: Vec<Vec<f64>> = (0..10_000).map(|_| vec![1.0, random.f64()]).collect();
        let mean = estimates(&terms, |sums| vec![sums[1] / sums[0]])[0];
        // The standard error of the mean of a uniform distribution from 0 to 1.
        let expected = 2.0 * 1.96 / 12.0_f64.sqrt() / 10_000.0_f64.sqrt();
        let all = terms.iter().map(|terms| terms[1]).sum::<f64>() / 10_000.0;
        assert!((mean.value - all).abs() < 1e-12 && (all - 0.5).abs() < expected, "{} {all}", mean.value);
        let [low, high] = mean.interval_95;
        assert!(((high - low) / expected - 1.0).abs() < 0.15, "{low} to {high}, expected width {expected}");
        assert!(estimates(&[], |_| vec![0.0]).is_empty());
    }
}
