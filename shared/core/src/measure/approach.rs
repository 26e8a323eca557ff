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
}

/// The limit of a fit, as an amplitude, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FitLimit {
    /// Modulus of the limit, in the signal's unit.
    pub(super) amplitude: f32,
    /// Standard uncertainty of that modulus.
    pub(super) uncertainty: f32,
    /// The fitted exponential decays, or alternates between neighbouring cycles, so that its mean is the limit.
    pub(super) converges: bool,
    /// RMS of what a decaying exponential leaves unexplained, over the RMS of the amplitudes about their mean; 0 to 1.
    pub(super) unexplained: f32,
    /// Share of the decaying part that is left after half of the cycles.
    left: f32,
}

impl FitLimit {
    /// A limit of 0 that nothing is known about.
    pub(super) const UNKNOWN: Self = Self { uncertainty: f32::MAX, converges: false, ..Self::at(0.0) };

    /// A limit that has been reached.
    const fn at(amplitude: f32) -> Self {
        Self { amplitude, uncertainty: 0.0, converges: true, unexplained: 0.0, left: 0.0 }
    }

    /// By how much the mean of a quantity over all cycles is above its limit, which it approaches as fast as the amplitude does.
    /// `late`: its mean over the second half.
    pub(super) fn above_limit(&self, mean: f32, late: f32) -> f32 {
        (mean - late) * (1.0 + self.left) / (1.0 - self.left)
    }
}

/// Slowest decay per cycle that a dwell can tell from none.
const SLOWEST: f32 = 0.9999;

/// Share of an alternation that is left after half of the cycles, from which on the motion repeats after two cycles and does not decay.
const ALTERNATES: f32 = 0.9;

impl Approach {
    /// Takes the next cycle's amplitude: its components in phase with the drive's sine and cosine.
    pub(super) fn push(&mut self, amplitude: Complex) {
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

    /// Modulus of the mean of the amplitudes. That of an irregular motion is smaller than the mean of their moduli.
    pub(super) fn modulus_of_mean(&self) -> f32 {
        let count = (self.pairs + 1) as f32;
        let differences = (self.differences.0.value(), self.differences.1.value());
        modulus(plus(self.first, scaled(plus(differences, self.last), 1.0 / count)))
    }

    /// The limit. `None` with fewer than four pairs, or if the fit has none (λ = 1).
    pub(super) fn limit(&self) -> Option<FitLimit> {
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
            return Some(FitLimit::at(modulus(plus(self.first, self.last))));
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
        let left = libm::powf(modulus(lambda).min(SLOWEST), 0.5 * (n + 1.0));
        let alternates = lambda.0 < 0.0 && left > ALTERNATES;
        Some(FitLimit {
            amplitude: modulus(plus(self.first, limit)),
            uncertainty: Scalar::sqrt(variance),
            converges: square(lambda) < 1.0 || lambda.0 < 0.0,
            unexplained: if alternates { 1.0 } else { Scalar::sqrt(residual / spread_to) },
            left: if alternates { 0.0 } else { left },
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

    #[test]
    fn a_mean_that_decays_with_the_amplitude_is_extrapolated_from_its_two_halves() {
        for cycles in [12, 30, 61] {
            let (mut approach, mut all, mut late) = (Approach::default(), 0.0, 0.0);
            for n in 0..cycles {
                approach.push(beat(n));
                let value = 2.0 + 0.3 * libm::powf(0.97, f32::from(n));
                all += value / f32::from(cycles);
                late += if n < cycles / 2 { 0.0 } else { value / f32::from(cycles - cycles / 2) };
            }
            let above = approach.limit().unwrap().above_limit(all, late);
            // An odd number of cycles has unequal halves: half a cycle of 61, over a decay by 0.4.
            assert!((above / (all - 2.0) - 1.0).abs() < 0.02, "{cycles}: {above}, {}", all - 2.0);
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
