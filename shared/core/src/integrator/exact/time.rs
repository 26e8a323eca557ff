//! Time in double-double precision, so that a long run adds many short arcs without losing digits.

use core::f64::consts::TAU;

/// 2π minus TAU: the rounding error of TAU.
const TAU_REST: f64 = 2.449_293_598_294_706_4e-16;

/// An instant, s: the sum of a rounded value and its rounding error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Time {
    rounded: f64,
    rest: f64,
}

impl Time {
    /// Exactly `seconds`.
    #[must_use]
    pub fn at(seconds: f64) -> Self {
        Self { rounded: seconds, rest: 0.0 }
    }

    /// The nearest `f64`, s.
    #[inline]
    #[must_use]
    pub fn seconds(self) -> f64 {
        self.rounded
    }

    /// This instant plus `seconds`.
    #[inline]
    #[must_use]
    pub fn plus(self, seconds: f64) -> Self {
        let (sum, lost) = two_sum(self.rounded, seconds);
        let (rounded, rest) = two_sum(sum, lost + self.rest);
        Self { rounded, rest }
    }

    /// self − `earlier`, s.
    #[must_use]
    pub fn since(self, earlier: Self) -> f64 {
        (self.rounded - earlier.rounded) + (self.rest - earlier.rest)
    }

    /// `seconds` − self, s.
    #[inline]
    #[must_use]
    pub fn until(self, seconds: f64) -> f64 {
        (seconds - self.rounded) - self.rest
    }

    /// `angular_frequency_rad_per_s` × time, reduced to one turn; absolute error a few 10⁻¹⁶ up to 10⁸ turns.
    #[must_use]
    pub fn phase_rad(self, angular_frequency_rad_per_s: f64) -> f64 {
        let (angle, lost) = two_product(angular_frequency_rad_per_s, self.rounded);
        let lost = lost + angular_frequency_rad_per_s * self.rest;
        let turns = libm::round(angle / TAU);
        let (whole, whole_lost) = two_product(turns, TAU);
        (angle - whole) - whole_lost - turns * TAU_REST + lost
    }
}

/// `a + b` and its rounding error (Knuth).
#[inline]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

/// `a × b` and its rounding error (Dekker; without fused operations, so the bits are the same on every machine).
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let ((a1, a2), (b1, b2)) = (split(a), split(b));
    (product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2)
}

/// Splits `a` into two halves of 26 bits.
fn split(a: f64) -> (f64, f64) {
    let scaled = 134_217_729.0 * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_million_short_arcs_add_up_without_rounding_error() {
        let mut time = Time::default();
        for _ in 0..10_000_000 {
            time = time.plus(0.1);
        }
        // 10⁷ × the nearest double to 0.1, whose own error is 5.55e-18.
        assert!(time.until(1e6).abs() < 1e-10);
        assert!((time.until(1e6) + 1e7 * 5.551_115_123_125_783e-18).abs() < 1e-15);
    }

    #[test]
    fn the_phase_keeps_its_digits_after_a_million_turns() {
        let turns = 1_000_000.0;
        let phase = Time::at(turns).phase_rad(TAU);
        // 10⁶ turns of TAU fall short of 2π·10⁶ by 10⁶·TAU_REST.
        assert!((phase + turns * TAU_REST).abs() < 1e-16);
    }
}
