//! Band-limited noise as a base motion: sines of equal amplitudes and random phases, under an envelope.
//!
//! z(t) = w(t)·Σ cos(2π k t/T + φₖ) for all whole k with from ≤ k/T ≤ to, scaled to a peak. Its spectrum is flat within the band and zero
//! outside, up to the envelope's width. The same seed gives the same bits on every machine: phases from a generator with a fixed
//! algorithm (xoshiro256++), sine and cosine from `libm`, and otherwise sums, products and quotients only.

use std::f64::consts::TAU;

use damprig_core::control::transient::playback::MAX_SAMPLES;
use damprig_core::io::TICK_HZ;
use damprig_motion::cosines::{Cosine, add_cosines};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::record::{Record, RecordOrigin, RecordQuantity};

/// A base motion of noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Seed of the phases.
    pub seed: u64,
    /// Lower end of the band, Hz; greater than 0.
    pub from_hz: f64,
    /// Upper end of the band, Hz; greater than the lower end.
    pub to_hz: f64,
    /// Length, s.
    pub duration_s: f64,
    /// Time over which the envelope rises at the beginning, s.
    pub rise_s: f64,
    /// Time over which it falls at the end, s; with the rise at most the length.
    pub fall_s: f64,
}

/// Samples in a period of the highest frequency, at least: the cubics between them then miss 0.5 % of its amplitude.
pub(super) const MIN_PER_PERIOD: f64 = 10.0;

/// Sines in the band, at least: fewer are no noise.
pub(super) const MIN_LINES: usize = 10;

impl Noise {
    /// The highest sample rate at which the controller's record buffer holds it, Hz: whole, at most that of the controller.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        ((MAX_SAMPLES - 1) as f64 / self.duration_s).floor().min(f64::from(TICK_HZ))
    }

    /// The lowest sample rate that follows it, Hz.
    #[must_use]
    pub fn least_rate_hz(&self) -> f64 {
        MIN_PER_PERIOD * self.to_hz
    }

    /// Numbers of the first and the last sine of the band, in units of 1/duration.
    pub(super) fn lines(&self) -> std::ops::RangeInclusive<u32> {
        // A frequency that is a multiple of 1/duration counts, whatever the rounding.
        let place = |frequency_hz: f64| frequency_hz * self.duration_s;
        (place(self.from_hz) - 1e-9).ceil() as u32..=(place(self.to_hz) + 1e-9).floor() as u32
    }

    /// The motion at this sample rate (Hz) with this largest |z| (m).
    #[must_use]
    pub fn record(&self, rate_hz: f64, peak_m: f64) -> Record {
        let count = (self.duration_s * rate_hz * (1.0 + 1e-12)).floor() as usize + 1;
        let mut samples = vec![0.0; count];
        let mut random = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        let cosine = |line| {
            // 53 bits give every multiple of 2⁻⁵³ below 1.
            let phase = TAU * ((random.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64));
            let step = TAU * f64::from(line) / (self.duration_s * rate_hz);
            let [phase, turn] = [phase, step].map(|angle| [libm::cos(angle), libm::sin(angle)]);
            Cosine { phase, turn }
        };
        let cosines: Vec<Cosine> = self.lines().map(cosine).collect();
        add_cosines(&mut samples, &cosines);
        let end_s = (count - 1) as f64 / rate_hz;
        let mut largest = 0.0f64;
        for (n, z) in samples.iter_mut().enumerate() {
            let t_s = n as f64 / rate_hz;
            *z *= ramp(t_s, self.rise_s) * ramp(end_s - t_s, self.fall_s);
            largest = largest.max(z.abs());
        }
        let scale = peak_m / largest.max(f64::MIN_POSITIVE);
        samples.iter_mut().for_each(|z| *z *= scale);
        Record {
            origin: RecordOrigin::Noise,
            quantity: RecordQuantity::Displacement,
            step_s: 1.0 / rate_hz,
            samples,
            resampling: None,
        }
    }

    /// Its properties in words.
    #[must_use]
    pub fn about(&self) -> String {
        let Self { seed, from_hz, to_hz, duration_s, rise_s, fall_s } = self;
        format!(
            "noise from {from_hz} Hz to {to_hz} Hz, seed {seed}, {duration_s} s with a rise of {rise_s} s and a fall of {fall_s} s"
        )
    }
}

/// From 0 to 1 over `length_s` with a horizontal tangent at both ends, as the controller's ramps.
fn ramp(t_s: f64, length_s: f64) -> f64 {
    let share = if length_s > 0.0 { (t_s / length_s).clamp(0.0, 1.0) } else { 1.0 };
    share * share * (3.0 - 2.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: Noise = Noise { seed: 1, from_hz: 0.5, to_hz: 10.0, duration_s: 20.0, rise_s: 0.0, fall_s: 0.0 };

    /// Amplitude of a frequency by correlation with sine and cosine over the whole length.
    fn amplitude(record: &Record, line: f64) -> f64 {
        let samples = &record.samples[..record.samples.len() - 1];
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (n, z) in samples.iter().enumerate() {
            let angle = TAU * line * n as f64 / samples.len() as f64;
            (sine, cosine) = (sine + z * angle.sin(), cosine + z * angle.cos());
        }
        2.0 * sine.hypot(cosine) / samples.len() as f64
    }

    /// Without an envelope each sine is orthogonal to the others over the length, so rounding alone is left outside the band.
    #[test]
    fn the_spectrum_is_flat_in_the_band_and_zero_outside() {
        let record = NOISE.record(200.0, 1e-3);
        let inside = amplitude(&record, 100.0);
        assert!(inside > 1e-5, "{inside}");
        for line in [10.0, 11.0, 57.0, 199.0, 200.0] {
            assert!((amplitude(&record, line) / inside - 1.0).abs() < 1e-9, "{line}");
        }
        for line in [1.0, 9.0, 201.0, 500.0] {
            assert!(amplitude(&record, line) < 1e-9 * inside, "{line}");
        }
        assert!((record.peak() - 1e-3).abs() < 1e-15);
    }

    #[test]
    fn the_envelope_begins_and_ends_at_rest_and_leaves_the_middle() {
        let record = Noise { rise_s: 2.0, fall_s: 3.0, ..NOISE }.record(200.0, 1.0);
        let plain = NOISE.record(200.0, 1.0);
        let (first, last) = (record.samples[0], record.samples[record.samples.len() - 1]);
        assert_eq!((first, last), (0.0, 0.0));
        let scale = record.samples[1000] / plain.samples[1000];
        for n in (400..3400).step_by(100) {
            assert!((record.samples[n] / plain.samples[n] / scale - 1.0).abs() < 1e-12);
        }
        assert!((record.samples[200] / plain.samples[200] / scale - 0.5).abs() < 1e-12, "half of the rise");
    }

    /// Recorded once. A change of these bits changes every campaign with noise: a resumed run would go on with another motion.
    #[test]
    fn a_seed_gives_the_same_bits_for_ever() {
        let record = Noise { rise_s: 2.0, fall_s: 2.0, ..NOISE }.record(200.0, 1e-3);
        let bits = record.samples.iter().fold(0u64, |sum, z| sum.rotate_left(5) ^ z.to_bits());
        assert_eq!(bits, 5_846_193_608_897_926_364);
        assert_ne!(Noise { seed: 2, ..NOISE }.record(200.0, 1e-3).samples, NOISE.record(200.0, 1e-3).samples);
    }
}
