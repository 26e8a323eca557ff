//! Prediction of a growing vibration's amplitude a few half-cycles ahead.
//!
//! There is one maximum between two zero crossings. The straight line through the maxima of one side is an upper bound
//! of every growth that slows down, such as that of a resonance driven by a constant base: A(1 − e^(−ζωt)) lies below
//! its tangent. Only maxima of the same side are compared, so a sensor's offset does not look like growth.

/// Part of the last maximum by which x must pass zero before a half-cycle counts as over. It keeps noise from counting
/// as half-cycles.
const HYSTERESIS: f32 = 0.05;

/// Follows the half-cycles of one displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Envelope {
    /// Sign of x in the present half-cycle.
    positive: bool,
    /// Largest |x| of the present half-cycle.
    present: f32,
    /// Largest |x| of the last two half-cycles, newest first.
    before: [f32; 2],
    /// Number of half-cycles seen.
    seen: u8,
}

impl Envelope {
    /// Takes one tick's mean of x, m. Returns max |x| predicted for `ahead` half-cycles after the present one, m; 0
    /// until three maxima are known.
    pub fn push(&mut self, x_m: f32, ahead: f32) -> f32 {
        let along = if self.positive { x_m } else { -x_m };
        if along < -HYSTERESIS * self.present {
            self.before = [self.present, self.before[0]];
            self.seen = self.seen.saturating_add(1);
            self.positive = !self.positive;
            self.present = -along;
        } else if along > self.present {
            self.present = along;
        }
        // The first half-cycle is incomplete: it may have begun at any phase.
        if self.seen < 4 {
            return 0.0;
        }
        // The present half-cycle is not over. It counts once it is larger than the one before.
        let growth = (self.present - self.before[1]) * 0.5;
        let known = if self.present > self.before[0] { self.present } else { self.before[0] };
        if growth > 0.0 { known + growth * ahead } else { known }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest prediction and first tick at which it passes `limit`, for x(t).
    fn run(x: impl Fn(f64) -> f64, ticks: u32, ahead: f32, limit: f32) -> (f32, Option<u32>) {
        let mut envelope = Envelope::default();
        let (mut largest, mut first) = (0.0f32, None);
        for tick in 0..ticks {
            let predicted = envelope.push(x(f64::from(tick) * 1e-3) as f32, ahead);
            largest = largest.max(predicted);
            if predicted >= limit && first.is_none() {
                first = Some(tick);
            }
        }
        (largest, first)
    }

    const OMEGA: f64 = 15.708;

    #[test]
    fn a_steady_vibration_with_an_offset_predicts_its_own_maximum() {
        let (largest, _) = run(|t| 0.03 * libm::sin(OMEGA * t) + 0.002, 20_000, 6.0, 1.0);
        assert!((largest - 0.032).abs() < 1e-6, "{largest}");
    }

    #[test]
    fn a_resonance_is_foreseen_before_it_reaches_the_limit() {
        // Z = 3 mm at resonance, ζ = 0.0038: the final amplitude is 395 mm, the limit is 80 mm.
        let grown = |t: f64| 0.395 * (1.0 - libm::exp(-0.0038 * OMEGA * t)) * libm::sin(OMEGA * t);
        let (_, foreseen) = run(grown, 10_000, 6.0, 0.08);
        let reached = (0..10_000u32).find(|tick| grown(f64::from(*tick) * 1e-3).abs() >= 0.08).unwrap();
        // Six half-cycles are 1.2 s. The warning occurs in the part of them that follows the maximum which triggers
        // it.
        assert!(foreseen.is_some_and(|tick| reached - tick > 900 && reached - tick < 1500), "{foreseen:?} {reached}");
    }

    #[test]
    fn a_decay_predicts_no_increase() {
        let (largest, _) = run(|t| 0.05 * libm::exp(-0.2 * t) * libm::cos(OMEGA * t), 10_000, 6.0, 1.0);
        assert!(largest <= 0.05, "{largest}");
    }

    #[test]
    fn noise_at_rest_predicts_no_large_amplitude() {
        let (largest, _) = run(|t| 1e-5 * libm::sin(7919.0 * t * t), 20_000, 6.0, 1.0);
        assert!(largest < 1e-4, "{largest}");
    }
}
