//! Lock-in: amplitude and phase of a signal at the drive frequency.

use super::sum::Sum;
use crate::scalar::Scalar;

/// Correlates a signal with the drive's sine and cosine over whole cycles.
///
/// Within a cycle the sums are plain; over the cycles they carry their rounding errors ([`Sum`]). A long dwell
/// therefore loses no precision, and a tick costs two multiplications. The sample in which a cycle ends is divided
/// between both cycles.
#[derive(Clone, Copy, Debug, Default)]
pub struct LockIn {
    cycle: (f32, f32),
    /// The last sample's products with the reference.
    last: (f32, f32),
    total: (Sum, Sum),
}

impl LockIn {
    /// Takes one sample, and the reference's sine and cosine at the same tick.
    #[inline]
    pub fn push(&mut self, sample: f32, (sine, cosine): (f32, f32)) {
        self.last = (sample * sine, sample * cosine);
        self.cycle.0 += self.last.0;
        self.cycle.1 += self.last.1;
    }

    /// Closes a cycle, of which `over`, a fraction of the last sample (0 to 1), belongs to the next one. Returns the
    /// cycle's sums of products with sine and cosine.
    pub fn end_cycle(&mut self, over: f32) -> (f32, f32) {
        let next = (over * self.last.0, over * self.last.1);
        let cycle = (self.cycle.0 - next.0, self.cycle.1 - next.1);
        self.total.0.push(cycle.0);
        self.total.1.push(cycle.1);
        self.cycle = next;
        cycle
    }

    /// Counts the last sample once more, by this fraction: a cycle that began between two samples has the missing part
    /// of its first one.
    pub(super) fn extend_last(&mut self, fraction: f32) {
        self.cycle.0 += fraction * self.last.0;
        self.cycle.1 += fraction * self.last.1;
    }

    /// Amplitude (in the signal's unit) and phase (rad, positive where the signal leads the reference) over the closed
    /// cycles. `samples` is the number of samples in them, with fractions. Zero if there are none.
    #[must_use]
    pub fn amplitude_and_phase(&self, samples: f32) -> (f32, f32) {
        let (sine, cosine) = self.components(samples);
        (Scalar::sqrt(sine * sine + cosine * cosine), libm::atan2f(cosine, sine))
    }

    /// The squared amplitude alone, without a root or an angle. Used for a sum over harmonics.
    #[must_use]
    pub fn squared_amplitude(&self, samples: f32) -> f32 {
        let (sine, cosine) = self.components(samples);
        sine * sine + cosine * cosine
    }

    /// The components in phase with the sine and with the cosine.
    pub(super) fn components(&self, samples: f32) -> (f32, f32) {
        if samples <= 0.0 {
            return (0.0, 0.0);
        }
        let scale = 2.0 / samples;
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
                lock_in.end_cycle(0.0);
                samples = tick;
            }
        }
        let (amplitude, angle) = lock_in.amplitude_and_phase(samples as f32);
        // A cycle boundary is known to one tick of 80 × 400: the error is at most 2 · (0.0123 + 0.004)/0.0123/32000 =
        // 8.3e-5.
        assert!((amplitude / 0.0123 - 1.0).abs() < 8.3e-5, "{amplitude}");
        assert!((angle - core::f32::consts::FRAC_PI_4).abs() < 8.3e-5, "{angle}");
    }

    #[test]
    fn the_amplitude_of_every_cycle_is_the_same_although_cycles_end_between_samples() {
        // 123.4 samples a cycle, and an offset.
        let increment = Phase::increment(1000.0 / 123.4, 1000.0);
        let (mut phase, mut lock_in, mut cycles) = (Phase::default(), LockIn::default(), 0);
        // A sample stands for the time up to the next one: second order in 2π/123.4, beside 1/123.4 if cycles were cut at
        // samples.
        let second_order = (core::f32::consts::TAU / 123.4) * (core::f32::consts::TAU / 123.4);
        while cycles < 50 {
            let reference = phase.sin_cos();
            lock_in.push(0.0123 * reference.0 + 0.004, reference);
            if phase.advance(increment) {
                let (sine, cosine) = lock_in.end_cycle(phase.0 as f32 / increment as f32);
                let amplitude = 2.0 / 123.4 * libm::sqrtf(sine * sine + cosine * cosine);
                assert!((amplitude / 0.0123 - 1.0).abs() < second_order, "{cycles}: {amplitude}");
                cycles += 1;
            }
        }
    }
}
