//! Compensated summation in `f32`: the rounding error of every addition is summed separately.

/// A sum with its rounding errors (Knuth's two-sum), good to about 48 bits. An addition takes nine operations that the
/// controller's hardware has. Sums in `f64`, which the hardware lacks, take a hundred instructions each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    high: f32,
    low: f32,
}

impl Sum {
    /// Adds a value.
    #[inline]
    pub fn push(&mut self, value: f32) {
        let sum = self.high + value;
        let added = sum - self.high;
        let low = self.low + ((self.high - (sum - added)) + (value - added));
        self.high = sum + low;
        self.low = low - (self.high - sum);
    }

    /// The sum, rounded once.
    #[must_use]
    pub fn value(&self) -> f32 {
        self.high + self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_small_values_added_to_a_large_one_are_not_lost() {
        let (mut sum, mut exact) = (Sum::default(), 1e6);
        sum.push(1e6);
        for n in 0..1_000_000u32 {
            let value = 1e-3 + (n % 7) as f32 * 1e-4;
            sum.push(value);
            exact += f64::from(value);
        }
        assert!((f64::from(sum.value()) / exact - 1.0).abs() < 1.2e-7, "{sum:?} {exact}");
    }
}
