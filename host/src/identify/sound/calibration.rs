//! Calibration of a microphone by the recording of a sound calibrator: a steady tone of known level.

use realfft::RealFftPlanner;

use super::recording::Recording;
use super::{REFERENCE_PA, level_db};
use crate::identify::CannotIdentify;

/// The tone of a calibrator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Pressure of one unit of the recording, Pa.
    pub pascal_per_unit: f64,
}

/// Share of the power that must be the tone's.
const LEAST_PURITY: f64 = 0.95;

/// Largest difference between parts of the tone, dB.
const MOST_UNSTEADY_DB: f64 = 0.5;

/// Parts whose levels are compared.
const PARTS: usize = 4;

/// Shortest recording of a tone, s.
const LEAST_S: f64 = 1.0;

/// Frequencies of a calibrator, Hz: 250 Hz and 1 kHz are usual.
const FREQUENCIES_HZ: std::ops::RangeInclusive<f64> = 100.0..=5000.0;

/// Finds the tone of this level (dB) in a recording.
///
/// # Errors
/// A recording that is too short, silent, unsteady, or of something else than a tone.
pub fn tone(recording: &Recording, level: f64) -> Result<Tone, CannotIdentify> {
    if recording.duration_s() < LEAST_S {
        return Err(recording.refuse(format!(
            "{:.2} s are too short for a calibration: at least {LEAST_S} s of the calibrator's tone",
            recording.duration_s()
        )));
    }
    let mean = recording.samples.iter().sum::<f64>() / recording.samples.len() as f64;
    let samples: Vec<f64> = recording.samples.iter().map(|sample| sample - mean).collect();
    let power = |part: &[f64]| part.iter().map(|p| p * p).sum::<f64>() / part.len() as f64;
    let all = power(&samples);
    if recording.is_silent() {
        return Err(recording.refuse("it is silent: was the calibrator switched on?"));
    }
    let (frequency_hz, tone_power) = strongest(&samples, recording.sample_rate_hz);
    let purity = tone_power / all;
    if purity < LEAST_PURITY {
        return Err(recording.refuse(format!(
            "it is no calibration tone: {:.0} % of its power are at {frequency_hz:.1} Hz, at least {:.0} % must be\n  record the \
             calibrator on the microphone, without handling noise; cut the recording to the tone",
            100.0 * purity,
            100.0 * LEAST_PURITY
        )));
    }
    if !FREQUENCIES_HZ.contains(&frequency_hz) {
        return Err(recording.refuse(format!(
            "its tone of {frequency_hz:.1} Hz is not that of a calibrator: {} Hz to {} Hz are possible, 250 Hz and 1000 Hz are usual\n  is it \
             mains hum? check the cable and the calibrator",
            FREQUENCIES_HZ.start(),
            FREQUENCIES_HZ.end()
        )));
    }
    let parts: Vec<f64> = samples.chunks_exact(samples.len() / PARTS).map(power).map(level_db).collect();
    let ends = parts.iter().fold([f64::MAX, f64::MIN], |[low, high], l| [low.min(*l), high.max(*l)]);
    if ends[1] - ends[0] > MOST_UNSTEADY_DB {
        return Err(recording.refuse(format!(
            "the tone is not steady: its level changes by {:.1} dB, at most {MOST_UNSTEADY_DB} dB are allowed\n  cut the recording to the \
             steady tone; is the calibrator's battery low, or the microphone loose in it?",
            ends[1] - ends[0]
        )));
    }
    let pressure_pa = REFERENCE_PA * 10f64.powf(level / 20.0);
    Ok(Tone { frequency_hz, pascal_per_unit: pressure_pa / tone_power.sqrt() })
}

/// Lines of Hann's window on either side of a tone that hold its power.
const BESIDE: usize = 3;

/// Frequency and power of the strongest tone, under Hann's window over the recording.
fn strongest(samples: &[f64], sample_rate_hz: f64) -> (f64, f64) {
    let count = samples.len();
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(count);
    let window = |n: usize| (std::f64::consts::PI * (n as f64 + 0.5) / count as f64).sin().powi(2);
    let mut windowed: Vec<f64> = samples.iter().enumerate().map(|(n, sample)| sample * window(n)).collect();
    let mut spectrum = transform.make_output_vec();
    // The lengths are those of the plan, so it cannot fail.
    let _ = transform.process(&mut windowed, &mut spectrum);
    let powers: Vec<f64> = spectrum.iter().map(|line| line.norm_sqr()).collect();
    let top = (1..powers.len()).max_by(|a, b| powers[*a].total_cmp(&powers[*b])).unwrap_or(0);
    let around = top.saturating_sub(BESIDE)..(top + BESIDE + 1).min(powers.len());
    let sum: f64 = powers[around.clone()].iter().sum();
    let centre = around.map(|n| n as f64 * powers[n]).sum::<f64>() / sum.max(f64::MIN_POSITIVE);
    // Both sides of the spectrum; the mean of the window's square is 3/8.
    let power = 2.0 * sum / (count as f64).powi(2) / 0.375;
    (centre * sample_rate_hz / count as f64, power)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn recording(sample: impl Fn(f64) -> f64) -> Recording {
        let samples = (0..96_000).map(|n| sample(f64::from(n) / 48_000.0)).collect();
        Recording { file: "tone.wav".into(), is_pascal: false, sample_rate_hz: 48_000.0, samples }
    }

    /// An amplitude of 0.1 units is 0.0707 RMS; 94 dB are 1.00237 Pa.
    #[test]
    fn a_tone_of_94_db_gives_the_pressure_of_a_unit() {
        let found = tone(&recording(|t| 0.1 * (TAU * 1000.3 * t).sin() + 0.02), 94.0).unwrap();
        assert!((found.frequency_hz - 1000.3).abs() < 0.1, "{found:?}");
        assert!((found.pascal_per_unit / (1.002_374 / 0.070_710_7) - 1.0).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn what_is_no_calibration_tone_is_told() {
        let mut random = fastrand::Rng::with_seed(1);
        let noise: Vec<f64> = (0..96_000).map(|_| random.f64() - 0.5).collect();
        let refused = |recording: Recording| tone(&recording, 94.0).unwrap_err().0;
        let is_noise = refused(Recording { samples: noise, ..recording(|_| 0.0) });
        assert!(is_noise.contains("no calibration tone"), "{is_noise}");
        let hum = refused(recording(|t| 0.1 * (TAU * 50.0 * t).sin()));
        assert!(hum.contains("50.0 Hz") && hum.contains("hum"), "{hum}");
        let fading = refused(recording(|t| 0.1 * (-0.3 * t).exp() * (TAU * 1000.0 * t).sin()));
        assert!(fading.contains("not steady"), "{fading}");
        assert!(refused(recording(|_| 0.3)).contains("silent"));
        let short = Recording { samples: vec![0.1; 1000], ..recording(|_| 0.0) };
        assert!(refused(short).contains("too short"));
    }
}
