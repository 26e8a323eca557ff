//! Power series over one arc, their certified first root ([`first_failure`]) and their maximum ([`largest`]).
//!
//! Time runs from 0 to 1 over an arc. The shorter, scalar-generic polynomials of the sampled driver are in
//! [`crate::integrator::polynomial`].

/// Number of coefficients. An arc spans at most [`super::flow::LARGEST_ARC_RAD`] = 0.8 rad of the fastest rate, so the
/// first neglected term of a displacement is 0.8¹⁸/18! = 3·10⁻¹⁸ of the amplitude.
pub const TERMS: usize = 18;

/// Coefficients in ascending order: `p(τ) = p[0] + p[1] τ + …`.
pub type Series = [f64; TERMS];

/// `p(τ)`.
#[inline]
#[must_use]
pub fn value(p: &Series, at: f64) -> f64 {
    let square = at * at;
    let (mut even, mut odd) = (p[TERMS - 2], p[TERMS - 1]);
    for n in (1..TERMS - 2).rev().step_by(2) {
        odd = odd * square + p[n];
        even = even * square + p[n - 1];
    }
    even + odd * at
}

/// `p(τ)` at several times.
#[inline]
#[must_use]
pub fn values<const N: usize>(p: &Series, at: &[f64; N]) -> [f64; N] {
    let mut sums = [p[TERMS - 1]; N];
    for n in (0..TERMS - 1).rev() {
        for (sum, at) in sums.iter_mut().zip(at) {
            *sum = *sum * at + p[n];
        }
    }
    sums
}

/// `p(τ)` and `p′(τ)`.
#[inline]
#[must_use]
pub fn value_and_slope(p: &Series, at: f64) -> (f64, f64) {
    let square = at * at;
    let (mut even, mut odd) = (p[TERMS - 2], p[TERMS - 1]);
    // The even powers of p′ come from the odd coefficients of p, and the odd powers from the even ones.
    let (mut even_slope, mut odd_slope) = (p[TERMS - 1] * (TERMS - 1) as f64, p[TERMS - 2] * (TERMS - 2) as f64);
    for n in (1..TERMS - 2).rev().step_by(2) {
        odd = odd * square + p[n];
        even = even * square + p[n - 1];
        even_slope = even_slope * square + p[n] * n as f64;
        if n > 1 {
            odd_slope = odd_slope * square + p[n - 1] * (n - 1) as f64;
        }
    }
    (even + odd * at, even_slope + odd_slope * at)
}

/// A motion without its constant and linear terms, and its rate: `Σ pₙ τⁿ` and `Σ n pₙ τⁿ⁻¹` from n = 2 on.
pub(super) struct Bend {
    value: [f64; TERMS - 2],
    rate: [f64; TERMS - 2],
}

impl Bend {
    /// The sum of the columns, weighted by `unit`.
    #[inline]
    pub fn new(columns: &[Series; 5], unit: &[f64; 5]) -> Self {
        let mut value = [0.0; TERMS - 2];
        let mut rate = [0.0; TERMS - 2];
        for n in 0..TERMS - 2 {
            value[n] = (columns[0][n + 2] * unit[0] + columns[1][n + 2] * unit[1])
                + (columns[2][n + 2] * unit[2] + (columns[3][n + 2] * unit[3] + columns[4][n + 2] * unit[4]));
        }
        for n in 0..TERMS - 2 {
            rate[n] = value[n] * (n + 2) as f64;
        }
        Self { value, rate }
    }

    /// Value and rate at τ = `at`, as four interleaved sums: this shortens the chain of dependent operations.
    #[inline]
    pub fn at(&self, at: f64) -> (f64, f64) {
        let square = at * at;
        let fourth = square * square;
        let sum = |c: &[f64; TERMS - 2]| {
            let mut chains = [0.0; 4];
            for block in (0..(TERMS - 2) / 4).rev() {
                for (lane, chain) in chains.iter_mut().enumerate() {
                    *chain = *chain * fourth + c[4 * block + lane];
                }
            }
            (chains[0] + chains[1] * at) + (chains[2] + chains[3] * at) * square
        };
        (sum(&self.value) * square, sum(&self.rate) * at)
    }
}

/// The coefficients of `p′`.
#[inline]
#[must_use]
pub fn derivative(p: &Series) -> Series {
    let mut d = [0.0; TERMS];
    for n in 1..TERMS {
        d[n - 1] = p[n] * n as f64;
    }
    d
}

/// Upper bound of half the largest `|p″|` over `[0, end]`: `Σ n(n−1)/2 |p[n]| endⁿ⁻²`.
#[inline]
#[must_use]
pub fn curvature_bound(p: &Series, end: f64) -> f64 {
    let terms = (2..TERMS).rev().map(|n| p[n].abs() * (n * (n - 1) / 2) as f64);
    // The same sum: over a whole arc nothing is scaled.
    if end == 1.0 { terms.sum() } else { terms.fold(0.0, |sum, term| sum * end + term) }
}

/// The first time in `[0, end]`, `end` ≤ 1, at which a quantity that must stay positive reaches zero.
///
/// **No root is passed.** Let `B ≥ max |g″|/2` over `[0, end]`. From any `t` with `g(t) > 0`, Taylor's theorem gives
/// `g(t+δ) ≥ g(t) + g′(t) δ − B δ²` for every `δ` up to the end. The right-hand side is positive up to its positive
/// root `δ*`. Hence `g` has no root before `t + δ*`, and the walk steps there. The walk thus approaches the first root
/// from below and never crosses it, however close a second root is. The bound is tangent to `g`, so the approach
/// converges as fast as Newton's method. `B` comes from the coefficients' magnitudes, so it holds without sampling.
///
/// Leading coefficients of exactly zero mean that the quantity starts at its limit. They are divided out: `g = τᵐ q`
/// with `q(0) ≠ 0` has the positive roots of `q`, and `q(0) < 0` fails at once.
#[must_use]
#[inline]
pub fn first_failure(guard: &Series, end: f64) -> Option<f64> {
    let mut g = *guard;
    let mut divided_out = 0;
    while g[0] == 0.0 {
        g.rotate_left(1);
        divided_out += 1;
        if divided_out == TERMS {
            return None;
        }
    }
    if g[0] < 0.0 {
        return Some(0.0);
    }
    walk(&g, 0.0, end)
}

/// Steps after which the walk continues with a shorter stretch. Convergence is quadratic at a simple root and halves
/// the distance at a double one, so this many steps exceed the available bits.
const MAX_STEPS: u32 = 200;

/// Stretches after which a quantity that has fallen counts as failed: it is then too close to zero for this arithmetic
/// to decide.
const MAX_STRETCHES: u32 = 200;

/// Outcome of one stretch of the walk.
enum Stretch {
    /// No root.
    Clear,
    /// The first root.
    Root(f64),
    /// No root up to that time; the steps became very short.
    Slow(f64),
}

/// The walk of [`first_failure`], from `from`, where `g` is positive.
///
/// A quantity that has left zero as the third power of time and is still small (a particle just released by its wall)
/// allows only short steps while `B` is the bound of the whole interval. The walk then continues in stretches, each
/// with its own bound.
fn walk(g: &Series, from: f64, end: f64) -> Option<f64> {
    let (mut t, mut until, mut has_fallen) = (from, end, false);
    for _ in 0..MAX_STRETCHES {
        t = match stretch(g, (t, until), end, &mut has_fallen) {
            Stretch::Root(at) => return Some(at),
            Stretch::Clear if until >= end => return None,
            Stretch::Clear => until,
            Stretch::Slow(at) => at,
        };
        until = (2.0 * t).min(end);
    }
    has_fallen.then_some(t)
}

/// Walks from `from` to `until` within an interval that ends at `end`. A small step counts as a root only if the
/// quantity has fallen; a quantity that has only risen may be arbitrarily close to zero without a root.
fn stretch(g: &Series, (from, until): (f64, f64), end: f64, has_fallen: &mut bool) -> Stretch {
    let bound = curvature_bound(g, until);
    let smallest_step = end * f64::EPSILON;
    let mut t = from;
    let (mut value, mut slope) = if from == 0.0 { (g[0], g[1]) } else { value_and_slope(g, from) };
    for _ in 0..MAX_STEPS {
        *has_fallen |= slope < 0.0;
        let left = until - t;
        // The parabola below `g` is still positive at the end: its root, the end of the step, is not needed.
        if value + (slope - bound * left) * left > 0.0 {
            return Stretch::Clear;
        }
        let root = libm::sqrt(slope * slope + 4.0 * bound * value.max(0.0));
        let step = if slope < 0.0 {
            2.0 * value / (root - slope)
        } else if bound > 0.0 {
            (slope + root) / (2.0 * bound)
        } else {
            return Stretch::Clear;
        };
        if step > left {
            return Stretch::Clear;
        }
        t += step;
        (value, slope) = value_and_slope(g, t);
        if value <= 0.0 || (*has_fallen && step <= smallest_step.max(t * f64::EPSILON)) {
            // Rounding may have put the last step past the root; one Newton step corrects it.
            if slope < 0.0 {
                let polished = t - value / slope;
                if (polished - t).abs() <= 1e-9 * end {
                    t = polished.clamp(from, end);
                }
            }
            return Stretch::Root(t);
        }
    }
    Stretch::Slow(t)
}

/// The largest value of `p` over `[from, to]`, if it is above `least`; else `least`.
///
/// Walks to each point where `p` rises above the largest value so far, and from there to the following maximum. The
/// certainty is that of [`first_failure`]: a peak higher than the result by more than a few roundings cannot be passed.
#[must_use]
pub fn largest(p: &Series, from: f64, to: f64, least: f64) -> f64 {
    let mut most = least.max(value(p, from)).max(value(p, to));
    let rising = derivative(p);
    let mut t = from;
    for _ in 0..TERMS {
        let mut below = p.map(|c| -c);
        let rounding = 4.0 * f64::EPSILON * most.abs();
        below[0] += most + rounding;
        let start = value_and_slope(&below, t);
        if start.0 > 0.0 || start.1 >= 0.0 {
            match walk(&below, t, to) {
                Some(at) => t = at,
                None => return most,
            }
        }
        // `p` rises from here; walk to where its slope becomes zero.
        match if value(&rising, t) > 0.0 { walk(&rising, t, to) } else { Some(t) } {
            Some(top) => t = top,
            None => return most.max(value(p, to)),
        }
        most = most.max(value(p, t));
    }
    most
}

/// ∫₀¹ a b dτ.
pub(super) fn mean_product(a: &Series, b: &Series) -> f64 {
    let mut product = [0.0; 2 * TERMS];
    for (n, a) in a.iter().enumerate() {
        for (m, b) in b.iter().enumerate() {
            product[n + m] += a * b;
        }
    }
    product.iter().enumerate().rev().map(|(n, c)| c / (n + 1) as f64).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from_roots(roots: &[f64]) -> Series {
        let mut p = [0.0; TERMS];
        p[0] = 1.0;
        for &root in roots {
            let old = p;
            for n in 0..TERMS {
                p[n] = old[n] - if n > 0 { old[n - 1] / root } else { 0.0 };
            }
        }
        p
    }

    #[test]
    fn value_and_slope_agree_with_the_plain_sums() {
        let mut p = [0.0; TERMS];
        for (n, c) in p.iter_mut().enumerate() {
            *c = 1.0 / (n as f64 + 1.3) * if n % 3 == 0 { -1.0 } else { 1.0 };
        }
        for at in [0.0, 1e-9, 0.3, 0.77, 1.0] {
            let plain: f64 = p.iter().enumerate().map(|(n, c)| c * libm::pow(at, n as f64)).sum();
            let slope: f64 =
                p.iter().enumerate().skip(1).map(|(n, c)| c * n as f64 * libm::pow(at, n as f64 - 1.0)).sum();
            let (v, s) = value_and_slope(&p, at);
            assert!((v - plain).abs() < 1e-14 && (value(&p, at) - plain).abs() < 1e-14, "{at}");
            assert!((s - slope).abs() < 1e-13, "{at}: {s} {slope}");
        }
    }

    #[test]
    fn the_nearer_of_two_close_roots_is_found() {
        for gap in [1e-1, 1e-3, 1e-6] {
            let found = first_failure(&from_roots(&[0.4, 0.4 + gap, -3.0]), 1.0).expect("a root");
            assert!((found - 0.4).abs() < 1e-14 / gap, "{gap}: {found}");
        }
    }

    #[test]
    fn a_graze_that_stays_positive_is_not_a_failure() {
        for lift in [1e-3, 1e-9, 1e-13] {
            let mut p = from_roots(&[0.5, 0.5]);
            p[0] += lift;
            assert_eq!(first_failure(&p, 1.0), None, "{lift}");
        }
    }

    #[test]
    fn the_largest_value_is_that_of_the_highest_peak() {
        let wave = |shift: f64| {
            let mut p = [0.0; TERMS];
            let mut term = 1.0;
            for (n, c) in p.iter_mut().enumerate() {
                *c = term * libm::cos(shift + n as f64 * core::f64::consts::FRAC_PI_2);
                term *= 2.0 / (n + 1) as f64;
            }
            p
        };
        // cos(2τ + shift): the peak lies inside the interval for shifts from −2 to 0.
        for n in 1..20 {
            let shift = -0.1 * f64::from(n);
            assert!((largest(&wave(shift), 0.0, 1.0, -5.0) - 1.0).abs() < 1e-8, "{shift}");
            assert_eq!(largest(&wave(shift), 0.0, 1.0, 1.5), 1.5);
        }
        assert!((largest(&wave(0.5), 0.2, 1.0, -5.0) - libm::cos(0.9)).abs() < 1e-8);
    }

    #[test]
    fn a_quantity_that_left_zero_as_the_third_power_a_moment_ago_does_not_fail() {
        for since in [1e-2, 1e-4, 1e-6, 1e-9, 1e-12, 1e-30] {
            let mut p = [0.0; TERMS];
            (p[0], p[1], p[2], p[3]) = (since * since * since, 3.0 * since * since, 3.0 * since, 1.0);
            assert_eq!(first_failure(&p, 1.0), None, "{since}");
            // (t + s)³ (1 − t/0.7) returns to zero at 0.7.
            let rising = p;
            for n in 1..TERMS {
                p[n] -= rising[n - 1] / 0.7;
            }
            let found = first_failure(&p, 1.0).expect("the quantity returns to zero");
            assert!((found - 0.7).abs() < 1e-14, "{since}: {found}");
        }
    }

    #[test]
    fn leaving_a_limit_is_not_a_failure_but_returning_to_it_is() {
        let mut p = [0.0; TERMS];
        p[1] = 0.3;
        p[2] = -1.0;
        assert!((first_failure(&p, 1.0).expect("returns") - 0.3).abs() < 1e-15);
        assert_eq!(first_failure(&p, 0.2), None);
        assert_eq!(first_failure(&[0.0; TERMS], 1.0), None);
    }
}
