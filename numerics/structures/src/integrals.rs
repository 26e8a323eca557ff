//! Integrals of exponentials, and of exponentials times powers of time.

use smallvec::smallvec;

use crate::events::Few;
use crate::linear::C64;

/// Turn over a piece, rad, up to which moments are series, and most terms of one: 4⁴⁰/40! is 10⁻²⁴.
const SERIES: f64 = 4.0;
const MAX_TERMS: i32 = 40;

/// Re ∫ of an exponential from `start` to `end` over h: their difference over the rate, or for a slow one its series.
pub(crate) fn exponential(start: C64, end: C64, rate: C64, h: f64) -> f64 {
    let square = rate.norm_sqr();
    if square * h * h > 1e-4 {
        let more = end - start;
        return (more.re * rate.re + more.im * rate.im) / square;
    }
    let turn = rate * h;
    // Σ (λh)^k/(k + 1)!: the next term is below 10⁻¹⁴/5040.
    let series = 1.0 + turn * (0.5 + turn * (1.0 / 6.0 + turn * (1.0 / 24.0 + turn * (1.0 / 120.0 + turn / 720.0))));
    (start * series).re * h
}

/// ∫ sⁿ e^{xs} ds from 0 to 1 for n = 1 to `count`.
pub(crate) fn moments(x: C64, count: usize) -> Few<C64> {
    let mut moments: Few<C64> = smallvec![C64::ZERO; count];
    if x.norm_sqr() < SERIES * SERIES {
        // Σ xᵏ / (k! (k + n + 1)).
        let mut term = C64::ONE;
        for k in 0..MAX_TERMS {
            for (n, moment) in (2..).zip(&mut moments) {
                *moment += term / f64::from(k + n);
            }
            term *= x / f64::from(k + 1);
            if term.norm_sqr() < f64::EPSILON * f64::EPSILON {
                break;
            }
        }
        return moments;
    }
    let end = x.exp();
    let mut before = (end - 1.0) / x;
    for (n, moment) in (1..).zip(&mut moments) {
        *moment = (end - before * f64::from(n)) / x;
        before = *moment;
    }
    moments
}
