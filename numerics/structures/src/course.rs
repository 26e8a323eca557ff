//! The course of a displacement over a piece of motion, and its largest magnitude.

use crate::guard::Here;
use crate::integrals::{exponential, moments};
use crate::linear::C64;
use crate::polynomial::Polynomial;

/// A displacement over a piece of motion: a polynomial and a sum of exponentials whose amplitudes never grow.
#[derive(Clone, Debug, Default)]
pub struct Course {
    terms: Vec<Term>,
    polynomial: Polynomial,
    /// Length of the piece, s, and what the displacement is at its ends.
    length_s: f64,
    start: Here,
    end: Here,
}

/// An exponential over a piece.
#[derive(Clone, Copy, Debug)]
struct Term {
    /// At the start and at the end of the piece.
    start: C64,
    end: C64,
    rate: C64,
}

/// Share of the terms of a sum that its rounding, and that of slopes from it, may reach.
const ROUNDINGS: f64 = 16.0 * f64::EPSILON;

/// Least share of an interval that is still divided: an extremum closer to an end is the end.
const NARROW: f64 = 1e-9;

/// Decay over a piece, as an exponent, from which on a bound takes it into account.
const FAST: f64 = 10.0;

/// Steps of the search for a turning point.
const MAX_STEPS: u32 = 60;

impl Course {
    /// From amplitudes at the start and at the end of the piece with their rates.
    pub(crate) fn new(terms: impl Iterator<Item = (C64, C64, C64)>, polynomial: Polynomial, length_s: f64) -> Self {
        let (mut start, mut end) = (polynomial.at(0.0), polynomial.at(length_s));
        let mut of_terms = Vec::with_capacity(terms.size_hint().1.unwrap_or(0));
        for (at_start, at_end, rate) in terms {
            if at_start != C64::ZERO {
                start = start.plus(here_of(at_start, rate));
                end = end.plus(here_of(at_end, rate));
                of_terms.push(Term { start: at_start, end: at_end, rate });
            }
        }
        Self { terms: of_terms, polynomial, length_s, start, end }
    }

    /// Displacement, m, and velocity, m/s, at `after_s` from the start of the piece.
    #[must_use]
    pub fn at(&self, after_s: f64) -> (f64, f64) {
        let here = self.here(after_s);
        (here.value, here.slope)
    }

    fn here(&self, after_s: f64) -> Here {
        if after_s == 0.0 {
            return self.start;
        }
        if after_s == self.length_s {
            return self.end;
        }
        let terms = self.terms.iter().map(|term| here_of(term.start * (term.rate * after_s).exp(), term.rate));
        terms.fold(self.polynomial.at(after_s), Here::plus)
    }

    /// Acceleration, m/s², at `after_s` from the start of the piece.
    #[must_use]
    pub fn acceleration_m_per_s2(&self, after_s: f64) -> f64 {
        self.with_bend(after_s).1
    }

    /// Displacement with velocity, and acceleration.
    fn with_bend(&self, after_s: f64) -> (Here, f64) {
        let (mut here, mut bend) = (self.polynomial.at(after_s), self.polynomial.bend_at(after_s));
        for Term { start, rate, .. } in &self.terms {
            let term = start * (rate * after_s).exp();
            let slope = rate * term;
            here = here.plus(Here { value: term.re, slope: slope.re });
            bend += rate.re * slope.re - rate.im * slope.im;
        }
        (here, bend)
    }

    /// Coefficients of the powers of time from `after_s` on, m/sᵏ: Taylor's polynomial of degree N − 1, which is off by at most
    /// [`Course::remainder_m`] of order N.
    #[must_use]
    pub fn taylor<const N: usize>(&self, after_s: f64) -> [f64; N] {
        let mut powers = [0.0; N];
        let mut factorial = 1.0;
        for (k, (to, of)) in powers.iter_mut().zip(self.polynomial.after(after_s).derivatives()).enumerate() {
            factorial *= k.max(1) as f64;
            *to = of / factorial;
        }
        for Term { start, rate, .. } in &self.terms {
            let mut term = if after_s == 0.0 { *start } else { start * (rate * after_s).exp() };
            for (k, to) in powers.iter_mut().enumerate() {
                *to += term.re;
                term *= rate / (k + 1) as f64;
            }
        }
        powers
    }

    /// Bound of what Taylor's polynomial of degree `order` − 1 is off by at `length_s`, anywhere in the piece: Σ|c||λh|ⁿ/n!, m. `order` is 4 or
    /// greater, so that a cubic has no part in it.
    #[must_use]
    pub fn remainder_m(&self, order: u32, length_s: f64) -> f64 {
        let factorial: f64 = (1..=order).map(f64::from).product();
        let power = i32::try_from(order).unwrap_or(i32::MAX);
        let of = |term: &Term| term.start.norm() * (term.rate.norm() * length_s).powi(power);
        let of_polynomial = usize::try_from(order).map_or(0.0, |order| self.polynomial.most(order, self.length_s))
            * length_s.powi(power);
        (self.terms.iter().map(of).sum::<f64>() + of_polynomial) / factorial
    }

    /// Σ|c|: what the displacement's oscillations reach at most, m.
    #[must_use]
    pub fn size_m(&self) -> f64 {
        self.terms.iter().map(|term| term.start.norm()).sum()
    }

    /// The course of the velocity, m/s.
    #[must_use]
    pub fn rate(&self) -> Self {
        self.with_rate(0.0, 1.0, 0.0)
    }

    /// The course of the acceleration, m/s².
    #[must_use]
    pub fn acceleration(&self) -> Self {
        let terms = self.terms.iter().map(|Term { start, end, rate }| (rate * rate * start, rate * rate * end, *rate));
        Self::new(terms, self.polynomial.rate().rate(), self.length_s)
    }

    /// ∫ab dt of two courses of one piece: a quarter of the difference of the squares of a + b and a − b, which are made of one size.
    #[must_use]
    pub fn product_m2_s(&self, other: &Self) -> f64 {
        let scale = (self.square_m2_s() / other.square_m2_s()).sqrt();
        if !(scale.is_finite() && scale > 0.0) {
            return 0.0;
        }
        let [sum, difference] = [-scale, scale].map(|by| self.minus(&other.with_rate(by, 0.0, 0.0)).square_m2_s());
        (sum - difference) / (4.0 * scale)
    }

    /// The course of `of` times the displacement, `of_rate` times its velocity, and a constant.
    #[must_use]
    pub fn with_rate(&self, of: f64, of_rate: f64, constant: f64) -> Self {
        let terms = self.terms.iter().map(|Term { start, end, rate }| {
            let factor = rate * of_rate + of;
            (factor * start, factor * end, *rate)
        });
        let polynomial = of * self.polynomial + of_rate * self.polynomial.rate() + Polynomial::constant(constant);
        Self::new(terms, polynomial, self.length_s)
    }

    /// The difference of two courses of one piece.
    #[must_use]
    pub fn minus(&self, other: &Self) -> Self {
        let mut terms = self.terms.clone();
        // Courses of one piece have their exponentials in one order.
        let mut from = 0;
        for Term { start, end, rate } in &other.terms {
            match terms[from..].iter().position(|term| term.rate == *rate) {
                Some(more) => {
                    let own = &mut terms[from + more];
                    (own.start, own.end) = (own.start - start, own.end - end);
                    from += more + 1;
                }
                None => terms.push(Term { start: -start, end: -end, rate: *rate }),
            }
        }
        let less = |a: Here, b: Here| Here { value: a.value - b.value, slope: a.slope - b.slope };
        Self {
            terms,
            polynomial: self.polynomial + -1.0 * other.polynomial,
            length_s: self.length_s,
            start: less(self.start, other.start),
            end: less(self.end, other.end),
        }
    }

    /// ∫x² dt over the piece, m²·s, in closed form.
    #[must_use]
    pub fn square_m2_s(&self) -> f64 {
        let h = self.length_s;
        let powers = self.polynomial.powers(h);
        let product =
            |(i, a): (usize, &f64)| a * powers.iter().enumerate().map(|(j, b)| b / (i + j + 1) as f64).sum::<f64>();
        let mut square = h * powers.iter().enumerate().map(product).sum::<f64>();
        for (n, term) in self.terms.iter().enumerate() {
            let Term { start, end, rate } = *term;
            square += 2.0 * powers[0] * exponential(start, end, rate, h);
            if let [_, rising @ ..] = powers.as_slice()
                && !rising.is_empty()
            {
                let moments = moments(rate * h, rising.len());
                let moment: C64 = moments.iter().zip(rising).map(|(moment, power)| moment * *power).sum();
                square += 2.0 * h * (start * moment).re;
            }
            // Re a · Re b = ½ Re(ab + ab̄), of a term with itself once and of two terms twice.
            square += 0.5 * pair(term, term, h);
            square += self.terms[..n].iter().map(|other| pair(term, other, h)).sum::<f64>();
        }
        square
    }

    /// The largest magnitude between two times, s, if above `least_m`, else `least_m`.
    ///
    /// The motion, its velocity and its acceleration deviate from the cubic with the values and slopes of an interval's ends by at most
    /// `max|x⁗|` times h⁴/384, √3 h³/216 and h²/12 (Birkhoff and Priver 1967). An interval is left out when the motion stays below what was found, but for rounding, or the velocity keeps
    /// its sign. It is searched for its turning point when the acceleration keeps its sign; otherwise it is halved.
    #[must_use]
    pub fn largest_abs(&self, (from_s, to_s): (f64, f64), least_m: f64) -> f64 {
        let (from, to) = (self.here(from_s), self.here(to_s));
        let mut largest = least_m.max(from.value.abs()).max(to.value.abs());
        let whole = Interval { start_s: from_s, start: from, end_s: to_s, end: to };
        let mut open = Vec::new();
        let mut next = Some(whole);
        let (size, bound) = self.sizes();
        let rounding = ROUNDINGS * (size + self.polynomial.size(self.length_s));
        while let Some(interval) = next {
            let Interval { start_s, start, end_s, end } = interval;
            next = None;
            let h = end_s - start_s;
            let fourth = bound.from(start_s);
            let is_below = interval.largest_of_cubic() + fourth * h.powi(4) / 384.0 <= largest + rounding;
            let turns = || !keep_sign(&interval.slopes_of_cubic(), fourth * h.powi(3) * (3.0_f64.sqrt() / 216.0));
            if !is_below && h > NARROW * (to_s - from_s) && turns() {
                if keep_sign(&interval.bends_of_cubic(), fourth * h * h / 12.0) {
                    if start.slope * end.slope < 0.0 {
                        largest = largest.max(self.turning_point(&interval));
                    }
                } else {
                    let middle_s = 0.5 * (start_s + end_s);
                    let middle = self.here(middle_s);
                    largest = largest.max(middle.value.abs());
                    open.push(Interval { start_s: middle_s, start: middle, end_s, end });
                    next = Some(Interval { start_s, start, end_s: middle_s, end: middle });
                }
            }
            next = next.or_else(|| open.pop());
        }
        largest
    }

    /// Bounds of the sum of the exponentials and of its fourth derivative.
    fn sizes(&self) -> (f64, FourthDerivative) {
        let slow = self.polynomial.most(4, self.length_s);
        let (mut sum, mut bound) = (0.0, FourthDerivative { slow, fast: Vec::new() });
        for Term { start, rate, .. } in &self.terms {
            let size = start.norm_sqr().sqrt();
            let fourth = size * rate.norm_sqr().powi(2);
            sum += size;
            if rate.re * self.length_s < -FAST {
                bound.fast.push((fourth, rate.re));
            } else {
                bound.slow += fourth;
            }
        }
        (sum, bound)
    }

    /// The magnitude where the velocity is zero in an interval whose ends have velocities of different sign: from where it is zero in the cubic,
    /// Newton's steps within a bracket.
    fn turning_point(&self, of: &Interval) -> f64 {
        let (mut low, mut high) = (of.start_s, of.end_s);
        let rises = of.end.slope > 0.0;
        let mut at_s = of.turning_point_of_cubic_s();
        let mut largest = 0.0_f64;
        for _ in 0..MAX_STEPS {
            let (here, bend) = self.with_bend(at_s);
            largest = largest.max(here.value.abs());
            // A further step would change the value by less than rounding.
            if here.slope * here.slope <= 2.0 * bend.abs() * f64::EPSILON * here.value.abs() {
                break;
            }
            if (here.slope > 0.0) == rises {
                high = at_s;
            } else {
                low = at_s;
            }
            let newton = at_s - here.slope / bend;
            at_s = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        largest
    }
}

/// A part of a piece with what the displacement is at its ends.
struct Interval {
    start_s: f64,
    start: Here,
    end_s: f64,
    end: Here,
}

impl Interval {
    /// The largest magnitude of the cubic with the values and slopes of the ends: at most that of its Bézier points.
    fn largest_of_cubic(&self) -> f64 {
        let third_s = (self.end_s - self.start_s) / 3.0;
        let inner = [self.start.value + self.start.slope * third_s, self.end.value - self.end.slope * third_s];
        let ends = self.start.value.abs().max(self.end.value.abs());
        ends.max(inner[0].abs()).max(inner[1].abs())
    }

    /// The slope of that cubic is within these: its Bernstein coefficients.
    fn slopes_of_cubic(&self) -> [f64; 3] {
        let (start, end) = (self.start.slope, self.end.slope);
        [start, 3.0 * (self.end.value - self.start.value) / (self.end_s - self.start_s) - start - end, end]
    }

    /// The second derivative of that cubic is between these.
    fn bends_of_cubic(&self) -> [f64; 2] {
        let [start, middle, end] = self.slopes_of_cubic();
        [middle - start, end - middle].map(|rise| 2.0 * rise / (self.end_s - self.start_s))
    }

    /// Where the slope of that cubic is zero, if it has different signs at the ends, s.
    fn turning_point_of_cubic_s(&self) -> f64 {
        let h = self.end_s - self.start_s;
        let (m0, m1) = (self.start.slope * h, self.end.slope * h);
        let rise = self.end.value - self.start.value;
        // m0 + 2 b t + a t², by the root that does not cancel.
        let (b, a) = (3.0 * rise - 2.0 * m0 - m1, 3.0 * (m0 + m1 - 2.0 * rise));
        let root = (b * b - a * m0).max(0.0).sqrt();
        let q = -(b + root.copysign(b));
        let inside = [q / a, m0 / q].into_iter().find(|t| *t > 0.0 && *t < 1.0);
        self.start_s + h * inside.unwrap_or(0.5)
    }
}

/// A bound of the fourth derivative of a course.
#[derive(Default)]
struct FourthDerivative {
    /// Of what lasts for the piece.
    slow: f64,
    /// Of what is over long before its end: at the start, with its rate.
    fast: Vec<(f64, f64)>,
}

impl FourthDerivative {
    /// From `start_s` on.
    fn from(&self, start_s: f64) -> f64 {
        self.slow + self.fast.iter().map(|(fourth, rate)| fourth * (rate * start_s).exp()).sum::<f64>()
    }
}

/// Whether all values that deviate from these by at most `off` have one sign.
fn keep_sign(values: &[f64], off: f64) -> bool {
    values.iter().all(|value| *value > off) || values.iter().all(|value| *value < -off)
}

/// Value and slope of a term.
fn here_of(term: C64, rate: C64) -> Here {
    Here { value: term.re, slope: rate.re * term.re - rate.im * term.im }
}

/// Re ∫ (ab + ab̄) dt of two terms.
fn pair(a: &Term, b: &Term, h: f64) -> f64 {
    let sum = exponential(a.start * b.start, a.end * b.end, a.rate + b.rate, h);
    sum + exponential(a.start * b.start.conj(), a.end * b.end.conj(), a.rate + b.rate.conj(), h)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTH_S: f64 = 2.5;

    fn course(terms: &[(f64, f64, f64)]) -> Course {
        course_of(terms, LENGTH_S)
    }

    /// A cubic and Re Σ of terms with these amplitudes and frequencies.
    fn course_of(terms: &[(f64, f64, f64)], length_s: f64) -> Course {
        let terms = terms.iter().map(|(size, phase, turning)| {
            let (amplitude, rate) = (C64::from_polar(*size, *phase), C64::new(-0.01, *turning));
            (amplitude, amplitude * (rate * length_s).exp(), rate)
        });
        Course::new(terms, Polynomial::of([0.1, 0.02, -0.05, 0.13, 0.0, 0.0, 0.0, 0.0]), length_s)
    }

    #[test]
    fn the_largest_magnitude_is_that_of_a_million_points() {
        for (n, terms) in [
            vec![(1.0, 0.3, 3.0)],
            vec![(1.0, 0.3, 3.0), (0.4, 1.0, 17.0), (0.01, 2.0, 90.0)],
            vec![(0.1, 0.0, 1.0), (1.0, 1.0, 40.0), (1.0, 2.0, 40.5)],
        ]
        .into_iter()
        .enumerate()
        {
            let course = course(&terms);
            let count = 1_000_000;
            let points = (0..=count).map(|n| course.at(2.5 * f64::from(n) / f64::from(count)).0.abs());
            let expected = points.fold(0.0, f64::max);
            let largest = course.largest_abs((0.0, 2.5), 0.0);
            // Between two points x differs from its largest value by at most x″ h²/8.
            let off =
                terms.iter().map(|(size, _, turning)| size * turning * turning).sum::<f64>() * 2.5e-6_f64.powi(2) / 8.0;
            assert!(largest >= expected && largest <= expected + off, "{n}: {largest} {expected}");
            assert_eq!(course.largest_abs((0.0, 2.5), 7.0), 7.0);
        }
    }

    #[test]
    fn what_is_over_soon_hides_no_extremum() {
        for (size, rate) in [(-0.5, -1e6), (0.5, -1e3), (-0.3, -1e9)] {
            let slow = (C64::new(1.0, 0.0), C64::new(-0.01, 3.0));
            let terms = [slow, (C64::new(size, 0.0), C64::new(rate, 0.0))];
            let terms = terms.map(|(amplitude, rate)| (amplitude, amplitude * (rate * LENGTH_S).exp(), rate));
            let course =
                Course::new(terms.into_iter(), Polynomial::of([0.1, 0.02, -0.05, 0.13, 0.0, 0.0, 0.0, 0.0]), LENGTH_S);
            // A thousand instants a decade from 1e-12 s on: x exceeds them by at most 9.1 (0.0023 t)²/8.
            let points =
                (0..=12_400).map(|n| course.at((1e-12 * 10.0_f64.powf(f64::from(n) / 1000.0)).min(LENGTH_S)).0.abs());
            let expected = points.fold(course.at(0.0).0.abs(), f64::max);
            let largest = course.largest_abs((0.0, LENGTH_S), 0.0);
            assert!(largest >= expected && largest <= expected + 4e-5, "{rate}: {largest} {expected}");
        }
    }

    #[test]
    fn the_mean_square_in_closed_form_is_that_of_a_fine_sum() {
        for terms in
            [vec![(1.0, 0.3, 3.0)], vec![(1.0, 0.3, 0.2), (0.4, 1.0, 17.0), (0.01, 2.0, 90.0), (0.1, 0.2, 0.0)]]
        {
            for length_s in [1e-5, 0.01, 0.7, 2.5] {
                let course = course_of(&terms, length_s);
                // Simpson's rule: its error is below 90⁴ h⁴/180 with h = 1e-4.
                let count = 20_000;
                let square = |n: i32| course.at(length_s * f64::from(n) / f64::from(count)).0.powi(2);
                let weight = |n: i32| if n == 0 || n == count { 1.0 } else { f64::from(2 + 2 * (n % 2)) };
                let sum: f64 = (0..=count).map(|n| weight(n) * square(n)).sum();
                let expected = sum * length_s / f64::from(count) / 3.0;
                let found = course.square_m2_s();
                assert!((found / expected - 1.0).abs() < 1e-9, "{length_s} s: {found} {expected}");
            }
        }
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives() {
        let course = course(&[(1.0, 0.3, 3.0), (0.4, 1.0, 17.0)]);
        let h = 1e-4;
        let [before, here, after] = [0.7 - h, 0.7, 0.7 + h].map(|at_s| course.at(at_s));
        assert!(((after.0 - before.0) / (2.0 * h) - here.1).abs() < 1e-4);
        assert!(((after.1 - before.1) / (2.0 * h) - course.acceleration_m_per_s2(0.7)).abs() < 1e-2);
        let acceleration = course.acceleration();
        for after_s in [0.0, 0.7, LENGTH_S] {
            let (expected, found) = (course.acceleration_m_per_s2(after_s), acceleration.at(after_s).0);
            assert!((found - expected).abs() < 1e-12 * 4.0 * 17.0_f64.powi(2), "{after_s}: {found} {expected}");
        }
        let none = course.minus(&course);
        assert!(none.at(0.4).0.abs() < 1e-15 && none.largest_abs((0.0, 1.0), 0.0) < 1e-14);
    }
}
