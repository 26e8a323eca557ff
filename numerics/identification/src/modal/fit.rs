//! Fits one mode with residual terms to the lines of a band.
//!
//! H/s = A/(ωn² − ω² + 2ζωnωj) + B + C·(ωn²/ω² − 1), less what H has without a mode, with s of [`Quantity::of_receptance`]. B and C are
//! complex: the stiffness of the higher modes and the mass of the lower ones, as they act within the band. A, B and C follow by linear least
//! squares for each fn and ζ, so that only these two are searched (variable projection).
//!
//! The variance of a line is taken as a floor and a share of |H|². With a coherence both follow from |H|²·(1 − γ²)/(2γ²), which is the variance
//! of the real and of the imaginary part of n averages times n − 1 (Bendat and Piersol, Random Data, have n). Where n is not known, its scale
//! follows from what the fit leaves. The coherence of single lines scatters too much to be their weight, but a line that is far worse than
//! that has its own. Without a coherence both parts follow from what the fit leaves.

use std::f64::consts::TAU;

use damprig_fourier::Complex;
use nalgebra::DVector;

use super::ResponseLine;
use super::linear::{Sensitivities, parts, solve};
use super::quantity::Quantity;
use crate::statistics::{self, Value, variance_parts};

/// Parameters of the fit: fn, ζ, and the complex A, B, C.
pub(super) const PARAMETERS: usize = 8;

/// Lines that a fit needs at least.
pub(super) const MIN_LINES: usize = 8;

/// Least standard deviation of a line as a share of |H|: of sensors and their digits.
const MIN_DEVIATION: f64 = 1e-6;

/// Rounds in which variances and parameters follow each other.
const ROUNDS: usize = 6;

/// Damping ratios of the search, the smallest and the ratio of neighbours.
const SEARCH: (f64, f64, usize) = (5e-5, 1.8, 16);

/// Frequencies of the search for each line about the peak, and the best places that are followed.
const PLACES: (usize, usize) = (16, 3);

/// The measured lines of a band and what they are of.
pub(super) struct Band<'a> {
    pub(super) lines: &'a [ResponseLine],
    pub(super) quantity: Quantity,
    /// Averages that the coherence is of, if they are known.
    pub(super) averages: Option<f64>,
    /// Width of a line of Hann's window, Hz, if it is known.
    pub(super) window_hz: Option<f64>,
}

/// A fitted mode.
#[derive(Clone, Debug)]
pub(super) struct FittedMode {
    /// fn in Hz, ζ.
    pub(super) place: [f64; 2],
    /// A, B, C.
    pub(super) factors: [Complex<f64>; 3],
    /// Measured less fitted H, in SI units.
    pub(super) residuals: Vec<Complex<f64>>,
    /// Variance of the real and of the imaginary part of each line.
    pub(super) variances: Vec<f64>,
    /// Shapes of the variance at each line.
    shapes: Vec<[f64; 2]>,
    noise: LineNoise,
}

/// Parts of the variance, times a scale.
#[derive(Clone, Copy, Debug)]
struct LineNoise {
    parts: [f64; 2],
    scale: f64,
}

/// A coherence that makes a line this many times as noisy as the others is taken for that line.
const WORSE: f64 = 5.0;

/// 1/(ωn² − ω² + 2ζωnωj).
fn pole([natural_hz, zeta]: [f64; 2], omega: f64) -> Complex<f64> {
    let natural = TAU * natural_hz;
    Complex::new(natural * natural - omega * omega, 2.0 * zeta * natural * omega).inv()
}

impl Band<'_> {
    /// What multiplies A, B and C at a frequency.
    fn columns_at(&self, place: [f64; 2], frequency_hz: f64) -> [Complex<f64>; 3] {
        let omega = TAU * frequency_hz;
        let (_, factor) = self.quantity.of_receptance(omega);
        [factor * pole(place, omega), factor, factor * ((place[0] / frequency_hz).powi(2) - 1.0)]
    }

    /// H of a mode.
    pub(super) fn fitted(&self, place: [f64; 2], factors: [Complex<f64>; 3], frequency_hz: f64) -> Complex<f64> {
        let columns = self.columns_at(place, frequency_hz);
        let (constant, _) = self.quantity.of_receptance(TAU * frequency_hz);
        constant + columns.iter().zip(factors).map(|(column, factor)| column * factor).sum::<Complex<f64>>()
    }

    pub(super) fn known(&self) -> KnownNoise {
        match (self.lines.first().and_then(|line| line.coherence), self.averages) {
            (None, _) => KnownNoise::Nothing,
            (Some(_), None) => KnownNoise::Shape,
            (Some(_), Some(_)) => KnownNoise::All,
        }
    }

    pub(super) fn all<T>(&self, of: impl Fn(f64) -> T) -> Vec<T> {
        self.lines.iter().map(|line| of(line.frequency_hz)).collect()
    }

    /// A, B and C that fit best.
    fn factors(&self, place: [f64; 2], weights: &[f64]) -> Option<[Complex<f64>; 3]> {
        if !(place[0] > 0.0 && place[1] > 0.0 && place[1] < 1.0) {
            return None;
        }
        let columns: Vec<[Complex<f64>; 3]> = self.all(|hz| self.columns_at(place, hz));
        let columns: [Vec<Complex<f64>>; 3] = [0, 1, 2].map(|k| columns.iter().map(|row| row[k]).collect());
        let constant = |line: &ResponseLine| self.quantity.of_receptance(TAU * line.frequency_hz).0;
        let target: Vec<Complex<f64>> = self.lines.iter().map(|line| line.h - constant(line)).collect();
        solve(&columns, &target, weights)?.try_into().ok()
    }

    fn residuals(&self, place: [f64; 2], factors: [Complex<f64>; 3]) -> Vec<Complex<f64>> {
        self.lines.iter().map(|line| line.h - self.fitted(place, factors, line.frequency_hz)).collect()
    }

    /// Shapes of the variance of lines whose magnitudes are fitted.
    fn shapes(&self, magnitudes: &[f64]) -> Vec<[f64; 2]> {
        let floor = self.floor();
        magnitudes.iter().map(|magnitude| [floor * floor, magnitude * magnitude]).collect()
    }

    /// Variance of a line for one average, by its coherence.
    fn of_coherence(&self, n: usize) -> Option<f64> {
        let line = &self.lines[n];
        let least = (MIN_DEVIATION * line.h.norm()).powi(2);
        line.coherence.map(|coherence| (line.h.norm_sqr() * (1.0 - coherence) / (2.0 * coherence)).max(least))
    }

    /// The median magnitude.
    fn floor(&self) -> f64 {
        let mut all: Vec<f64> = self.lines.iter().map(|line| line.h.norm()).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    }

    /// Starts of the search: about a peak, where fn and ζ leave least.
    fn starts(&self, peak: usize, weights: &[f64]) -> Vec<[f64; 2]> {
        let at = |n: usize| self.lines[n].frequency_hz;
        let (low, high) = (at(peak.saturating_sub(1)), at((peak + 1).min(self.lines.len() - 1)));
        let mut found = Vec::new();
        for n in 0..=2 * PLACES.0 {
            let natural_hz = low + (high - low) * n as f64 / (2 * PLACES.0) as f64;
            for k in 0..SEARCH.2 {
                let place = [natural_hz, SEARCH.0 * SEARCH.1.powi(k as i32)];
                let Some(factors) = self.factors(place, weights) else { continue };
                let left = self.residuals(place, factors);
                found.push((left.iter().zip(weights).map(|(r, w)| r.norm_sqr() * w).sum::<f64>(), place));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().take(PLACES.1).map(|(_, place)| place).collect()
    }

    /// The best fn and ζ from a start, under these variances.
    fn search(&self, start: [f64; 2], variances: &[f64]) -> Option<(f64, [f64; 2])> {
        let (weights, deviations) = weights_of(variances);
        let values: Vec<Complex<f64>> = self.lines.iter().map(|line| line.h).collect();
        let measured = parts(&values, &deviations);
        let model = |p: &[f64], out: &mut Vec<f64>| {
            let place = [p[0], p[1]];
            match self.factors(place, &weights) {
                Some(factors) => out.extend(parts(&self.all(|hz| self.fitted(place, factors, hz)), &deviations).iter()),
                None => out.resize(2 * values.len(), f64::NAN),
            }
        };
        let steps = [1e-3 * start[1] * start[0], 1e-3 * start[1]];
        let found = statistics::fit(measured.as_slice(), &start, &steps, model)?;
        Some((found.residuals.iter().map(|r| r * r).sum(), [found.parameters[0], found.parameters[1]]))
    }

    /// Fits a mode about the line `peak`.
    pub(super) fn fit(&self, peak: usize) -> Option<FittedMode> {
        let magnitudes: Vec<f64> = self.lines.iter().map(|line| line.h.norm()).collect();
        let mut shapes = self.shapes(&magnitudes);
        let mut noise = self.noise_of_coherence(&shapes).unwrap_or(LineNoise { parts: [1e-4; 2], scale: 1.0 });
        let mut place = None;
        let mut mode = None;
        for _ in 0..ROUNDS {
            let variances = self.variances(&shapes, noise);
            let starts = match place {
                Some(place) => vec![place],
                None => self.starts(peak, &weights_of(&variances).0),
            };
            let best = starts.into_iter().filter_map(|start| self.search(start, &variances));
            let (_, best) = best.min_by(|a, b| a.0.total_cmp(&b.0))?;
            let factors = self.factors(best, &weights_of(&variances).0)?;
            let residuals = self.residuals(best, factors);
            let found = FittedMode { place: best, factors, residuals, variances, shapes, noise };
            if found.place[1] <= 0.0 {
                return None;
            }
            place = Some(best);
            let fitted: Vec<f64> = self.all(|hz| self.fitted(best, factors, hz).norm());
            shapes = self.shapes(&fitted);
            noise = self.noise(&found, &shapes)?;
            mode = Some(found);
        }
        mode
    }

    fn variances(&self, shapes: &[[f64; 2]], LineNoise { parts, scale }: LineNoise) -> Vec<f64> {
        let least = (MIN_DEVIATION * MIN_DEVIATION * self.floor()).powi(2);
        let of = |(n, [a, b]): (usize, &[f64; 2])| {
            let usual = parts[0] * a + parts[1] * b;
            let own = self.of_coherence(n).filter(|own| *own > WORSE * usual);
            (scale * own.unwrap_or(usual)).max(least)
        };
        shapes.iter().enumerate().map(of).collect()
    }

    /// The noise that the coherence shows; of one average where the number of averages is not known.
    fn noise_of_coherence(&self, shapes: &[[f64; 2]]) -> Option<LineNoise> {
        let powers: Option<Vec<f64>> = (0..self.lines.len()).map(|n| self.of_coherence(n)).collect();
        let parts = variance_parts(&powers?, |n| shapes[n], [1e-4; 2]);
        // One of n averages is that of H itself.
        Some(LineNoise { parts, scale: self.averages.map_or(1.0, |averages| (averages - 1.0).recip()) })
    }

    /// The noise, from what a fit leaves and from the coherence. The fit takes a share of each line's noise.
    fn noise(&self, mode: &FittedMode, shapes: &[[f64; 2]]) -> Option<LineNoise> {
        let free = self.sensitivities(mode)?.free_shares();
        let powers: Vec<f64> =
            mode.residuals.iter().zip(free.iter()).map(|(r, free)| 0.5 * r.norm_sqr() / free).collect();
        let Some(known) = self.noise_of_coherence(shapes) else {
            return Some(LineNoise { parts: variance_parts(&powers, |n| shapes[n], [1e-4; 2]), scale: 1.0 });
        };
        if self.averages.is_some() {
            return Some(known);
        }
        let of_one = self.variances(shapes, LineNoise { scale: 1.0, ..known });
        let squares: f64 = mode.residuals.iter().zip(&of_one).map(|(r, v)| r.norm_sqr() / v).sum();
        Some(LineNoise { scale: squares / (2 * self.lines.len() - PARAMETERS) as f64, ..known })
    }

    /// Sensitivities of H to fn, ζ and the parts of A, B and C.
    pub(super) fn sensitivities(&self, mode: &FittedMode) -> Option<OfMode> {
        let [natural_hz, zeta] = mode.place;
        let natural = TAU * natural_hz;
        let mut columns = vec![Vec::new(); PARAMETERS];
        for line in self.lines {
            let omega = TAU * line.frequency_hz;
            let own = self.columns_at(mode.place, line.frequency_hz);
            let slope = -mode.factors[0] * own[0] * pole(mode.place, omega);
            columns[0].push(slope * Complex::new(2.0 * natural, 2.0 * zeta * omega) * TAU);
            columns[1].push(slope * Complex::new(0.0, 2.0 * natural * omega));
            for (k, column) in own.into_iter().enumerate() {
                columns[2 + 2 * k].push(column);
                columns[3 + 2 * k].push(column * Complex::i());
            }
        }
        let (_, deviations) = weights_of(&mode.variances);
        let inner = Sensitivities::new(&columns, &deviations)?;
        Some(OfMode { residuals: parts(&mode.residuals, &deviations), inner, deviations })
    }
}

/// What is known of the noise without the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum KnownNoise {
    Nothing,
    /// Its shape, by the coherence.
    Shape,
    /// Its size too, by the averages.
    All,
}

/// Weights and standard deviations of variances.
fn weights_of(variances: &[f64]) -> (Vec<f64>, Vec<f64>) {
    variances.iter().map(|v| (1.0 / v, v.sqrt())).unzip()
}

/// Sensitivities of a fitted mode, with the lines' standard deviations and what it leaves of them.
pub(super) struct OfMode {
    pub(super) inner: Sensitivities,
    pub(super) deviations: Vec<f64>,
    pub(super) residuals: DVector<f64>,
}

impl OfMode {
    /// Real numbers less parameters.
    pub(super) fn degrees_of_freedom(&self) -> f64 {
        (self.residuals.len() - PARAMETERS) as f64
    }

    /// |A| with its uncertainty.
    pub(super) fn size(&self, constant: Complex<f64>, mode: &FittedMode, inflation: f64, known: KnownNoise) -> Value {
        let along = constant / constant.norm();
        let influence = self.inner.influence(2) * along.re + self.inner.influence(3) * along.im;
        self.value_of(&influence, constant.norm(), mode, inflation, known)
    }

    /// Share of each line's variance that the fit leaves in its residual.
    fn free_shares(&self) -> DVector<f64> {
        let leverages = self.inner.leverages();
        let count = self.deviations.len();
        // A line that the fit follows alone tells nothing of its noise.
        DVector::from_fn(count, |n, _| (1.0 - 0.5 * (leverages[n] + leverages[n + count])).max(0.05))
    }

    /// A parameter with its uncertainty; the noise of the lines counts `inflation` times.
    pub(super) fn value(
        &self,
        parameter: usize,
        value: f64,
        mode: &FittedMode,
        inflation: f64,
        known: KnownNoise,
    ) -> Value {
        self.value_of(&self.inner.influence(parameter), value, mode, inflation, known)
    }

    fn value_of(
        &self,
        influence: &DVector<f64>,
        value: f64,
        mode: &FittedMode,
        inflation: f64,
        known: KnownNoise,
    ) -> Value {
        let count = self.deviations.len();
        let free = self.free_shares();
        let share = |n: usize, part: usize| mode.noise.parts[part] * mode.shapes[n][part] / mode.variances[n];
        let of_part = |part: usize| -> (f64, f64) {
            let variance = (0..2 * count).map(|n| influence[n].powi(2) * share(n % count, part)).sum::<f64>();
            let freedom = (0..count).map(|n| 2.0 * free[n] * share(n, part).powi(2)).sum::<f64>();
            (variance, freedom.max(2.0))
        };
        let all = influence.norm_squared();
        let freedom = match known {
            KnownNoise::All => f64::MAX,
            KnownNoise::Shape => (2 * count - PARAMETERS) as f64,
            KnownNoise::Nothing => {
                let parts = [of_part(0), of_part(1)];
                // Welch and Satterthwaite.
                let sum: f64 = parts.iter().map(|(variance, freedom)| variance * variance / freedom).sum();
                (all * all / sum.max(f64::MIN_POSITIVE)).clamp(2.0, (2 * count - PARAMETERS) as f64)
            }
        };
        Value { value, standard_uncertainty: (all * inflation).sqrt(), degrees_of_freedom: freedom }
    }
}
