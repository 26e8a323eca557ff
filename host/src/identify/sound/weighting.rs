//! The frequency weightings A, C and Z of IEC 61672-1, by the closed form of their analogue definition.
//!
//! C(f): two poles each at f1 = 20.6 Hz and f4 = 12.19 kHz, two zeros at 0 Hz. A(f): the same and a pole each at f2 = 107.7 Hz and
//! f3 = 737.9 Hz, four zeros at 0 Hz. Both are scaled to 0 dB at 1 kHz; the poles are those that the standard derives from its design
//! frequencies. A recording is weighted in blocks by the complex response of the analogue filter, so there is no warping of its
//! upper frequencies, as a bilinear filter has. Z is 1, less the mean.

use std::f64::consts::TAU;

use damprig_fourier::{Complex, Transform};

/// A frequency weighting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Weighting {
    /// Follows the ear at moderate levels
    #[value(name = "A", alias = "a")]
    A,
    /// Nearly flat from 31.5 Hz to 8 kHz
    #[value(name = "C", alias = "c")]
    C,
    /// No weighting
    #[value(name = "Z", alias = "z")]
    Z,
}

/// Names of the levels with a weighting.
pub(super) struct WeightedNames {
    pub(super) equivalent: &'static str,
    pub(super) source: &'static str,
    pub(super) background: &'static str,
    pub(super) fast: &'static str,
    pub(super) slow: &'static str,
    pub(super) peak: &'static str,
}

macro_rules! names {
    ($letter:literal) => {
        WeightedNames {
            equivalent: concat!("equivalent level L", $letter, "eq"),
            source: concat!("equivalent level L", $letter, "eq without the background"),
            background: concat!("equivalent level L", $letter, "eq of the background"),
            fast: concat!("largest level L", $letter, "Fmax"),
            slow: concat!("largest level L", $letter, "Smax"),
            peak: concat!("peak level L", $letter, "peak"),
        }
    };
}

/// Frequencies of the poles, Hz.
struct Poles {
    f1: f64,
    f2: f64,
    f3: f64,
    f4: f64,
}

impl Poles {
    /// From the standard's design frequencies: −3 dB at 10^1.5 Hz and 10^3.9 Hz for C about 1 kHz; a high-pass at 10^2.45 Hz for A.
    fn new() -> Self {
        let (reference, low, high) = (1000.0f64.powi(2), 10f64.powf(1.5).powi(2), 10f64.powf(3.9).powi(2));
        let half = 0.5f64.sqrt();
        let c = low * high;
        let b = (reference + c / reference - half * (low + high)) / (1.0 - half);
        let root = (b * b - 4.0 * c).sqrt();
        let of_a = 10f64.powf(2.45);
        Self {
            f1: ((-b - root) / 2.0).abs().sqrt().min(((-b + root) / 2.0).abs().sqrt()),
            f2: (3.0 - 5f64.sqrt()) / 2.0 * of_a,
            f3: (3.0 + 5f64.sqrt()) / 2.0 * of_a,
            f4: ((-b - root) / 2.0).abs().sqrt().max(((-b + root) / 2.0).abs().sqrt()),
        }
    }
}

impl Weighting {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::A, Self::C, Self::Z];

    /// Unit of a level with it.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::A => "dB(A)",
            Self::C => "dB(C)",
            Self::Z => "dB",
        }
    }

    pub(super) fn names(self) -> WeightedNames {
        match self {
            Self::A => names!("A"),
            Self::C => names!("C"),
            Self::Z => names!("Z"),
        }
    }

    /// The complex response of the analogue filter, without its scale.
    fn unscaled(self, frequency_hz: f64, poles: &Poles) -> Complex<f64> {
        let s = Complex::new(0.0, TAU * frequency_hz);
        let pole = |f: f64| s + TAU * f;
        let c = s * s / (pole(poles.f1) * pole(poles.f1)) / (pole(poles.f4) * pole(poles.f4));
        match self {
            Self::Z => Complex::new(if frequency_hz == 0.0 { 0.0 } else { 1.0 }, 0.0),
            Self::C => c,
            Self::A => c * s * s / (pole(poles.f2) * pole(poles.f3)),
        }
    }

    /// Its level at a frequency, dB; 0 at 1 kHz.
    #[must_use]
    pub fn db(self, frequency_hz: f64) -> f64 {
        let poles = Poles::new();
        20.0 * (self.unscaled(frequency_hz, &poles) / self.unscaled(1000.0, &poles).norm()).norm().log10()
    }

    /// Samples with this weighting. The mean is removed: a microphone has none, and its preamplifier's offset is no sound.
    #[must_use]
    pub fn applied(self, samples: &[f64], sample_rate_hz: f64) -> Vec<f64> {
        let mean = samples.iter().sum::<f64>() / samples.len().max(1) as f64;
        let centred: Vec<f64> = samples.iter().map(|sample| sample - mean).collect();
        if self == Self::Z {
            return centred;
        }
        let beside = (SETTLE_S * sample_rate_hz).ceil() as usize;
        let block = (BLOCK_S * sample_rate_hz).ceil() as usize;
        let length = (block + 2 * beside).next_multiple_of(2);
        let transform = Transform::new(length);
        let poles = Poles::new();
        let scale = 1.0 / (self.unscaled(1000.0, &poles).norm() * length as f64);
        let response: Vec<Complex<f64>> = (0..=length / 2)
            .map(|n| self.unscaled(n as f64 * sample_rate_hz / length as f64, &poles) * scale)
            .collect();
        let mut out = Vec::with_capacity(samples.len());
        let mut from = 0;
        while from < centred.len() {
            // The block with what the filter has heard before it; silence before the recording and after it.
            let at =
                |n: usize| (from + n).checked_sub(beside).and_then(|place| centred.get(place)).copied().unwrap_or(0.0);
            let mut spectrum = transform.forward((0..length).map(at).collect());
            spectrum.iter_mut().zip(&response).for_each(|(s, r)| *s *= r);
            let values = transform.inverse(spectrum);
            let kept = block.min(centred.len() - from);
            out.extend_from_slice(&values[beside..beside + kept]);
            from += block;
        }
        out
    }
}

/// Time in which the filter forgets, s: its slowest poles, at 20.6 Hz, have decayed to e^−65.
const SETTLE_S: f64 = 0.5;

/// Length of a block, s.
const BLOCK_S: f64 = 4.0;

#[cfg(test)]
mod tests {
    use super::*;

    /// IEC 61672-1, table of the weightings at nominal frequencies: the exact ones are 10^(n/10) Hz, the values rounded to 0.1 dB.
    #[test]
    fn the_weights_are_those_of_the_standards_table_within_its_rounding() {
        let table = [
            (10, -70.4, -14.3),
            (12, -56.7, -8.5),
            (13, -50.5, -6.2),
            (14, -44.7, -4.4),
            (15, -39.4, -3.0),
            (16, -34.6, -2.0),
            (17, -30.2, -1.3),
            (18, -26.2, -0.8),
            (19, -22.5, -0.5),
            (20, -19.1, -0.3),
            (21, -16.1, -0.2),
            (22, -13.4, -0.1),
            (23, -10.9, 0.0),
            (24, -8.6, 0.0),
            (25, -6.6, 0.0),
            (26, -4.8, 0.0),
            (27, -3.2, 0.0),
            (28, -1.9, 0.0),
            (29, -0.8, 0.0),
            (30, 0.0, 0.0),
            (31, 0.6, 0.0),
            (32, 1.0, -0.1),
            (33, 1.2, -0.2),
            (34, 1.3, -0.3),
            (35, 1.2, -0.5),
            (36, 1.0, -0.8),
            (37, 0.5, -1.3),
            (38, -0.1, -2.0),
            (39, -1.1, -3.0),
            (40, -2.5, -4.4),
            (41, -4.3, -6.2),
            (42, -6.6, -8.5),
            (43, -9.3, -11.2),
        ];
        for (tenths, a, c) in table {
            let frequency_hz = 10f64.powf(f64::from(tenths) / 10.0);
            for (weighting, expected) in [(Weighting::A, a), (Weighting::C, c), (Weighting::Z, 0.0)] {
                let db = weighting.db(frequency_hz);
                assert!(
                    (db - expected).abs() <= 0.051,
                    "{weighting:?} at {frequency_hz:.1} Hz: {db:.3} for {expected}"
                );
            }
        }
    }

    /// Tones of whole cycles in a recording of several blocks, away from its ends.
    #[test]
    fn a_weighted_tone_has_the_weight_of_its_frequency_in_every_block() {
        let rate_hz = 48_000.0;
        for frequency_hz in [31.5, 1000.0, 16_000.0, 20_000.0] {
            let tone: Vec<f64> =
                (0..480_000).map(|n| (TAU * frequency_hz * f64::from(n) / rate_hz).sin() * 2f64.sqrt()).collect();
            for weighting in [Weighting::A, Weighting::C] {
                let weighted = weighting.applied(&tone, rate_hz);
                assert_eq!(weighted.len(), tone.len());
                for second in [2, 3, 4, 7] {
                    let part = &weighted[second * 48_000..(second + 1) * 48_000];
                    let db = 10.0 * (part.iter().map(|p| p * p).sum::<f64>() / 48_000.0).log10();
                    // Half a cycle of 31.5 Hz is a 63rd of the second's energy at most; others are whole.
                    let allowed = if frequency_hz < 100.0 { 0.05 } else { 0.005 };
                    let expected = weighting.db(frequency_hz);
                    assert!(
                        (db - expected).abs() < allowed,
                        "{weighting:?} {frequency_hz} Hz, second {second}: {db} {expected}"
                    );
                }
            }
        }
    }
}
