//! The real number type of the calculations: `f64` on a computer and `f32` on the controller, from one source.
//!
//! The trait holds only operations that IEEE 754 defines to the last bit (`+ − × ÷`, comparison, `|·|`), and a square
//! root and a power made of them, so code written against it gives the same bits on every machine. Other functions (sine,
//! exponential) are called by path from [`libm`] or [`crate::sine`] where they are needed. `num_traits::Float` is not
//! used: built for a host it forwards to the system's functions, whose last bits differ.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A real number type with exactly specified arithmetic.
pub trait Scalar:
    Copy
    + Debug
    + Default
    + PartialEq
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Send
    + Sync
    + 'static
{
    /// 0
    const ZERO: Self;
    /// 1
    const ONE: Self;
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;

    /// The representable number nearest to `value`.
    fn from_f64(value: f64) -> Self;

    /// Converts a small whole number.
    fn from_u8(value: u8) -> Self;

    /// The value as `f64` (exact for both floating-point types).
    fn to_f64(self) -> f64;

    /// The square root of a non-negative number, within one unit in the last place.
    #[must_use]
    fn sqrt(self) -> Self;

    /// `self` to the power of `exponent`, of a `self` that is not negative.
    #[must_use]
    fn power(self, exponent: Self) -> Self;

    /// `|self|`
    #[must_use]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }

    /// The larger of the two.
    #[must_use]
    fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }

    /// The smaller of the two.
    #[must_use]
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
}

impl Scalar for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const EPSILON: Self = f64::EPSILON;

    #[inline]
    fn from_f64(value: f64) -> Self {
        value
    }

    #[inline]
    fn from_u8(value: u8) -> Self {
        f64::from(value)
    }

    #[inline]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    fn power(self, exponent: Self) -> Self {
        libm::pow(self, exponent)
    }
}

impl Scalar for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const EPSILON: Self = f32::EPSILON;

    #[inline]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline]
    fn from_u8(value: u8) -> Self {
        f32::from(value)
    }

    #[inline]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    /// Three Heron steps from an estimate made by halving the exponent. The estimate is within 3.5 %; after three steps
    /// only rounding is left (1 unit in the last place). The controller divides in one instruction, while `libm`
    /// computes the root bit by bit.
    fn sqrt(self) -> Self {
        if self < Self::MIN_POSITIVE {
            // A subnormal number is scaled by 2⁴⁸ to a normal one. A negative number has no root.
            return match self {
                0.0 => self,
                _ if self < 0.0 => Self::NAN,
                _ => Scalar::sqrt(self * 281_474_976_710_656.0) * (1.0 / 16_777_216.0),
            };
        }
        if self.is_nan() || self > Self::MAX {
            return self;
        }
        let mut root = Self::from_bits(0x1fbd_1df5 + (self.to_bits() >> 1));
        for _ in 0..3 {
            root = 0.5 * (root + self / root);
        }
        root
    }

    fn power(self, exponent: Self) -> Self {
        libm::powf(self, exponent)
    }

    /// A single instruction on the controller.
    #[inline]
    fn abs(self) -> Self {
        libm::fabsf(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_precision_root_is_within_a_unit_in_the_last_place() {
        let mut bits = 1u32;
        while bits < f32::INFINITY.to_bits() {
            let (value, root) = (f32::from_bits(bits), <f32 as Scalar>::sqrt(f32::from_bits(bits)));
            let off = root.to_bits().abs_diff(libm::sqrtf(value).to_bits());
            assert!(off <= 1, "√{value:e} is {root:e}, {off} off");
            bits += 10_007;
        }
        assert_eq!([0.0, f32::INFINITY].map(<f32 as Scalar>::sqrt), [0.0, f32::INFINITY]);
        assert!([-1.0, f32::NAN].map(<f32 as Scalar>::sqrt).iter().all(|root| root.is_nan()));
    }
}
