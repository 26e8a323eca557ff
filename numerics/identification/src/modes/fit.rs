//! Fits frequencies and damping ratios of all modes to the lines of all places, and gives what they are with their uncertainties.

use nalgebra::DVector;

use super::place::{Constants, Place, Poles};
use super::{C64, Mode, Modes};
use crate::Refused;
use crate::modal::ResponseLine;
use crate::statistics::{self, Fit, Value};

/// Rounds in which the variances follow from what the fit leaves.
const ROUNDS: usize = 4;

/// Damping ratios of the search for a start: the smallest, the ratio of neighbours, and their number.
const RATIOS: (f64, f64, i32) = (2e-4, 2.0, 11);

/// Frequencies of that search to either side, in half-power half-widths.
const PLACES: i32 = 2;

/// Lines in common that widen an interval.
const BLOCK: usize = 6;

/// The responses of all places.
pub(super) struct Problem {
    pub places: Vec<Place>,
}

/// Poles that fit, and the deviations of the lines.
pub(super) struct Fitted {
    pub poles: Fit,
    pub deviations: Vec<Vec<f64>>,
}

impl Fitted {
    pub fn poles(&self) -> &Poles {
        &self.poles.parameters
    }
}

impl Problem {
    pub fn residuals(&self, poles: &Poles, deviations: &[Vec<f64>], out: &mut Vec<f64>) {
        let is_possible = poles.chunks(2).all(|pole| pole[0] > 0.0 && pole[1] > 0.0 && pole[1] < 1.0);
        for (place, deviations) in self.places.iter().zip(deviations) {
            match place.fitted(poles, deviations).filter(|_| is_possible) {
                Some(fitted) => {
                    for ((line, fitted), deviation) in place.lines.iter().zip(fitted).zip(deviations) {
                        out.extend([(line.h - fitted).re / deviation, (line.h - fitted).im / deviation]);
                    }
                }
                None => out.resize(out.len() + 2 * place.lines.len(), f64::NAN),
            }
        }
    }

    fn cost(&self, poles: &Poles, deviations: &[Vec<f64>]) -> f64 {
        let mut residuals = Vec::new();
        self.residuals(poles, deviations, &mut residuals);
        let cost = residuals.iter().map(|r| r * r).sum::<f64>();
        if cost.is_finite() { cost } else { f64::INFINITY }
    }

    /// Searches each mode about its peak in turn, the others where they are.
    pub fn start(&self, near_hz: &[f64], deviations: &[Vec<f64>]) -> Vec<f64> {
        let mut poles: Vec<f64> = near_hz.iter().flat_map(|hz| [*hz, 0.01]).collect();
        for _ in 0..2 {
            for mode in 0..near_hz.len() {
                self.search(&mut poles, mode, deviations);
            }
        }
        poles
    }

    /// Puts a mode where it fits best about its place, the others where they are.
    pub fn search(&self, poles: &mut [f64], mode: usize, deviations: &[Vec<f64>]) {
        let about_hz = poles[2 * mode];
        let mut best = (self.cost(poles, deviations), [poles[2 * mode], poles[2 * mode + 1]]);
        for k in 0..RATIOS.2 {
            let ratio = RATIOS.0 * RATIOS.1.powi(k);
            for n in -PLACES..=PLACES {
                let hz = about_hz * (1.0 + ratio * f64::from(n));
                (poles[2 * mode], poles[2 * mode + 1]) = (hz, ratio);
                let cost = self.cost(poles, deviations);
                if cost < best.0 {
                    best = (cost, [hz, ratio]);
                }
            }
        }
        [poles[2 * mode], poles[2 * mode + 1]] = best.1;
    }

    /// Before a fit every line counts by a part of its own magnitude and of the median.
    pub fn first_deviations(&self) -> Vec<Vec<f64>> {
        let of_place = |place: &Place| place.lines.iter().map(|line| line.h.norm().hypot(place.median)).collect();
        self.places.iter().map(of_place).collect()
    }

    /// Steps for derivatives.
    fn steps(poles: &Poles) -> Vec<f64> {
        poles.chunks(2).flat_map(|pole| [1e-3 * pole[1] * pole[0], 1e-3 * pole[1]]).collect()
    }

    /// Fits all modes from these poles, with these deviations of the lines.
    pub fn refit(&self, poles: &Poles, deviations: &[Vec<f64>]) -> Result<Fit, Refused> {
        let count: usize = self.places.iter().map(|place| 2 * place.lines.len()).sum();
        let model = |poles: &[f64], out: &mut Vec<f64>| {
            self.residuals(poles, deviations, out);
            out.iter_mut().for_each(|r| *r = -*r);
        };
        statistics::fit(&vec![0.0; count], poles, &Self::steps(poles), model).ok_or_else(lost)
    }

    /// Fits all modes from these poles, and the deviations of the lines.
    pub fn fit(&self, mut poles: Vec<f64>, mut deviations: Vec<Vec<f64>>) -> Result<Fitted, Refused> {
        let count = poles.len() / 2;
        let mut found = None;
        for _ in 0..ROUNDS {
            let fit = self.refit(&poles, &deviations)?;
            poles.clone_from(&fit.parameters);
            let of_place = |(place, deviations): (&Place, &Vec<f64>)| {
                let fitted = place.fitted(&poles, deviations)?;
                Some(place.deviations(&fitted, 2 * (count + place.terms) + 2 * count / self.places.len()))
            };
            let next: Option<Vec<Vec<f64>>> = self.places.iter().zip(&deviations).map(of_place).collect();
            found = Some(fit);
            deviations = next.ok_or_else(lost)?;
        }
        let poles = found.ok_or_else(lost)?;
        let sorted = |pair: &[&[f64]]| pair[0][0] < pair[1][0];
        let is_apart = poles.parameters.chunks(2).collect::<Vec<_>>().windows(2).all(sorted);
        if is_apart { Ok(Fitted { poles, deviations }) } else { Err(lost()) }
    }

    pub fn modes(&self, fit: &Fitted, driven: usize, band_hz: [f64; 2]) -> Result<Modes, Refused> {
        let (poles, deviations) = (fit.poles(), &fit.deviations);
        let count = poles.len() / 2;
        let lost = || Refused("the modes do not determine their shapes".into());
        let all = |poles: &Poles| -> Option<Vec<Constants>> {
            self.places.iter().zip(deviations).map(|(place, deviations)| place.constants(poles, deviations)).collect()
        };
        let constants = all(poles).ok_or_else(lost)?;
        let fitted: Vec<Vec<(ResponseLine, C64)>> = self
            .places
            .iter()
            .zip(&constants)
            .map(|(place, own)| place.lines.iter().copied().zip(own.fitted()).collect())
            .collect();
        let (inflation, worst_hz) = misfit(&fitted, deviations);
        let covariance = &fit.poles.shape * inflation;
        // How A changes with frequencies and damping ratios.
        let steps = Self::steps(poles);
        let mut slopes: Vec<Vec<DVector<C64>>> = Vec::new();
        for (k, step) in steps.iter().enumerate() {
            let moved = |sign: f64| {
                let mut moved = poles.to_vec();
                moved[k] += sign * step;
                all(&moved)
            };
            let (above, below) = moved(1.0).zip(moved(-1.0)).ok_or_else(lost)?;
            let slope = |(a, b): (&Constants, &Constants)| (&a.values - &b.values) / C64::from(2.0 * step);
            slopes.push(above.iter().zip(&below).map(slope).collect());
        }
        let reals: usize = self.places.iter().map(|place| 2 * place.lines.len()).sum();
        let constants_of = |place: &Place| 2 * (count + place.terms);
        let taken: usize = self.places.iter().map(constants_of).sum::<usize>() + 2 * count;
        let freedom = reals.saturating_sub(taken).max(2) as f64;
        let value = |value: f64, variance: f64| Value {
            value,
            standard_uncertainty: variance.max(0.0).sqrt(),
            degrees_of_freedom: freedom,
        };
        let mode = |j: usize| -> Result<Mode, Refused> {
            let of_force = constants[driven].values[j].re;
            if of_force <= 0.0 {
                return Err(Refused(format!(
                    "the mode of {:.4} Hz has A = {of_force:.3e} 1/kg where the force acts, which must be greater than 0\n  name that place with \
                     --driven; where the motion counts against the force, write PLACE=-FILE",
                    poles[2 * j]
                )));
            }
            let phi_driven = of_force.sqrt();
            let own_variance = |place: usize| inflation * constants[place].variances[j];
            let shape = (0..self.places.len()).map(|r| {
                let phi = constants[r].values[j].re / phi_driven;
                // φ by A at the place, and by A where the force acts.
                let (by_own, by_driven) =
                    if r == driven { (0.0, 0.5 / phi_driven) } else { (1.0 / phi_driven, -0.5 * phi / of_force) };
                let by_pole = DVector::from_fn(steps.len(), |k, _| {
                    by_own * slopes[k][r][j].re + by_driven * slopes[k][driven][j].re
                });
                let of_lines = by_own.powi(2) * own_variance(r) + by_driven.powi(2) * own_variance(driven);
                value(phi, of_lines + by_pole.dot(&(&covariance * &by_pole)))
            });
            let out = |own: &Constants| own.values[j].im.abs() / own.values[j].norm();
            Ok(Mode {
                natural_frequency_hz: value(poles[2 * j], covariance[(2 * j, 2 * j)]),
                damping_ratio: value(poles[2 * j + 1], covariance[(2 * j + 1, 2 * j + 1)]),
                shape_per_root_kg: shape.collect(),
                out_of_phase: constants.iter().map(out).fold(0.0, f64::max),
            })
        };
        let modes: Result<Vec<Mode>, Refused> = (0..count).map(mode).collect();
        Ok(Modes { modes: modes?, band_hz, fitted, inflation, worst_hz })
    }
}

fn lost() -> Refused {
    Refused(
        "they do not fit together: two are at one peak, or one is at none\n  say where they are with --near-hz, or choose a band"
            .into(),
    )
}

/// By how much what neighbouring lines leave in common exceeds noise, and where most is left, Hz.
fn misfit(fitted: &[Vec<(ResponseLine, C64)>], deviations: &[Vec<f64>]) -> (f64, f64) {
    let (mut inflation, mut worst) = (1.0_f64, (0.0, f64::NAN));
    for (own, deviations) in fitted.iter().zip(deviations) {
        let left: Vec<C64> = own.iter().zip(deviations).map(|((line, h), d)| (line.h - h) / *d).collect();
        for part in [|c: &C64| c.re, |c: &C64| c.im] {
            let part: Vec<f64> = left.iter().map(part).collect();
            inflation = inflation.max(statistics::inflation(&part, BLOCK));
        }
        for (lines, left) in own.chunks(BLOCK).zip(left.chunks(BLOCK)) {
            let size = left.iter().sum::<C64>().norm() / (left.len() as f64).sqrt();
            if size > worst.0 {
                worst = (size, lines[lines.len() / 2].0.frequency_hz);
            }
        }
    }
    (inflation, worst.1)
}
