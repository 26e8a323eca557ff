//! Natural frequency and damping ratio from x and z over time, with the base in any broadband motion.
//!
//! The answer is that of [`output_error`]: x is simulated from the measured z, and the structure's parameters are fitted to the measured
//! x. It uses the whole record, knows no leakage, and follows a motion that begins and ends. Welch's method ([`welch`]) needs
//! segments of many time constants 1/(ζω) to resolve a light damping: hours at ζ = 0.0038. Its H1 and its coherence show whether x
//! follows z and where another mode or a disturbance lies; where its segments do resolve the resonance, a fit to H1 gives the same
//! parameters by other means.

pub mod output_error;
mod residuals;
pub mod welch;

use super::response::{self, DrivenBy, Point};
use super::{Estimate, Sensors};
use crate::Refused;
use output_error::OutputError;
use welch::{Segments, Spectrum};

/// Motion of structure and base at even times.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Where it was taken from.
    pub taken_from: String,
    /// Time between samples, s.
    pub step_s: f64,
    /// Displacement of the structure, m.
    pub x_m: Vec<f64>,
    /// Displacement of the base, m.
    pub z_m: Vec<f64>,
}

/// Segments of Welch's method; what is left out is chosen from the record and the damping.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Length of a segment, s.
    pub segment_s: Option<f64>,
    /// Overlap of neighbouring segments, as a share of their length.
    pub overlap: Option<f64>,
}

/// What a motion shows.
#[derive(Clone, Debug)]
pub struct TimeResponse {
    /// The fit over time.
    pub fitted: OutputError,
    /// H1 and coherence.
    pub spectrum: Spectrum,
    /// The fit to H1, where its segments resolve the resonance.
    pub by_h1: Result<Vec<Estimate>, String>,
}

/// Shortest record, in periods of the natural frequency.
const MIN_PERIODS: f64 = 10.0;

/// Coherence that a line of the fit to H1 must have, and that one line of a record must have at least.
const GOOD_COHERENCE: f64 = 0.8;
const MIN_COHERENCE: f64 = 0.5;

/// Half-width of the noise bandwidth of Hann's window, in lines: 1.5 lines are its whole width.
pub const HANN_WIDTH_LINES: f64 = 1.5;

/// Half-power width over noise bandwidth at which H1 resolves a resonance: its peak is then too low by a third of the square of its
/// inverse, 2 %.
pub const RESOLVED: f64 = 4.0;

/// Lines in the half-power width at which Hann's window resolves it.
pub const RESOLVED_LINES: f64 = RESOLVED * HANN_WIDTH_LINES;

/// Averages that the fit to H1 needs at least.
const MIN_AVERAGES: f64 = 8.0;

/// Segments in a record without a wish, with half of each shared: nine averages.
pub const USUAL_SEGMENTS: f64 = 5.0;

/// Neighbouring lines of Hann's window share their noise: the variance of a fit to all of them is larger than that of independent
/// lines by 1 + 2·((2/3)² + (1/6)²).
pub(super) const LINES_SHARE: f64 = 1.944;

/// Identifies fn and ζ.
///
/// # Errors
/// A base at rest, x that does not follow it, no resonance in the excited band, a record too short.
pub fn identify(motion: &Motion, wanted: Wanted) -> Result<TimeResponse, Refused> {
    let overlap = wanted.overlap.unwrap_or(0.5);
    let length_s = motion.step_s * motion.x_m.len() as f64;
    check_motion(motion)?;
    let first = Segments::new(motion, wanted.segment_s.unwrap_or(length_s / USUAL_SEGMENTS), overlap)?;
    let rough = welch::spectrum(motion, &first);
    let peak = output_error::peak(&rough);
    if let Ok(peak_hz) = peak
        && length_s * peak_hz < MIN_PERIODS
    {
        return Err(Refused(format!(
            "the record of {length_s:.1} s is too short: {:.1} periods of {peak_hz:.2} Hz, at least {MIN_PERIODS} are needed\n  record \
             longer",
            length_s * peak_hz
        )));
    }
    check_coherence(&rough)?;
    let peak_hz = peak?;
    let fitted = output_error::fit_motion(motion, &rough, peak_hz)?;
    let natural = fitted.natural_frequency_hz.value;
    let width_hz = 2.0 * fitted.damping_ratio.value * natural;
    let needed_s = needed_s(width_hz);
    let segment_s = wanted.segment_s.unwrap_or(needed_s.max(20.0 / natural).min(length_s / USUAL_SEGMENTS));
    let segments = Segments::new(motion, segment_s, overlap)?;
    let spectrum = welch::spectrum(motion, &segments);
    let by_h1 = by_h1(&spectrum, natural, width_hz, length_s);
    Ok(TimeResponse { fitted, spectrum, by_h1 })
}

/// Length of a segment that resolves a half-power width, with room for its rounding to samples, s.
pub fn needed_s(width_hz: f64) -> f64 {
    1.05 * RESOLVED * HANN_WIDTH_LINES / width_hz
}

fn check_motion(motion: &Motion) -> Result<(), Refused> {
    let rms = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    };
    for (name, values, what) in [("z", &motion.z_m, "base"), ("x", &motion.x_m, "structure")] {
        if values.len() < 100 {
            return Err(Refused(format!("{} samples are too few: record longer", values.len())));
        }
        let rms = rms(values);
        if rms < 1e-9 {
            return Err(Refused(format!(
                "{name} does not move: {rms:.1e} m RMS about its mean\n  is the sensor of the {what} connected, and was the drive on? for a \
                 release use `damprig identify decay`"
            )));
        }
    }
    Ok(())
}

/// Refuses x that does not follow z.
fn check_coherence(spectrum: &Spectrum) -> Result<(), Refused> {
    let best = spectrum.excited().map(|line| line.coherence).fold(0.0, f64::max);
    if best < MIN_COHERENCE {
        return Err(Refused(format!(
            "x does not follow z: the coherence is at most {best:.2} where the base moves\n  is the structure moved by something else, or are \
             x and z of different records?"
        )));
    }
    Ok(())
}

/// fn and ζ from the lines of H1; in words why not.
fn by_h1(spectrum: &Spectrum, natural_hz: f64, width_hz: f64, length_s: f64) -> Result<Vec<Estimate>, String> {
    let noise_width_hz = HANN_WIDTH_LINES / spectrum.segments.segment_s;
    let resolution = width_hz / noise_width_hz;
    if resolution < RESOLVED || spectrum.averages < MIN_AVERAGES {
        let needed_s = needed_s(width_hz);
        return Err(format!(
            "H1 does not resolve the resonance: its half-power width is {width_hz:.4} Hz, the width of the lines {noise_width_hz:.4} Hz with \
             {:.0} averages; that needs segments of {needed_s:.0} s, a record of {:.0} s. Peak and width of |H| in the picture are those of the \
             window; fn and ζ are from the fit over time, which does not depend on it ({length_s:.0} s)",
            spectrum.averages,
            needed_s * USUAL_SEGMENTS
        ));
    }
    let near = |line: &&welch::SpectralLine| (line.frequency_hz - natural_hz).abs() < 5.0 * width_hz;
    let points: Vec<Point> = spectrum
        .excited()
        .filter(near)
        .filter(|line| line.coherence >= GOOD_COHERENCE)
        .map(|line| Point {
            frequency_hz: line.frequency_hz,
            ratio: line.magnitude(),
            phase_rad: Some(line.phase_rad()),
            uncertainty: Some(line.relative_uncertainty(spectrum.averages)),
            x_m: 0.0,
        })
        .collect();
    let estimates =
        response::identify(&points, DrivenBy::Base, &Sensors::EXACT).map_err(|error| format!("H1: {error}"))?;
    // The window lowers the peak by a third of the square of the widths' ratio; as an uncertainty, that over √3.
    let bias = (1.0 / resolution).powi(2) / 3.0 / 3f64.sqrt();
    let widened = |mut estimate: Estimate, method, bias: f64| {
        let u = (estimate.standard_uncertainty * LINES_SHARE.sqrt()).hypot(bias);
        let factor = u / estimate.standard_uncertainty;
        let half = factor * 0.5 * (estimate.interval_95[1] - estimate.interval_95[0]);
        estimate.interval_95 = [estimate.value - half, estimate.value + half];
        (estimate.standard_uncertainty, estimate.method, estimate.key) = (u, method, None);
        estimate
    };
    let mut estimates = estimates.into_iter();
    let (Some(frequency), Some(damping)) = (estimates.next(), estimates.next()) else {
        return Err("no fit to H1".into());
    };
    let (of_frequency, of_damping) = (bias * width_hz, bias * damping.value);
    Ok(vec![widened(frequency, BY_H1, of_frequency), widened(damping, BY_H1, of_damping)])
}

const BY_TIME: &str = "fit of x simulated from z";
const BY_H1: &str = "fit of H1 (Welch)";

impl TimeResponse {
    /// The estimates: those of the fit over time are the values of a set-up's keys.
    #[must_use]
    pub fn estimates(&self) -> Vec<Estimate> {
        let mut all = vec![
            Estimate::new("natural frequency", "Hz", BY_TIME, &self.fitted.natural_frequency_hz)
                .of_key("structure.natural_frequency_hz"),
            Estimate::new("damping ratio", "", BY_TIME, &self.fitted.damping_ratio).of_key("structure.damping_ratio"),
        ];
        all.extend(self.by_h1.iter().flatten().cloned());
        all
    }

    /// What a person has to know about them.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let fitted = &self.fitted;
        let segments = &self.spectrum.segments;
        let mut remarks = vec![
            format!(
                "the simulated x deviates by {:.2} µm RMS, {:.2} % of x; x over z has the scale {:.4} and is {:+.1} µs late",
                fitted.residual_rms_m * 1e6,
                100.0 * fitted.relative_residual,
                fitted.gain,
                fitted.delay_s * 1e6
            ),
            format!(
                "spectra: Hann's window over {:.1} s, overlap {:.0} %, {:.1} independent averages; coherence {:.3} at fn",
                segments.segment_s,
                100.0 * segments.overlap,
                self.spectrum.averages,
                self.spectrum.nearest(fitted.natural_frequency_hz.value).map_or(f64::NAN, |line| line.coherence)
            ),
        ];
        if fitted.noise_at_resonance > 0.5 {
            remarks.push(
                "most of the deviation is at the resonance, as of a disturbance of the structure or of the base's sensor; the intervals \
                 include it"
                    .into(),
            );
        }
        remarks.extend(self.by_h1.as_ref().err().cloned());
        remarks.push(response::REPORT.into());
        remarks
    }
}
