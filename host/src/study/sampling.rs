//! How points are drawn from ranges.

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use sobol::Sobol;
use sobol::params::JoeKuoD6;

use super::{elementary_effects, sobol_indices};

/// How points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplingMethod {
    /// In each dimension one point in each of `count` equal parts (McKay, Beckman and Conover 1979).
    LatinHypercube,
    /// Sobol's sequence with the direction numbers of Joe and Kuo (2008), from its first point.
    Sobol,
    /// Points from which Sobol' indices are computed.
    SobolIndices,
    /// Trajectories from which elementary effects are computed.
    Morris,
}

/// Words of files, in the order of [`SamplingMethod::ALL`].
pub const SAMPLING_WORDS: &[&str] = &["latin_hypercube", "sobol", "sobol_indices", "morris"];

impl SamplingMethod {
    /// All, in the order of the words of files.
    pub const ALL: [Self; 4] = [Self::LatinHypercube, Self::Sobol, Self::SobolIndices, Self::Morris];

    /// As files name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        SAMPLING_WORDS[self as usize]
    }

    /// Whether its points are those of sensitivity indices.
    #[must_use]
    pub const fn is_for_indices(self) -> bool {
        matches!(self, Self::SobolIndices | Self::Morris)
    }

    /// Most ranges that points are drawn from.
    #[must_use]
    pub const fn most_ranges(self) -> usize {
        match self {
            Self::LatinHypercube | Self::Morris => usize::MAX,
            Self::Sobol => 2 * sobol_indices::MAX_INPUTS,
            Self::SobolIndices => sobol_indices::MAX_INPUTS,
        }
    }
}

/// Drawn points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// How.
    pub method: SamplingMethod,
    /// How many; of base points or trajectories where they are for indices.
    pub count: usize,
    /// Of the random numbers.
    pub seed: u64,
}

impl Sampling {
    /// Number of points in so many dimensions; `None` if there are more than a program can count.
    #[must_use]
    pub fn points(&self, dimensions: usize) -> Option<usize> {
        self.count.checked_mul(match self.method {
            SamplingMethod::LatinHypercube | SamplingMethod::Sobol => 1,
            SamplingMethod::SobolIndices => sobol_indices::points_per_base(dimensions),
            SamplingMethod::Morris => elementary_effects::points_per_trajectory(dimensions),
        })
    }

    /// Shares of the ranges, 0 to 1, a list of `dimensions` for each point.
    #[must_use]
    pub fn shares(&self, dimensions: usize) -> Vec<Vec<f64>> {
        match self.method {
            SamplingMethod::Sobol => Sobol::<f64>::new(dimensions, &JoeKuoD6::standard()).take(self.count).collect(),
            SamplingMethod::LatinHypercube => latin_hypercube(self.count, dimensions, self.seed),
            SamplingMethod::SobolIndices => sobol_indices::shares(self.count, dimensions, self.seed),
            SamplingMethod::Morris => elementary_effects::shares(self.count, dimensions, self.seed),
        }
    }
}

fn latin_hypercube(count: usize, dimensions: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut unit = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let mut points = vec![vec![0.0; dimensions]; count];
    for dimension in 0..dimensions {
        let mut part: Vec<usize> = (0..count).collect();
        // Fisher and Yates.
        for last in (1..count).rev() {
            part.swap(last, ((unit() * (last + 1) as f64) as usize).min(last));
        }
        for (point, part) in points.iter_mut().zip(part) {
            point[dimension] = (part as f64 + unit()) / count as f64;
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latin_hypercube_has_one_point_in_each_part_of_each_dimension() {
        let points = latin_hypercube(50, 3, 7);
        for dimension in 0..3 {
            let mut parts: Vec<usize> = points.iter().map(|point| (point[dimension] * 50.0) as usize).collect();
            parts.sort_unstable();
            assert_eq!(parts, (0..50).collect::<Vec<_>>());
        }
        assert_eq!(points, latin_hypercube(50, 3, 7));
        assert_ne!(points, latin_hypercube(50, 3, 8));
    }

    #[test]
    fn sobol_points_are_those_of_joe_and_kuo() {
        // The first points of their reference program, in three dimensions.
        let points = Sampling { method: SamplingMethod::Sobol, count: 5, seed: 1 }.shares(3);
        let expected =
            [[0.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.75, 0.25, 0.25], [0.25, 0.75, 0.75], [0.375, 0.375, 0.625]];
        assert_eq!(points, expected.map(Vec::from));
    }
}
