//! The sampled driver's third scalar: 64-bit fixed point, for a controller without floating point.
//!
//! 16 integer and 48 fractional bits: range ±32 768, resolution 3.6·10⁻¹⁵. It is meant for non-dimensional numbers: with
//! lengths in units of the clearance or of the starting amplitude ([`crate::integrator::sampled::Units`]) and
//! time in steps, displacements are of order 1 to 1000, and the smallest number that matters, the damping's share of a
//! step, 2ζωh·v ≈ 2·10⁻⁶, still has 29 bits. Sums and products saturate, so nothing wraps and nothing panics.

use crate::scalar::Scalar;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use fixed::types::I16F48;

/// A fixed-point number; see the [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fixed(I16F48);

impl Fixed {
    /// The raw bits, to compare two machines.
    #[must_use]
    pub fn to_bits(self) -> i64 {
        self.0.to_bits()
    }
}

impl Add for Fixed {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for Fixed {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl Mul for Fixed {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        Self(self.0.saturating_mul(other.0))
    }
}

impl Div for Fixed {
    type Output = Self;

    /// Division by zero gives the largest number of the dividend's sign, as a saturated quotient would.
    #[inline]
    fn div(self, other: Self) -> Self {
        if other.0 == I16F48::ZERO {
            return Self(if self.0 < I16F48::ZERO { I16F48::MIN } else { I16F48::MAX });
        }
        Self(self.0.saturating_div(other.0))
    }
}

impl Neg for Fixed {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self(self.0.saturating_neg())
    }
}

impl AddAssign for Fixed {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Fixed {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Scalar for Fixed {
    const ZERO: Self = Self(I16F48::ZERO);
    const ONE: Self = Self(I16F48::ONE);
    const EPSILON: Self = Self(I16F48::DELTA);

    fn from_f64(value: f64) -> Self {
        if value.is_nan() { Self::ZERO } else { Self(I16F48::saturating_from_num(value)) }
    }

    fn from_u8(value: u8) -> Self {
        Self(I16F48::from_num(value))
    }

    fn to_f64(self) -> f64 {
        self.0.to_num()
    }

    fn sqrt(self) -> Self {
        if self.0 <= I16F48::ZERO { Self::ZERO } else { Self(self.0.sqrt()) }
    }
}
