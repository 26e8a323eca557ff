//! Lock-in: amplitude and phase of a signal at the drive frequency.

use super::sum::Sum;
use crate::scalar::Scalar;

/// Correlates a signal with the drive's sine and cosine over whole cycles.
///
/// Within a cycle the sums are plain; over the cycles they carry their rounding errors ([`Sum`]). A long dwell
/// therefore loses no precision, and a tick costs two multiplications.
#[derive(Clone, Copy, Debug, Default)]
pub struct LockIn {
    cycle: (f32, f32),
    total: (Sum, Sum),
}

impl LockIn {
    /// Takes one sample, and the reference's sine and cosine at the same tick.
    #[inline]
    pub fn push(&mut self, sample: f32, (sine, cosine): (f32, f32)) {
        self.cycle.0 += sample * sine;
        self.cycle.1 += sample * cosine;
    }

    /// Closes a cycle.
    pub fn end_cycle(&mut self) {
        self.total.0.push(self.cycle.0);
        self.total.1.push(self.cycle.1);
        self.cycle = (0.0, 0.0);
    }

    /// Amplitude (in the signal's unit) and phase (rad, positive where the signal leads the reference) over the closed
    /// cycles. `samples` is the number of samples in them. Zero if there are none.
    #[must_use]
    pub fn amplitude_and_phase(&self, samples: u32) -> (f32, f32) {
        let (sine, cosine) = self.components(samples);
        (Scalar::sqrt(sine * sine + cosine * cosine), libm::atan2f(cosine, sine))
    }

    /// The squared amplitude alone, without a root or an angle. Used for a sum over harmonics.
    #[must_use]
    pub fn squared_amplitude(&self, samples: u32) -> f32 {
        let (sine, cosine) = self.components(samples);
        sine * sine + cosine * cosine
    }

    /// The components in phase with the sine and with the cosine.
    pub(super) fn components(&self, samples: u32) -> (f32, f32) {
        if samples == 0 {
            return (0.0, 0.0);
        }
        let scale = 2.0 / samples as f32;
        (self.total.0.value() * scale, self.total.1.value() * scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sine::Phase;

    #[test]
    fn amplitude_and_phase_of_a_known_sine_are_measured() {
        let increment = Phase::increment(2.5, 1000.0);
        let (mut phase, mut lock_in, mut samples) = (Phase::default(), LockIn::default(), 0);
        for tick in 1..=80 * 400 {
            let reference = phase.sin_cos();
            let shifted = Phase(phase.0.wrapping_add(u32::MAX / 8)).sin_cos().0;
            lock_in.push(0.0123 * shifted + 0.004, reference);
            if phase.advance(increment) {
                lock_in.end_cycle();
                samples = tick;
            }
        }
        let (amplitude, angle) = lock_in.amplitude_and_phase(samples);
        // A cycle boundary is known to one tick of 80 × 400: the error is at most 2 · (0.0123 + 0.004)/0.0123/32000 =
        // 8.3e-5.
        assert!((amplitude / 0.0123 - 1.0).abs() < 8.3e-5, "{amplitude}");
        assert!((angle - core::f32::consts::FRAC_PI_4).abs() < 8.3e-5, "{angle}");
    }
}
