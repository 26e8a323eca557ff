//! Natural modes of a structure with several places from its frequency responses: one force, motions at several places.
//!
//! `H_r/s = Σⱼ A_rj/(ωⱼ² − ω² + 2ζⱼωⱼωi) + Σₖ B_rk (f/f₀)ᵏ` with k = −4, −2, 0, 2, 4, s of [`Quantity::of_receptance`](super::modal::quantity::Quantity) and f₀ in the middle of the band:
//! the mass of the modes below and the stiffness of those above, with their change over the band. All places have the same ωⱼ and ζⱼ; A and B of each follow by linear least
//! squares, so that only frequencies and damping ratios are searched (variable projection, as of one mode in [`super::modal`]). Of a real mode A_rj = φ_rj·φ_sj, with s the place of the force and a modal mass of 1 kg:
//! `φ_sj = √A_sj`, `φ_rj = A_rj/φ_sj`. The part of A that is out of phase is left out and stated.
//!
//! The variance of a line is a floor and a share of |H|², which follow from what the fit leaves. What neighbouring lines leave in common (another
//! mode, noise that is not white) widens the intervals, and so does what the last residual terms change: the modes outside of the band are more than these
//! terms. Errors of scale of the sensors are not in them.

mod peaks;
mod place;

use damprig_fourier::Complex;
use nalgebra::DVector;

use super::modal::{FrequencyResponse, ResponseLine, Wish};
use super::statistics::{self, Fit, Value};
use crate::Refused;
use peaks::peaks_of;
use place::{Constants, Place, Poles};

type C64 = Complex<f64>;

/// Modes at most.
pub const MAX_MODES: usize = 20;

/// Residual terms without the last of either end.
const FEWER: usize = 3;

/// Lines that each place needs for every mode, and for the residual terms, at least.
const LINES_PER_MODE: usize = 6;

/// Rounds in which the variances follow from what the fit leaves.
const ROUNDS: usize = 4;

/// Damping ratios of the search for a start: the smallest, the ratio of neighbours, and their number.
const RATIOS: (f64, f64, i32) = (2e-4, 2.0, 11);

/// Frequencies of that search to either side, in half-power half-widths.
const PLACES: i32 = 2;

/// A mode that is this far from its peak, as a logarithm, is another one.
const ASTRAY: f64 = 0.1;

/// Half-power width at most of a mode that is no peak, as a share of the band.
const NARROW: f64 = 0.25;

/// Its part of H at its own frequency at least, over that of all else.
const SEEN: f64 = 0.5;

/// Lines in common that widen an interval.
const BLOCK: usize = 6;

/// A natural mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// fn, Hz.
    pub natural_frequency_hz: Value,
    /// ζ.
    pub damping_ratio: Value,
    /// φ of each place for a modal mass of 1 kg, 1/√kg.
    pub shape_per_root_kg: Vec<Value>,
    /// Largest share of an A that is out of phase with the place of the force.
    pub out_of_phase: f64,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Modes {
    /// In the order of their frequencies.
    pub modes: Vec<Mode>,
    /// Frequencies of the first and the last line, Hz.
    pub band_hz: [f64; 2],
    /// Measured and fitted H of each place at its lines, SI units.
    pub fitted: Vec<Vec<(ResponseLine, C64)>>,
    /// By how much what neighbouring lines leave in common widens the variances; 1 where nothing is.
    pub inflation: f64,
    /// Where the fit leaves most, Hz.
    pub worst_hz: f64,
}

/// Identifies the modes of a band. `driven`: the place of the force; `near_hz`: about where the modes are, all peaks without any, and what the fit
/// of the peaks leaves that another mode explains.
///
/// # Errors
/// Too few lines or modes, a response that is no motion per force, a mode that the fit loses or that the place of the force does not move.
pub fn identify(places: &[FrequencyResponse], driven: usize, near_hz: &[f64], band: Wish) -> Result<Modes, Refused> {
    if let Some(other) = places.iter().find(|place| !place.quantity.is_per_force()) {
        return Err(Refused(format!(
            "{}: a {} has no mass-normalised shape\n  give motions per force",
            other.taken_from,
            other.quantity.name()
        )));
    }
    let inside = |line: &&ResponseLine| {
        band.from_hz.is_none_or(|from| line.frequency_hz >= from) && band.to_hz.is_none_or(|to| line.frequency_hz <= to)
    };
    let lines: Vec<Vec<ResponseLine>> =
        places.iter().map(|place| place.lines.iter().filter(inside).copied().collect()).collect();
    if let Some((at_rest, _)) =
        places.iter().zip(&lines).find(|(_, own)| !own.is_empty() && own.iter().all(|line| line.h.norm_sqr() == 0.0))
    {
        return Err(Refused(format!("{}: has no motion in the band\n  leave out that place", at_rest.taken_from)));
    }
    let fewest = lines.iter().map(Vec::len).min().unwrap_or(0);
    let is_by_peaks = near_hz.is_empty();
    let peaks;
    let near_hz = if is_by_peaks {
        peaks = if fewest > 2 { peaks_of(&lines) } else { Vec::new() };
        &peaks[..]
    } else {
        near_hz
    };
    if near_hz.is_empty() || near_hz.len() > MAX_MODES {
        let many = near_hz.len();
        return Err(Refused(format!(
            "{many} peaks are found, 1 to {MAX_MODES} are fitted together\n  say about where the modes are, --near-hz 118,742, or choose a band"
        )));
    }
    if fewest < LINES_PER_MODE * (near_hz.len() + 1) {
        return Err(Refused(format!(
            "a place has {fewest} lines in the band; {} modes need {}\n  choose a wider band or fewer modes",
            near_hz.len(),
            LINES_PER_MODE * (near_hz.len() + 1)
        )));
    }
    let band_hz @ [low_hz, high_hz] = [
        lines.iter().map(|own| own[0].frequency_hz).fold(f64::INFINITY, f64::min),
        lines.iter().map(|own| own[own.len() - 1].frequency_hz).fold(0.0, f64::max),
    ];
    if let Some(outside) = near_hz.iter().find(|hz| !(low_hz..=high_hz).contains(*hz)) {
        return Err(Refused(format!(
            "--near-hz {outside}: must be within the lines, from {low_hz:.4} Hz to {high_hz:.4} Hz"
        )));
    }
    let middle_hz = (band_hz[0] * band_hz[1]).sqrt();
    let places: Vec<Place> =
        places.iter().zip(lines).map(|(response, lines)| Place::new(response, lines, middle_hz)).collect();
    let mut problem = Problem { places };
    let about = |Refused(why): Refused| {
        let all: Vec<String> = near_hz.iter().map(|hz| format!("{hz:.4}")).collect();
        Refused(format!("modes about {} Hz: {why}", all.join(", ")))
    };
    let deviations = problem.first_deviations();
    let mut fit = problem.fit(problem.start(near_hz, &deviations), deviations).map_err(about)?;
    let gone = near_hz.iter().zip(fit.poles().chunks(2)).find(|(near, pole)| (pole[0] / **near).ln().abs() > ASTRAY);
    if let Some((near, pole)) = gone {
        return Err(about(Refused(format!(
            "the fit of that about {near:.4} Hz goes astray, to {:.4} Hz: there is no mode, or lines are too few\n  leave it out with --near-hz",
            pole[0]
        ))));
    }
    if is_by_peaks {
        while let Some(with_another) = problem.with_another(&fit, driven, band_hz) {
            fit = with_another;
        }
    }
    let mut found = problem.modes(&fit, driven, band_hz)?;
    // What the last residual terms change.
    problem.places.iter_mut().for_each(|place| place.terms = FEWER);
    let poles = problem.refit(fit.poles(), &fit.deviations)?;
    let fewer = problem.modes(&Fitted { poles, ..fit }, driven, band_hz)?;
    for (mode, other) in found.modes.iter_mut().zip(&fewer.modes) {
        let widen = |own: &mut Value, other: &Value| *own = own.widened((own.value - other.value).abs());
        widen(&mut mode.natural_frequency_hz, &other.natural_frequency_hz);
        widen(&mut mode.damping_ratio, &other.damping_ratio);
        mode.shape_per_root_kg.iter_mut().zip(&other.shape_per_root_kg).for_each(|(own, other)| widen(own, other));
    }
    Ok(found)
}

/// The responses of all places.
struct Problem {
    places: Vec<Place>,
}

/// Poles that fit, and the deviations of the lines.
struct Fitted {
    poles: Fit,
    deviations: Vec<Vec<f64>>,
}

impl Fitted {
    fn poles(&self) -> &Poles {
        &self.poles.parameters
    }
}

impl Problem {
    fn residuals(&self, poles: &Poles, deviations: &[Vec<f64>], out: &mut Vec<f64>) {
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
    fn start(&self, near_hz: &[f64], deviations: &[Vec<f64>]) -> Vec<f64> {
        let mut poles: Vec<f64> = near_hz.iter().flat_map(|hz| [*hz, 0.01]).collect();
        for _ in 0..2 {
            for mode in 0..near_hz.len() {
                self.search(&mut poles, mode, deviations);
            }
        }
        poles
    }

    /// Puts a mode where it fits best about its place, the others where they are.
    fn search(&self, poles: &mut [f64], mode: usize, deviations: &[Vec<f64>]) {
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

    /// The fit with one mode more, where this one leaves most: if it is within the band and explains more than noise does, by Schwarz's criterion.
    fn with_another(&self, fit: &Fitted, driven: usize, band_hz: [f64; 2]) -> Option<Fitted> {
        let count = fit.poles().len() / 2 + 1;
        let fewest = self.places.iter().map(|place| place.lines.len()).min()?;
        if count > MAX_MODES || fewest < LINES_PER_MODE * (count + 1) {
            return None;
        }
        let before = self.modes(fit, driven, band_hz).ok()?;
        let mut poles = [fit.poles(), &[before.worst_hz, 0.01]].concat();
        self.search(&mut poles, count - 1, &fit.deviations);
        let mut pairs: Vec<&[f64]> = poles.chunks(2).collect();
        pairs.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let fit_more = self.fit(pairs.concat(), fit.deviations.clone()).ok()?;
        let modes = self.modes(&fit_more, driven, band_hz).ok()?;
        let [low, high] = band_hz;
        let is_inside = |pole: &[f64]| {
            let half_width = pole[0] * pole[1];
            pole[0] - half_width > low && pole[0] + half_width < high && 2.0 * half_width < NARROW * (high - low)
        };
        let lines: usize = self.places.iter().map(|place| place.lines.len()).sum();
        let parameters = 2 * (1 + self.places.len());
        let gain = (self.misfit_of(fit)? - self.misfit_of(&fit_more)?) / modes.inflation;
        let is_more = gain > parameters as f64 * (2.0 * lines as f64).ln();
        // What bends under other modes, or is a disturbance, may be explained by a mode, but is none that anyone would see.
        // It is the one that is left when each mode of before has its nearest.
        let mut left: Vec<&Mode> = modes.modes.iter().collect();
        for known in &before.modes {
            let apart = |mode: &Mode| (mode.natural_frequency_hz.value - known.natural_frequency_hz.value).abs();
            let nearest = (0..left.len()).min_by(|a, b| apart(left[*a]).total_cmp(&apart(left[*b])))?;
            left.remove(nearest);
        }
        let new = left.first()?;
        (is_more && self.is_seen(&fit_more, new) && fit_more.poles().chunks(2).all(is_inside)).then_some(fit_more)
    }

    /// Whether a mode is a good part of H at its own frequency, at one place at least.
    fn is_seen(&self, fit: &Fitted, mode: &Mode) -> bool {
        let Some(which) = fit.poles().chunks(2).position(|pole| pole[0] == mode.natural_frequency_hz.value) else {
            return false;
        };
        self.places.iter().zip(&fit.deviations).any(|(place, deviations)| {
            let constants = place.constants(fit.poles(), deviations);
            let hz = |n: &usize| (place.lines[*n].frequency_hz - mode.natural_frequency_hz.value).abs();
            let nearest = (0..place.lines.len()).min_by(|a, b| hz(a).total_cmp(&hz(b)));
            constants.zip(nearest).is_some_and(|(of, n)| {
                let own = of.columns[(n, which)] * of.values[which];
                let rest = of.fitted()[n] - own;
                own.norm() > SEEN * rest.norm()
            })
        })
    }

    /// −2 ln L of a fit, but for a constant.
    fn misfit_of(&self, fit: &Fitted) -> Option<f64> {
        let mut residuals = Vec::new();
        self.residuals(fit.poles(), &fit.deviations, &mut residuals);
        let squares: f64 = residuals.iter().map(|r| r * r).sum();
        let variances: f64 = fit.deviations.iter().flatten().map(|deviation| 4.0 * deviation.ln()).sum();
        Some(squares + variances).filter(|sum| sum.is_finite())
    }

    /// Before a fit every line counts by a part of its own magnitude and of the median.
    fn first_deviations(&self) -> Vec<Vec<f64>> {
        let of_place = |place: &Place| place.lines.iter().map(|line| line.h.norm().hypot(place.median)).collect();
        self.places.iter().map(of_place).collect()
    }

    /// Steps for derivatives.
    fn steps(poles: &Poles) -> Vec<f64> {
        poles.chunks(2).flat_map(|pole| [1e-3 * pole[1] * pole[0], 1e-3 * pole[1]]).collect()
    }

    /// Fits all modes from these poles, with these deviations of the lines.
    fn refit(&self, poles: &Poles, deviations: &[Vec<f64>]) -> Result<Fit, Refused> {
        let count: usize = self.places.iter().map(|place| 2 * place.lines.len()).sum();
        let model = |poles: &[f64], out: &mut Vec<f64>| {
            self.residuals(poles, deviations, out);
            out.iter_mut().for_each(|r| *r = -*r);
        };
        statistics::fit(&vec![0.0; count], poles, &Self::steps(poles), model).ok_or_else(lost)
    }

    /// Fits all modes from these poles, and the deviations of the lines.
    fn fit(&self, mut poles: Vec<f64>, mut deviations: Vec<Vec<f64>>) -> Result<Fitted, Refused> {
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

    fn modes(&self, fit: &Fitted, driven: usize, band_hz: [f64; 2]) -> Result<Modes, Refused> {
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

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use fastrand::Rng;

    use super::*;
    use crate::modal::quantity::{MotionKind, Quantity};

    /// A drawn structure: frequency (Hz) and damping ratio of each mode, and its shape at three places.
    struct Drawn {
        poles: Vec<[f64; 2]>,
        shapes: Vec<[f64; 3]>,
        /// Frequencies of a mode below and of one above the band, Hz.
        beyond_hz: [f64; 2],
    }

    impl Drawn {
        fn new(random: &mut Rng, count: usize, least_ratio: f64, more: f64) -> Self {
            let mut hz = 20.0;
            let mut poles = Vec::new();
            let mut shapes = Vec::new();
            for _ in 0..count {
                hz *= least_ratio + more * random.f64();
                poles.push([hz, 0.003 * (10_f64).powf(random.f64())]);
                let mut phi = || (0.4 + 0.8 * random.f64()) * if random.bool() { 1.0 } else { -1.0 };
                shapes.push([phi().abs(), phi(), phi()]);
            }
            let last_hz = poles[count - 1][0];
            let beyond_hz = [poles[0][0] * (0.2 + 0.3 * random.f64()), last_hz * (2.0 + 3.0 * random.f64())];
            Self { poles, shapes, beyond_hz }
        }

        /// H of the motion at a place per force at the first one, with modes below and above that the fit does not know.
        fn h(&self, place: usize, hz: f64) -> C64 {
            let omega = TAU * hz;
            let pole = |[natural_hz, ratio]: [f64; 2]| {
                let natural = TAU * natural_hz;
                Complex::new(natural * natural - omega * omega, 2.0 * ratio * natural * omega).inv()
            };
            let known = self.poles.iter().zip(&self.shapes).map(|(of, shape)| pole(*of) * (shape[0] * shape[place]));
            let [below_hz, above_hz] = self.beyond_hz;
            known.sum::<C64>() + pole([below_hz, 0.01]) * 0.3 + pole([above_hz, 0.01]) * 0.5
        }

        /// Accelerances at all places from a half of the first to 1.4 of the last frequency, with noise of this share of the median.
        fn measured(&self, random: &mut Rng, noise: f64) -> Vec<FrequencyResponse> {
            let (low, high) = (0.7 * self.poles[0][0], 1.4 * self.poles[self.poles.len() - 1][0]);
            // Three lines in the narrowest half-power width.
            let spacing = self.poles.iter().map(|[hz, ratio]| 2.0 * hz * ratio / 3.0).fold(f64::INFINITY, f64::min);
            let count = ((high - low) / spacing) as usize;
            let quantity = Quantity::of_force(MotionKind::Acceleration, false, 1.0);
            (0..3)
                .map(|place| {
                    let exact: Vec<(f64, C64)> = (0..count)
                        .map(|n| {
                            let hz = low + spacing * n as f64;
                            (hz, self.h(place, hz) * -(TAU * hz).powi(2))
                        })
                        .collect();
                    let mut sizes: Vec<f64> = exact.iter().map(|(_, h)| h.norm()).collect();
                    sizes.sort_by(f64::total_cmp);
                    let floor = noise * sizes[sizes.len() / 2];
                    let mut draw = |h: C64| {
                        let size = (-(1.0 - random.f64()).ln()).sqrt();
                        Complex::from_polar(floor.hypot(0.002 * h.norm()) * size, TAU * random.f64())
                    };
                    let lines = exact
                        .iter()
                        .map(|(hz, h)| ResponseLine { frequency_hz: *hz, h: h + draw(*h), coherence: None })
                        .collect();
                    FrequencyResponse {
                        taken_from: format!("place {place}"),
                        quantity,
                        lines,
                        averages: None,
                        window_hz: None,
                        remarks: Vec::new(),
                    }
                })
                .collect()
        }
    }

    /// Of drawn structures 95 % intervals of frequencies, damping ratios and shapes cover the truth in about 95 %; peaks are found by themselves.
    #[test]
    fn intervals_of_modes_and_shapes_cover_the_truth() {
        let draws = if std::env::var_os("DAMPRIG_FULL").is_some() { 300 } else { 16 };
        intervals_cover(draws, (1.3, 1.2));
    }

    /// Many of these are no peaks of all places together: they follow from what the fit of the peaks leaves.
    #[test]
    fn modes_near_each_other_are_found_too() {
        let draws = if std::env::var_os("DAMPRIG_FULL").is_some() { 100 } else { 12 };
        intervals_cover(draws, (1.04, 0.1));
    }

    fn intervals_cover(draws: u64, (least_ratio, more): (f64, f64)) {
        let (mut inside, mut all, mut found) = ([0; 3], [0; 3], 0);
        for seed in 0..draws {
            let mut random = Rng::with_seed(1_000 + seed);
            let count = random.usize(2..5);
            let drawn = Drawn::new(&mut random, count, least_ratio, more);
            let noise = 0.003 * 10_f64.powf(random.f64());
            let places = drawn.measured(&mut random, noise);
            let Ok(modes) = identify(&places, 0, &[], Wish::default()) else { continue };
            if modes.modes.len() != count {
                continue;
            }
            found += 1;
            for ((mode, [hz, ratio]), shape) in modes.modes.iter().zip(&drawn.poles).zip(&drawn.shapes) {
                let mut count = |which: usize, value: &Value, truth: f64| {
                    let [low, high] = value.interval_95();
                    all[which] += 1;
                    inside[which] += usize::from(low <= truth && truth <= high);
                    // An interval that misses far is no interval.
                    assert!(
                        (value.value - truth).abs() < 8.0 * value.standard_uncertainty,
                        "{seed}: {value:?} {truth}"
                    );
                };
                count(0, &mode.natural_frequency_hz, *hz);
                count(1, &mode.damping_ratio, *ratio);
                for (phi, truth) in mode.shape_per_root_kg.iter().zip(shape) {
                    count(2, phi, *truth);
                }
            }
        }
        let share = |n: usize| inside[n] as f64 / all[n] as f64;
        println!("{found} of {draws}: fn {:.3}, ζ {:.3}, φ {:.3} of {all:?}", share(0), share(1), share(2));
        assert!(found as f64 > 0.9 * draws as f64, "{found}");
        for n in 0..3 {
            // Three standard deviations of a binomial share of 95 % below it.
            let least = 0.95 - 3.0 * (0.95 * 0.05 / all[n] as f64).sqrt();
            assert!(share(n) > least, "{n}: {} of {}", inside[n], all[n]);
        }
    }
}
