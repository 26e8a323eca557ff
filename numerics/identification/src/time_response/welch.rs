//! H1 and coherence by Welch's method: averages over overlapping segments under Hann's window.
//!
//! H1 = S_zx/S_zz takes all noise as that of x; γ² = |S_zx|²/(S_zz·S_xx). Relative standard uncertainty of |H|:
//! √((1 − γ²)/(2·n·γ²)) for n independent averages (Bendat and Piersol, Random Data). Overlapping segments share samples; n counts them
//! by the correlation of their windows (Welch 1967).

use damprig_fourier::{Complex, Transform};

use super::Motion;
use crate::Refused;

/// Segments of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segments {
    /// Samples in a segment.
    pub samples: usize,
    /// Samples from the beginning of one segment to that of the next.
    pub hop: usize,
    /// Length of a segment, s.
    pub segment_s: f64,
    /// Shared part of neighbouring segments.
    pub overlap: f64,
}

/// Segments of a record at least: one average has the coherence 1 whatever the motion.
const MIN: usize = 2;

impl Segments {
    /// Segments of this length (s) and overlap.
    ///
    /// # Errors
    /// Fewer than two segments, or segments of a few samples.
    pub fn new(motion: &Motion, segment_s: f64, overlap: f64) -> Result<Self, Refused> {
        let samples = (segment_s / motion.step_s).round() as usize;
        let hop = (((1.0 - overlap) * samples as f64).round() as usize).max(1);
        let all = motion.x_m.len();
        if samples < 16 || samples + (MIN - 1) * hop > all {
            let length_s = motion.step_s * all as f64;
            return Err(Refused(format!(
                "a segment of {segment_s} s does not fit: the record has {length_s:.3} s with a sample each {:.6} s; segments have at least 16 \
                 samples, and a record at least {MIN} segments\n  give a shorter --segment-s, or record longer",
                motion.step_s
            )));
        }
        Ok(Self { samples, hop, segment_s: samples as f64 * motion.step_s, overlap })
    }
}

/// A line of the spectra.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectralLine {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// H1 = X/Z.
    pub h: Complex<f64>,
    /// γ², 0 to 1.
    pub coherence: f64,
    /// Share of the base's largest spectral line.
    pub excitation: f64,
}

impl SpectralLine {
    /// |H|.
    #[must_use]
    pub fn magnitude(&self) -> f64 {
        self.h.norm()
    }

    /// Phase of x relative to z, −π to π.
    #[must_use]
    pub fn phase_rad(&self) -> f64 {
        self.h.arg()
    }

    /// Relative standard uncertainty of |H| for this many independent averages.
    #[must_use]
    pub fn relative_uncertainty(&self, averages: f64) -> f64 {
        ((1.0 - self.coherence).max(0.0) / (2.0 * averages * self.coherence.max(1e-6))).sqrt()
    }
}

/// H1 and coherence of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// The segments.
    pub segments: Segments,
    /// Independent averages that they are worth.
    pub averages: f64,
    /// Lines from the first above 0 Hz on.
    pub lines: Vec<SpectralLine>,
}

/// Share of the base's largest line below which a frequency counts as not excited.
const EXCITED: f64 = 1e-4;

impl Spectrum {
    /// The lines at which the base moves.
    pub fn excited(&self) -> impl Iterator<Item = &SpectralLine> {
        self.lines.iter().filter(|line| line.excitation >= EXCITED)
    }

    /// The line nearest to a frequency.
    #[must_use]
    pub fn nearest(&self, frequency_hz: f64) -> Option<&SpectralLine> {
        let distance = |line: &SpectralLine| (line.frequency_hz - frequency_hz).abs();
        self.lines.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

/// Computes the spectra.
#[must_use]
pub fn spectrum(motion: &Motion, segments: &Segments) -> Spectrum {
    let count = segments.samples;
    let window: Vec<f64> =
        (0..count).map(|n| (std::f64::consts::PI * (n as f64 + 0.5) / count as f64).sin().powi(2)).collect();
    let transform = Transform::new(count);
    let transformed = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / count as f64;
        transform.forward(values.iter().zip(&window).map(|(v, w)| (v - mean) * w).collect())
    };
    let (mut zz, mut xx) = (vec![0.0; count / 2 + 1], vec![0.0; count / 2 + 1]);
    let mut zx = vec![Complex::new(0.0, 0.0); count / 2 + 1];
    let starts: Vec<usize> = (0..=motion.x_m.len() - count).step_by(segments.hop).collect();
    for from in &starts {
        let range = *from..from + count;
        let (z, x) = (transformed(&motion.z_m[range.clone()]), transformed(&motion.x_m[range]));
        for n in 0..z.len() {
            zz[n] += z[n].norm_sqr();
            xx[n] += x[n].norm_sqr();
            zx[n] += z[n].conj() * x[n];
        }
    }
    let largest = zz[1..].iter().fold(f64::MIN_POSITIVE, |most, s| most.max(*s));
    let line = |n: usize| SpectralLine {
        frequency_hz: n as f64 / (count as f64 * motion.step_s),
        h: zx[n] / zz[n].max(f64::MIN_POSITIVE),
        coherence: (zx[n].norm_sqr() / (zz[n] * xx[n]).max(f64::MIN_POSITIVE)).min(1.0),
        excitation: zz[n] / largest,
    };
    // At the Nyquist frequency a line has no phase.
    let lines = (1..count.div_ceil(2)).map(line).collect();
    Spectrum { segments: *segments, averages: averages(&window, segments.hop, starts.len()), lines }
}

/// Independent averages of this many overlapping segments.
fn averages(window: &[f64], hop: usize, segments: usize) -> f64 {
    let power = window.iter().map(|w| w * w).sum::<f64>();
    let all = segments as f64;
    let shared = (1..segments).take_while(|apart| apart * hop < window.len()).map(|apart| {
        let product = window.iter().zip(&window[apart * hop..]).map(|(a, b)| a * b).sum::<f64>();
        (1.0 - apart as f64 / all) * (product / power).powi(2)
    });
    all / (1.0 + 2.0 * shared.sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(x: impl Fn(usize, f64) -> f64) -> Motion {
        let mut random = fastrand::Rng::with_seed(3);
        let z_m: Vec<f64> = (0..40_000).map(|_| random.f64() - 0.5).collect();
        let x_m = (0..z_m.len()).map(|n| x(n, z_m[n.saturating_sub(1)])).collect();
        Motion { taken_from: String::new(), step_s: 0.01, x_m, z_m }
    }

    #[test]
    fn h1_of_twice_the_base_a_sample_later_is_2_with_a_linear_phase() {
        let motion = motion(|_, z| 2.0 * z);
        let segments = Segments::new(&motion, 4.0, 0.5).unwrap();
        let spectrum = spectrum(&motion, &segments);
        // A delay of one sample of 400 under a smooth window: 1/400 of a line's noise is new in each segment.
        for line in spectrum.excited() {
            assert!((line.magnitude() / 2.0 - 1.0).abs() < 0.01, "{line:?}");
            let phase = -std::f64::consts::TAU * line.frequency_hz * 0.01;
            assert!((line.phase_rad() - phase).abs() < 0.01, "{line:?}");
            assert!(line.coherence > 0.999);
        }
    }

    /// x = z + independent noise of the same power: γ² = 1/2, H = 1, and |H| scatters as its uncertainty says.
    #[test]
    fn noise_lowers_the_coherence_and_scatters_h1_as_stated() {
        // Far from the seed of z: neighbouring seeds of this generator are correlated.
        let mut random = fastrand::Rng::with_seed(0x9e37_79b9_7f4a_7c15);
        let noise: Vec<f64> = (0..40_000).map(|_| random.f64() - 0.5).collect();
        let motion = motion(|n, z| z + noise[n]);
        let segments = Segments::new(&motion, 4.0, 0.5).unwrap();
        let spectrum = spectrum(&motion, &segments);
        // 199 segments, each sharing 1/6 of its window's power with the next: 199/(1 + 2/36).
        assert!((spectrum.averages - 199.0 / (1.0 + 2.0 / 36.0)).abs() < 1.0, "{}", spectrum.averages);
        let count = spectrum.lines.len() as f64;
        let mean = spectrum.lines.iter().map(|line| line.coherence).sum::<f64>() / count;
        // A coherence of 0.5 scatters by √(2γ²)(1 − γ²)/√n = 0.036 a line; 199 lines, of which neighbours share their noise.
        assert!((mean - 0.5).abs() < 4.0 * 0.036 * (1.944f64 / count).sqrt(), "{mean}");
        let scatter = (spectrum.lines.iter().map(|line| (line.magnitude() - 1.0).powi(2)).sum::<f64>() / count).sqrt();
        let stated =
            spectrum.lines.iter().map(|line| line.relative_uncertainty(spectrum.averages)).sum::<f64>() / count;
        assert!((scatter / stated - 1.0).abs() < 0.25, "{scatter} {stated}");
    }

    #[test]
    fn segments_that_do_not_fit_are_refused() {
        let motion = motion(|_, z| z);
        assert!(Segments::new(&motion, 300.0, 0.5).unwrap_err().to_string().contains("--segment-s"));
        assert!(Segments::new(&motion, 0.05, 0.5).is_err());
    }
}
