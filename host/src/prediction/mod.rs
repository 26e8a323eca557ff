//! Predicts the largest displacement of each set-up before the rig moves, and refuses those that exceed a limit. Records,
//! pulses and free vibrations are in [`transient`], responses that a loop keeps in [`loops`], the drive's range in [`drive`], the time that a bare structure needs to settle
//! in [`settling`], a stepped sine in [`stepped_sine`], forces on the walls in [`wall_force`], the simulated shaker and sensors in [`simulated_rig`].
//!
//! Each set-up is simulated through the campaign's points with the sampled driver in `f64`. The base motion is given as
//! cubics that match the sine's displacement and velocity at the ends of every step. The error of a cubic over a step h for
//! a sine of angular frequency Ω is at most (Ωh)⁴/384 of its amplitude: 2.5·10⁻⁷ with at least 64 steps a period. The
//! largest |x| is found between the steps too (`watch`). A period has a whole number of steps, so cycles are cut exactly.
//!
//! The work is bounded: a point that lasts very long is predicted up to [`Swing::predicted_s`].

pub mod drive;
pub mod loops;
pub mod settling;
pub mod simulated_rig;
mod stepped_sine;
pub mod transient;
pub mod wall_force;
pub(crate) mod watch;

use damprig_core::integrator::sampled::LARGEST_RATE_PER_STEP;
use damprig_core::io::{Invalid, TICK_HZ};
use damprig_core::twin::TwinConfig;
use rayon::prelude::*;

use crate::campaign::transient::two_digits_down;
use crate::campaign::{AroundPeak, Campaign, CampaignSetUp, SteppedSine};
use crate::failure::Failure;
use crate::input::Problem;
use loops::LoopPrediction;
use stepped_sine::{PredictedSweep, simulate, whole_cycles};
use transient::Expected;
pub use watch::contact_s;

/// The largest displacement of a set-up, over several starts of its particle where the start is not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Largest |x|, m.
    pub max_x_m: f64,
    /// Drive frequency at which it occurs, Hz.
    pub frequency_hz: f64,
    /// Largest force on the walls at −d and +d, N; 0 without an impact.
    pub wall_force_n: [f64; 2],
    /// Time of each point that was simulated, s, if that is less than the point takes.
    pub predicted_s: Option<f64>,
}

impl Swing {
    const NOTHING: Self = Self { max_x_m: 0.0, frequency_hz: 0.0, wall_force_n: [0.0; 2], predicted_s: None };

    /// The larger of both, in each respect.
    fn or(self, other: Self) -> Self {
        let larger = if other.max_x_m > self.max_x_m { other } else { self };
        Self {
            wall_force_n: wall_force::larger(self.wall_force_n, other.wall_force_n),
            predicted_s: [self.predicted_s, other.predicted_s].into_iter().flatten().reduce(f64::min),
            ..larger
        }
    }
}

/// The prediction for one set-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Position of the set-up in the campaign.
    pub set_up: usize,
    /// The largest displacement over all its points.
    pub swing: Swing,
}

/// The predicted frequency response of one experiment on one set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Position of the set-up in the campaign.
    pub set_up: usize,
    /// Position of the experiment in the campaign.
    pub experiment: usize,
    /// Drive frequency (Hz) and X/Z of each point: X is the mean over the cycles of the dwell of max |x|, Z the base amplitude as
    /// set; of a point that is measured until it is steady, in its last possible dwell. A point whose dwell is not predicted is left out.
    pub points: Vec<(f64, f64)>,
    /// The points around the predicted peak, which `points` has at its end; none without such points, or if a dwell of the grid is not
    /// predicted. The run measures them around the measured peak.
    pub around_peak: Option<AroundPeak>,
    /// Largest |x| in the dwells of its points, as the results measure it, m; `None` if a dwell is not predicted to its end.
    pub dwell_max_x_m: Option<f64>,
}

/// Steps in a period of the drive, at least.
const STEPS_PER_PERIOD: f64 = 64.0;

/// Steps for all points of a campaign together: about half a second of computing.
const MAX_STEPS: u64 = 1_200_000;

/// Steps that every point may have, however many there are: 175 s at 2.5 Hz, in 10 ms of computing.
const STEPS_PER_POINT: u64 = 28_000;

/// Simulations of a set-up in search of an amplitude that fits.
const MAX_TRIES: u64 = 30;

/// Share of the displacement limit that a prediction may reach; the rest is for noise, resolution and model error.
pub const USABLE: f64 = 0.98;

/// The predictions for all experiments of a campaign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CampaignPrediction {
    /// Of the set-ups in stepped sines that drive the base.
    pub swings: Vec<Prediction>,
    /// Of the experiments that keep the response, on their set-ups.
    pub held: Vec<LoopPrediction>,
    /// Of the stepped sines on their set-ups.
    pub responses: Vec<Response>,
    /// Of records, pulses and free vibrations.
    pub expected: Vec<Expected>,
}

impl CampaignPrediction {
    /// Predicts all experiments of a campaign.
    ///
    /// # Errors
    /// As [`predict`], [`loops::predict`] and [`transient::predict`].
    pub fn of(campaign: &Campaign) -> Result<Self, Failure> {
        let (swings, mut responses) = predict(campaign)?;
        let held = loops::predict(campaign)?;
        responses.extend(held.iter().flat_map(|own| own.responses(campaign)));
        responses.sort_by_key(|response| (response.set_up, response.experiment));
        Ok(Self { swings, held, responses, expected: transient::predict(campaign)? })
    }

    /// The largest displacement of each set-up over all its stepped sines, in the order of the campaign.
    #[must_use]
    pub fn largest(&self) -> Vec<Prediction> {
        let held = self.held.iter().map(|own| Prediction { set_up: own.set_up, swing: own.swing });
        let mut all: Vec<Prediction> = self.swings.iter().copied().chain(held).collect();
        all.sort_by_key(|prediction| prediction.set_up);
        let one = |same: &[Prediction]| {
            let swing = same[1..].iter().fold(same[0].swing, |largest, other| largest.or(other.swing));
            Prediction { set_up: same[0].set_up, swing }
        };
        all.chunk_by(|a, b| a.set_up == b.set_up).map(one).collect()
    }

    /// Refuses what would leave a limit, for a drive of ± `drive_m`; returns warnings.
    ///
    /// # Errors
    /// As [`check`], [`loops::check`], [`transient::check`], [`drive::check`] and [`wall_force::check`].
    pub fn check(&self, campaign: &Campaign, drive_m: f64) -> Result<Vec<String>, Failure> {
        check(campaign, &self.swings)?;
        let mut warnings = loops::check(campaign, &self.held)?;
        transient::check(campaign, &self.expected)?;
        drive::check(campaign, &self.expected, drive_m)?;
        warnings.extend(wall_force::check(campaign, &self.swings, &self.held, &self.expected)?);
        let times = self.largest().into_iter().map(|p| p.swing.predicted_s);
        let times = times.chain(self.expected.iter().map(|e| e.outlook.predicted_s)).flatten();
        if let Some(least_s) = times.reduce(f64::min) {
            let text = "long experiments are predicted in part only: the shortest part is the first";
            warnings.push(format!("{text} {} s", trim(least_s)));
        }
        Ok(warnings)
    }
}

/// Predicts every set-up that a stepped sine drives by its base, in the order of the campaign. Of one without a model max |x| is NaN, and there is
/// no response.
///
/// # Errors
/// A parameter that cannot be simulated, with the set-up's name.
pub fn predict(campaign: &Campaign) -> Result<(Vec<Prediction>, Vec<Response>), Failure> {
    let used = |i: &usize| campaign.experiments.iter().any(|e| e.base_driven().is_some() && e.set_ups.contains(i));
    let indices: Vec<usize> = (0..campaign.set_ups.len()).filter(used).collect();
    let predictions: Result<Vec<(Prediction, Vec<Response>)>, Failure> = indices
        .into_par_iter()
        .map(|set_up| {
            let it = &campaign.set_ups[set_up];
            let (swing, responses) = motion(campaign, set_up, it.base_amplitude_m)
                .map_err(|e| Failure::Input(format!("set-up {:?}: {e}", it.name)))?;
            Ok((Prediction { set_up, swing }, responses))
        })
        .collect();
    let (swings, responses): (Vec<Prediction>, Vec<Vec<Response>>) = predictions?.into_iter().unzip();
    Ok((swings, responses.concat()))
}

/// Refuses set-ups that would exceed the displacement limit, and gives the largest Z that would fit.
///
/// # Errors
/// One message for all of them, each with the line of the set-up's base amplitude.
pub fn check(campaign: &Campaign, predictions: &[Prediction]) -> Result<(), Failure> {
    let limit = campaign.rig.structure_limit_m();
    let [range_m, _] = campaign.rig.sensor_range_m();
    let base_m = USABLE * campaign.rig.base_limit_m();
    for prediction in predictions {
        let set_up = &campaign.set_ups[prediction.set_up];
        if set_up.base_amplitude_m > base_m {
            campaign.source.report(Problem {
                title: format!("set-up {:?} would leave the displacement limit of the base", set_up.name),
                span: set_up.base_amplitude_span.clone(),
                allowed: format!("at most {base_m} m may be used"),
                help: Some(format!("write {} = {}", set_up.amplitude_key(), set_up.amplitude_for(base_m))),
            });
            continue;
        }
        let is_beyond = prediction.swing.max_x_m > USABLE * limit;
        if !is_beyond {
            continue;
        }
        let fix = largest_fitting(campaign, prediction, limit);
        campaign.source.report(Problem {
            title: format!(
                "set-up {:?} would leave the displacement limit: predicted largest |x| = {:.1} mm at {} Hz, limit ±{} mm (sensor range ±{} mm)",
                set_up.name,
                prediction.swing.max_x_m * 1e3,
                prediction.swing.frequency_hz,
                trim(limit * 1e3),
                trim(f64::from(range_m) * 1e3),
            ),
            span: set_up.base_amplitude_span.clone(),
            allowed: format!("Z = {} mm is too large for this set-up", trim(set_up.base_amplitude_m * 1e3)),
            help: fix.map(|(z, swing)| {
                let (key, amplitude) = (set_up.amplitude_key(), set_up.amplitude_for(z));
                format!("write {key} = {amplitude} (predicted largest |x| = {:.1} mm at {} Hz)", swing.max_x_m * 1e3, swing.frequency_hz)
            }),
        });
    }
    campaign.source.verdict()
}

/// Up to six digits, no trailing zeros.
pub fn trim(value: f64) -> String {
    format!("{value:.3}").trim_end_matches('0').trim_end_matches('.').to_string()
}

/// The largest base amplitude of two digits that keeps the set-up within the limit, with its prediction.
///
/// |x| may not be monotonic in Z, so candidates are simulated one by one, downwards from the amplitude that would fit in
/// proportion.
fn largest_fitting(campaign: &Campaign, prediction: &Prediction, limit: f64) -> Option<(f64, Swing)> {
    let z = campaign.set_ups[prediction.set_up].base_amplitude_m;
    let mut candidate = two_digits_down(z * USABLE * limit / prediction.swing.max_x_m);
    for _ in 0..tries(steps_of(campaign, prediction.set_up)) {
        let swing = motion(campaign, prediction.set_up, candidate).ok()?.0;
        if swing.max_x_m <= USABLE * limit {
            return Some((candidate, swing));
        }
        candidate = two_digits_down(candidate * 0.97);
    }
    None
}

/// Tries that the bound on the work allows, when each takes this many steps.
fn tries(steps: u64) -> u64 {
    (2 * MAX_STEPS / steps.max(1)).clamp(1, MAX_TRIES)
}

/// Steps in a period of the drive.
fn steps_per_period(set_up: &CampaignSetUp, frequency_hz: f64) -> f64 {
    let structure = set_up.model().structure;
    let rate = structure.angular_frequency_rad_per_s().max(structure.damping_n_s_per_m / structure.mass_kg);
    // A tick at most where a soft wall or a tuned mass may need shorter flights: what the rig accepts is then predicted too.
    let by_tick = if TwinConfig::follows(&set_up.model()) { 0.0 } else { f64::from(TICK_HZ) / frequency_hz };
    STEPS_PER_PERIOD.max((rate / frequency_hz / LARGEST_RATE_PER_STEP).ceil()).max(by_tick.ceil())
}

/// Steps that each point of the campaign may have.
fn allowance(campaign: &Campaign) -> u64 {
    let points: usize =
        campaign.experiments.iter().map(|e| (e.frequencies_hz().len() + e.peak_points()) * e.set_ups.len()).sum();
    STEPS_PER_POINT.max(MAX_STEPS / points.max(1) as u64)
}

/// Steps of all points of a set-up, at most.
fn steps_of(campaign: &Campaign, set_up: usize) -> u64 {
    let own = campaign.experiments.iter().filter(|e| e.set_ups.contains(&set_up));
    let wanted = own.filter_map(|e| e.base_driven()).flat_map(|sine| {
        let steps =
            move |f: &f64| whole_cycles(sine, *f).iter().sum::<f64>() * steps_per_period(&campaign.set_ups[set_up], *f);
        // Those around the peak are somewhere in the grid.
        let around_peak = sine.frequencies_hz.iter().take(1).cycle().take(sine.peak_points());
        sine.frequencies_hz.iter().chain(around_peak).map(steps)
    });
    let most = allowance(campaign);
    wanted.map(|steps| (steps as u64).min(most)).sum()
}

/// The largest displacement of a set-up over all its stepped sines, and its responses.
fn motion(campaign: &Campaign, set_up: usize, base_amplitude_m: f64) -> Result<(Swing, Vec<Response>), Invalid> {
    let most_steps = allowance(campaign);
    let mut largest = Swing::NOTHING;
    let mut responses = Vec::new();
    for (experiment, own) in campaign.experiments.iter().enumerate() {
        let Some(sine) = own.base_driven().filter(|_| own.set_ups.contains(&set_up)) else { continue };
        let detection = &watch::detection(&campaign.rig.board.impacts);
        let starts = campaign.set_ups[set_up].starts();
        let budget = (most_steps / starts.len() as u64, detection);
        let simulated = |sine: &SteppedSine| -> Result<PredictedSweep, Invalid> {
            let all: Result<Vec<PredictedSweep>, Invalid> =
                starts.iter().map(|start| simulate(start, sine, base_amplitude_m, budget)).collect();
            Ok(PredictedSweep::of_starts(&all?))
        };
        let mut all = simulated(sine)?;
        let is_whole = all.points.len() == sine.frequencies_hz.len();
        let around_peak = (sine.peak_points() > 0 && is_whole).then(|| sine.around_peak(&all.points));
        if let Some(around) = &around_peak {
            let frequencies_hz = around.frequencies_hz.clone();
            all.add(simulated(&SteppedSine { frequencies_hz, ..sine.clone() })?);
        }
        largest = largest.or(all.swing);
        let dwell_max_x_m = all.swing.predicted_s.is_none().then_some(all.dwell_max_x_m);
        responses.push(Response { set_up, experiment, points: all.points, around_peak, dwell_max_x_m });
    }
    if !campaign.set_ups[set_up].is_predicted {
        return Ok((Swing { max_x_m: f64::NAN, ..Swing::NOTHING }, Vec::new()));
    }
    Ok((largest, responses))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

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
        let prediction = &predict(&bare(2.5)).unwrap().0[0];
        // 400 s leave e^(−24) of the start.
        let relative = prediction.swing.max_x_m / closed_form - 1.0;
        assert!(relative.abs() < 1e-6, "{relative}");
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
        let swing = predict(&bare(2.4)).unwrap().0[0].swing.max_x_m;
        // The closed form is looked at every millisecond, within 1 − cos(Ω/2 ms) of its peak.
        let miss = 1.0 - (0.5e-3 * drive).cos() + 1e-6;
        assert!((swing / highest - 1.0).abs() < miss, "{swing} {highest}");
    }

    #[test]
    fn a_suggested_amplitude_has_two_digits_and_fits() {
        for (value, expected) in [(0.000_712_9, 0.00071), (0.0015, 0.0015), (12.99, 12.0)] {
            assert_eq!(two_digits_down(value), expected);
        }
    }
}
