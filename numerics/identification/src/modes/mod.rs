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

mod another;
mod fit;
mod peaks;
mod place;

use damprig_fourier::Complex;

use super::modal::{FrequencyResponse, ResponseLine, Wish};
use super::statistics::Value;
use crate::Refused;
use fit::{Fitted, Problem};
use peaks::peaks_of;
use place::Place;

type C64 = Complex<f64>;

/// Modes at most.
pub const MAX_MODES: usize = 20;

/// Residual terms without the last of either end.
const FEWER: usize = 3;

/// Lines that each place needs for every mode, and for the residual terms, at least.
const LINES_PER_MODE: usize = 6;

/// A mode that is this far from its peak, as a logarithm, is another one.
const ASTRAY: f64 = 0.1;

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
