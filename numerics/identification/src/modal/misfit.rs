//! Lack of fit of a mode: what would explain the residuals that the noise does not.
//!
//! Further terms are added to the fitted mode, to first order: another mode at each place of the band, a residual part that bends over the
//! band, and a peak of another shape. What each takes of the sum of squares is compared with what noise would give it, by the F distribution
//! at 0.1 %; of another mode also for the number of places.

use std::f64::consts::TAU;

use damprig_fourier::Complex;
use nalgebra::DVector;

use super::fit::{Band, FittedMode, KnownNoise, OfMode, PARAMETERS};
use super::line_fit::{self, ByLine};
use super::linear::{Explained, parts};
use crate::lack_of_fit::{TAIL, most_of};
use crate::statistics::correlation;
use crate::time_response::LINES_SHARE;

/// A way in which a single mode does not fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModalMisfit {
    /// Another mode or a disturbance at this frequency, Hz.
    Mode(f64),
    /// The part of the other modes bends over the band.
    Background,
    /// The peak has another shape than that of a mode with viscous damping.
    Shape,
    /// The lines about the peak and the whole band give different values: ζ of the line, and of the mode.
    Methods([f64; 2]),
    /// The lines scatter this many times as much as coherence and averages state.
    Scatter(f64),
}

/// What does not fit, and what the noise is beyond that of independent lines.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ModalLackOfFit {
    /// By how much the variance of neighbours' sums exceeds that of independent lines.
    pub(super) inflation: f64,
    /// By how much the lines' variance exceeds what coherence and averages state, at least 1.
    pub(super) scatter: f64,
    pub(super) by_line: Option<ByLine>,
    pub(super) misfits: Vec<ModalMisfit>,
    /// By how much fn (Hz), ζ and |A| (1/kg) change with the terms that are missing.
    pub(super) shift: [f64; 3],
}

/// Tests the mode.
pub(super) fn test(band: &Band, mode: &FittedMode, of_mode: &OfMode) -> ModalLackOfFit {
    let explained = |columns: &[Vec<Complex<f64>>]| {
        let both: Vec<DVector<f64>> = columns
            .iter()
            .flat_map(|column| {
                let turned: Vec<Complex<f64>> = column.iter().map(|c| c * Complex::i()).collect();
                [parts(column, &of_mode.deviations), parts(&turned, &of_mode.deviations)]
            })
            .collect();
        of_mode.inner.explained(&of_mode.residuals, &both)
    };
    let (background, shape) = (background(band, mode), shape(band, mode));
    let smooth = explained(&[background.as_slice(), std::slice::from_ref(&shape)].concat());
    let least = if band.window_hz.is_some() { LINES_SHARE } else { 1.0 };
    let inflation = inflation(&smooth.left).max(least);
    let excess = |explained: &Explained, places: usize| {
        let freedom = (2 * band.lines.len()).saturating_sub(PARAMETERS + explained.count) as f64;
        if explained.count == 0 || freedom < 2.0 {
            return 0.0;
        }
        let rest = explained.left.norm_squared() / freedom;
        // The larger of many: the tail is smaller by their number.
        let tail = (TAIL * TAIL + 2.0 * (places as f64).ln()).sqrt();
        explained.fall / (rest.max(f64::MIN_POSITIVE) * inflation) / most_of(explained.count, freedom, tail)
    };
    let (background, shape) = (explained(&background), explained(&[shape]));
    let mut found = vec![
        (excess(&background, 1), ModalMisfit::Background, background.shift),
        (excess(&shape, 1), ModalMisfit::Shape, shape.shift),
    ];
    let places = places(band, mode);
    let modes = places.iter().map(|place| (place[0], explained(&[modal(band, *place)])));
    if let Some((frequency_hz, other)) = modes.max_by(|a, b| a.1.fall.total_cmp(&b.1.fall)) {
        found.push((excess(&other, places.len()), ModalMisfit::Mode(frequency_hz), other.shift));
    }
    found.retain(|(excess, ..)| *excess > 1.0);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut misfits: Vec<ModalMisfit> = found.first().map(|(_, misfit, _)| *misfit).into_iter().collect();
    let along = mode.factors[0] / mode.factors[0].norm();
    let changes = |[hz, ratio, re, im]: [f64; 4]| [hz, ratio, re * along.re + im * along.im];
    let shift = [0, 1, 2].map(|k| found.iter().map(|(.., shift)| changes(*shift)[k].abs()).fold(0.0, f64::max));
    let freedom = of_mode.degrees_of_freedom();
    let square = of_mode.residuals.norm_squared();
    let scatter = if band.known() == KnownNoise::All { (square / freedom).max(1.0) } else { 1.0 };
    let by_line = line_fit::fit(band, mode, inflation * scatter);
    if let Some(line) = by_line.as_ref().filter(|line| line.is_apart) {
        misfits.push(ModalMisfit::Methods([line.damping_ratio.value, mode.place[1]]));
    }
    // Of a known variance: the F distribution with many degrees of freedom.
    if band.known() == KnownNoise::All && square > inflation * most_of(freedom as usize, 1e6, TAIL) {
        misfits.push(ModalMisfit::Scatter(scatter.sqrt()));
    }
    ModalLackOfFit { inflation, scatter, by_line, misfits, shift }
}

/// Powers of the frequency beyond those of the residual terms.
fn background(band: &Band, mode: &FittedMode) -> Vec<Vec<Complex<f64>>> {
    let all: Vec<f64> = band.all(|hz| hz - mode.place[0]);
    let reach = all.iter().fold(0.0, |most: f64, own| most.max(own.abs()));
    let power = |power: i32| {
        band.all(|hz| band.quantity.of_receptance(TAU * hz).1 * ((hz - mode.place[0]) / reach).powi(power))
    };
    vec![power(2), power(3)]
}

/// The cube of a mode's shape: a window that is wider than the resonance, or a frequency that changes with the amplitude, adds it.
fn shape(band: &Band, mode: &FittedMode) -> Vec<Complex<f64>> {
    let [natural_hz, zeta] = mode.place;
    band.all(|hz| {
        let r = hz / natural_hz;
        let own = Complex::new(1.0 - r * r, 2.0 * zeta * r).inv() * (2.0 * zeta);
        band.quantity.of_receptance(TAU * hz).1 * own * own * own
    })
}

/// H of a mode of unit size.
fn modal(band: &Band, [natural_hz, zeta]: [f64; 2]) -> Vec<Complex<f64>> {
    band.all(|hz| {
        let r = hz / natural_hz;
        band.quantity.of_receptance(TAU * hz).1 * Complex::new(1.0 - r * r, 2.0 * zeta * r).inv() * (2.0 * zeta)
    })
}

/// Damping ratios of another mode over that of the fitted one.
const DAMPINGS: [f64; 3] = [0.3, 1.0, 3.0];

/// Frequencies of another mode at most: the time of the test.
const MAX_PLACES: f64 = 2000.0;

/// Frequencies and damping ratios at which another mode is looked for: over the band, nearer than its half-power width and the lines.
fn places(band: &Band, mode: &FittedMode) -> Vec<[f64; 2]> {
    let (Some(first), Some(last)) = (band.lines.first(), band.lines.last()) else { return Vec::new() };
    let spacing = (last.frequency_hz - first.frequency_hz) / (band.lines.len() - 1).max(1) as f64;
    let [natural_hz, zeta] = mode.place;
    let step = spacing.max(0.5 * zeta * natural_hz).max((last.frequency_hz - first.frequency_hz) / MAX_PLACES);
    let count = ((last.frequency_hz - first.frequency_hz) / step).round() as usize;
    let at = |n: usize| first.frequency_hz + n as f64 * step;
    (0..=count).flat_map(|n| DAMPINGS.map(|share| [at(n), (share * zeta).max(0.25 * spacing / at(n))])).collect()
}

/// Neighbouring lines whose sums are compared with independent ones.
const BLOCK: usize = 4;

/// By how much the variance of a mean over neighbouring lines exceeds that of independent ones, at least 1: lines of a window share their noise.
fn inflation(residuals: &DVector<f64>) -> f64 {
    let half = residuals.len() / 2;
    let (real, imaginary) = residuals.as_slice().split_at(half);
    let both: Vec<f64> = [real, imaginary].into_iter().filter_map(|part| correlation(part, BLOCK)).collect();
    if both.is_empty() { 1.0 } else { (both.iter().sum::<f64>() / both.len() as f64).max(1.0) }
}

impl ModalMisfit {
    /// What does not fit and what is likely the reason.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::Mode(frequency_hz) => format!(
                "there is another mode or a disturbance at {frequency_hz:.4} Hz: leave it out of the band with --from-hz or --to-hz"
            ),
            Self::Background => "what the other modes add bends over the band: narrow it with --from-hz and --to-hz".into(),
            Self::Shape => "the peak has not the shape of a mode with viscous damping: a window that is wider than the resonance, a stiffness or \
                            damping that goes with the amplitude, or two modes near each other do this"
                .into(),
            Self::Methods([line, mode]) => format!(
                "the lines about the peak alone give the damping ratio {line:.6}, the fit of the band {mode:.6}"
            ),
            Self::Scatter(times) => {
                format!("the lines deviate {times:.2} times as much as their coherence and the averages state")
            }
        }
    }
}
