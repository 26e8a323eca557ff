//! Predicts the largest displacement of each set-up before the rig moves, and refuses those that exceed a limit. Records,
//! pulses and free vibrations are in [`transient`], the drive's range in [`drive`].
//!
//! Each set-up is simulated through the campaign's points with the sampled driver in `f64`. The base motion is given as
//! cubics that match the sine's displacement and velocity at the ends of every step. The error of a cubic over a step h for
//! a sine of angular frequency Ω is at most (Ωh)⁴/384 of its amplitude: 2.5·10⁻⁷ with at least 64 steps a period. The
//! largest |x| is taken at the steps: the error of a sine's peak is at most 1 − cos(π/64) = 0.12 %, within the 2 % margin
//! ([`USABLE`]).

pub mod drive;
pub mod transient;

use std::f64::consts::TAU;

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::sampled::{LARGEST_RATE_PER_STEP, Sampled};
use damprig_core::integrator::units::Units;
use damprig_core::io::Invalid;
use damprig_core::model::Initial;
use rayon::prelude::*;

use crate::campaign::transient::two_digits_down;
use crate::campaign::{Campaign, CampaignSetUp, Start, SteppedSine};
use crate::input::{Problem, Refusal};

/// The largest displacement of a set-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Largest |x|, m.
    pub max_x_m: f64,
    /// Drive frequency at which it occurs, Hz.
    pub frequency_hz: f64,
}

/// The prediction for one set-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Position of the set-up in the campaign.
    pub set_up: usize,
    /// The largest displacement over all its points.
    pub swing: Swing,
}

/// Steps in a period of the drive, at least.
const STEPS_PER_PERIOD: f64 = 64.0;

/// Share of the displacement limit that a prediction may reach; the rest is for noise, resolution and model error.
pub const USABLE: f64 = 0.98;

/// Predicts every set-up that a stepped sine uses, in the order of the campaign.
///
/// # Errors
/// A parameter that cannot be simulated, with the set-up's name.
pub fn predict(campaign: &Campaign) -> Result<Vec<Prediction>, Refusal> {
    let used = |i: &usize| campaign.experiments.iter().any(|e| e.stepped_sine().is_some() && e.set_ups.contains(i));
    let indices: Vec<usize> = (0..campaign.set_ups.len()).filter(used).collect();
    let predictions: Result<Vec<Prediction>, Refusal> = indices
        .into_par_iter()
        .map(|set_up| {
            let it = &campaign.set_ups[set_up];
            let swing = swing(campaign, set_up, it.base_amplitude_m);
            swing.map(|swing| Prediction { set_up, swing }).map_err(|e| Refusal(format!("set-up {:?}: {e}", it.name)))
        })
        .collect();
    predictions
}

/// Refuses set-ups that would exceed the displacement limit, and gives the largest Z that would fit.
///
/// # Errors
/// One message for all of them, each with the line of the set-up's base amplitude.
pub fn check(campaign: &Campaign, predictions: &[Prediction]) -> Result<(), Refusal> {
    let limit = campaign.rig.structure_limit_m();
    let [range_m, _] = campaign.rig.sensor_range_m();
    for prediction in predictions {
        if prediction.swing.max_x_m <= USABLE * limit {
            continue;
        }
        let set_up = &campaign.set_ups[prediction.set_up];
        let fix = largest_fitting(campaign, prediction, limit);
        campaign.source.report(Problem {
            title: format!(
                "set-up {:?} would leave the displacement limit: predicted max|x| = {:.1} mm at {} Hz, limit ±{} mm (sensor range ±{} mm)",
                set_up.name,
                prediction.swing.max_x_m * 1e3,
                prediction.swing.frequency_hz,
                trim(limit * 1e3),
                trim(f64::from(range_m) * 1e3),
            ),
            span: set_up.base_amplitude_span.clone(),
            allowed: format!("Z = {} mm is too large for this set-up", trim(set_up.base_amplitude_m * 1e3)),
            help: fix.map(|(z, swing)| {
                format!("write base_amplitude_m = {z} (predicted max|x| = {:.1} mm at {} Hz)", swing.max_x_m * 1e3, swing.frequency_hz)
            }),
        });
    }
    campaign.source.verdict()
}

/// Up to six digits, no trailing zeros.
fn trim(value: f64) -> String {
    format!("{value:.3}").trim_end_matches('0').trim_end_matches('.').to_string()
}

/// The largest base amplitude of two digits that keeps the set-up within the limit, with its prediction.
///
/// |x| may not be monotonic in Z, so candidates are simulated one by one, downwards from the amplitude that would fit in
/// proportion.
fn largest_fitting(campaign: &Campaign, prediction: &Prediction, limit: f64) -> Option<(f64, Swing)> {
    let z = campaign.set_ups[prediction.set_up].base_amplitude_m;
    let mut candidate = two_digits_down(z * USABLE * limit / prediction.swing.max_x_m);
    for _ in 0..30 {
        let swing = swing(campaign, prediction.set_up, candidate).ok()?;
        if swing.max_x_m <= USABLE * limit {
            return Some((candidate, swing));
        }
        candidate = two_digits_down(candidate * 0.97);
    }
    None
}

fn swing(campaign: &Campaign, set_up: usize, base_amplitude_m: f64) -> Result<Swing, Invalid> {
    let mut largest = Swing { max_x_m: 0.0, frequency_hz: 0.0 };
    for experiment in campaign.experiments.iter().filter(|e| e.set_ups.contains(&set_up)) {
        let Some(sine) = experiment.stepped_sine() else { continue };
        let swing = simulate(&campaign.set_ups[set_up], sine, base_amplitude_m)?;
        if swing.max_x_m > largest.max_x_m {
            largest = swing;
        }
    }
    Ok(largest)
}

/// One experiment on one set-up with base amplitude Z.
fn simulate(set_up: &CampaignSetUp, experiment: &SteppedSine, base_amplitude_m: f64) -> Result<Swing, Invalid> {
    let model = set_up.spec.at(base_amplitude_m);
    let initial = Initial { y_m: set_up.spec.particle_start_m(base_amplitude_m), ..Initial::default() };
    let rate =
        model.structure.angular_frequency_rad_per_s().max(model.structure.damping_n_s_per_m / model.structure.mass_kg);
    let mut largest = Swing { max_x_m: 0.0, frequency_hz: 0.0 };
    let mut carried: Option<Initial> = None;
    for &frequency_hz in &experiment.frequencies_hz {
        let steps = STEPS_PER_PERIOD.max((rate / frequency_hz / LARGEST_RATE_PER_STEP).ceil());
        let step_s = 1.0 / (frequency_hz * steps);
        let mut motion = Sampled::<f64>::new(&model, Units::metres(step_s), &carried.take().unwrap_or(initial))?;
        let count = ((experiment.settle_s + experiment.dwell_s) / step_s).ceil() as u64;
        let at = |step: u64| {
            let angle = TAU * (step as f64 % steps) / steps;
            (base_amplitude_m * angle.sin(), base_amplitude_m * angle.cos() * TAU / steps)
        };
        let mut start = at(0);
        for step in 0..count {
            let end = at(step + 1);
            motion.step(&BaseSegment::hermite(start.0, end.0, start.1, end.1), &mut ());
            start = end;
            let x = motion.state().x.abs();
            if x > largest.max_x_m {
                largest = Swing { max_x_m: x, frequency_hz };
            }
        }
        if experiment.start == Start::CarryOver {
            let state = motion.state();
            let (v, slide) = (state.v / step_s, state.slide / step_s);
            let y_m = state.x + state.offset;
            carried = Some(Initial { x_m: state.x, v_m_per_s: v, y_m, u_m_per_s: v + slide });
        }
    }
    Ok(largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Source;

    fn bare(frequency_hz: f64) -> Campaign {
        let text = format!(
            "name = \"t\"\n[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.0038\n\
             [[set_up]]\nname = \"bare\"\nbase_amplitude_m = 0.0004\n\
             [[experiment]]\nkind = \"stepped_sine\"\nfrequencies_hz = [{frequency_hz}]\nstart = \"from_rest\"\ndwell_s = 400\n"
        );
        Campaign::parse(Source::new("t.toml", text)).unwrap()
    }

    #[test]
    fn the_bare_structure_at_resonance_reaches_its_closed_form() {
        let zeta = 0.0038f64;
        let closed_form = 0.0004 * (1.0 + 4.0 * zeta * zeta).sqrt() / (2.0 * zeta);
        let prediction = predict(&bare(2.5)).unwrap()[0];
        // 400 s leave e^(−24) of the start; the steps miss a peak by at most 1 − cos(π/64).
        let miss = 1.0 - (std::f64::consts::PI / 64.0).cos() + 1e-6;
        let relative = prediction.swing.max_x_m / closed_form - 1.0;
        assert!(relative < 1e-6 && relative > -miss, "{relative}");
    }

    #[test]
    fn off_resonance_the_beat_of_the_start_is_part_of_the_swing() {
        let (z, zeta, natural, drive) = (0.0004, 0.0038f64, TAU * 2.5, TAU * 2.4);
        let (r, damped) = (drive / natural, natural * (1.0 - zeta * zeta).sqrt());
        // Forced part p sin Ωt + q cos Ωt, and the free part that makes x(0) = x′(0) = 0.
        let (a, b) = (1.0 - r * r, 2.0 * zeta * r);
        let (p, q) = (z * (a + b * b) / (a * a + b * b), z * (a * b - b) / (a * a + b * b));
        let sine = -(p * drive + zeta * natural * q) / damped;
        let x = |t: f64| {
            let free = (-zeta * natural * t).exp() * (sine * (damped * t).sin() - q * (damped * t).cos());
            p * (drive * t).sin() + q * (drive * t).cos() + free
        };
        let highest = (0..400_000).map(|i| x(f64::from(i) * 1e-3).abs()).fold(0.0, f64::max);
        let swing = predict(&bare(2.4)).unwrap()[0].swing.max_x_m;
        let miss = 1.0 - (std::f64::consts::PI / 64.0).cos() + 1e-4;
        assert!((swing / highest - 1.0).abs() < miss, "{swing} {highest}");
    }

    #[test]
    fn a_suggested_amplitude_has_two_digits_and_fits() {
        for (value, expected) in [(0.000_712_9, 0.00071), (0.0015, 0.0015), (12.99, 12.0)] {
            assert_eq!(two_digits_down(value), expected);
        }
    }
}
