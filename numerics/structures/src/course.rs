//! The course of a displacement over a piece of motion, and its largest magnitude.

use crate::guard::Parabola;
use crate::linear::C64;

/// A displacement over a piece of motion: a parabola and a sum of exponentials whose amplitudes never grow.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Each amplitude and its rate.
    terms: Vec<(C64, C64)>,
    parabola: Parabola,
}

/// A displacement and its derivatives at an instant.
#[derive(Clone, Copy, Debug, Default)]
struct Here {
    value: f64,
    rate: f64,
}

/// Least share of an interval that is still divided: an extremum closer to an end is the end.
const NARROW: f64 = 1e-9;

/// Steps of the search for a turning point.
const MAX_STEPS: u32 = 60;

impl Course {
    pub(crate) fn new(terms: impl Iterator<Item = (C64, C64)>, parabola: Parabola) -> Self {
        Self { terms: terms.filter(|(amplitude, _)| *amplitude != C64::ZERO).collect(), parabola }
    }

    /// Displacement, m, and velocity, m/s, at `after_s` from the start of the piece.
    #[must_use]
    pub fn at(&self, after_s: f64) -> (f64, f64) {
        let here = self.here(after_s);
        (here.value, here.rate)
    }

    fn here(&self, after_s: f64) -> Here {
        let parabola = self.parabola.at(after_s);
        let mut here = Here { value: parabola.value, rate: parabola.slope };
        for (amplitude, rate) in &self.terms {
            let term = amplitude * (rate * after_s).exp();
            here.value += term.re;
            here.rate += rate.re * term.re - rate.im * term.im;
        }
        here
    }

    /// Acceleration, m/s², at `after_s` from the start of the piece.
    #[must_use]
    pub fn acceleration_m_per_s2(&self, after_s: f64) -> f64 {
        let terms = self.terms.iter().map(|(amplitude, rate)| (rate * rate * amplitude * (rate * after_s).exp()).re);
        self.parabola.bend + terms.sum::<f64>()
    }

    /// The difference of two courses of one piece.
    #[must_use]
    pub fn minus(&self, other: &Self) -> Self {
        let (a, b) = (&self.parabola, &other.parabola);
        let parabola = Parabola { value: a.value - b.value, slope: a.slope - b.slope, bend: a.bend - b.bend };
        let taken = other.terms.iter().map(|(amplitude, rate)| (-amplitude, *rate));
        Self { terms: self.terms.iter().copied().chain(taken).collect(), parabola }
    }

    /// ∫x² dt over `length_s` from the start of the piece, m²·s, in closed form.
    #[must_use]
    pub fn square_m2_s(&self, length_s: f64) -> f64 {
        let h = length_s;
        let Parabola { value, slope, bend } = self.parabola;
        let (b, c) = (slope * h, 0.5 * bend * h * h);
        let mut square = h * (value * (value + b + 2.0 * c / 3.0) + b * (b / 3.0 + 0.5 * c) + 0.2 * c * c);
        for (n, (a, rate)) in self.terms.iter().enumerate() {
            // ∫ tⁿ e^{λt} dt for n = 0, 1, 2.
            let [zeroth, first, second] = moments(*rate, h);
            square += 2.0 * (a * (zeroth * value + first * slope + second * (0.5 * bend))).re;
            square += 0.5 * (a * a * moments(2.0 * rate, h)[0]).re;
            square += 0.5 * a.norm_sqr() * moments(C64::new(2.0 * rate.re, 0.0), h)[0].re;
            for (other, other_rate) in &self.terms[..n] {
                let sum = a * other * moments(rate + other_rate, h)[0];
                let difference = a * other.conj() * moments(rate + other_rate.conj(), h)[0];
                square += sum.re + difference.re;
            }
        }
        square
    }

    /// The largest magnitude between two times, s, if above `least_m`, else `least_m`.
    ///
    /// An interval is left out when the cubic with the values and slopes of its ends, and Hermite's remainder `max|x⁗| h⁴/384` of it, stay
    /// below what was found; it is searched for its turning point when x″ keeps its sign, which `|x″| > max|x‴| h/2` in its middle proves;
    /// otherwise it is halved.
    #[must_use]
    pub fn largest_abs(&self, (from_s, to_s): (f64, f64), least_m: f64) -> f64 {
        let (from, to) = (self.here(from_s), self.here(to_s));
        let mut largest = least_m.max(from.value.abs()).max(to.value.abs());
        let mut open = vec![(from_s, from, to_s, to)];
        while let Some((a_s, a, b_s, b)) = open.pop() {
            let h = b_s - a_s;
            // Bounds of the third and the fourth derivative from `a` on.
            let [mut third, mut fourth] = [0.0, 0.0];
            for (amplitude, rate) in &self.terms {
                let size = rate.norm();
                let most = amplitude.norm() * (rate.re * a_s).exp() * size.powi(3);
                (third, fourth) = (third + most, fourth + most * size);
            }
            let corners = [a.value, a.value + a.rate * h / 3.0, b.value - b.rate * h / 3.0, b.value];
            let cubic = corners.iter().fold(0.0, |most: f64, corner| most.max(corner.abs()));
            if cubic + fourth * h.powi(4) / 384.0 <= largest || h <= NARROW * (to_s - from_s) {
                continue;
            }
            let middle_s = 0.5 * (a_s + b_s);
            let bends = self.acceleration_m_per_s2(middle_s).abs() > 0.5 * third * h;
            if bends {
                if a.rate * b.rate < 0.0 {
                    largest = largest.max(self.turning_point((a_s, a.rate), (b_s, b.rate)));
                }
                continue;
            }
            let middle = self.here(middle_s);
            largest = largest.max(middle.value.abs());
            open.push((a_s, a, middle_s, middle));
            open.push((middle_s, middle, b_s, b));
        }
        largest
    }

    /// The magnitude where the velocity is zero between two times with velocities of different sign: secant steps within a bracket.
    fn turning_point(&self, mut low: (f64, f64), mut high: (f64, f64)) -> f64 {
        let mut largest = 0.0_f64;
        for _ in 0..MAX_STEPS {
            let at_s = low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1);
            let here = self.here(at_s);
            largest = largest.max(here.value.abs());
            // A further step would change the value by less than rounding.
            if here.rate == 0.0 || (here.rate * (high.0 - low.0)).abs() <= f64::EPSILON * here.value.abs() {
                break;
            }
            if here.rate * high.1 < 0.0 {
                low = high;
            } else {
                low.1 *= 0.5;
            }
            high = (at_s, here.rate);
        }
        largest
    }
}

/// ∫ tⁿ e^{λt} dt from 0 to h for n = 0, 1, 2.
fn moments(rate: C64, h: f64) -> [C64; 3] {
    let turn = rate * h;
    if turn.norm_sqr() < 1.0 {
        // Σ (λh)^k / (k! (k + n + 1)): the terms left out are below 1/20!.
        let mut sums = [C64::ZERO; 3];
        let mut term = C64::ONE;
        for k in 0..20_u8 {
            for (n, sum) in (1_u8..).zip(&mut sums) {
                *sum += term / f64::from(k + n);
            }
            term *= turn / f64::from(k + 1);
        }
        return [sums[0] * h, sums[1] * (h * h), sums[2] * (h * h * h)];
    }
    let end = turn.exp();
    let zeroth = (end - 1.0) / rate;
    let first = (end * h - zeroth) / rate;
    [zeroth, first, (end * (h * h) - first * 2.0) / rate]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 + Re Σ of terms with these amplitudes and frequencies.
    fn course(terms: &[(f64, f64, f64)]) -> Course {
        let terms =
            terms.iter().map(|(size, phase, turning)| (C64::from_polar(*size, *phase), C64::new(-0.01, *turning)));
        Course::new(terms, Parabola { value: 0.1, slope: 0.02, bend: -0.05 })
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
    fn the_mean_square_in_closed_form_is_that_of_a_fine_sum() {
        for terms in
            [vec![(1.0, 0.3, 3.0)], vec![(1.0, 0.3, 0.2), (0.4, 1.0, 17.0), (0.01, 2.0, 90.0), (0.1, 0.2, 0.0)]]
        {
            let course = course(&terms);
            for length_s in [0.01, 0.7, 2.5] {
                // Simpson's rule: its error is below 90⁴ h⁴/180 with h = 1e-4.
                let count = 20_000;
                let square = |n: i32| course.at(length_s * f64::from(n) / f64::from(count)).0.powi(2);
                let weight = |n: i32| if n == 0 || n == count { 1.0 } else { f64::from(2 + 2 * (n % 2)) };
                let sum: f64 = (0..=count).map(|n| weight(n) * square(n)).sum();
                let expected = sum * length_s / f64::from(count) / 3.0;
                let found = course.square_m2_s(length_s);
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
        let none = course.minus(&course);
        assert!(none.at(0.4).0.abs() < 1e-15 && none.largest_abs((0.0, 1.0), 0.0) < 1e-14);
    }
}
