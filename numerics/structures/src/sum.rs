//! Sums that know their rounding.

/// A sum with the size of its terms.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sum {
    pub sum: f64,
    pub size: f64,
}

impl Sum {
    pub fn of(value: f64) -> Self {
        Self { sum: value, size: value.abs() }
    }

    pub fn add(&mut self, value: f64, size: f64) {
        self.sum += value;
        self.size += size;
    }

    /// The sum; zero where it is no more than rounding.
    pub fn value(self) -> f64 {
        if self.sum.abs() <= 4.0 * f64::EPSILON * self.size { 0.0 } else { self.sum }
    }
}
