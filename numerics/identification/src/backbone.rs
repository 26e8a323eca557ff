//! Damping ratio and natural frequency over the amplitude of a free vibration: the measured backbone.
//!
//! The swings are cut into windows of whole cycles, one after the other. In each, a damped sine with zero, drift, second and third
//! harmonic is fitted by least squares. To first order the fitted damping ratio is the mean of ζ(t) over the window, weighted by
//! K(t) = ∫ₜ (s − s̄)·a²(s) ds, and so is the frequency. The amplitude of a window is the mean of a(t) with the same weight, so a
//! damping ratio that is linear in the amplitude is found without a bias. The curvature of ζ(a) adds ½·ζ″·var(a) to the uncertainty.

use std::f64::consts::{PI, TAU};

use damprig_fourier::Complex;
use serde::Serialize;

use super::decay_record::Swings;
use super::statistics::{Fit, Value, correlation, fit};

/// Windows that a record is cut into, if they have [`MIN_CYCLES`] cycles each.
const WINDOWS: usize = 5;
/// Cycles of a window at least.
const MIN_CYCLES: usize = 2;
/// Windows that make a backbone at least.
const MIN_WINDOWS: usize = 3;
/// Fall of the amplitude over a window that more cycles may not exceed.
const MAX_FALL: f64 = 0.2;
/// Parameters of a window: ω, ζ, cosine and sine, zero, drift, cosine and sine of two harmonics.
const PARAMETERS: usize = 10;
/// Samples of a window at least.
const MIN_SAMPLES: usize = 4 * PARAMETERS;
/// Spectral lines of a window about a harmonic that its parameters take.
const RESOLUTION: f64 = 1.5;
/// Blocks of a cycle over which neighbouring residuals are compared.
const BLOCKS_PER_CYCLE: f64 = 8.0;
/// Steps of the integrals over a window.
const STEPS: usize = 200;

/// What a window of some cycles shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// Its first and last time, s.
    pub span_s: [f64; 2],
    /// Amplitude that its damping ratio and frequency belong to, m.
    pub amplitude_m: f64,
    /// ζ.
    pub damping_ratio: Value,
    /// fn, Hz.
    pub natural_frequency_hz: Value,
    /// Reading about which it swings at the middle of the window, m.
    pub zero_m: Value,
}

/// Damping ratio and frequency over the amplitude.
#[derive(Clone, Debug, PartialEq)]
pub struct Backbone {
    /// The windows, from the first to the last.
    pub windows: Vec<Window>,
    /// Cycles of a window.
    pub cycles: usize,
    /// What the windows' fits leave, m: noise, and what is faster than a window. One value for each sample from the first window's
    /// first.
    pub residuals_m: Vec<f64>,
    /// Degrees of freedom of the density of the noise, which all windows share.
    pub noise_freedom: f64,
    /// First sample of the first window, from the first that the whole fit uses.
    pub first: usize,
}

/// A window as a row of a table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// First time of the window, s.
    pub from_s: f64,
    /// Its last time, s.
    pub to_s: f64,
    /// Amplitude that damping ratio and frequency belong to, m.
    pub amplitude_m: f64,
    /// ζ.
    pub damping_ratio: f64,
    /// Its standard uncertainty.
    pub damping_ratio_standard_uncertainty: f64,
    /// Ends of its 95 % interval.
    pub damping_ratio_interval_95: [f64; 2],
    /// fn, Hz.
    pub natural_frequency_hz: f64,
    /// Its standard uncertainty, Hz.
    pub natural_frequency_standard_uncertainty_hz: f64,
    /// Ends of its 95 % interval, Hz.
    pub natural_frequency_interval_95_hz: [f64; 2],
}

impl Backbone {
    /// The windows as rows of a table.
    #[must_use]
    pub fn rows(&self) -> Vec<Row> {
        let row = |window: &Window| {
            let (zeta, frequency) = (&window.damping_ratio, &window.natural_frequency_hz);
            Row {
                from_s: window.span_s[0],
                to_s: window.span_s[1],
                amplitude_m: window.amplitude_m,
                damping_ratio: zeta.value,
                damping_ratio_standard_uncertainty: zeta.standard_uncertainty,
                damping_ratio_interval_95: zeta.interval_95(),
                natural_frequency_hz: frequency.value,
                natural_frequency_standard_uncertainty_hz: frequency.standard_uncertainty,
                natural_frequency_interval_95_hz: frequency.interval_95(),
            }
        };
        self.windows.iter().map(row).collect()
    }

    /// RMS of what the windows' fits leave, m; for the parameters that each window has of its own.
    #[must_use]
    pub fn noise_rms_m(&self) -> f64 {
        let free = self.residuals_m.len() as f64 - (PARAMETERS * self.windows.len()) as f64;
        (self.residuals_m.iter().map(|r| r * r).sum::<f64>() / free).sqrt()
    }
}

/// The backbone of a record; `None` where it has too few cycles or samples for three windows.
pub(super) fn backbone(t_s: &[f64], x_m: &[f64], swings: &Swings, damping_ratio: f64) -> Option<Backbone> {
    let crossings = &swings.crossings_s;
    let whole = (crossings.len() - 1) / 2;
    let by_fall = -(1.0 - MAX_FALL).ln() / (TAU * damping_ratio.max(1e-6));
    let by_samples = (MIN_SAMPLES as f64 / swings.samples_per_period).ceil() as usize;
    let most = (whole / WINDOWS).min(by_fall as usize);
    let cycles = most.max(MIN_CYCLES).max(by_samples);
    let count = whole / cycles;
    if count < MIN_WINDOWS {
        return None;
    }
    let sample = |crossing: usize| t_s.partition_point(|t| *t < crossings[crossing]);
    let bounds: Vec<usize> = (0..=count).map(|n| sample(2 * n * cycles)).collect();
    let fits: Vec<(Fit, f64)> = bounds
        .windows(2)
        .enumerate()
        .map(|(n, pair)| {
            let middle_s = 0.5 * (t_s[pair[0]] + t_s[pair[1] - 1]);
            let near = swings.turnings.iter().rev().find(|turning| turning.0 <= middle_s)?;
            let half_s = (crossings[2 * (n + 1) * cycles] - crossings[2 * n * cycles]) / (2 * cycles) as f64;
            let start = Start { middle_s, turning: *near, half_s, damping_ratio, zero_m: swings.centre_m };
            Some((fit_window(&t_s[pair[0]..pair[1]], &x_m[pair[0]..pair[1]], &start)?, middle_s))
        })
        .collect::<Option<_>>()?;
    let residuals_m: Vec<f64> = fits.iter().flat_map(|(fit, _)| fit.residuals.iter().copied()).collect();
    let (widened, freedom) = noise_near(&residuals_m, swings.samples_per_period, cycles);
    let windows = fits.iter().zip(bounds.windows(2)).map(|((fit, middle_s), pair)| {
        let of_window = [t_s[pair[0]], t_s[pair[1] - 1]];
        window(fit, *middle_s, of_window, (widened, freedom))
    });
    let (mut windows, spreads): (Vec<Window>, Vec<f64>) = windows.unzip();
    add_curvature(&mut windows, &spreads);
    Some(Backbone { windows, cycles, residuals_m, noise_freedom: freedom, first: bounds[0] - swings.first })
}

/// How much denser the noise is near the frequency of the swings than what the windows leave is on the mean, and the degrees of freedom of
/// that. The larger of two: by the means over eighths of a cycle, and by the lines between the harmonics.
fn noise_near(residuals_m: &[f64], samples_per_period: f64, cycles: usize) -> (f64, f64) {
    let cycles = cycles as f64;
    let blocks = BLOCKS_PER_CYCLE * cycles;
    let free = blocks - PARAMETERS as f64;
    let ratio = correlation(residuals_m, (samples_per_period / BLOCKS_PER_CYCLE).round() as usize);
    let windows = residuals_m.len() as f64 / (samples_per_period * cycles);
    let by_blocks = ratio.map_or((1.0, free * windows), |ratio| (ratio * blocks / free, free * windows));
    // What a window fits of zero, drift and harmonics is not left.
    let near = RESOLUTION / cycles;
    let by_lines = density(residuals_m, |f| {
        let f = f * samples_per_period;
        (near..=1.0 - near).contains(&f) || (1.0 + near..=2.0 - near).contains(&f)
    });
    let (density, freedom) = by_lines.filter(|by_lines| by_lines.0 > by_blocks.0).unwrap_or(by_blocks);
    (density.max(1.0), freedom)
}

/// Mean power of the spectral lines at these frequencies (per sample) over that of all, and its degrees of freedom; `None` without such
/// lines.
fn density(values: &[f64], is_wanted: impl Fn(f64) -> bool) -> Option<(f64, f64)> {
    let power = power(values);
    let step = 1.0 / values.len() as f64;
    let wanted: Vec<f64> =
        power.iter().enumerate().filter(|(n, _)| is_wanted(*n as f64 * step)).map(|(_, power)| *power).collect();
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    let ratio = mean(&wanted) / mean(&power);
    ratio.is_finite().then_some((ratio, 2.0 * wanted.len() as f64))
}

/// Power of each line of a spectrum, from 0 on.
pub(super) fn power(values: &[f64]) -> Vec<f64> {
    damprig_fourier::spectrum(values).iter().map(Complex::norm_sqr).collect()
}

/// Where the fit of a window starts.
struct Start {
    middle_s: f64,
    turning: (f64, f64),
    half_s: f64,
    damping_ratio: f64,
    zero_m: f64,
}

/// Fits a damped sine about the middle of the window.
fn fit_window(t_s: &[f64], x_m: &[f64], start: &Start) -> Option<Fit> {
    let zeta = start.damping_ratio.clamp(-0.5, 0.9);
    let omega = PI / start.half_s / (1.0 - zeta * zeta).sqrt();
    let damped = PI / start.half_s;
    let (turning_s, turning_m) = start.turning;
    let since = damped * (turning_s - start.middle_s);
    let at_middle = turning_m * (zeta * omega * (turning_s - start.middle_s)).exp();
    let span_s = (t_s[t_s.len() - 1] - t_s[0]).max(f64::MIN_POSITIVE);
    let size = turning_m.abs();
    let parameters =
        [omega, zeta, at_middle * since.cos(), at_middle * since.sin(), start.zero_m, 0.0, 0.0, 0.0, 0.0, 0.0];
    let small = 1e-5 * size;
    let steps = [1e-6 * omega, 1e-6, small, small, small, small / span_s, small, small, small, small];
    fit(x_m, &parameters, &steps, |p, out| {
        let root = (1.0 - p[1] * p[1]).max(1e-12).sqrt();
        for t in t_s {
            let u = t - start.middle_s;
            let fall = (-p[1] * p[0] * u).exp();
            let (s1, c1) = (p[0] * root * u).sin_cos();
            let (s2, c2) = (2.0 * s1 * c1, 2.0 * c1 * c1 - 1.0);
            let (s3, c3) = (s2 * c1 + c2 * s1, c2 * c1 - s2 * s1);
            let swing = fall * (p[2] * c1 + p[3] * s1);
            out.push(swing + p[4] + p[5] * u + p[6] * c2 + p[7] * s2 + p[8] * c3 + p[9] * s3);
        }
    })
}

/// What a fit says, and the weighted variance of the amplitude over the window, m².
fn window(fit: &Fit, middle_s: f64, span_s: [f64; 2], (widened, freedom): (f64, f64)) -> (Window, f64) {
    let variance = fit.variance() * widened;
    let value = |index: usize| {
        let value = fit.value(index, variance);
        Value { degrees_of_freedom: (value.degrees_of_freedom / widened).min(freedom).max(1.0), ..value }
    };
    let (omega, zeta) = (value(0), value(1));
    let rate = omega.value * zeta.value;
    let amplitude = fit.parameters[2].hypot(fit.parameters[3]);
    let (mean, spread) = weighted_amplitude(rate, [span_s[0] - middle_s, span_s[1] - middle_s]);
    let window = Window {
        span_s,
        amplitude_m: amplitude * mean,
        damping_ratio: zeta,
        natural_frequency_hz: omega.mapped(omega.value / TAU, 1.0 / TAU),
        zero_m: value(4),
    };
    (window, (amplitude * spread).powi(2))
}

/// Mean and standard deviation of e^(−rate·t) with the weight K(t) of the module's head.
fn weighted_amplitude(rate: f64, [from_s, to_s]: [f64; 2]) -> (f64, f64) {
    let step_s = (to_s - from_s) / STEPS as f64;
    let points: Vec<(f64, f64)> =
        (0..STEPS).map(|n| from_s + (n as f64 + 0.5) * step_s).map(|t| (t, (-rate * t).exp())).collect();
    let (all, first) = points.iter().fold((0.0, 0.0), |(all, first), (t, a)| (all + a * a, first + t * a * a));
    let centre = first / all;
    let (mut kernel, mut sums) = (0.0, [0.0; 3]);
    for (t, a) in &points {
        kernel += (centre - t) * a * a;
        (0..3).for_each(|power| sums[power] += kernel * a.powi(power as i32));
    }
    let mean = sums[1] / sums[0];
    (mean, (sums[2] / sums[0] - mean * mean).max(0.0).sqrt())
}

/// Adds ½·ζ″·var(a), with ζ″ by divided differences of three windows, and the same of the frequency.
fn add_curvature(windows: &mut [Window], variances: &[f64]) {
    let last = windows.len() - 1;
    let parts: Vec<[f64; 2]> = (0..windows.len())
        .map(|n| {
            let middle = n.clamp(1, last - 1);
            let three = [&windows[middle - 1], &windows[middle], &windows[middle + 1]];
            let half_second = |of: &dyn Fn(&Window) -> f64| {
                let slope = |a: &Window, b: &Window| (of(b) - of(a)) / (b.amplitude_m - a.amplitude_m);
                (slope(three[1], three[2]) - slope(three[0], three[1])) / (three[2].amplitude_m - three[0].amplitude_m)
            };
            let part = |of: &dyn Fn(&Window) -> f64| {
                let part = (half_second(of) * variances[n]).abs();
                if part.is_finite() { part } else { 0.0 }
            };
            [part(&|w| w.damping_ratio.value), part(&|w| w.natural_frequency_hz.value)]
        })
        .collect();
    for (window, [zeta, frequency]) in windows.iter_mut().zip(parts) {
        window.damping_ratio = window.damping_ratio.widened(zeta);
        window.natural_frequency_hz = window.natural_frequency_hz.widened(frequency);
    }
}
