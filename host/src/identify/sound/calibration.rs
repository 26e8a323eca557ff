//! Calibration of a microphone by the recording of a sound calibrator: a steady tone of known level.

use super::REFERENCE_PA;
use super::recording::SoundRecording;
use crate::failure::Failure;
use crate::signal_file::Tone;

/// Frequencies of a calibrator, Hz: 250 Hz and 1 kHz are usual.
const FREQUENCIES_HZ: std::ops::RangeInclusive<f64> = 100.0..=5000.0;

/// Finds the calibrator's tone of this level (dB) in a recording: its frequency, Hz, and the pressure of one unit of the recording, Pa.
///
/// # Errors
/// A recording that is too short, silent, unsteady, or of something else than a tone.
pub fn calibrated(recording: &SoundRecording, level: f64) -> Result<(f64, f64), Failure> {
    let tone = Tone::find(&recording.samples, recording.sample_rate_hz, &FREQUENCIES_HZ);
    let tone = tone.map_err(|why| recording.refuse(why))?;
    Ok((tone.frequency_hz, REFERENCE_PA * 10f64.powf(level / 20.0) / tone.rms))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn recording(sample: impl Fn(f64) -> f64) -> SoundRecording {
        let samples = (0..96_000).map(|n| sample(f64::from(n) / 48_000.0)).collect();
        SoundRecording { file: "tone.wav".into(), is_pascal: false, sample_rate_hz: 48_000.0, samples }
    }

    /// An amplitude of 0.1 units is 0.0707 RMS; 94 dB are 1.00237 Pa.
    #[test]
    fn a_tone_of_94_db_gives_the_pressure_of_a_unit() {
        let (frequency_hz, pascal_per_unit) =
            calibrated(&recording(|t| 0.1 * (TAU * 1000.3 * t).sin() + 0.02), 94.0).unwrap();
        assert!((frequency_hz - 1000.3).abs() < 0.1, "{frequency_hz}");
        assert!((pascal_per_unit / (1.002_374 / 0.070_710_7) - 1.0).abs() < 1e-3, "{pascal_per_unit}");
    }

    #[test]
    fn what_is_no_calibration_tone_is_told() {
        let mut random = fastrand::Rng::with_seed(1);
        let noise: Vec<f64> = (0..96_000).map(|_| random.f64() - 0.5).collect();
        let refused = |recording: SoundRecording| calibrated(&recording, 94.0).unwrap_err().to_string();
        let is_noise = refused(SoundRecording { samples: noise, ..recording(|_| 0.0) });
        assert!(is_noise.contains("no calibration tone"), "{is_noise}");
        let hum = refused(recording(|t| 0.1 * (TAU * 50.0 * t).sin()));
        assert!(hum.contains("50.0 Hz") && hum.contains("hum"), "{hum}");
        let fading = refused(recording(|t| 0.1 * (-0.3 * t).exp() * (TAU * 1000.0 * t).sin()));
        assert!(fading.contains("not steady"), "{fading}");
        assert!(refused(recording(|_| 0.3)).contains("silent"));
        let short = SoundRecording { samples: vec![0.1; 1000], ..recording(|_| 0.0) };
        assert!(refused(short).contains("too short"));
    }
}
