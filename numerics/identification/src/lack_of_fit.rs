//! Lack of fit of a free vibration: whether the fitted model holds over the whole record, and what is likely wrong.
//!
//! The windows of the [`backbone`](super::backbone) are fitted to the record and to the readings of the fitted model. Where the model
//! holds, their damping ratios and frequencies agree within the windows' uncertainties: the sum of the squared ratios follows the F distribution.
//! The logarithmic decrement of both is compared in the same way. The windows' zeros show a drift; what their fits leave shows
//! another vibration and spikes.

use super::backbone::{Backbone, Window, power};
use super::statistics::{Value, line};

/// Quantile of the normal distribution whose upper tail is 0.001: the share of good records with white noise that fail a test.
pub(super) const TAIL: f64 = 3.090_232_306;
/// Part of the half-power width that counts as an uncertainty of damping ratio and frequency at least: what is smaller is no lack of fit.
const MIN_WIDTH: f64 = 1e-4;
/// Part of the first swing from which another vibration, a drift or a spike is named.
const MIN_SWING: f64 = 1e-5;
/// Standard uncertainties beyond which two methods contradict each other.
const APART: f64 = 3.5;
/// Share of the deviations that a curve over the amplitude has to explain.
const EXPLAINED: f64 = 0.8;
/// Robust standard deviations beyond which a reading is a spike, and how many spikes are named.
const SPIKE: (f64, usize) = (7.0, 3);
/// Median of what is fast over that of all residuals that noise with a fast part has; white noise has 1.2.
const FAST: f64 = 0.6;
/// Smallest share of another vibration in what the windows leave, and how far its line stands above the median about it.
const LINE: (f64, f64) = (0.3, 20.0);
/// Spectral lines that are summed, and those about them that make the background.
const LINES: (usize, usize) = (2, 60);
/// Frequencies of the mains and twice them, Hz.
const MAINS_HZ: [f64; 4] = [50.0, 60.0, 100.0, 120.0];
/// Factor of a 95 % interval of the normal distribution.
const NORMAL_95: f64 = 1.959_963_985;

/// How a quantity goes with the amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// Value at the smallest amplitude, and that amplitude in m.
    pub smallest: (f64, f64),
    /// Value at the largest amplitude, and that amplitude in m.
    pub largest: (f64, f64),
    /// Whether the deviations go with 1/a rather than with ln a or a.
    pub is_inverse: bool,
}

/// A way in which the model does not hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Misfit {
    /// The damping ratio goes with the amplitude in another way than the model's.
    Damping(Trend),
    /// The frequency, Hz, goes with the amplitude.
    Frequency(Trend),
    /// Damping or frequency of the windows goes up and down.
    Scatter,
    /// The friction that fits best is negative: this many standard uncertainties below 0.
    NegativeFriction(f64),
    /// The logarithmic decrement of the record, and that of the fitted model.
    Decrement([f64; 2]),
    /// Another vibration: frequency in Hz, its share of what the windows leave, and its RMS in m.
    Vibration(f64, f64, f64),
    /// The zero moves by this length, m.
    Drift(f64),
    /// Number of spikes, and the largest in m.
    Spikes(usize, f64),
}

impl Misfit {
    /// Size of a vibration, a drift or a spike, m.
    fn length_m(&self) -> f64 {
        match self {
            Self::Vibration(.., length_m) | Self::Drift(length_m) | Self::Spikes(_, length_m) => *length_m,
            _ => f64::INFINITY,
        }
    }
}

/// What does not fit.
#[derive(Clone, Debug, PartialEq)]
pub struct LackOfFit {
    /// The ways, the most important first; at least one.
    pub misfits: Vec<Misfit>,
    /// Largest deviation of a window's damping ratio from that of the model, beyond its noise.
    pub damping_ratio: f64,
    /// The same of the frequency, Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio of the first half of the windows and of the second.
    pub halves: [f64; 2],
}

/// What is compared.
pub(super) struct Compared<'a> {
    /// Windows of the record.
    pub(super) record: &'a Backbone,
    /// The same windows of the fitted model's readings.
    pub(super) model: &'a Backbone,
    /// Damping ratio by the logarithmic decrement: of the record, of the model.
    pub(super) decrements: Option<[Value; 2]>,
    /// Friction that fits best, if it was fitted.
    pub(super) coulomb: Option<Value>,
    /// Natural frequency, Hz.
    pub(super) frequency_hz: f64,
    /// First swing, m.
    pub(super) swing_m: f64,
    /// Time between samples, s.
    pub(super) step_s: f64,
}

/// Tests the model; `None` where it holds.
pub(super) fn lack_of_fit(compared: &Compared) -> Option<LackOfFit> {
    let (record, model) = (&compared.record.windows, &compared.model.windows);
    let pairs: Vec<(&Window, &Window)> = record.iter().zip(model).collect();
    let of = |get: fn(&Window) -> &Value, unit: f64| -> Vec<Deviation> {
        let deviation = |(own, expected): &(&Window, &Window)| {
            let value = get(own);
            let least = MIN_WIDTH * own.damping_ratio.value.abs() * unit;
            Deviation {
                amplitude_m: own.amplitude_m,
                value: value.value,
                from_model: value.value - get(expected).value,
                uncertainty: value.standard_uncertainty.hypot(least),
            }
        };
        pairs.iter().map(deviation).collect()
    };
    let (damping, frequency) = (of(|w| &w.damping_ratio, 1.0), of(|w| &w.natural_frequency_hz, compared.frequency_hz));
    let of_noise = compared.record.noise_freedom;
    let mut misfits = Vec::new();
    misfits.extend(trend(&damping, of_noise).map(Misfit::Damping));
    misfits.extend(trend(&frequency, of_noise).map(Misfit::Frequency));
    let fitted = 2 + usize::from(compared.coulomb.is_some());
    let both = chi_square(&damping, 0.0) + chi_square(&frequency, 0.0);
    let is_scattered = both > most_chi_square(2 * pairs.len() - fitted, of_noise)
        || [&damping, &frequency].iter().any(|all| chi_square(all, 0.0) > most_chi_square(all.len(), of_noise));
    if is_scattered && misfits.is_empty() {
        misfits.push(Misfit::Scatter);
    }
    if let Some(friction) = compared.coulomb.filter(|c| c.value < -APART * c.standard_uncertainty) {
        misfits.push(Misfit::NegativeFriction(-friction.value / friction.standard_uncertainty));
    }
    if let Some([own, expected]) = compared.decrements
        && (own.value - expected.value).abs() > APART * own.standard_uncertainty.hypot(expected.standard_uncertainty)
    {
        misfits.push(Misfit::Decrement([own.value, expected.value]));
    }
    let beside = [vibration(compared), drift(record, of_noise), spikes(&compared.record.residuals_m)];
    misfits.extend(beside.into_iter().flatten().filter(|misfit| misfit.length_m() > MIN_SWING * compared.swing_m));
    let (first, second) = damping.split_at(damping.len() / 2);
    (!misfits.is_empty()).then(|| LackOfFit {
        misfits,
        damping_ratio: beyond_noise(&damping),
        natural_frequency_hz: beyond_noise(&frequency),
        halves: [first, second].map(|half| weighted_mean(half, |d| d.value)),
    })
}

/// A window's value beside the model's.
struct Deviation {
    amplitude_m: f64,
    value: f64,
    from_model: f64,
    uncertainty: f64,
}

fn chi_square(all: &[Deviation], mean: f64) -> f64 {
    all.iter().map(|d| ((d.from_model - mean) / d.uncertainty).powi(2)).sum()
}

/// The sum of this many squared ratios that one of a thousand exceeds, where `of_noise` are the degrees of freedom of the noise in all of them:
/// ν times the quantile of the F distribution, by Paulson's approximation.
pub fn most_chi_square(count: usize, of_noise: f64) -> f64 {
    most_of(count, of_noise, TAIL)
}

/// The same for the upper tail beyond another quantile of the normal distribution.
pub(super) fn most_of(count: usize, of_noise: f64, tail: f64) -> f64 {
    let nu = count.max(1) as f64;
    let (own, of_noise) = (2.0 / (9.0 * nu), 2.0 / (9.0 * of_noise.max(6.0)));
    let (a, b, square) = (1.0 - own, 1.0 - of_noise, tail * tail);
    let leading = b * b - square * of_noise;
    let root = (a * a * b * b - leading * (a * a - square * own)).sqrt();
    nu * ((a * b + root) / leading).powi(3)
}

fn weighted_mean(all: &[Deviation], get: impl Fn(&Deviation) -> f64) -> f64 {
    let weight = |d: &Deviation| d.uncertainty.powi(-2);
    all.iter().map(|d| weight(d) * get(d)).sum::<f64>() / all.iter().map(weight).sum::<f64>()
}

fn beyond_noise(all: &[Deviation]) -> f64 {
    all.iter().map(|d| (d.from_model.powi(2) - d.uncertainty.powi(2)).max(0.0).sqrt()).fold(0.0, f64::max)
}

/// How the values go with the amplitude, where that explains deviations that are no noise: a line over a, ln a or 1/a.
fn trend(all: &[Deviation], of_noise: f64) -> Option<Trend> {
    let deviations: Vec<f64> = all.iter().map(|d| d.from_model).collect();
    let whole = chi_square(all, weighted_mean(all, |d| d.from_model));
    if whole <= most_chi_square(all.len() - 1, of_noise) {
        return None;
    }
    let left = |of: fn(f64) -> f64| {
        let places: Vec<f64> = all.iter().map(|d| of(d.amplitude_m)).collect();
        let line = line(&places, &deviations, |n| all[n].uncertainty.powi(-2))?;
        let at = |n: usize| line.intercept.value + line.slope.value * places[n];
        Some((0..all.len()).map(|n| ((deviations[n] - at(n)) / all[n].uncertainty).powi(2)).sum::<f64>())
    };
    let [by_a, by_log, by_inverse] = [left(|a| a)?, left(f64::ln)?, left(f64::recip)?];
    if by_a.min(by_log).min(by_inverse) > (1.0 - EXPLAINED) * whole {
        return None;
    }
    let ends = |is_larger: bool| {
        let sign = if is_larger { 1.0 } else { -1.0 };
        let end = all.iter().max_by(|a, b| (sign * a.amplitude_m).total_cmp(&(sign * b.amplitude_m)));
        end.map(|d| (d.value, d.amplitude_m))
    };
    Some(Trend { smallest: ends(false)?, largest: ends(true)?, is_inverse: by_inverse < by_a.min(by_log) })
}

/// A zero that moves from window to window.
fn drift(windows: &[Window], of_noise: f64) -> Option<Misfit> {
    let zeros: Vec<Deviation> = windows
        .iter()
        .map(|w| Deviation {
            amplitude_m: w.amplitude_m,
            value: w.zero_m.value,
            from_model: w.zero_m.value,
            uncertainty: w.zero_m.standard_uncertainty,
        })
        .collect();
    if chi_square(&zeros, weighted_mean(&zeros, |d| d.value)) <= most_chi_square(zeros.len() - 1, of_noise) {
        return None;
    }
    let (low, high) = zeros.iter().fold((f64::MAX, f64::MIN), |(low, high), d| (low.min(d.value), high.max(d.value)));
    Some(Misfit::Drift(high - low))
}

/// Readings far beyond the noise, which is taken without what is slow. Noise without a fast part hides no spike, but shows none either:
/// a filter has made all of it slow.
fn spikes(residuals_m: &[f64]) -> Option<Misfit> {
    let fast: Vec<f64> = residuals_m.windows(3).map(|w| (w[1] - 0.5 * (w[0] + w[2])).abs()).collect();
    let median = |sizes: &mut Vec<f64>| {
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied()
    };
    let of_fast = median(&mut fast.clone())?;
    let of_all = median(&mut residuals_m.iter().map(|r| r.abs()).collect())?;
    let largest_m = fast.iter().fold(0.0, |most: f64, size| most.max(*size));
    let count = fast.iter().filter(|size| **size > SPIKE.0 * of_fast / 0.6745).count();
    (of_fast > FAST * of_all && count >= SPIKE.1).then_some(Misfit::Spikes(count, largest_m))
}

/// The strongest line in the spectrum of what the windows leave of the record and not of the model, away from what they fit.
fn vibration(compared: &Compared) -> Option<Misfit> {
    let (record, model) = (&compared.record.residuals_m, &compared.model.residuals_m);
    let left: Vec<f64> = record.iter().zip(model).map(|(own, expected)| own - expected).collect();
    let power = power(&left);
    let width_hz = 1.0 / (left.len() as f64 * compared.step_s);
    let reach = LINES.0;
    let sum_about =
        |n: usize, reach: usize| power[n.saturating_sub(reach)..(n + reach + 1).min(power.len())].iter().sum::<f64>();
    let sums: Vec<f64> = (0..power.len()).map(|n| sum_about(n, reach)).collect();
    // A window's own fit takes what is nearer to its harmonics than its resolution.
    let near_hz = 1.5 * compared.frequency_hz / compared.record.cycles as f64;
    let is_free = |n: usize| {
        let frequency_hz = n as f64 * width_hz;
        (0..=3).all(|harmonic| (frequency_hz - f64::from(harmonic) * compared.frequency_hz).abs() > near_hz)
    };
    let peak = (reach..sums.len()).filter(|n| is_free(*n)).max_by(|a, b| sums[*a].total_cmp(&sums[*b]))?;
    // What leaks from a harmonic rises towards it.
    let about = peak.saturating_sub(4 * reach)..(peak + 4 * reach + 1).min(sums.len());
    if sums[about].iter().any(|sum| *sum > sums[peak]) {
        return None;
    }
    let background = peak.saturating_sub(LINES.1)..(peak + LINES.1).min(sums.len());
    let mut background: Vec<f64> =
        background.filter(|n| n.abs_diff(peak) > 4 * reach && is_free(*n)).map(|n| sums[n]).collect();
    background.sort_by(f64::total_cmp);
    let median = *background.get(background.len() / 2)?;
    // A line that decays is broader than the lines that are summed.
    let share = sum_about(peak, 4 * reach) / power.iter().sum::<f64>();
    let rms_m = (share * left.iter().map(|r| r * r).sum::<f64>() / left.len() as f64).sqrt();
    let found = Misfit::Vibration(peak as f64 * width_hz, share, rms_m);
    (sums[peak] > LINE.1 * median && share > LINE.0).then_some(found)
}

impl LackOfFit {
    /// Whether another method of this module contradicts the fitted damping ratio or frequency.
    #[must_use]
    pub fn contradicts(&self) -> bool {
        let beside = |misfit: &Misfit| matches!(misfit, Misfit::Vibration(..) | Misfit::Drift(_) | Misfit::Spikes(..));
        !self.misfits.iter().all(beside)
    }

    /// A value of the fit with the model's error as a part of its uncertainty: the interval then covers the deviation of every window.
    #[must_use]
    pub fn widened(value: &Value, deviation: f64) -> Value {
        value.widened(deviation / NORMAL_95)
    }

    /// What does not fit and what is likely the reason, a sentence each.
    #[must_use]
    pub fn sentences(&self, has_coulomb: bool) -> Vec<String> {
        self.misfits.iter().map(|misfit| self.sentence(misfit, has_coulomb)).collect()
    }

    fn sentence(&self, misfit: &Misfit, has_coulomb: bool) -> String {
        let goes = |trend: &Trend| if trend.largest.0 > trend.smallest.0 { "rises" } else { "falls" };
        match misfit {
            Misfit::Damping(trend) => {
                let falls = trend.largest.0 < trend.smallest.0;
                let why = match (falls, trend.is_inverse, has_coulomb) {
                    (true, true, false) => "; dry friction does this: fit it (leave out --viscous)",
                    (false, ..) => {
                        "; losses in the air, in the material or in a joint do this, viscous and dry friction do not"
                    }
                    _ => "",
                };
                format!(
                    "the damping ratio {} with the amplitude, {} at {} and {} at {}{why}",
                    goes(trend),
                    damping(trend.smallest.0),
                    millimetres(trend.smallest.1),
                    damping(trend.largest.0),
                    millimetres(trend.largest.1)
                )
            }
            Misfit::Frequency(trend) => format!(
                "the frequency {} with the amplitude, {} at {} and {} at {}: the stiffness is not constant",
                goes(trend),
                hertz(trend.smallest.0),
                millimetres(trend.smallest.1),
                hertz(trend.largest.0),
                millimetres(trend.largest.1)
            ),
            Misfit::Scatter => format!(
                "damping and frequency differ over the record, by up to {} and {} from the fit, and not with the amplitude: a second \
                 mode near the first (a beat), a disturbance, or a sensor that is not linear",
                damping(self.damping_ratio),
                hertz(self.natural_frequency_hz)
            ),
            Misfit::NegativeFriction(deviations) => format!(
                "the friction that fits best would be negative, {deviations:.1} standard uncertainties below 0: the damping falls as the \
                 swings become smaller"
            ),
            Misfit::Decrement([own, expected]) => format!(
                "the logarithmic decrement gives the damping ratio {}, that of the fitted motion {}",
                damping(*own),
                damping(*expected)
            ),
            Misfit::Vibration(frequency_hz, share, _) => {
                let is_mains = MAINS_HZ.iter().any(|mains| (frequency_hz / mains - 1.0).abs() < 0.005);
                let what = if is_mains { "the mains, or a second mode" } else { "a second mode, or a disturbance" };
                format!(
                    "there is another vibration at {}, {:.0} % of what the fits of {} leave: {what}",
                    hertz(*frequency_hz),
                    100.0 * share,
                    "single windows"
                )
            }
            Misfit::Drift(length_m) => {
                format!("the zero of the sensor drifts by {} during the swings", millimetres(*length_m))
            }
            Misfit::Spikes(count, largest_m) => format!(
                "{count} readings stand out of the noise by up to {}: a loose cable or contact, or impacts",
                millimetres(*largest_m)
            ),
        }
    }
}

fn damping(ratio: f64) -> String {
    format!("{ratio:.5}")
}

fn hertz(frequency_hz: f64) -> String {
    format!("{frequency_hz:.4} Hz")
}

fn millimetres(length_m: f64) -> String {
    format!("{:.4} mm", length_m * 1e3)
}
