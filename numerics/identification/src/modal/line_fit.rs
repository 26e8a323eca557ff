//! fn and ζ by a straight line: near a resonance 1/(H/s) goes with ω² as (ωn²(1 + 2ζj) − ω²)/A.
//!
//! It takes only the lines about the peak and no residual terms, so that it differs from the fit of the mode where the peak and its flanks contradict each other. What it
//! gives of the fitted mode instead of the measured lines is its own error: a part of its uncertainty, and left out of the comparison.

use std::f64::consts::TAU;

use damprig_fourier::Complex;
use nalgebra::{Matrix2, Vector2};

use super::fit::{Band, FittedMode};
use crate::statistics::Value;

/// Share of the peak's magnitude that a line must have: 1.7 half-power widths about fn.
const SHARE: f64 = 0.5;

/// Lines at least.
const MIN: usize = 4;

/// Standard uncertainties beyond which the line of the measured lines and that of the fitted mode contradict each other.
const APART: f64 = 3.5;

/// fn in Hz and ζ by the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByLine {
    /// Natural frequency, Hz.
    pub natural_frequency_hz: Value,
    /// Damping ratio.
    pub damping_ratio: Value,
    /// Whether they contradict the fitted mode.
    pub is_apart: bool,
}

/// Fits the line, where the noise of the lines counts `inflation` times; `None` for too few lines about the peak.
pub(super) fn fit(band: &Band, mode: &FittedMode, inflation: f64) -> Option<ByLine> {
    let measured = of_values(band, mode, |n| band.lines[n].h)?;
    let measured =
        measured.map(|value| Value { standard_uncertainty: inflation.sqrt() * value.standard_uncertainty, ..value });
    let of_mode = of_values(band, mode, |n| band.fitted(mode.place, mode.factors, band.lines[n].frequency_hz))?;
    let own = |k: usize| measured[k].widened(of_mode[k].value - mode.place[k]);
    let is_apart =
        (0..2).any(|k| (measured[k].value - of_mode[k].value).abs() > APART * measured[k].standard_uncertainty);
    Some(ByLine { natural_frequency_hz: own(0), damping_ratio: own(1), is_apart })
}

fn of_values(band: &Band, mode: &FittedMode, h: impl Fn(usize) -> Complex<f64>) -> Option<[Value; 2]> {
    let [natural_hz, zeta] = mode.place;
    let natural = TAU * natural_hz;
    let r = |n: usize| band.lines[n].frequency_hz / natural_hz;
    // Over the peak's magnitude.
    let fitted = |n: usize| 2.0 * zeta / (1.0 - r(n).powi(2)).hypot(2.0 * zeta * r(n));
    let used: Vec<usize> = (0..band.lines.len()).filter(|n| fitted(*n) >= SHARE).collect();
    if used.len() < MIN {
        return None;
    }
    let peak = mode.factors[0].norm() / (2.0 * zeta * natural * natural);
    let mut normal: Matrix2<f64> = Matrix2::zeros();
    let mut right: Vector2<Complex<f64>> = Vector2::zeros();
    for n in &used {
        let (constant, factor) = band.quantity.of_receptance(TAU * band.lines[*n].frequency_hz);
        let inverse = (peak * factor) / (h(*n) - constant);
        // The variance of 1/g is that of g over |g|⁴.
        let weight = fitted(*n).powi(4) * (peak * factor).norm_sqr() / mode.variances[*n];
        let row = [1.0, 1.0 - r(*n).powi(2)];
        for i in 0..2 {
            right[i] += inverse * (row[i] * weight);
            for j in 0..2 {
                normal[(i, j)] += row[i] * row[j] * weight;
            }
        }
    }
    let inverse = normal.try_inverse()?;
    // 1/g = p + q·(1 − (ω/ωn)²), with the fitted ωn: the squared frequency at which it is 0 is ωn²(1 + p/q).
    let [p, q]: [Complex<f64>; 2] = [0, 1].map(|k| right[0] * inverse[(k, 0)] + right[1] * inverse[(k, 1)]);
    let ratio = p / q;
    let root = 1.0 + ratio.re;
    if !(root > 0.0 && ratio.im.is_finite()) {
        return None;
    }
    let variance = inverse[(0, 0)] + ratio.norm_sqr() * inverse[(1, 1)] - 2.0 * ratio.re * inverse[(0, 1)];
    let deviation = (variance.max(0.0) / q.norm_sqr()).sqrt();
    let degrees_of_freedom = (2 * used.len() - 4) as f64;
    let value = |value, standard_uncertainty| Value { value, standard_uncertainty, degrees_of_freedom };
    Some([value(natural_hz * root.sqrt(), 0.5 * natural_hz * deviation), value(0.5 * ratio.im / root, 0.5 * deviation)])
}
