//! Fits the structure's parameters to x over time: x simulated from the measured z against the measured x.
//!
//! ẍ + 2ζω(ẋ − ż) + ω²(x − z) = 0, with z a cubic between its samples, as the controller plays it; so the simulation is exact for this z. The
//! measured x is that motion times a scale (of both sensors), late by a delay, from any initial state, about any zero. These enter
//! linearly and are eliminated, so that the search is over fn and ζ alone: a grid about the largest |H|, then least squares.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, SMatrix, SVector};

use super::Motion;
use super::residuals::ResidualNoise;
use super::welch::Spectrum;
use crate::Refused;
use crate::statistics::{Fit, Value, fit};

/// What the fit over time shows.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputError {
    /// fn, Hz.
    pub natural_frequency_hz: Value,
    /// ζ.
    pub damping_ratio: Value,
    /// Scale of x over that of z; 1 for sensors of one scale.
    pub gain: f64,
    /// Delay of x after z beyond that of the structure, s.
    pub delay_s: f64,
    /// RMS of measured less simulated x, m.
    pub residual_rms_m: f64,
    /// The same over the RMS of x.
    pub relative_residual: f64,
    /// Share of the residuals' power that has the shape of the resonance.
    pub noise_at_resonance: f64,
}

/// Samples in a period of fn: of the search, and of the fit at least.
const COARSE_PER_PERIOD: f64 = 16.0;
const FINE_PER_PERIOD: f64 = 60.0;

/// Damping ratios of the search.
const DAMPINGS: [f64; 3] = [0.003, 0.02, 0.1];

/// Peak of |H| below which there is no resonance.
const MIN_PEAK: f64 = 1.5;

/// RMS of the residuals over that of x above which the structure is not one mass on a spring.
const MAX_RESIDUAL: f64 = 0.2;

/// Relative standard uncertainty of ζ above which it is not known.
const MAX_UNCERTAIN: f64 = 0.5;

/// Frequency of the largest |H| where the base moves and x follows it, Hz.
///
/// # Errors
/// No resonance in the excited band.
pub(super) fn peak(rough: &Spectrum) -> Result<f64, Refused> {
    let peak = rough.excited().max_by(|a, b| (a.magnitude() * a.coherence).total_cmp(&(b.magnitude() * b.coherence)));
    if let Some(line) = peak.filter(|line| line.magnitude() > MIN_PEAK) {
        return Ok(line.frequency_hz);
    }
    let ends = rough
        .excited()
        .fold([f64::MAX, 0.0f64], |[low, high], line| [low.min(line.frequency_hz), high.max(line.frequency_hz)]);
    Err(Refused(format!(
        "there is no resonance where the base moves, from {:.3} Hz to {:.3} Hz: |H| is at most {:.2}\n  excite a band around the natural \
         frequency",
        ends[0],
        ends[1],
        peak.map_or(0.0, |line| line.magnitude())
    )))
}

/// Fits a motion whose rough spectra and their peak (Hz) are known.
///
/// # Errors
/// Another kind of structure, a damping that the record does not tell.
pub(super) fn fit_motion(motion: &Motion, rough: &Spectrum, peak_hz: f64) -> Result<OutputError, Refused> {
    let start = search(motion, peak_hz, rough.segments.segment_s);
    let fine = motion.thinned(TAU / start[0] / FINE_PER_PERIOD);
    let steps = [1e-6 * start[0], 1e-4 * start[1]];
    let model = |p: &[f64], out: &mut Vec<f64>| match Simulated::new(&fine, p[0], p[1]) {
        Some(simulated) => out.extend(simulated.fitted),
        None => out.extend(std::iter::repeat_n(f64::NAN, fine.x_m.len())),
    };
    let no_fit = || {
        Refused(
            "x cannot be simulated from z by one mass on a spring with viscous damping\n  is a damper mounted, or is z not the motion of \
             the structure's base?"
                .into(),
        )
    };
    let found = fit(&fine.x_m, &start, &steps, model).ok_or_else(no_fit)?;
    let simulated = Simulated::new(&fine, found.parameters[0], found.parameters[1]).ok_or_else(no_fit)?;
    let result = with_uncertainty(&fine, &found, &simulated).ok_or_else(no_fit)?;
    check(&result, rough)?;
    Ok(result)
}

fn check(result: &OutputError, rough: &Spectrum) -> Result<(), Refused> {
    let (natural, zeta) = (&result.natural_frequency_hz, &result.damping_ratio);
    if result.relative_residual > MAX_RESIDUAL {
        return Err(Refused(format!(
            "the motion is not that of one mass on a spring with viscous damping: the simulated x deviates by {:.0} % of x\n  is a damper \
             mounted, or is x moved by something else?",
            100.0 * result.relative_residual
        )));
    }
    if rough.nearest(natural.value).is_none_or(|line| line.excitation < 1e-6) {
        return Err(Refused(format!(
            "the base does not move at the natural frequency, {:.4} Hz: its damping cannot be told\n  excite a band around it",
            natural.value
        )));
    }
    if zeta.standard_uncertainty > MAX_UNCERTAIN * zeta.value {
        return Err(Refused(format!(
            "the damping ratio {:.3e} has the uncertainty {:.3e}\n  record longer, or move the base more around {:.3} Hz",
            zeta.value, zeta.standard_uncertainty, natural.value
        )));
    }
    Ok(())
}

/// ω and ζ of the grid with the least deviation. The deviation is a valley as wide as 1/length in frequency, so the grid is twice as
/// fine.
fn search(motion: &Motion, about_hz: f64, segment_s: f64) -> [f64; 2] {
    let coarse = motion.thinned(1.0 / (about_hz * COARSE_PER_PERIOD));
    let length_s = coarse.step_s * coarse.x_m.len() as f64;
    let (reach_hz, step_hz) = (1.5 / segment_s, 0.5 / length_s);
    let count = (reach_hz / step_hz).ceil() as i32;
    let mut best = (f64::MAX, [TAU * about_hz, DAMPINGS[0]]);
    for place in -count..=count {
        let omega = TAU * (about_hz + f64::from(place) * step_hz);
        for zeta in DAMPINGS {
            let deviation =
                Simulated::new(&coarse, omega, zeta).filter(|_| omega > 0.0).map_or(f64::MAX, |s| s.residual_m2);
            if deviation < best.0 {
                best = (deviation, [omega, zeta]);
            }
        }
    }
    best.1
}

impl Motion {
    /// The means of groups of samples that are at most `step_s` together. Both motions are averaged alike, so x follows z as before.
    fn thinned(&self, step_s: f64) -> Self {
        let group = ((step_s / self.step_s).floor() as usize).max(1);
        let mean = |values: &[f64]| values.chunks_exact(group).map(|g| g.iter().sum::<f64>() / group as f64).collect();
        Self {
            taken_from: self.taken_from.clone(),
            step_s: self.step_s * group as f64,
            x_m: mean(&self.x_m),
            z_m: mean(&self.z_m),
        }
    }
}

/// Linear parameters: scale, scale times delay, two of the initial state, the zero.
const LINEAR: usize = 5;

/// x simulated from z for some ω and ζ, with the linear parameters that fit best.
struct Simulated {
    fitted: Vec<f64>,
    /// Sum of the squared deviations, m².
    residual_m2: f64,
    gain: f64,
    delay_s: f64,
}

impl Simulated {
    /// `None` when the parameters are those of no structure, or the motion does not determine the linear ones.
    fn new(motion: &Motion, omega: f64, zeta: f64) -> Option<Self> {
        let columns = columns(motion, omega, zeta)?;
        let mut normal = SMatrix::<f64, LINEAR, LINEAR>::zeros();
        let mut right = SVector::<f64, LINEAR>::zeros();
        let mut squares = [0.0; LINEAR];
        for row in &columns {
            for (sum, value) in squares.iter_mut().zip(row) {
                *sum += value * value;
            }
        }
        let scale = squares.map(|sum| 1.0 / sum.sqrt().max(f64::MIN_POSITIVE));
        for (row, x) in columns.iter().zip(&motion.x_m) {
            for i in 0..LINEAR {
                right[i] += scale[i] * row[i] * x;
                for j in 0..=i {
                    normal[(i, j)] += scale[i] * scale[j] * row[i] * row[j];
                }
            }
        }
        let solution = normal.cholesky()?.solve(&right);
        let amount: [f64; LINEAR] = std::array::from_fn(|n| solution[n] * scale[n]);
        let of = |row: &[f64; LINEAR]| row.iter().zip(&amount).map(|(value, a)| value * a).sum::<f64>();
        let fitted: Vec<f64> = columns.iter().map(of).collect();
        let residual_m2: f64 = fitted.iter().zip(&motion.x_m).map(|(f, x)| (x - f).powi(2)).sum();
        residual_m2.is_finite().then_some(Self {
            fitted,
            residual_m2,
            gain: amount[0],
            delay_s: -amount[1] / amount[0],
        })
    }
}

/// Least damping ratio of the search.
const MIN_ZETA: f64 = -0.05;

/// x and its velocity from rest under z, the free motions from each initial state, and a constant, sample by sample.
fn columns(motion: &Motion, omega: f64, zeta: f64) -> Option<Vec<[f64; LINEAR]>> {
    // The search may step over 0: what it finds there is refused.
    if !(omega > 0.0 && (MIN_ZETA..1.0).contains(&zeta)) {
        return None;
    }
    let h = motion.step_s;
    // Displacement, velocity times h, and the base's cubic with its derivatives, over a step of length 1.
    let (stiff, loss) = (omega * omega * h * h, 2.0 * zeta * omega * h);
    let mut rates = DMatrix::<f64>::zeros(6, 6);
    rates[(0, 1)] = 1.0;
    for (place, value) in [(0, -stiff), (1, -loss), (2, stiff), (3, loss)] {
        rates[(1, place)] = value;
    }
    for place in 2..5 {
        rates[(place, place + 1)] = 1.0;
    }
    let step = rates.exp();
    let row = |n: usize| -> [f64; 6] { std::array::from_fn(|place| step[(n, place)]) };
    let [to_x, to_v] = [row(0), row(1)];
    let z = &motion.z_m;
    let last = z.len() - 1;
    // About the first reading, the base starts at rest at 0.
    let at = |n: usize| z[n.min(last)] - z[0];
    let slope = |n: usize| 0.5 * (at(n + 1) - at(n.saturating_sub(1)));
    let mut state = [0.0; 2];
    let mut free = [[1.0, 0.0], [0.0, 1.0]];
    let mut rows = Vec::with_capacity(z.len());
    for n in 0..z.len() {
        rows.push([state[0], state[1] / h, free[0][0], free[1][0], 1.0]);
        let (start, rise, from, to) = (at(n), at(n + 1) - at(n), slope(n), slope(n + 1));
        let base = [start, from, 2.0 * (3.0 * rise - 2.0 * from - to), 6.0 * (from + to - 2.0 * rise)];
        let pushed = |weights: &[f64; 6]| weights[2..].iter().zip(&base).map(|(w, b)| w * b).sum::<f64>();
        let moved = |s: [f64; 2]| [to_x[0] * s[0] + to_x[1] * s[1], to_v[0] * s[0] + to_v[1] * s[1]];
        let on = moved(state);
        state = [on[0] + pushed(&to_x), on[1] + pushed(&to_v)];
        free = free.map(moved);
    }
    Some(rows)
}

/// |H|² at the frequencies of a discrete spectrum of `count` samples.
fn h_squared(count: usize, step_s: f64, omega: f64, zeta: f64) -> Vec<f64> {
    let of = |n: usize| {
        let r = TAU * n as f64 / (count as f64 * step_s) / omega;
        let d = 2.0 * zeta * r;
        (1.0 + d * d) / ((1.0 - r * r).powi(2) + d * d)
    };
    (0..=count / 2).map(of).collect()
}

/// The parameters with the uncertainty under the noise that the residuals show.
fn with_uncertainty(motion: &Motion, found: &Fit, simulated: &Simulated) -> Option<OutputError> {
    let [omega, zeta] = [found.parameters[0], found.parameters[1]];
    let count = motion.x_m.len();
    let h_squared = h_squared(count, motion.step_s, omega, zeta);
    let noise = ResidualNoise::of(&found.residuals, &h_squared);
    let sensitivity = |change: [f64; 2]| {
        let above = Simulated::new(motion, omega + change[0], zeta + change[1])?;
        let below = Simulated::new(motion, omega - change[0], zeta - change[1])?;
        let size = 2.0 * (change[0] + change[1]);
        Some(above.fitted.iter().zip(&below.fitted).map(|(a, b)| (a - b) / size).collect::<Vec<f64>>())
    };
    let sensitivities = [sensitivity([1e-6 * omega, 0.0])?, sensitivity([0.0, 1e-4 * zeta])?];
    let spectra: Vec<_> = sensitivities.iter().map(|s| damprig_fourier::spectrum(s)).collect();
    let [white, resonant] = noise.seen_by(&spectra, &h_squared, count);
    let value = |place: usize| {
        let variance = |seen: &DMatrix<f64>| (&found.shape * seen * &found.shape)[(place, place)].max(0.0);
        let (white, resonant) = (variance(&white), variance(&resonant));
        let all = white + resonant;
        // Welch and Satterthwaite.
        let freedom =
            all * all / (resonant * resonant / noise.degrees_of_freedom + white * white / found.degrees_of_freedom());
        Value { value: found.parameters[place], standard_uncertainty: all.sqrt(), degrees_of_freedom: freedom }
    };
    let mean = motion.x_m.iter().sum::<f64>() / count as f64;
    let power = motion.x_m.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    let frequency = value(0);
    let result = OutputError {
        natural_frequency_hz: frequency.mapped(frequency.value / TAU, 1.0 / TAU),
        damping_ratio: value(1),
        gain: simulated.gain,
        delay_s: simulated.delay_s,
        residual_rms_m: (simulated.residual_m2 / count as f64).sqrt(),
        relative_residual: (simulated.residual_m2 / power).sqrt(),
        noise_at_resonance: noise.resonant_share(&h_squared),
    };
    result.damping_ratio.standard_uncertainty.is_finite().then_some(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed form: a sine of the base from rest, whose velocity is 0 at the start (cosine less 1), gives the steady motion and a free
    /// one that cancels its start.
    #[test]
    fn the_simulation_is_the_closed_form_of_a_structure_on_a_moving_base() {
        let (omega, zeta, drive, h) = (15.7f64, 0.02f64, 12.0f64, 2e-3);
        let z_m: Vec<f64> = (0..2000).map(|n| 1e-3 * ((drive * f64::from(n) * h).cos() - 1.0)).collect();
        let motion = Motion { taken_from: String::new(), step_s: h, x_m: vec![0.0; 2000], z_m };
        let rows = columns(&motion, omega, zeta).unwrap();
        // X/Z = (1 + 2ζrj)/(1 − r² + 2ζrj).
        let (r, d) = (drive / omega, 2.0 * zeta * drive / omega);
        let square = (1.0 - r * r).powi(2) + d * d;
        let (re, im) = (((1.0 - r * r) + d * d) / square, (d * (1.0 - r * r) - d) / square);
        let steady = |t: f64| 1e-3 * (re * (drive * t).cos() - im * (drive * t).sin() - 1.0);
        let speed = |t: f64| -1e-3 * drive * (re * (drive * t).sin() + im * (drive * t).cos());
        let (x0, v0) = (-steady(0.0), -speed(0.0));
        let damped = omega * (1.0 - zeta * zeta).sqrt();
        for n in [1, 10, 400, 1999] {
            let t = n as f64 * h;
            let free = (-zeta * omega * t).exp()
                * (x0 * (damped * t).cos() + (v0 + zeta * omega * x0) / damped * (damped * t).sin());
            // The cubic misses (Ωh)³/50 = 3e-7 of the base, which resonance multiplies by 2.
            assert!((rows[n][0] - steady(t) - free).abs() < 5e-9, "{n}: {} {}", rows[n][0], steady(t) + free);
        }
        // The free columns are the free motions.
        let t = 400.0 * h;
        let expected = (-zeta * omega * t).exp() * ((damped * t).cos() + zeta * omega / damped * (damped * t).sin());
        assert!((rows[400][2] - expected).abs() < 1e-12);
    }
}
