//! Polynomials in time over one step, and a search for their first root that cannot miss one.
//!
//! Time runs from 0 to 1 over a step. Coefficients are in ascending order: `p(t) = p[0] + p[1] t + …`.

use crate::scalar::Scalar;

/// Number of coefficients of a flight: degree 7.
///
/// The velocity is its derivative, so the first neglected term over a step is (rate × step)⁷/7! of the amplitude:
/// 2·10⁻¹¹ at the largest allowed 0.1 (`sampled::LARGEST_RATE_PER_STEP`), 5·10⁻¹⁷ at 2.5 Hz and 1 kHz.
pub const COEFFICIENTS: usize = 8;

/// Coefficients in ascending order.
pub type Polynomial<S> = [S; COEFFICIENTS];

/// `p(t) − p(0)`: the increment, so that rounding of a small change is relative to the change and not to the state.
#[inline]
pub fn increment<S: Scalar>(p: &[S], t: S) -> S {
    let mut sum = S::ZERO;
    for &coefficient in p[1..].iter().rev() {
        sum = sum * t + coefficient;
    }
    sum * t
}

/// `p(t)`: not generic, so that it is as fast as this crate wherever it is called.
#[must_use]
pub fn value(p: &[f64], t: f64) -> f64 {
    p[0] + increment(p, t)
}

/// `p′(t) − p′(0)`.
#[inline]
pub fn derivative_increment<S: Scalar>(p: &[S], t: S) -> S {
    let mut sum = S::ZERO;
    for (power, &coefficient) in p.iter().enumerate().skip(2).rev() {
        sum = sum * t + coefficient * S::from_u8(power as u8);
    }
    sum * t
}

/// The coefficients of `p′`.
#[inline]
pub fn derivative<S: Scalar>(p: &Polynomial<S>) -> Polynomial<S> {
    let mut d = [S::ZERO; COEFFICIENTS];
    for power in 1..COEFFICIENTS {
        d[power - 1] = p[power] * S::from_u8(power as u8);
    }
    d
}

/// `Σ |p[n]| tⁿ` over n ≥ 1: an upper bound of the deviation of `p` from `p(0)` up to time `t`.
#[inline]
pub fn reach<S: Scalar>(p: &Polynomial<S>, t: S) -> S {
    let mut sum = S::ZERO;
    for &coefficient in p[1..].iter().rev() {
        sum = sum * t + coefficient.abs();
    }
    sum * t
}

/// Moves the origin: the coefficients of `q(t) = p(t + by)`.
pub fn shift<S: Scalar>(p: &mut [S], by: S) {
    for lowest in 0..p.len().saturating_sub(1) {
        for n in (lowest..p.len() - 1).rev() {
            p[n] += by * p[n + 1];
        }
    }
}

/// The first time in `[0, end]` at which a quantity that must not be negative becomes negative, if any.
///
/// The search walks from the left. Let `g` be the polynomial shifted to the present point. With
/// `B = Σ_{n≥2} |g_n|·rest^{n−2}`, `g0 + g1 δ − B δ²` is a lower bound of `g(δ)` for every `δ` in the rest of the
/// interval. Up to the root of this bound `g` is positive, so a step to that root cannot pass a root of `g`. The search
/// thus approaches the first root from below, however close a second root is. The bound is tangent to `g`, so the
/// convergence is that of Newton's method.
///
/// A leading coefficient of exactly zero means that the quantity starts at its limit. The sign of the next one then
/// says whether the quantity leaves its limit (the root at 0 is divided out) or fails at once.
#[must_use]
pub fn first_failure<S: Scalar>(guard: &Polynomial<S>, end: S) -> Option<S> {
    let mut g = *guard;
    let mut divided_out = 0;
    while g[0] == S::ZERO && divided_out < COEFFICIENTS {
        for n in 1..COEFFICIENTS {
            g[n - 1] = g[n];
        }
        g[COEFFICIENTS - 1] = S::ZERO;
        divided_out += 1;
    }
    if divided_out == COEFFICIENTS {
        return None;
    }
    if g[0] < S::ZERO {
        return Some(S::ZERO);
    }
    if g[0] > reach(&g, end) {
        return None;
    }
    // Near a root, a step below the resolution of the numbers around `end` counts as converged.
    let smallest_step = end * S::EPSILON * S::from_u8(4);
    let mut t = S::ZERO;
    let mut has_fallen = false;
    // Convergence is quadratic at a simple root and linear (a factor of at least two) at a double one.
    for _ in 0..64 {
        let rest = end - t;
        let mut bound = S::ZERO;
        for &coefficient in g[2..].iter().rev() {
            bound = bound * rest + coefficient.abs();
        }
        let (value, slope) = (g[0], g[1]);
        has_fallen |= slope < S::ZERO;
        let four_bound = bound * S::from_u8(4);
        let root = (slope * slope + four_bound * value).sqrt();
        let step = if slope < S::ZERO {
            (value + value) / (root - slope)
        } else if bound > S::ZERO {
            (slope + root) / (bound + bound)
        } else {
            return None;
        };
        if step >= rest {
            return None;
        }
        t += step;
        if has_fallen && step <= smallest_step {
            return Some(t);
        }
        shift(&mut g, step);
        if g[0] <= S::ZERO {
            return Some(t);
        }
    }
    crawl(g, t, end, has_fallen)
}

/// Continues a search whose steps have become very short: `g` has just left zero as the third power of time (a particle
/// just released by its wall), and the bound over the whole remaining interval hides its rise. Each step uses the bound
/// of a stretch of suitable length.
#[cold]
fn crawl<S: Scalar>(mut g: Polynomial<S>, mut t: S, end: S, mut has_fallen: bool) -> Option<S> {
    let smallest_step = end * S::EPSILON * S::from_u8(4);
    let half = S::from_f64(0.5);
    // Each step at least doubles the time since `g` left zero.
    for _ in 0..256 {
        let rest = end - t;
        let mut stretch = rest;
        has_fallen |= g[1] < S::ZERO;
        let step = loop {
            let mut bound = S::ZERO;
            for &coefficient in g[2..].iter().rev() {
                bound = bound * stretch + coefficient.abs();
            }
            let (value, slope) = (g[0], g[1]);
            let root = (slope * slope + bound * S::from_u8(4) * value).sqrt();
            let step = if slope < S::ZERO {
                (value + value) / (root - slope)
            } else if bound > S::ZERO {
                (slope + root) / (bound + bound)
            } else {
                stretch
            };
            if step + step >= stretch {
                break step.min(stretch);
            }
            stretch = stretch * half;
        };
        if step >= rest {
            return None;
        }
        t += step;
        shift(&mut g, step);
        if (has_fallen && step <= smallest_step) || g[0] <= S::ZERO {
            return Some(t);
        }
    }
    has_fallen.then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from_roots(roots: &[f64]) -> Polynomial<f64> {
        let mut p = [0.0; COEFFICIENTS];
        p[0] = 1.0;
        for &root in roots {
            let old = p;
            for n in 0..COEFFICIENTS {
                p[n] = old[n] - if n > 0 { old[n - 1] / root } else { 0.0 };
            }
        }
        p
    }

    #[test]
    fn the_nearer_of_two_close_roots_is_found() {
        for gap in [1e-1, 1e-3, 1e-6] {
            let p = from_roots(&[0.4, 0.4 + gap, -3.0]);
            let found = first_failure(&p, 1.0).expect("a root");
            // The value at a double root is known to ε, so its place to √ε over the gap.
            assert!((found - 0.4).abs() < 1e-14 / gap + 1e-15, "{gap}: {found}");
        }
    }

    #[test]
    fn a_graze_that_stays_positive_is_not_an_event() {
        let mut p = from_roots(&[0.5, 0.5]);
        p[0] += 1e-9;
        assert_eq!(first_failure(&p, 1.0), None);
    }

    #[test]
    fn a_quantity_that_left_zero_as_the_third_power_a_moment_ago_does_not_fail() {
        for since in [1e-2, 1e-4, 1e-6, 1e-9, 1e-12, 1e-30] {
            let mut p = [0.0; COEFFICIENTS];
            (p[0], p[1], p[2], p[3]) = (since * since * since, 3.0 * since * since, 3.0 * since, 1.0);
            assert_eq!(first_failure(&p, 1.0), None, "{since}");
            assert_eq!(first_failure(&p.map(|c| c as f32), 1.0), None, "{since}");
            // (t + s)³ (1 − t/0.7) returns to zero at 0.7.
            let rising = p;
            for n in 1..COEFFICIENTS {
                p[n] -= rising[n - 1] / 0.7;
            }
            let found = first_failure(&p, 1.0).expect("the quantity returns to zero");
            assert!((found - 0.7).abs() < 1e-14, "{since}: {found}");
        }
    }

    #[test]
    fn leaving_a_limit_is_not_an_event_but_returning_to_it_is() {
        // t (0.3 − t): starts at the limit, leaves it and returns at 0.3.
        let p = [0.0, 0.3, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!((first_failure(&p, 1.0).unwrap() - 0.3).abs() < 1e-15);
        assert_eq!(first_failure(&p, 0.2), None);
    }

    #[test]
    fn a_limit_that_is_being_violated_fails_at_once() {
        assert_eq!(first_failure(&[0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0), Some(0.0));
        assert_eq!(first_failure(&[-1e-9, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0), Some(0.0));
    }

    #[test]
    fn shifting_moves_the_origin() {
        let mut p = [1.0, -2.0, 3.0, 0.5, 0.0, 0.0, 0.0, 0.0];
        shift(&mut p, 2.0);
        // p(2) = 1 − 4 + 12 + 4
        assert_eq!(p[0], 13.0);
        // p′(2) = −2 + 12 + 6
        assert_eq!(p[1], 16.0);
    }
}
