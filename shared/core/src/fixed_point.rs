//! 64-bit fixed-point scalar for the sampled driver on a controller without floating point.
//!
//! 16 integer and 48 fractional bits ([`I16F48`]): range ±32 768, resolution u = 2⁻⁴⁸ = 3.6·10⁻¹⁵. A product is
//! truncated (at most u too low), sums are exact, and both saturate: nothing wraps and nothing panics.
//!
//! # Range
//! Lengths are counted in a unit of the motion's own size ([`crate::integrator::units::Units`]: the clearance or the
//! starting amplitude), time in steps of h, forces per structure mass. Displacements are then of order 1: a structure
//! at resonance with ζ = 0.0038 moves 130 base amplitudes, and the range leaves room for 250 times as much. Velocities
//! are smaller by ωh ≤ 0.1, accelerations by (ωh)². The largest other numbers are the mass ratio and the factors up to
//! 7 of the derivatives. A quotient that saturates is a time beyond the step, so it produces no event.
//!
//! # Resolution
//! At 2.5 Hz and 1 kHz ωh = 0.0157. The smallest number that matters is the damping's share of a step, 2ζωh·v ≈ 2·10⁻⁶:
//! 29 bits. Errors from one second of motion (1000 steps), in units of length:
//!
//! * *Truncated products.* The velocity of a step contains 3, 2, 2, 2, 2 and 2 products in the series' terms 2 to 7,
//!   each times its power: at most 56 u. As a steady acceleration this displaces the structure's equilibrium by 56
//!   u/(ωh)² = 8·10⁻¹⁰, and the structure swings about it: 1.6·10⁻⁹. This part does not accumulate from step to step;
//!   its random part, 56 u·√(1000/12)/(ωh) = 1·10⁻¹⁰, does.
//! * *Coefficients.* Half the stiffness, (ωh)²/2 = 1.2·10⁻⁴, has an error of u. The relative error of the frequency is
//!   1.5·10⁻¹¹, the error of the phase 2.3·10⁻¹⁰.
//! * *Internal friction.* Half its acceleration has an error of 1.25 u: 1000²·1.25 u = 4.4·10⁻⁹ in the particle's
//!   position, 1000·2.5 u/(ωh) = 5.6·10⁻¹⁰ in its velocity. Without friction the particle flies exactly: the increments
//!   of y − x are those of −x, bit for bit.
//!
//! The total is 2·10⁻⁹ for the structure and, with a margin of a third for steps that contain events, 6·10⁻⁹ and
//! 8·10⁻¹⁰ for the particle. Impacts amplify such an error as they do any small change of the state.
//! `tests/integration/scalars.rs` adds these errors to a motion in `f64`, once per second, and requires the
//! fixed-point error to stay within the sum of their effects. Results over 10 s of the [reference
//! runs](mod@reference), displacements and velocities over ω, in units of length (the starting amplitude):
//!
//! | run | impacts | estimate | error |
//! |---|---|---|---|
//! | free, d/x0 0.4, e 0.4, μi 0 | 63 | 4.8e-6 | 1.9e-6 |
//! | free, 0.8, 0.4, 0.08 | 8 | 1.6e-7 | 1.3e-7 |
//! | free, 0.85, 0.55, 0 | 17 | 4.5e-5 | 1.1e-5 |
//! | free, 1.2, 0.3, 0.05 | 6 | 3.3e-7 | 9.2e-8 |
//! | driven, with a friction damper | 42 | 2.0e-7 | 1.8e-9 |
//!
//! A motion whose estimate exceeds 1e-4 within that time is treated as diverged: no arithmetic can follow it.

mod narrow;
pub mod reference;

use crate::scalar::Scalar;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use fixed::types::I16F48;

/// A fixed-point number; see the [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fixed(I16F48);

impl Fixed {
    /// The raw bits, for comparison between machines.
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
        Self(narrow::product(self.0, other.0))
    }
}

impl Div for Fixed {
    type Output = Self;

    /// Division by zero gives the largest number of the dividend's sign, like a saturated quotient.
    #[inline]
    fn div(self, other: Self) -> Self {
        if other.0 == I16F48::ZERO {
            return Self(if self.0 < I16F48::ZERO { I16F48::MIN } else { I16F48::MAX });
        }
        Self(narrow::quotient(self.0, other.0))
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
        if self.0 <= I16F48::ZERO { Self::ZERO } else { Self(narrow::root(self.0)) }
    }

    fn power(self, exponent: Self) -> Self {
        Self::from_f64(libm::pow(self.to_f64(), exponent.to_f64()))
    }
}
