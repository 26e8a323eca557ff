//! Where a sequence of complex amplitudes, one per cycle, is heading.

use super::sum::Sum;
use crate::scalar::Scalar;

/// A complex number: real and imaginary part.
type Complex = (f32, f32);

fn plus(a: Complex, b: Complex) -> Complex {
    (a.0 + b.0, a.1 + b.1)
}

fn minus(a: Complex, b: Complex) -> Complex {
    (a.0 - b.0, a.1 - b.1)
}

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn scaled(a: Complex, factor: f32) -> Complex {
    (a.0 * factor, a.1 * factor)
}

fn conjugate(a: Complex) -> Complex {
    (a.0, -a.1)
}

fn square(a: Complex) -> f32 {
    a.0 * a.0 + a.1 * a.1
}

pub(super) fn modulus(a: Complex) -> f32 {
    Scalar::sqrt(square(a))
}

/// Least-squares fit of A(n + 1) = λ·A(n) + b to the amplitudes A of successive cycles.
///
/// After a start or a change of frequency a linear system's amplitude at the drive frequency is a constant plus a
/// decaying exponential: |λ| is its decay and arg λ its beat with the drive, both per cycle. The limit is b/(1 − λ).
/// Only sums are kept, of differences from the first amplitude, so a small change of a large amplitude is not lost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Approach {
    first: Complex,
    /// The last amplitude's difference from the first.
    last: Complex,
    /// Number of pairs of successive amplitudes.
    pairs: u32,
    is_begun: bool,
    /// Σ of the differences from the first amplitude, without the last one.
    differences: (Sum, Sum),
    /// Σ of their squared moduli.
    squares: Sum,
    /// Σ of each difference times the conjugate of the one before it.
    products: (Sum, Sum),
    /// Σ of the moduli of all amplitudes.
    moduli: Sum,
}

/// The limit of a fit, as an amplitude, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limit {
    /// Modulus of the limit, in the signal's unit.
    pub(super) amplitude: f32,
    /// Standard uncertainty of that modulus.
    pub(super) uncertainty: f32,
    /// The fitted exponential decays, or alternates between neighbouring cycles, so that its mean is the limit.
    pub(super) converges: bool,
    /// RMS of what the exponential leaves unexplained, over the RMS of the amplitudes about their mean; 0 to 1.
    pub(super) unexplained: f32,
    /// Factor of the decaying part from cycle to cycle.
    lambda: Complex,
    /// Modulus of the decaying part in the first cycle.
    decaying: f32,
    /// Number of cycles.
    cycles: u32,
}

impl Limit {
    /// A limit of 0 that nothing is known about.
    pub(super) const UNKNOWN: Self = Self { uncertainty: f32::MAX, converges: false, ..Self::at(0.0) };

    /// A limit that has been reached.
    const fn at(amplitude: f32) -> Self {
        Self {
            amplitude,
            uncertainty: 0.0,
            converges: true,
            unexplained: 0.0,
            lambda: (0.0, 0.0),
            decaying: 0.0,
            cycles: 0,
        }
    }

    /// By how much the decaying part raises the mean cycle maximum above the mean amplitude, in the signal's unit.
    pub(super) fn beat(&self) -> f32 {
        raised_by_beat(self.lambda) * self.decaying * mean_power(modulus(self.lambda), self.cycles)
    }
}

/// By how much a vibration that decays and beats with the drive raises the mean of the cycle maxima, over the mean of its amplitude
/// per cycle. `lambda`: its factor from cycle to cycle.
///
/// A cycle has two peaks of |x|, of which the larger counts. The beat turns by θ = arg λ in a cycle, so by θ/2 from peak to peak: the
/// vibration b raises them by b cos β and b cos(β + θ/2). The larger of two numbers is their mean, plus half of their distance; over
/// all β the mean of that is b·(2/π) sin(θ/4). The amplitude over a cycle that turns by θ is b·sin(θ/2)/(θ/2).
fn raised_by_beat(lambda: Complex) -> f32 {
    let theta = libm::atan2f(lambda.1, lambda.0).abs();
    theta / (core::f32::consts::TAU * libm::cosf(0.25 * theta))
}

/// Mean of 1, q, q² … over `count` terms, for q from 0; 1 for a q above 1.
fn mean_power(q: f32, count: u32) -> f32 {
    let away = 1.0 - q;
    // Below, rounding would spoil the difference.
    if away < 1e-4 {
        return 1.0;
    }
    let (mut power, mut square, mut left) = (1.0, q, count);
    while left > 0 {
        if left & 1 == 1 {
            power *= square;
        }
        square *= square;
        left >>= 1;
    }
    (1.0 - power) / (count as f32 * away)
}

impl Approach {
    /// Takes the next cycle's amplitude: its components in phase with the drive's sine and cosine.
    pub(super) fn push(&mut self, amplitude: Complex) {
        self.moduli.push(modulus(amplitude));
        if !self.is_begun {
            (self.first, self.is_begun) = (amplitude, true);
            return;
        }
        let next = minus(amplitude, self.first);
        let product = times(next, conjugate(self.last));
        self.differences.0.push(self.last.0);
        self.differences.1.push(self.last.1);
        self.squares.push(square(self.last));
        self.products.0.push(product.0);
        self.products.1.push(product.1);
        self.last = next;
        self.pairs += 1;
    }

    /// Mean modulus of the amplitudes.
    pub(super) fn mean_modulus(&self) -> f32 {
        self.moduli.value() / (self.pairs + 1) as f32
    }

    /// Modulus of the mean of the amplitudes. That of an irregular motion is smaller than [`Self::mean_modulus`].
    pub(super) fn modulus_of_mean(&self) -> f32 {
        let count = (self.pairs + 1) as f32;
        let differences = (self.differences.0.value(), self.differences.1.value());
        modulus(plus(self.first, scaled(plus(differences, self.last), 1.0 / count)))
    }

    /// The limit. `None` with fewer than four pairs, or if the fit has none (λ = 1).
    pub(super) fn limit(&self) -> Option<Limit> {
        if self.pairs < 4 {
            return None;
        }
        let n = self.pairs as f32;
        let from = (self.differences.0.value(), self.differences.1.value());
        let to = plus(from, self.last);
        let (mean_from, mean_to) = (scaled(from, 1.0 / n), scaled(to, 1.0 / n));
        let squares = self.squares.value();
        let spread_from = squares - square(from) / n;
        let spread_to = squares + square(self.last) - square(to) / n;
        let products = (self.products.0.value(), self.products.1.value());
        let covariance = minus(products, times(to, conjugate(mean_from)));
        // Amplitudes equal to the last bit are at their limit.
        if spread_from <= 0.0 || spread_to <= 0.0 {
            return Some(Limit::at(modulus(plus(self.first, self.last))));
        }
        let lambda = scaled(covariance, 1.0 / spread_from);
        let away = minus((1.0, 0.0), lambda);
        let away_square = square(away);
        if away_square < 1e-12 {
            return None;
        }
        let residual = (spread_to - square(covariance) / spread_from).max(0.0);
        let intercept = minus(mean_to, times(lambda, mean_from));
        let limit = scaled(times(intercept, conjugate(away)), 1.0 / away_square);
        let reach = square(minus(limit, mean_from)) / spread_from;
        let variance = residual / (n - 2.0) / away_square * (1.0 / n + reach);
        Some(Limit {
            amplitude: modulus(plus(self.first, limit)),
            uncertainty: Scalar::sqrt(variance),
            converges: square(lambda) < 1.0 || lambda.0 < 0.0,
            unexplained: Scalar::sqrt(residual / spread_to),
            lambda,
            decaying: modulus(limit),
            cycles: self.pairs + 1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An amplitude of 1 that a beat approaches: decay 0.97 and 0.1 rad a cycle.
    fn beat(n: u16) -> Complex {
        let (decay, angle) = (libm::powf(0.97, f32::from(n)), 0.1 * f32::from(n));
        (1.0 + 0.5 * decay * libm::cosf(angle), 0.5 * decay * libm::sinf(angle))
    }

    #[test]
    fn a_decaying_beat_is_extrapolated_to_its_limit() {
        let mut approach = Approach::default();
        (0..30).for_each(|n| approach.push(beat(n)));
        let limit = approach.limit().unwrap();
        assert!(limit.converges && limit.unexplained < 1e-3, "{limit:?}");
        assert!((limit.amplitude - 1.0).abs() < 1e-4, "{limit:?}");
    }

    /// x = sin(2πt) + b e^(−t/τ) sin(2πrt + φ), t in cycles: its cycle maxima and amplitudes, for twelve phases φ.
    #[test]
    fn the_rise_of_the_cycle_maxima_by_a_beat_is_known_to_half() {
        const TICKS: usize = 400;
        for (ratio, decay, b) in [(1.25, 0.9, 0.2), (1.4, 0.95, 0.1), (0.8, 0.9, 0.2), (0.9, 0.97, 0.1)] {
            for phase in 0..12 {
                let (mut approach, mut maxima) = (Approach::default(), 0.0);
                for cycle in 0..60 {
                    let (mut sum, mut largest) = ((0.0, 0.0), 0.0f64);
                    for tick in 0..TICKS {
                        let t = f64::from(cycle) + tick as f64 / TICKS as f64;
                        let turn = core::f64::consts::TAU * t;
                        let beat = libm::sin(ratio * turn + 0.5 * f64::from(phase));
                        let x = libm::sin(turn) + b * libm::pow(decay, t) * beat;
                        let share = 2.0 / TICKS as f64 * x;
                        sum = (sum.0 + share * libm::sin(turn), sum.1 + share * libm::cos(turn));
                        largest = largest.max(x.abs());
                    }
                    maxima += largest / 60.0;
                    approach.push((sum.0 as f32, sum.1 as f32));
                }
                let limit = approach.limit().unwrap();
                let risen = maxima as f32 - approach.mean_modulus();
                // The beat's phases are few, the rise of each lies between 0 and π/2 of the mean; b²/4 is the second order.
                assert!((risen - limit.beat()).abs() < 0.5 * limit.beat() + 2e-4, "{ratio} {phase}: {risen} {limit:?}");
            }
        }
    }

    #[test]
    fn the_mean_of_powers_is_that_of_their_sum() {
        for (q, count) in [(0.0, 7), (0.9, 60), (0.999, 1000), (0.99999, 50), (1.2, 10)] {
            let terms = (0..count).map(|n| libm::pow(f64::from(q), f64::from(n)).min(1.0));
            let exact = terms.sum::<f64>() / f64::from(count);
            assert!((f64::from(mean_power(q, count)) - exact).abs() < 1e-3, "{q} {count}");
        }
    }

    #[test]
    fn the_stated_uncertainty_covers_the_error_that_noise_causes() {
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            1e-3 * ((state >> 8) as f32 / 8_388_608.0 - 1.0)
        };
        let mut covered = 0;
        for _ in 0..200 {
            let mut approach = Approach::default();
            (0..60).for_each(|n| approach.push(plus(beat(n), (noise(), noise()))));
            let limit = approach.limit().unwrap();
            covered += u32::from((limit.amplitude - 1.0).abs() < 2.0 * limit.uncertainty);
        }
        // Two standard uncertainties cover 95 %; noise in both members of a pair biases λ a little.
        assert!(covered > 170, "{covered} of 200");
    }

    #[test]
    fn equal_amplitudes_are_their_own_limit() {
        let mut approach = Approach::default();
        (0..10).for_each(|_| approach.push((0.3, -0.4)));
        let limit = approach.limit().unwrap();
        assert_eq!((limit.amplitude, limit.uncertainty), (0.5, 0.0));
    }
}
