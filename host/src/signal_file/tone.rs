//! The tone of a calibrator in a recording: steady, pure, of known level.

use std::ops::RangeInclusive;

/// A tone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Its RMS, in the unit of the recording.
    pub rms: f64,
}

/// Share of the power that must be the tone's.
const MIN_PURITY: f64 = 0.95;
/// Largest difference between parts of the tone, dB.
const MAX_UNSTEADY_DB: f64 = 0.5;
/// Parts whose levels are compared.
const PARTS: usize = 4;
/// Shortest recording of a tone, s.
const MIN_S: f64 = 1.0;
/// Lines of Hann's window on either side of a tone that hold its power.
const BESIDE: usize = 3;

impl Tone {
    /// Finds the tone of a calibrator, whose frequency (Hz) is within a range, in the samples of a recording.
    ///
    /// # Errors
    /// A recording that is too short, silent, unsteady, or of something else than a tone.
    pub fn find(samples: &[f64], sample_rate_hz: f64, frequencies_hz: &RangeInclusive<f64>) -> Result<Self, String> {
        let duration_s = samples.len() as f64 / sample_rate_hz;
        if duration_s < MIN_S {
            return Err(format!(
                "{duration_s:.2} s are too short for a calibration: at least {MIN_S} s of the calibrator's tone"
            ));
        }
        if samples.windows(2).all(|pair| pair[0] == pair[1]) {
            return Err("it is silent: was the calibrator switched on?".into());
        }
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        let samples: Vec<f64> = samples.iter().map(|sample| sample - mean).collect();
        let power = |part: &[f64]| part.iter().map(|p| p * p).sum::<f64>() / part.len() as f64;
        let (frequency_hz, tone_power) = strongest(&samples, sample_rate_hz);
        let purity = tone_power / power(&samples);
        if purity < MIN_PURITY {
            return Err(format!(
                "it is no calibration tone: {:.0} % of its power are at {frequency_hz:.1} Hz, at least {:.0} % must be\n  record the \
                 calibrator on the same sensor, without handling noise; cut the recording to the tone",
                100.0 * purity,
                100.0 * MIN_PURITY
            ));
        }
        if !frequencies_hz.contains(&frequency_hz) {
            return Err(format!(
                "its tone of {frequency_hz:.1} Hz is not that of a calibrator: {} Hz to {} Hz are possible\n  is it mains hum? check the \
                 cable and the calibrator",
                frequencies_hz.start(),
                frequencies_hz.end()
            ));
        }
        let parts = samples.chunks_exact(samples.len() / PARTS).map(|part| 10.0 * power(part).log10());
        let ends = parts.fold([f64::MAX, f64::MIN], |[low, high], level| [low.min(level), high.max(level)]);
        if ends[1] - ends[0] > MAX_UNSTEADY_DB {
            return Err(format!(
                "the tone is not steady: its level changes by {:.1} dB, at most {MAX_UNSTEADY_DB} dB are allowed\n  cut the recording to \
                 the steady tone; is the calibrator's battery low, or the sensor loose on it?",
                ends[1] - ends[0]
            ));
        }
        Ok(Self { frequency_hz, rms: tone_power.sqrt() })
    }
}

/// Frequency and power of the strongest tone, under Hann's window over the recording.
fn strongest(samples: &[f64], sample_rate_hz: f64) -> (f64, f64) {
    let count = samples.len();
    let window = |n: usize| (std::f64::consts::PI * (n as f64 + 0.5) / count as f64).sin().powi(2);
    let windowed: Vec<f64> = samples.iter().enumerate().map(|(n, sample)| sample * window(n)).collect();
    let spectrum = damprig_fourier::spectrum(&windowed);
    let powers: Vec<f64> = spectrum.iter().map(|line| line.norm_sqr()).collect();
    let top = (1..powers.len()).max_by(|a, b| powers[*a].total_cmp(&powers[*b])).unwrap_or(0);
    let around = top.saturating_sub(BESIDE)..(top + BESIDE + 1).min(powers.len());
    let sum: f64 = powers[around.clone()].iter().sum();
    let centre = around.map(|n| n as f64 * powers[n]).sum::<f64>() / sum.max(f64::MIN_POSITIVE);
    // Both sides of the spectrum; the mean of the window's square is 3/8.
    let power = 2.0 * sum / (count as f64).powi(2) / 0.375;
    (centre * sample_rate_hz / count as f64, power)
}
