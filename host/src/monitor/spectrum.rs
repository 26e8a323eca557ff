//! The amplitude spectrum of the newest x: what moves beside the drive.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::history::TelemetryHistory;
use super::unsent::Unsent;

/// Lines of a spectrum, at most.
const MAX_LINES: usize = 256;

/// Harmonics of the drive that the lines reach, at least, below half the sampling rate.
const HARMONICS: f64 = 10.0;

/// Longest time that a spectrum is of, s.
const LONGEST_S: f64 = 17.0;

/// Fewest samples of a spectrum.
const MIN_SAMPLES: usize = 128;

/// Smallest amplitude that is told, m: below every sensor's resolution.
const MIN_M: f64 = 1e-9;

/// Spectra that are kept, and the time from one to the next.
const MAX_SPECTRA: usize = 60;
const EVERY: Duration = Duration::from_millis(500);

/// The last spectra.
#[derive(Debug)]
pub(super) struct Spectra {
    pub(super) list: Unsent<Spectrum>,
    /// When the last one was computed.
    computed_at: Option<Instant>,
}

impl Default for Spectra {
    fn default() -> Self {
        Self { list: Unsent::new(MAX_SPECTRA), computed_at: None }
    }
}

impl Spectra {
    /// Adds one of the newest values of a column, when it is time and rows have come.
    pub(super) fn follow(&mut self, recent: &TelemetryHistory, column: usize, drive_hz: f64) {
        let Some(last_s) = recent.last_s() else { return };
        let has_news = self.list.iter().last().is_none_or(|last| last.t_s < last_s);
        if !has_news || self.computed_at.is_some_and(|at| at.elapsed() < EVERY) {
            return;
        }
        self.computed_at = Some(Instant::now());
        let (x_m, step_s) = recent.unbroken(column);
        Spectrum::of(&x_m, last_s, step_s, drive_hz).into_iter().for_each(|spectrum| self.list.push(spectrum));
    }
}

/// An amplitude spectrum, with a Hann window. A sine between two lines is up to 15 % higher than both.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spectrum {
    /// Time of its newest sample, s.
    pub t_s: f64,
    /// From line to line, Hz; the first line is at 0.
    pub step_hz: f64,
    /// Amplitude of each line, m, to three digits. The mean is left out.
    pub amplitude_m: Vec<f32>,
}

impl Spectrum {
    /// Of the newest samples, `step_s` apart, at this drive frequency (0 without a drive); none of too few. They cover 12 to 25 cycles of
    /// the drive, as far as there are as many, and at least the fewest samples.
    #[must_use]
    pub fn of(x_m: &[f32], t_s: f64, step_s: f64, drive_hz: f64) -> Option<Self> {
        let most_s = LONGEST_S.min(MAX_LINES as f64 / (HARMONICS * drive_hz));
        // A count that the times miss by their rounding is whole.
        let most = ((most_s / step_s + 0.01) as usize).max(MIN_SAMPLES).min(x_m.len());
        if most < MIN_SAMPLES {
            return None;
        }
        let count = 1 << most.ilog2();
        let newest = &x_m[x_m.len() - count..];
        let mean = newest.iter().copied().map(f64::from).sum::<f64>() / count as f64;
        let window = |i: usize| 0.5 - 0.5 * (TAU * i as f64 / count as f64).cos();
        let weighted: Vec<f64> = (0..count).map(|i| window(i) * (f64::from(newest[i]) - mean)).collect();
        let lines = damprig_fourier::spectrum(&weighted);
        // Half the samples by the window's mean, and both signs of frequency: a sine has its amplitude.
        let amplitude = |line: &damprig_fourier::Complex<f64>| three_digits(4.0 / count as f64 * line.norm());
        let amplitude_m = lines.iter().take(MAX_LINES).map(amplitude).collect();
        Some(Self { t_s, step_hz: 1.0 / (count as f64 * step_s), amplitude_m })
    }
}

fn three_digits(amplitude_m: f64) -> f32 {
    let amplitude_m = amplitude_m.max(MIN_M);
    let scale = 10f64.powi(2 - amplitude_m.log10().floor() as i32);
    ((amplitude_m * scale).round() / scale) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(hz: f64, amplitude_m: f64, count: u32) -> Vec<f32> {
        (0..count).map(|i| (0.02 + amplitude_m * (TAU * hz * f64::from(i) * 1e-3).sin()) as f32).collect()
    }

    #[test]
    fn a_sine_on_a_line_has_its_amplitude_there_and_none_three_lines_away() {
        // 8192 samples of 1 ms: line 20 is at 2.4414 Hz.
        let hz = 20.0 / 8.192;
        let spectrum = Spectrum::of(&sine(hz, 3e-3, 9000), 9.0, 1e-3, 2.44).unwrap();
        assert!((spectrum.step_hz * 8.192 - 1.0).abs() < 1e-12 && spectrum.amplitude_m.len() == MAX_LINES);
        assert!((spectrum.amplitude_m[20] - 3e-3).abs() < 1e-5, "{}", spectrum.amplitude_m[20]);
        // f32 samples of 20 mm resolve 2 nm.
        assert!(spectrum.amplitude_m[23..].iter().chain(&spectrum.amplitude_m[..18]).all(|a| *a < 1e-7));
        // Between two lines the Hann window loses 1 − 8/(3π) of it.
        let between = Spectrum::of(&sine(20.5 / 8.192, 3e-3, 9000), 9.0, 1e-3, 2.44).unwrap();
        assert!((f64::from(between.amplitude_m[20]) / 3e-3 - 8.0 / (1.5 * TAU)).abs() < 0.01, "{between:?}");
    }

    #[test]
    fn the_lines_reach_ten_harmonics_of_any_drive() {
        for hz in [0.5, 2.5, 20.0, 90.0, 400.0] {
            let spectrum = Spectrum::of(&sine(hz, 1e-3, 20_000), 20.0, 1e-3, hz).unwrap();
            // No line is above half the sampling rate.
            let reach_hz = spectrum.step_hz * spectrum.amplitude_m.len() as f64;
            assert!(reach_hz >= (HARMONICS * hz).min(500.0), "{hz}: {reach_hz}");
            assert!(1.0 / spectrum.step_hz >= 8.0 / hz, "{hz}");
        }
        // Rows of 100 Hz reach 50 Hz at most; 1024 of them are 10.24 s, whatever the rounding of their times.
        for drift in [-1e-12, 0.0, 1e-12] {
            let spectrum = Spectrum::of(&sine(2.5, 1e-3, 20_000), 20.0, 0.01 + drift, 2.5).unwrap();
            assert!((spectrum.step_hz * 10.24 - 1.0).abs() < 1e-6, "{drift}");
            assert!(Spectrum::of(&sine(2.5, 1e-3, 20_000), 20.0, 0.01 + drift, 12.0).is_some());
        }
        assert_eq!(Spectrum::of(&sine(2.5, 1e-3, 127), 0.127, 1e-3, 2.5), None);
        // Without a drive as long as there are samples for.
        assert!((Spectrum::of(&sine(2.5, 1e-3, 20_000), 20.0, 1e-3, 0.0).unwrap().step_hz - 1.0 / 16.384).abs() < 1e-9);
    }
}
