//! Amplitude and phase of a signal at the drive frequency as a mean over the last whole cycle, renewed several times a
//! cycle: for loops that act on it.

use super::lock_in::LockIn;

/// Parts of a cycle after each of which the mean is renewed.
pub const PARTS: usize = 16;

/// Bits of a phase that lie within a part.
const PART_BITS: u32 = 32 - PARTS.ilog2();

/// Correlates a signal with the drive's sine and cosine over the last [`PARTS`] parts of a cycle. A mean and harmonics of the
/// signal do not enter: over a whole cycle they are orthogonal to the drive, wherever it begins. The sample in which a part
/// ends is divided between both parts.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleWindow {
    lock_in: LockIn,
    /// What each part contributes to a mean over the whole cycle, in the signal's unit.
    parts: [(f32, f32); PARTS],
    ticks_per_cycle: f32,
}

impl CycleWindow {
    /// Sets the length of a cycle; the parts carry over.
    pub fn tune(&mut self, ticks_per_cycle: f32) {
        self.ticks_per_cycle = ticks_per_cycle;
    }

    /// Takes one sample with its phase, the phase's increment to the next sample (at most a twentieth of a cycle), and the
    /// phase's sine and cosine. Returns the part that begins, if one ends with this sample.
    pub fn push(&mut self, sample: f32, phase: u32, increment: u32, wave: (f32, f32)) -> Option<usize> {
        self.lock_in.push(sample, wave);
        let next = phase.wrapping_add(increment);
        let (part, following) = ((phase >> PART_BITS) as usize % PARTS, (next >> PART_BITS) as usize % PARTS);
        if part == following {
            return None;
        }
        let over = (next & ((1 << PART_BITS) - 1)) as f32 / increment as f32;
        let (sine, cosine) = self.lock_in.end_cycle(over);
        let scale = 2.0 / self.ticks_per_cycle;
        self.parts[part] = (scale * sine, scale * cosine);
        Some(following)
    }

    /// As [`Self::components`] over the half of a cycle that ends before the part `following`. A mean and even harmonics enter.
    #[must_use]
    pub fn last_half(&self, following: usize) -> (f32, f32) {
        let last = (0..PARTS / 2).map(|n| self.parts[(following + PARTS - 1 - n) % PARTS]);
        let (sine, cosine) = last.fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
        (2.0 * sine, 2.0 * cosine)
    }

    /// The components in phase with the sine and with the cosine, in the signal's unit. In the first cycle they rise from 0.
    #[must_use]
    pub fn components(&self) -> (f32, f32) {
        self.parts.iter().fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sine::Phase;

    #[test]
    fn a_change_of_the_frequency_leaves_the_amplitude() {
        let (mut phase, mut window) = (Phase::default(), CycleWindow::default());
        for frequency_hz in [2.0, 3.0] {
            window.tune(1000.0 / frequency_hz);
            let increment = Phase::increment(frequency_hz, 1000.0);
            for tick in 0..1000 {
                let (sine, cosine) = phase.sin_cos();
                if window.push(0.5 * sine, phase.0, increment, (sine, cosine)).is_some()
                    && (frequency_hz > 2.0 || tick > 500)
                {
                    // The part in which the frequency changes has ticks of both.
                    assert!((window.components().0 - 0.5).abs() < 0.5 / PARTS as f32 / 2.0, "{tick}");
                }
                phase.advance(increment);
            }
        }
    }

    #[test]
    fn a_mean_and_harmonics_do_not_enter_in_any_part_of_the_cycle() {
        // 123.4 samples a cycle.
        let increment = Phase::increment(1000.0 / 123.4, 1000.0);
        let (mut phase, mut window) = (Phase::default(), CycleWindow::default());
        window.tune(123.4);
        // A sample stands for the time up to the next one, third harmonics included: second order in 3·2π/123.4.
        let second_order = libm::powf(3.0 * core::f32::consts::TAU / 123.4, 2.0);
        let mut seen = 0;
        for tick in 0..2000 {
            let (sine, cosine) = phase.sin_cos();
            let third = sine * (3.0 - 4.0 * sine * sine);
            let signal = 0.4 + 0.6 * sine - 0.8 * cosine + 0.3 * third;
            let renewed = window.push(signal, phase.0, increment, (sine, cosine));
            phase.advance(increment);
            if renewed.is_some() && tick > 130 {
                // The reference of a sample is at its start, its value stands until the next one: half a sample of phase.
                let (in_phase, quadrature) = window.components();
                assert!((in_phase - 0.6).abs() < second_order, "{tick}: {in_phase}");
                assert!((quadrature + 0.8).abs() < second_order, "{tick}: {quadrature}");
                seen += 1;
            }
        }
        assert!(seen > 200);
    }
}
