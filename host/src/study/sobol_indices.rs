//! Sobol' indices: the shares of a value's variance that follow from each input alone, and from it together with the others.
//!
//! The points are those of Saltelli: two sets A and B of independent points, and A with each of its columns from B. First-order indices
//! are those of Saltelli et al. (Comput. Phys. Commun. 181, 2010, table 2b), total ones those of Jansen (1999, table 2f there).

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use sobol::Sobol;
use sobol::params::JoeKuoD6;

use super::bootstrap::{IntervalEstimate, estimates};

/// Most inputs: Sobol's sequence has two dimensions for each.
pub const MAX_INPUTS: usize = 500;

/// Digits of a share in the base 2.
const BITS: u32 = 53;

/// Points for each base point: A, A with each column of B, B.
#[must_use]
pub const fn points_per_base(inputs: usize) -> usize {
    inputs + 2
}

/// The shares of the inputs at all points, base point by base point. A and B are Sobol's sequence in twice the dimensions, whose digits a
/// random number of the seed shifts: the points stay as even, and none is an end of a range.
#[must_use]
pub fn shares(count: usize, inputs: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let shifts: Vec<u64> = (0..2 * inputs).map(|_| random.next_u64() >> (64 - BITS)).collect();
    let scale = (1u64 << BITS) as f64;
    let shifted = |(share, shift): (&f64, &u64)| ((share * scale) as u64 ^ shift) as f64 / scale;
    let mut all = Vec::with_capacity(count * points_per_base(inputs));
    for base in Sobol::<f64>::new(2 * inputs, &JoeKuoD6::standard()).take(count) {
        let both: Vec<f64> = base.iter().zip(&shifts).map(shifted).collect();
        let (a, b) = both.split_at(inputs);
        all.push(a.to_vec());
        for input in 0..inputs {
            let mut mixed = a.to_vec();
            mixed[input] = b[input];
            all.push(mixed);
        }
        all.push(b.to_vec());
    }
    all
}

/// First-order and total index of each input, from the values at the points of [`shares`]. Base points with a value that is not a
/// number are left out; the number of the others is returned too.
#[must_use]
pub fn indices(values: &[f64], inputs: usize) -> (Vec<[IntervalEstimate; 2]>, usize) {
    let bases: Vec<&[f64]> = values
        .chunks_exact(points_per_base(inputs))
        .filter(|base| base.iter().all(|value| value.is_finite()))
        .collect();
    let ends = || bases.iter().flat_map(|base| [base[0], base[inputs + 1]]);
    // Sums of squares keep their digits around the mean.
    let mean = ends().sum::<f64>() / (2 * bases.len()) as f64;
    let terms = |base: &&[f64]| {
        let [a, b] = [base[0] - mean, base[inputs + 1] - mean];
        let mut terms = vec![1.0, a + b, a * a + b * b];
        for mixed in &base[1..=inputs] {
            let change = (mixed - mean) - a;
            terms.extend([change, b * change, change * change]);
        }
        terms
    };
    let terms: Vec<Vec<f64>> = bases.iter().map(terms).collect();
    let found = estimates(&terms, of_sums);
    (found.chunks_exact(2).map(|both| [both[0], both[1]]).collect(), bases.len())
}

/// First-order and total index of each input.
fn of_sums(sums: &[f64]) -> Vec<f64> {
    let [count, ends, squares] = [sums[0], sums[1], sums[2]];
    let mean = ends / (2.0 * count);
    let variance = squares / (2.0 * count) - mean * mean;
    let of = |input: &[f64]| {
        let first = (input[1] - mean * input[0]) / count;
        [first / variance, 0.5 * input[2] / count / variance]
    };
    sums[3..].chunks_exact(3).flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// The function of Ishigami and Homma (1990) with a = 7, b = 0.1, of shares of −π to π.
    fn ishigami(shares: &[f64]) -> f64 {
        let x: Vec<f64> = shares.iter().map(|share| PI * (2.0 * share - 1.0)).collect();
        libm::sin(x[0]) + 7.0 * libm::sin(x[1]) * libm::sin(x[1]) + 0.1 * libm::pow(x[2], 4.0) * libm::sin(x[0])
    }

    /// Its first-order and total indices in closed form.
    fn ishigami_indices() -> [[f64; 2]; 3] {
        let (a, b) = (7.0, 0.1);
        let (pi4, pi8) = (PI.powi(4), PI.powi(8));
        let first = 0.5 * (1.0 + b * pi4 / 5.0) * (1.0 + b * pi4 / 5.0);
        let second = a * a / 8.0;
        let both = b * b * pi8 * (1.0 / 18.0 - 1.0 / 50.0);
        let all = first + second + both;
        [[first / all, (first + both) / all], [second / all, second / all], [0.0, both / all]]
    }

    fn found(of: impl Fn(&[f64]) -> f64, count: usize, inputs: usize, seed: u64) -> Vec<[IntervalEstimate; 2]> {
        let values: Vec<f64> = shares(count, inputs, seed).iter().map(|shares| of(shares)).collect();
        indices(&values, inputs).0
    }

    #[test]
    fn the_indices_of_ishigamis_function_are_those_of_its_closed_form() {
        // The error of evenly spread points is about 1/n times a power of ln n; 0.005 is 20 times 1/4096.
        for (found, exact) in found(ishigami, 4096, 3, 1).iter().zip(ishigami_indices()) {
            for (estimate, exact) in found.iter().zip(exact) {
                assert!((estimate.value - exact).abs() < 0.005, "{} and not {exact}", estimate.value);
            }
        }
    }

    #[test]
    fn the_indices_of_a_product_are_those_of_its_closed_form() {
        // The function g of Sobol': ∏ (|4 x − 2| + a)/(1 + a); the variance of a factor is 1/(3 (1 + a)²).
        let a = [0.0, 1.0, 4.5, 9.0];
        let g = |shares: &[f64]| shares.iter().zip(a).map(|(x, a)| ((4.0 * x - 2.0).abs() + a) / (1.0 + a)).product();
        let variances = a.map(|a| 1.0 / (3.0 * (1.0 + a) * (1.0 + a)));
        let all: f64 = variances.iter().map(|variance| 1.0 + variance).product::<f64>() - 1.0;
        for ((found, own), input) in found(g, 4096, 4, 1).iter().zip(variances).zip(0..) {
            let others: f64 =
                variances.iter().enumerate().filter(|(other, _)| *other != input).map(|(_, v)| 1.0 + v).product();
            for (estimate, exact) in found.iter().zip([own / all, own * others / all]) {
                assert!((estimate.value - exact).abs() < 0.005, "{} and not {exact}", estimate.value);
            }
        }
    }

    #[test]
    fn at_least_95_percent_of_the_intervals_have_the_exact_index() {
        // Points of Sobol's sequence are more even than the independent ones that the bootstrap supposes: more intervals hold.
        let exact = ishigami_indices();
        let seeds = 10;
        let mut holding = 0;
        for seed in 0..seeds {
            for (found, exact) in found(ishigami, 256, 3, seed).iter().zip(&exact) {
                let holds = |(estimate, exact): (&IntervalEstimate, &f64)| {
                    let [low, high] = estimate.interval_95;
                    // Of an index that is computed without error the interval is a point.
                    low - 1e-12 <= *exact && *exact <= high + 1e-12
                };
                holding += found.iter().zip(exact).filter(|both| holds(*both)).count() as u64;
            }
        }
        assert!(holding as f64 >= 0.95 * (6 * seeds) as f64, "{holding} of {}", 6 * seeds);
    }

    #[test]
    fn a_base_point_with_a_missing_value_is_left_out_and_a_constant_has_no_indices() {
        let mut values: Vec<f64> = shares(64, 3, 1).iter().map(|shares| ishigami(shares)).collect();
        let without: Vec<f64> = [&values[..10], &values[15..]].concat();
        values[12] = f64::NAN;
        assert_eq!(indices(&values, 3), indices(&without, 3));
        assert_eq!(indices(&values, 3).1, 63);
        let (constant, _) = indices(&[2.5; 40], 3);
        assert!(constant.iter().flatten().all(|estimate| estimate.value.is_nan()));
        assert!(indices(&[f64::NAN; 40], 3).0.is_empty());
    }
}
