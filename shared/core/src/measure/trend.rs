//! Whether a sequence of cycle maxima still drifts, and how much it scatters.

/// Least-squares line through equally spaced values.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trend {
    count: u32,
    sum: f64,
    sum_of_squares: f64,
    sum_times_index: f64,
}

impl Trend {
    /// Takes the next value.
    pub fn push(&mut self, value: f32) {
        let value = f64::from(value);
        self.sum_times_index += value * f64::from(self.count);
        self.sum += value;
        self.sum_of_squares += value * value;
        self.count += 1;
    }

    /// The line's slope per value and the RMS distance of the values from it, both relative to the mean.
    ///
    /// `None` with fewer than three values or a mean of zero.
    #[must_use]
    pub fn slope_and_scatter(&self) -> Option<(f64, f64)> {
        if self.count < 3 || self.sum <= 0.0 {
            return None;
        }
        let n = f64::from(self.count);
        let mean = self.sum / n;
        // Σ (i − ī)² and Σ (i − ī) y of the indices 0 … n−1.
        let spread = n * (n * n - 1.0) / 12.0;
        let covariance = self.sum_times_index - self.sum * (n - 1.0) / 2.0;
        let slope = covariance / spread;
        let residual = (self.sum_of_squares - n * mean * mean - slope * covariance).max(0.0);
        Some((slope / mean, libm::sqrt(residual / n) / mean))
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
        assert!((slope - 0.25 / mean).abs() < 1e-12 && scatter < 1e-7, "{slope} {scatter}");
    }

    #[test]
    fn an_alternating_sequence_scatters_and_does_not_drift() {
        let mut trend = Trend::default();
        (0..40).for_each(|n| trend.push(if n % 2 == 0 { 0.9 } else { 1.1 }));
        let (slope, scatter) = trend.slope_and_scatter().unwrap();
        assert!(slope.abs() < 1e-3 && (scatter - 0.1).abs() < 1e-3, "{slope} {scatter}");
    }
}
