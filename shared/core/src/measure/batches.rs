//! The mean of a sequence whose neighbours may be correlated, with its uncertainty.

use crate::scalar::Scalar;

/// Most batches; a full list is merged in pairs.
const MAX: usize = 16;

/// Means of batches of successive values. The batches grow with the sequence, so that their means become independent
/// even if neighbouring values are not.
#[derive(Clone, Copy, Debug)]
pub struct Batches {
    means: [f32; MAX],
    full: usize,
    /// Values in a full batch.
    size: u32,
    sum: f32,
    count: u32,
}

impl Default for Batches {
    fn default() -> Self {
        Self { means: [0.0; MAX], full: 0, size: 1, sum: 0.0, count: 0 }
    }
}

fn mean_and_variance_of_it(values: &[f32]) -> (f32, f32) {
    let n = values.len() as f32;
    let mean = values.iter().sum::<f32>() / n;
    let squares = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>();
    (mean, squares / ((n - 1.0) * n))
}

impl Batches {
    /// Takes the next value.
    pub(super) fn push(&mut self, value: f32) {
        self.sum += value;
        self.count += 1;
        if self.count < self.size {
            return;
        }
        self.means[self.full] = self.sum / self.size as f32;
        self.full += 1;
        (self.sum, self.count) = (0.0, 0);
        if self.full == MAX {
            for n in 0..MAX / 2 {
                self.means[n] = 0.5 * (self.means[2 * n] + self.means[2 * n + 1]);
            }
            self.full = MAX / 2;
            self.size *= 2;
        }
    }

    /// Half-width of the 95 % interval of the mean. `None` with fewer than four batches.
    pub(super) fn half_width(&self) -> Option<f32> {
        let means = self.means.get(..self.full).filter(|means| means.len() >= 4)?;
        let (_, variance) = mean_and_variance_of_it(means);
        // Student's t for 95 % with 3 to 15 degrees of freedom, within 3 %: 3.18, 2.57, 2.36, 2.26, 2.13.
        let degrees = (means.len() - 1) as f32;
        let t = 1.96 + 2.4 / degrees + 3.6 / (degrees * degrees);
        Some(t * Scalar::sqrt(variance))
    }

    /// The first and the second half have different means: the difference is beyond 2.5 standard uncertainties.
    pub(super) fn drifts(&self) -> bool {
        let Some(means) = self.means.get(..self.full).filter(|means| means.len() >= 4) else { return true };
        let (first, second) = means.split_at(means.len() / 2);
        let ((mean, variance), (later_mean, later_variance)) =
            (mean_and_variance_of_it(first), mean_and_variance_of_it(second));
        let difference = later_mean - mean;
        difference * difference > 2.5 * 2.5 * (variance + later_variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Correlated noise about 1: each value is 0.6 of the one before plus a uniform one.
    fn correlated(seed: u32, count: u32) -> Batches {
        let (mut state, mut value, mut batches) = (seed, 0.0, Batches::default());
        for _ in 0..count {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            value = 0.6 * value + 0.1 * ((state >> 8) as f32 / 16_777_216.0 - 0.5);
            batches.push(1.0 + value);
        }
        batches
    }

    #[test]
    fn the_interval_of_a_mean_covers_it_although_neighbours_are_correlated() {
        let covers = |seed: &u32| {
            let batches = correlated(seed.wrapping_mul(2_654_435_761), 120);
            let mean = batches.means[..batches.full].iter().sum::<f32>() / batches.full as f32;
            (mean - 1.0).abs() < batches.half_width().unwrap()
        };
        let covered = (1..=400u32).filter(covers).count();
        // Batches of 8 to 16 values keep some correlation: less than the 380 of independent batches.
        assert!((340..396).contains(&covered), "{covered} of 400");
    }

    #[test]
    fn a_rising_sequence_drifts_and_a_wandering_one_seldom_does() {
        let mut rising = Batches::default();
        (0..60).for_each(|n| rising.push(1.0 + 0.01 * n as f32));
        assert!(rising.drifts());
        let drifting = (1..=400u32).filter(|seed| correlated(seed.wrapping_mul(40_503), 120).drifts()).count();
        assert!(drifting < 40, "{drifting} of 400");
    }
}
