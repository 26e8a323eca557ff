//! What to measure next: the points of a stepped sine that narrow the identified parameters most.
//!
//! A settled point measures ln(X/Z) with a relative standard uncertainty u. Its derivatives g by the parameters are those of the periodic
//! motion, exact through every event, so that it adds g·gᵀ/u² to the information on them, the inverse of their covariance. Points are added
//! one after another, each the one that makes the covariance's determinant (D-optimal) or the variance of one parameter smallest. The error of
//! the sensors' scale, which all points have in common, is a further parameter that no point is chosen for.

mod covariance;
mod point;
mod set_ups;

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

pub use covariance::ParameterCovariance;
pub use point::{CandidatePoint, SettledPoint};
pub use set_ups::{IdentifiedParameter, MeasurableSetUp};

use super::response::MIN_UNCERTAINTY;
use super::sensors;
use crate::campaign::{Campaign, CampaignSetUp};
use crate::failure::Failure;
use crate::prediction::USABLE;
use crate::run_folder::read::campaign_copy;
use crate::run_folder::{ResultRow, RunFolder};
use crate::setup::{Identified, SetUpFile};

/// Frequencies of a set-up, unless a step is stated: 200 steps over the band.
const STEPS: f64 = 200.0;

/// Most candidates.
const MOST: f64 = 20_000.0;

/// What is asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NextOptions {
    /// Number of points.
    pub points: usize,
    /// Key of the parameter to narrow; all together without one.
    pub key: Option<String>,
    /// Lowest and highest frequency, Hz; those of the run without them.
    pub from_hz: Option<f64>,
    /// The other end.
    pub to_hz: Option<f64>,
    /// Step of the frequencies, Hz.
    pub step_hz: Option<f64>,
}

/// A point to measure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextPoint {
    /// Its set-up.
    pub set_up: String,
    /// Z, m.
    pub base_amplitude_m: f64,
    /// Drive frequency, Hz.
    pub frequency_hz: f64,
    /// X/Z as the identified values predict it.
    pub x_over_z: f64,
    /// Relative standard uncertainty of its X/Z: the larger one of the run's neighbouring points.
    pub relative_uncertainty: f64,
    /// Standard uncertainty of each parameter after this point and those before it, in its unit.
    pub standard_uncertainties: Vec<f64>,
}

/// Points that are no candidates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOutPoints {
    /// Their set-up.
    pub set_up: String,
    /// Why.
    pub reason: &'static str,
    /// How many.
    pub points: usize,
}

impl std::fmt::Display for LeftOutPoints {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let points = if self.points == 1 { "point" } else { "points" };
        write!(f, "{}: {} {points} left out: {}", self.set_up, self.points, self.reason)
    }
}

/// What one point does.
#[derive(Clone, Debug, PartialEq)]
pub struct GainCurve {
    /// Name of the set-up.
    pub set_up: String,
    /// Its name in figures.
    pub label: String,
    /// Frequency, Hz, and the uncertainty after this point alone over that before; none of a point that is no candidate.
    pub points: Vec<(f64, Option<f64>)>,
}

/// The answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextPoints {
    /// The run.
    pub run: String,
    /// The file with the identified values.
    pub values_from: String,
    /// The key that is narrowed; all parameters together without one.
    pub key: Option<String>,
    /// The parameters.
    pub parameters: Vec<IdentifiedParameter>,
    /// The points, in the order in which they narrow most.
    pub points: Vec<NextPoint>,
    /// Points that were looked at.
    pub looked_at: usize,
    /// Those that cannot be used.
    pub left_out: Vec<LeftOutPoints>,
    /// What a person has to know.
    pub remarks: Vec<String>,
    /// What each point alone does, by set-ups.
    #[serde(skip)]
    pub gains: Vec<GainCurve>,
}

/// The relative standard uncertainty of a point's X/Z as the run states it; none of a point that did not settle.
fn uncertainty_of(row: &ResultRow) -> Option<f64> {
    let uncertainty = 0.5 * f64::from(row.deviation_uncertainty);
    let is_known = row.steadiness.is_settled() && uncertainty > 0.0 && uncertainty.is_finite();
    is_known.then(|| uncertainty.max(MIN_UNCERTAINTY))
}

/// The frequencies to look at, Hz.
fn frequencies(options: &NextOptions, rows: &[ResultRow], set_ups: usize) -> Result<Vec<f64>, Failure> {
    let all = || rows.iter().map(|row| row.frequency_hz);
    let (lowest_hz, highest_hz) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let (from_hz, to_hz) = (options.from_hz.unwrap_or(lowest_hz), options.to_hz.unwrap_or(highest_hz));
    if from_hz >= to_hz {
        return Err(Failure::Input(format!(
            "the band from {from_hz} Hz to {to_hz} Hz is empty\n  --from-hz must be less than --to-hz; their defaults are the run's lowest and \
             highest frequency"
        )));
    }
    if from_hz < 0.1 * lowest_hz || to_hz > 10.0 * highest_hz {
        return Err(Failure::Input(format!(
            "the band from {from_hz} Hz to {to_hz} Hz is far from that of the run, {lowest_hz} Hz to {highest_hz} Hz\n  --from-hz may be down to a \
             tenth of it, --to-hz up to ten times"
        )));
    }
    let step_hz = options.step_hz.unwrap_or((to_hz - from_hz) / STEPS);
    let steps = ((to_hz - from_hz) / step_hz * (1.0 + 1e-9)).floor();
    if (steps + 1.0) * set_ups as f64 > MOST {
        return Err(Failure::Input(format!(
            "--step-hz {step_hz} gives more than {MOST} points from {from_hz} Hz to {to_hz} Hz on {set_ups} set-ups\n  choose a larger step or a \
             narrower band"
        )));
    }
    Ok((0..=steps as u32).map(|n| from_hz + f64::from(n) * step_hz).collect())
}

/// Chooses the points to measure next on the set-ups of a run. `file`: the identified values; those of the run's campaign without one.
///
/// # Errors
/// A run without a campaign, settled points or identified values; a key that has none; an empty band; no point that could be used.
pub fn identify(path: &Path, file: Option<&Path>, options: &NextOptions) -> Result<NextPoints, Failure> {
    let run = RunFolder::open(path).map_err(Failure::input)?;
    let failed = |text: String| Failure::Input(format!("{}: {text}", path.display()));
    let rows = run.result_rows().map_err(|error| failed(error.to_string()))?;
    let mut campaign: Campaign = campaign_copy::campaign(path).map_err(Failure::input)?;
    let device = run.manifest().device.as_ref();
    if let Some(settings) = device.and_then(|device| device.settings.as_ref()) {
        // Limits were checked before the run.
        let _ = campaign.on_board(&settings.settings, device.is_some_and(|device| device.simulated));
    }
    let known = file.map(SetUpFile::read).transpose()?.or(campaign.set_up_file.take());
    let Some(known) = known else {
        return Err(failed(
            "its campaign names no set-up file with identified values\n  give one: `damprig identify … --out identified.toml`, then \
             --set-up-file identified.toml"
                .into(),
        ));
    };
    let can_be_used = |set_up: &&CampaignSetUp| !(set_up.has_unmodelled_damper || set_up.model().is_force_driven);
    let set_ups: Vec<&CampaignSetUp> = campaign.set_ups.iter().filter(can_be_used).collect();
    let (mut set_ups, parameters) = set_ups::measurable(&set_ups, &known.identified, file.is_some())
        .map_err(|error| Failure::Input(format!("{}: {error}", known.file)))?;
    if parameters.is_empty() {
        return Err(Failure::Input(format!(
            "{}: none of its identified values with an uncertainty is that of a set-up of {} on a moving base\n  `damprig identify … --out` writes \
             them; a campaign's own value overrides that of its set-up file, --set-up-file that of the campaign",
            known.file,
            path.display()
        )));
    }
    let place_of = |key: &String| parameters.iter().position(|parameter| parameter.key == *key);
    let only = match &options.key {
        Some(key) => Some(place_of(key).ok_or_else(|| {
            let keys: Vec<&str> = parameters.iter().map(|parameter| parameter.key.as_str()).collect();
            Failure::Input(format!(
                "--for {key}: it has no identified value with an uncertainty\n  one of {}",
                keys.join(", ")
            ))
        })?),
        None => None,
    };
    let least_known = rows.iter().filter_map(uncertainty_of).reduce(f64::max).ok_or_else(|| {
        failed(
            "it has no settled point of a stepped sine, whose uncertainty the next ones will have\n  settle longer (`steady`, `longest_dwell_s`)"
                .into(),
        )
    })?;
    for set_up in &mut set_ups {
        let own = rows.iter().filter(|row| row.set_up == set_up.name);
        set_up.measured = own.map(|row| (row.frequency_hz, uncertainty_of(row))).collect();
        if set_up.measured.is_empty() {
            set_up.measured.push((0.0, Some(least_known)));
        }
    }
    let frequencies = frequencies(options, &rows, set_ups.len())?;
    // X/Z has the errors of both scales.
    let scale = 2.0_f64.sqrt() * sensors::of_run(&run).scale;
    let limit_m = USABLE * campaign.rig.structure_limit_m();
    let places: Vec<(usize, f64)> =
        (0..set_ups.len()).flat_map(|set_up| frequencies.iter().map(move |hz| (set_up, *hz))).collect();
    let looked: Vec<Result<CandidatePoint, &'static str>> =
        places.par_iter().map(|at| set_ups[at.0].candidate(*at, &parameters, scale, limit_m)).collect();
    let left_out = left_out(&set_ups, &places, &looked);
    let before = ParameterCovariance::before(parameters.len(), only);
    let gains = gains(&set_ups, &frequencies, &looked, &before);
    let candidates: Vec<CandidatePoint> = looked.into_iter().filter_map(Result::ok).collect();
    if candidates.is_empty() {
        let why: Vec<String> = left_out.iter().map(|left| format!("\n  {left}")).collect();
        return Err(failed(format!("none of {} points can be used{}", places.len(), why.concat())));
    }
    let points = before.choose(&candidates, options.points).into_iter().map(|(n, known)| {
        let CandidatePoint { set_up, frequency_hz, x_over_z, relative_uncertainty, .. } = candidates[n];
        let MeasurableSetUp { name, base_amplitude_m, .. } = &set_ups[set_up];
        let after = known.shares().into_iter().zip(&parameters);
        let standard_uncertainties = after.map(|(share, of)| share * of.standard_uncertainty).collect();
        let (set_up, base_amplitude_m) = (name.clone(), *base_amplitude_m);
        NextPoint { set_up, base_amplitude_m, frequency_hz, x_over_z, relative_uncertainty, standard_uncertainties }
    });
    Ok(NextPoints {
        run: run.id(),
        key: options.key.clone(),
        points: points.collect(),
        looked_at: places.len(),
        left_out,
        remarks: remarks(&campaign, &known, &set_ups, &parameters, scale),
        gains,
        parameters,
        values_from: known.file,
    })
}

/// The points that are no candidates, by set-up and reason.
fn left_out(
    set_ups: &[MeasurableSetUp],
    places: &[(usize, f64)],
    looked: &[Result<CandidatePoint, &'static str>],
) -> Vec<LeftOutPoints> {
    let mut reasons: BTreeMap<(usize, &'static str), usize> = BTreeMap::new();
    for ((set_up, _), looked) in places.iter().zip(looked) {
        if let Err(reason) = looked {
            *reasons.entry((*set_up, *reason)).or_default() += 1;
        }
    }
    let of_reason = |((set_up, reason), points): ((usize, &'static str), usize)| {
        let set_up = set_ups[set_up].name.clone();
        LeftOutPoints { set_up, reason, points }
    };
    reasons.into_iter().map(of_reason).collect()
}

/// What each point alone narrows, by set-ups.
fn gains(
    set_ups: &[MeasurableSetUp],
    frequencies: &[f64],
    looked: &[Result<CandidatePoint, &'static str>],
    before: &ParameterCovariance,
) -> Vec<GainCurve> {
    let gain = |point: &CandidatePoint| before.after(&point.changes, point.relative_uncertainty).uncertainty();
    let of_set_up = |(set_up, own): (&MeasurableSetUp, &[Result<CandidatePoint, &'static str>])| {
        let points = frequencies.iter().zip(own).map(|(hz, looked)| (*hz, looked.as_ref().ok().map(gain)));
        GainCurve { set_up: set_up.name.clone(), label: set_up.label.clone(), points: points.collect() }
    };
    set_ups.iter().zip(looked.chunks(frequencies.len())).map(of_set_up).collect()
}

/// What a person has to know.
fn remarks(
    campaign: &Campaign,
    known: &SetUpFile,
    set_ups: &[MeasurableSetUp],
    all: &[IdentifiedParameter],
    scale: f64,
) -> Vec<String> {
    let mut remarks = vec![format!(
        "the uncertainty of a point is the larger one of the run's neighbouring points on its set-up, so it needs the same dwell; the error of the \
         sensors' scale, {:.3} %, is common to all points",
        100.0 * scale
    )];
    let is_used = |entry: &&Identified| all.iter().any(|parameter| parameter.key == entry.key);
    let unused: Vec<&str> =
        known.identified.iter().filter(|entry| !is_used(entry)).map(|entry| entry.key.as_str()).collect();
    if !unused.is_empty() {
        remarks.push(format!("not used: {} of {}; they count as exact", unused.join(", "), known.file));
    }
    let is_left_out = |set_up: &&CampaignSetUp| set_ups.iter().all(|other| other.name != set_up.name);
    let left_out: Vec<&str> = campaign.set_ups.iter().filter(is_left_out).map(|set_up| set_up.name.as_str()).collect();
    if !left_out.is_empty() {
        let text = "set-ups that are left out, since they have a damper without a model or are driven by a force";
        remarks.push(format!("{text}: {}", left_out.join(", ")));
    }
    remarks
}
