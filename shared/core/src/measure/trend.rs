//! Drift and scatter of a sequence of cycle maxima.

use super::sum::Sum;
use crate::scalar::Scalar;

/// Least-squares line through equally spaced values, updated value by value. Squared residuals are summed as they
/// appear (each is the error of the line so far, reduced by its leverage), so no precision is lost by subtracting large
/// sums.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trend {
    count: u32,
    mean: Sum,
    /// Σ (i − ī)(y − ȳ).
    covariance: Sum,
    /// Σ of the squared distances from the line.
    squares: f32,
}

/// Σ (i − ī)² of the indices 0 … n − 1.
fn spread(n: f32) -> f32 {
    n * (n * n - 1.0) * (1.0 / 12.0)
}

impl Trend {
    /// Takes the next value.
    pub fn push(&mut self, value: f32) {
        let n = self.count as f32;
        self.count += 1;
        if self.count == 1 {
            self.mean.push(value);
            return;
        }
        // Distance from the mean of the indices so far to this index.
        let along = 0.5 * (n + 1.0);
        let difference = value - self.mean.value();
        let spread = spread(n);
        if spread > 0.0 {
            let error = difference - self.covariance.value() / spread * along;
            let leverage = 1.0 / n + along * along / spread;
            self.squares += error * error / (1.0 + leverage);
        }
        let share = difference / (n + 1.0);
        self.covariance.push(along * share * n);
        self.mean.push(share);
    }

    /// The line's slope per value and the RMS distance of the values from it, both relative to the mean.
    ///
    /// `None` with fewer than three values or a mean that is not above zero.
    #[must_use]
    pub fn slope_and_scatter(&self) -> Option<(f32, f32)> {
        let mean = self.mean.value();
        if self.count < 3 || mean <= 0.0 {
            return None;
        }
        let n = self.count as f32;
        let slope = self.covariance.value() / spread(n);
        Some((slope / mean, Scalar::sqrt(self.squares / n) / mean))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_its_slope_and_no_scatter() {
        let mut trend = Trend::default();
        (0..40u8).for_each(|n| trend.push(1.0 + 0.25 * f32::from(n)));
        let (slope, scatter) = trend.slope_and_scatter().unwrap();
        let mean = 1.0 + 0.25 * 19.5;
        assert!((slope - 0.25 / mean).abs() < 1e-6 && scatter < 1e-6, "{slope} {scatter}");
    }

    #[test]
    fn an_alternating_sequence_scatters_and_does_not_drift() {
        let mut trend = Trend::default();
        (0..40).for_each(|n| trend.push(if n % 2 == 0 { 0.9 } else { 1.1 }));
        let (slope, scatter) = trend.slope_and_scatter().unwrap();
        assert!(slope.abs() < 1e-3 && (scatter - 0.1).abs() < 1e-3, "{slope} {scatter}");
    }

    #[test]
    fn a_long_sequence_gives_the_line_that_sums_in_double_precision_give() {
        let value = |n: u32| {
            let noise = (n.wrapping_mul(2_654_435_761) >> 8) as f32 / 16_777_216.0 - 0.5;
            0.05 + 1e-8 * n as f32 + 1e-4 * noise
        };
        let mut trend = Trend::default();
        let (mut sum, mut squares, mut times_index) = (0.0, 0.0, 0.0);
        let count = 10_000u32;
        for n in 0..count {
            trend.push(value(n));
            let y = f64::from(value(n));
            (sum, squares, times_index) = (sum + y, squares + y * y, times_index + y * f64::from(n));
        }
        let n = f64::from(count);
        let mean = sum / n;
        let slope = (times_index - sum * (n - 1.0) / 2.0) / (n * (n * n - 1.0) / 12.0);
        let residual = squares - n * mean * mean - slope * slope * n * (n * n - 1.0) / 12.0;
        let (found_slope, scatter) = trend.slope_and_scatter().unwrap();
        // 24 bits, plus the random walk of 10 000 roundings.
        assert!((f64::from(found_slope) * mean / slope - 1.0).abs() < 1e-4, "{found_slope} {slope}");
        assert!((f64::from(scatter) * mean / libm::sqrt(residual / n) - 1.0).abs() < 1e-4, "{scatter}");
    }
}
