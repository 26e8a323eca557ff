//! Product, quotient and square root of [`I16F48`] in 32-bit arithmetic, bit-identical to those of the `fixed` library.
//!
//! The library uses 128-bit numbers: on a Cortex-M3 its division alone takes thousands of instructions; the division
//! here takes hundreds. Operands whose result could saturate are passed to the library.

use fixed::types::I16F48;

const FRACTION: u32 = I16F48::FRAC_NBITS;

/// `a · b`, truncated downwards, saturated.
pub fn product(a: I16F48, b: I16F48) -> I16F48 {
    let (whole_a, whole_b) = (a.to_bits(), b.to_bits());
    let (high_a, high_b) = (whole_a >> 32, whole_b >> 32);
    let (low_a, low_b) = (whole_a & 0xffff_ffff, whole_b & 0xffff_ffff);
    let highest = high_a * high_b;
    let is_small = |high: i64| (-(1 << 30)..1 << 30).contains(&high);
    if !is_small(high_a) || !is_small(high_b) || !(-(1 << 46)..1 << 46).contains(&highest) {
        return a.saturating_mul(b);
    }
    // `middle` stays below 2⁶². The lowest product is not negative and keeps all its bits.
    let lowest = ((low_a as u64) * (low_b as u64)) >> 32;
    let middle = high_a * low_b + low_a * high_b + lowest as i64;
    I16F48::from_bits((highest << (64 - FRACTION)) + (middle >> (FRACTION - 32)))
}

/// `a / b`, truncated towards zero, saturated; `b` is not zero.
pub fn quotient(a: I16F48, b: I16F48) -> I16F48 {
    let is_negative = (a.to_bits() < 0) != (b.to_bits() < 0);
    let (dividend, divisor) = (a.to_bits().unsigned_abs(), b.to_bits().unsigned_abs());
    // The integer part of the quotient is below 2¹⁵; otherwise the quotient saturates.
    if divisor == 0 || dividend >> 15 >= divisor || divisor >> 63 == 1 {
        return a.saturating_div(b);
    }
    let whole = dividend / divisor;
    let mut rest = dividend % divisor;
    let mut bits = whole;
    for _ in 0..FRACTION {
        rest <<= 1;
        bits <<= 1;
        if rest >= divisor {
            rest -= divisor;
            bits |= 1;
        }
    }
    I16F48::from_bits(if is_negative { -(bits as i64) } else { bits as i64 })
}

/// `√a`, truncated downwards; `a` is not negative.
pub fn root(a: I16F48) -> I16F48 {
    // Each bit of the root takes two bits of the radicand, a · 2⁴⁸.
    let radicand = a.to_bits() as u64;
    let begin = radicand.leading_zeros() & !1;
    let mut left = radicand.unbounded_shl(begin);
    let (mut root, mut rest) = (0_u64, 0_u64);
    for _ in 0..(64 - begin + FRACTION) / 2 {
        rest = rest << 2 | left >> 62;
        left <<= 2;
        let trial = root << 2 | 1;
        root <<= 1;
        if rest >= trial {
            rest -= trial;
            root |= 1;
        }
    }
    I16F48::from_bits(root as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{RngCore, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Numbers of every magnitude and both signs, and the extreme values.
    fn numbers() -> impl Iterator<Item = I16F48> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        let ends = [0, 1, -1, 1 << 48, -(1 << 48), i64::MAX, i64::MIN, 1 << 62, -(1 << 62), (1 << 62) - 1, 1 << 32];
        let any = core::iter::repeat_with(move || {
            let size = random.next_u32() % 64;
            (random.next_u64() as i64) >> size
        });
        ends.into_iter().chain(any.take(300)).map(I16F48::from_bits)
    }

    #[test]
    fn product_and_quotient_equal_those_of_the_library() {
        for a in numbers() {
            for b in numbers() {
                assert_eq!(product(a, b), a.saturating_mul(b), "{} * {}", a.to_bits(), b.to_bits());
                if b != I16F48::ZERO {
                    assert_eq!(quotient(a, b), a.saturating_div(b), "{} / {}", a.to_bits(), b.to_bits());
                }
            }
        }
    }

    #[test]
    fn the_square_root_equals_that_of_the_library() {
        for a in numbers().filter(|a| *a >= I16F48::ZERO) {
            assert_eq!(root(a), a.sqrt(), "{}", a.to_bits());
        }
    }
}
