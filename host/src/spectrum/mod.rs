//! Response spectra of an acceleration record: the largest response of a linear oscillator over its period and damping ratio.
//!
//! u″ + 2ζω u′ + ω² u = −z″ from rest, with u the displacement relative to the ground. Sd = max|u|, Sv = max|u′| and Sa = max|u″ + z″|
//! are the true values; the pseudo values are PSV = ω·Sd and PSA = ω²·Sd. [`oscillator`] has the closed form of the motion.

pub mod oscillator;

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::motion_record::Record;

/// How the largest values are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PeakMethod {
    /// Exact motion under an acceleration that is linear between its samples; maxima between the samples too, and in the first period after
    /// the record.
    Exact,
    /// The same motion at the samples of the record only, as strong-motion agencies publish it.
    AtSamples,
    /// Newmark's average acceleration in steps of half a sample, at the steps only: the numerical error is a part of the values.
    Newmark,
}

impl PeakMethod {
    /// What it does, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Exact => "exact motion under a piecewise linear acceleration, maxima between the samples too",
            Self::AtSamples => "exact motion under a piecewise linear acceleration, maxima at the samples only",
            Self::Newmark => "Newmark's average acceleration in steps of half a sample, maxima at the steps only",
        }
    }
}

/// The largest responses of an oscillator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Largest {
    /// Sd = max|u|, m.
    pub sd_m: f64,
    /// Sv = max|u′|, m/s.
    pub sv_m_per_s: f64,
    /// Sa = max|u″ + z″|, m/s².
    pub sa_m_per_s2: f64,
}

/// A point of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SpectrumPoint {
    /// ζ.
    pub damping_ratio: f64,
    /// T, s.
    pub period_s: f64,
    /// Sd = max|u|, m.
    pub sd_m: f64,
    /// Sv = max|u′|, m/s.
    pub sv_m_per_s: f64,
    /// Sa = max|u″ + z″|, m/s².
    pub sa_m_per_s2: f64,
    /// PSV = ω·Sd, m/s.
    pub psv_m_per_s: f64,
    /// PSA = ω²·Sd, m/s².
    pub psa_m_per_s2: f64,
}

/// The spectra of an acceleration record: for each damping ratio (0 or more, below 1) all periods (s, greater than 0), in this order.
///
/// # Errors
/// A record that is no acceleration.
pub fn spectra(
    record: &Record,
    damping: &[f64],
    periods_s: &[f64],
    method: PeakMethod,
) -> Result<Vec<SpectrumPoint>, String> {
    if record.quantity != crate::motion_record::RecordQuantity::Acceleration {
        return Err("the record is a displacement: a response spectrum needs an acceleration".into());
    }
    let all: Vec<(f64, f64)> =
        damping.iter().flat_map(|zeta| periods_s.iter().map(move |period_s| (*zeta, *period_s))).collect();
    let point = |(damping_ratio, period_s): &(f64, f64)| {
        let omega = TAU / period_s;
        let largest = match method {
            PeakMethod::Exact => oscillator::exact(record, omega, *damping_ratio, true),
            PeakMethod::AtSamples => oscillator::exact(record, omega, *damping_ratio, false),
            PeakMethod::Newmark => oscillator::newmark(record, omega, *damping_ratio),
        };
        SpectrumPoint {
            damping_ratio: *damping_ratio,
            period_s: *period_s,
            sd_m: largest.sd_m,
            sv_m_per_s: largest.sv_m_per_s,
            sa_m_per_s2: largest.sa_m_per_s2,
            psv_m_per_s: omega * largest.sd_m,
            psa_m_per_s2: omega * omega * largest.sd_m,
        }
    };
    Ok(all.par_iter().map(point).collect())
}

/// Periods in even ratios from `from_s` to `to_s`.
#[must_use]
pub fn periods(from_s: f64, to_s: f64, count: usize) -> Vec<f64> {
    let last = count.saturating_sub(1).max(1) as f64;
    (0..count)
        .map(|n| if n + 1 == count && n > 0 { to_s } else { from_s * (to_s / from_s).powf(n as f64 / last) })
        .collect()
}
