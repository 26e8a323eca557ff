//! Integer phase accumulator, and the sine and cosine that the drive and the lock-in share.
//!
//! The 32-bit accumulator wraps once per cycle, so the phase never drifts and a cycle boundary is an overflow. The core
//! has its own sine because the bits must be the same on every machine.

use serde::{Deserialize, Serialize};

/// A phase; 2³² is one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Phase(pub u32);

impl Phase {
    /// The phase step per tick for `frequency_hz` at `tick_hz`. `tick_hz` is a whole number below 2¹⁶. The resolution
    /// is `tick_hz`/2³² (0.23 µHz at 1 kHz). A frequency of `tick_hz` or above gives the largest step.
    #[must_use]
    #[inline]
    pub fn increment(frequency_hz: f32, tick_hz: f32) -> u32 {
        // The frequency in units of 2⁻³² Hz, divided sixteen bits at a time: exact, without the long division that a
        // controller lacks.
        let (whole, tick) = (frequency_hz as u32, (tick_hz as u32).clamp(1, 0xffff));
        if whole >= tick {
            return u32::MAX;
        }
        let fraction = ((frequency_hz - whole as f32) * 4_294_967_296.0) as u32;
        let first = whole << 16 | fraction >> 16;
        let second = ((first % tick) << 16 | fraction & 0xffff) + tick / 2;
        ((first / tick) << 16).saturating_add(second / tick)
    }

    /// Advances the phase; returns true if a cycle was completed.
    pub fn advance(&mut self, increment: u32) -> bool {
        let (phase, wrapped) = self.0.overflowing_add(increment);
        self.0 = phase;
        wrapped
    }

    /// Sine and cosine of the phase. The absolute error is at most 2·10⁻⁷ (tested over all octants).
    #[must_use]
    pub fn sin_cos(self) -> (f32, f32) {
        // Fold to one eighth of a cycle: a 29-bit fraction, mirrored in the odd octants.
        let octant = self.0 >> 29;
        let fraction = self.0 & 0x1fff_ffff;
        let folded = if octant & 1 == 0 { fraction } else { 0x2000_0000 - fraction };
        const RADIANS_PER_COUNT: f32 = (core::f64::consts::TAU / 4_294_967_296.0) as f32;
        let a = folded as f32 * RADIANS_PER_COUNT;
        let square = a * a;
        // Taylor series about 0. The first omitted terms are (π/4)⁹/9! = 3·10⁻⁷·… below f32's resolution of 1.
        let sine = a + a
            * square
            * (-1.0 / 6.0 + square * (1.0 / 120.0 + square * (-1.0 / 5040.0 + square * (1.0 / 362_880.0))));
        let cosine =
            1.0 + square * (-0.5 + square * (1.0 / 24.0 + square * (-1.0 / 720.0 + square * (1.0 / 40_320.0))));
        match octant {
            0 => (sine, cosine),
            1 => (cosine, sine),
            2 => (cosine, -sine),
            3 => (sine, -cosine),
            4 => (-sine, -cosine),
            5 => (-cosine, -sine),
            6 => (-cosine, sine),
            _ => (-sine, cosine),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_stay_within_their_stated_error() {
        let mut worst: f64 = 0.0;
        for n in 0..200_000u32 {
            let phase = Phase(n.wrapping_mul(21_475));
            let exact = f64::from(phase.0) / 4_294_967_296.0 * core::f64::consts::TAU;
            let (sine, cosine) = phase.sin_cos();
            worst = worst.max((f64::from(sine) - libm::sin(exact)).abs());
            worst = worst.max((f64::from(cosine) - libm::cos(exact)).abs());
        }
        assert!(worst < 2e-7, "{worst}");
    }

    #[test]
    fn an_increment_is_the_nearest_whole_step() {
        for n in 0..200_000u32 {
            let (frequency_hz, tick_hz) = (n as f32 * 0.004_987, if n % 2 == 0 { 1000.0 } else { 50_000.0 });
            let exact = f64::from(frequency_hz) * 4_294_967_296.0 / f64::from(tick_hz);
            let increment = f64::from(Phase::increment(frequency_hz, tick_hz));
            // Frequency differences below 2⁻³² Hz are ignored.
            assert!((increment - exact).abs() <= 0.500_01, "{frequency_hz} Hz at {tick_hz} Hz: {increment}, {exact}");
        }
        assert_eq!(Phase::increment(1000.0, 1000.0), u32::MAX);
        assert_eq!([-1.0, f32::NAN].map(|odd| Phase::increment(odd, 1000.0)), [0, 0]);
    }

    #[test]
    fn the_number_of_cycles_follows_exactly_from_the_frequency() {
        let increment = Phase::increment(2.45, 1000.0);
        let mut phase = Phase::default();
        let cycles = (0..1_000_000).filter(|_| phase.advance(increment)).count();
        assert_eq!(cycles, 2450 - usize::from(f64::from(increment) / 4_294_967_296.0 * 1e6 < 2450.0));
    }
}
