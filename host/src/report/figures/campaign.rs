//! The figures of a campaign: X/Z and phase over frequency, x over time.

use std::collections::BTreeMap;
use std::path::Path;

use super::frequency_response::{Ordinate, ResponseCurve, ResponseNotes, ResponsePoint, draw};
use super::time_histories::{self, HistoryCurve, HistoryPanel};
use crate::campaign::{Campaign, CampaignSetUp, Experiment, ExperimentKind, PointStart};
use crate::failure::Failure;
use crate::report::describe;
use crate::report::numbers::trimmed;
use crate::report::peak::Peak;
use crate::report::plot::axis::Scale;
use crate::report::plot::palette::Look;
use crate::report::plot::{Breadth, Picture};
use crate::run_folder::ResultRow;
use crate::run_folder::RunFolder;
use crate::run_folder::schema::impacts::Impacts;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::transients::TransientRow;
use crate::table::values::{numbers, texts};

const X_OVER_Z: &str = "Vibration amplitude ratio X/Z (cycle maxima)";
const ABOUT_X_OVER_Z: &str = "X: mean of the cycle maxima of |x|; Z: lock-in amplitude of the base";

/// Most curves of one figure on a page.
const MAX_CURVES: usize = 12;

/// The figures of each kind that a page shows: one with all curves, or one for each experiment (with its repeats) if that would be
/// too many curves.
#[must_use]
pub fn groups(campaign: &Campaign) -> Vec<Option<String>> {
    if series_of(campaign).count() <= MAX_CURVES {
        return vec![None];
    }
    let sines = campaign.experiments.iter().filter(|e| e.base_driven().is_some());
    let mut series: Vec<Option<String>> = sines.map(|e| Some(e.series.clone())).collect();
    series.dedup();
    series
}

/// X/Z (cycle maxima) over frequency, a curve for each experiment on each set-up; of one group ([`groups`]) or of all.
#[must_use]
pub fn response(campaign: &Campaign, points: &[ResultRow], group: Option<&str>, breadth: Breadth) -> Picture {
    let quantity = Ordinate { label: X_OVER_Z, rings_peaks: true, scale: Scale::Log };
    curves(campaign, (points, group), (&quantity, ABOUT_X_OVER_Z), breadth, x_over_z)
}

/// X/Z of a point, and the half-width of its interval.
fn x_over_z(point: &ResultRow) -> (f64, f64) {
    (point.x_over_z(), f64::from(point.interval) * point.x_over_z())
}

/// A run in a figure of several: its name, its campaign, its points.
pub type PlottedRun<'a> = (&'a str, &'a Campaign, &'a [ResultRow]);

/// X/Z (cycle maxima) over frequency of several runs: one figure without a name, or one for each set-up, by its name, if that would be too
/// many curves; none without a point.
#[must_use]
pub fn responses_of_runs(runs: &[PlottedRun], breadth: Breadth) -> Vec<(Option<String>, Picture)> {
    let all = curves_of_runs(runs, None);
    let mut names: Vec<&str> = Vec::new();
    for set_up in runs.iter().flat_map(|(_, campaign, _)| &campaign.set_ups) {
        if !names.contains(&set_up.name.as_str()) {
            names.push(&set_up.name);
        }
    }
    let groups = if all.len() <= MAX_CURVES {
        vec![(None, all)]
    } else {
        names.iter().map(|name| (Some((*name).to_string()), curves_of_runs(runs, Some(name)))).collect()
    };
    let common = common_natural_hz(runs.iter().map(|(_, campaign, _)| *campaign));
    let quantity = Ordinate { label: X_OVER_Z, rings_peaks: true, scale: Scale::Log };
    let drawn = |(name, curves): (Option<String>, Vec<ResponseCurve>)| {
        let notes = ResponseNotes { natural_frequency_hz: common, caption: format!("{ABOUT_X_OVER_Z}.") };
        (name, draw(&curves, &quantity, &notes, breadth))
    };
    groups.into_iter().filter(|(_, curves)| !curves.is_empty()).map(drawn).collect()
}

/// The curves of X/Z of several runs; of one set-up, or of all.
fn curves_of_runs(runs: &[PlottedRun], set_up: Option<&str>) -> Vec<ResponseCurve> {
    let mut curves: Vec<ResponseCurve> = Vec::new();
    // A set-up has the same colour in every run, and its curves have different dashes.
    let mut set_ups: Vec<(&str, usize)> = Vec::new();
    for (name, campaign, points) in runs {
        let points: Vec<ResultRow> =
            points.iter().filter(|point| set_up.is_none_or(|set_up| point.set_up == set_up)).cloned().collect();
        for curve in response_curves(campaign, (&points, None), x_over_z) {
            let of = &campaign.set_ups[curve.look.set_up].name;
            let known = set_ups.iter().position(|(name, _)| name == of);
            let known = known.unwrap_or_else(|| {
                set_ups.push((of, 0));
                set_ups.len() - 1
            });
            let look = Look { set_up: known, run: set_ups[known].1 };
            set_ups[known].1 += 1;
            let label = format!("{name}: {}", curve.label);
            curves.push(ResponseCurve { place: curves.len(), look, label, ..curve });
        }
    }
    curves
}

/// Phase of x relative to z over frequency, as [`response`].
#[must_use]
pub fn phase(campaign: &Campaign, points: &[ResultRow], group: Option<&str>, breadth: Breadth) -> Picture {
    // Above resonance x lags by 180°, where the phase must not wrap.
    let unbroken = |degrees: f64| if degrees > 90.0 { degrees - 360.0 } else { degrees };
    let quantity = Ordinate { label: "Phase of x relative to z (°)", rings_peaks: false, scale: Scale::Linear };
    let about = "Phase: lock-in at the drive frequency over the dwell";
    let value = |p: &ResultRow| (unbroken(f64::from(p.phase_rad).to_degrees()), f64::NAN);
    curves(campaign, (points, group), (&quantity, about), breadth, value)
}

/// Largest force on a wall over frequency, as [`response`], for the points that had impacts; `None` without any.
#[must_use]
pub fn wall_force(campaign: &Campaign, taken: &JournalState, group: Option<&str>, breadth: Breadth) -> Option<Picture> {
    let mut forces_n: BTreeMap<(&str, &str, u64), f64> = BTreeMap::new();
    for row in taken.rows() {
        let is_own = |some: &&Impacts| {
            (&some.id.set_up, &some.id.experiment, some.id.segment) == (&row.set_up, &row.experiment, row.segment)
        };
        let impacts = taken.impacts.iter().filter(is_own).flat_map(|some| &some.impacts);
        let in_dwell = impacts.filter(|impact| (row.start_tick..row.end_tick).contains(&u64::from(impact.tick)));
        if let Some(force_n) = in_dwell.map(|impact| f64::from(impact.peak_n)).reduce(f64::max) {
            forces_n.insert((&row.set_up, &row.experiment, row.frequency_hz.to_bits()), force_n);
        }
    }
    let force = |p: &ResultRow| forces_n.get(&(&p.set_up, &p.experiment, p.frequency_hz.to_bits())).copied();
    let is_own =
        |p: &ResultRow| group.is_none_or(|group| experiments_of(campaign, group).any(|e| e.name == p.experiment));
    let points: Vec<ResultRow> = taken.rows().iter().filter(|p| force(p).is_some() && is_own(p)).cloned().collect();
    if points.is_empty() {
        return None;
    }
    let quantity = Ordinate { label: "Largest force on a wall (N)", rings_peaks: false, scale: Scale::Log };
    let about = "Largest peak of a wall's force in the dwell, as the board measured it";
    let value = |p: &ResultRow| (force(p).unwrap_or(f64::NAN), f64::NAN);
    Some(curves(campaign, (&points, group), (&quantity, about), breadth, value))
}

/// Every set-up with each of its stepped sines that drive the base, in the order of the campaign.
pub fn stepped_sines(campaign: &Campaign) -> impl Iterator<Item = (&CampaignSetUp, &Experiment)> {
    campaign.set_ups.iter().enumerate().flat_map(|(index, set_up)| {
        let own = campaign.experiments.iter();
        own.filter(move |e| e.base_driven().is_some() && e.set_ups.contains(&index)).map(move |e| (set_up, e))
    })
}

/// As [`stepped_sines`], with the repeats of an experiment once.
fn series_of(campaign: &Campaign) -> impl Iterator<Item = (&CampaignSetUp, &Experiment)> {
    stepped_sines(campaign).filter(|(_, experiment)| experiment.repeat == 0)
}

/// Label of the set-up, with the experiment's name if there are several on it.
fn label(campaign: &Campaign, set_up: &CampaignSetUp, experiment: &Experiment) -> String {
    let own = series_of(campaign).filter(|(other, _)| other.name == set_up.name).count();
    let label = if own > 1 { format!("{}: {}", set_up.label, experiment.series) } else { set_up.label.clone() };
    shortened(&label)
}

/// How an experiment on a set-up looks in every figure.
pub(super) fn look_of(campaign: &Campaign, set_up: &CampaignSetUp, experiment: &Experiment) -> Look {
    let own = series_of(campaign).filter(|(other, _)| other.name == set_up.name);
    let run = own.take_while(|(_, other)| other.series != experiment.series).count();
    Look { set_up: place_of(campaign, set_up), run }
}

/// The place of a set-up in its campaign, which gives its colour.
pub fn place_of(campaign: &Campaign, set_up: &CampaignSetUp) -> usize {
    campaign.set_ups.iter().position(|other| other.name == set_up.name).unwrap_or(0)
}

/// An experiment with its repeats.
fn experiments_of<'a>(campaign: &'a Campaign, series: &'a str) -> impl Iterator<Item = &'a Experiment> {
    campaign.experiments.iter().filter(move |e| e.series == series)
}

/// The curves of a quantity that have points; `value` gives it with the half-width of its interval.
fn response_curves(
    campaign: &Campaign,
    (points, group): (&[ResultRow], Option<&str>),
    value: impl Fn(&ResultRow) -> (f64, f64),
) -> Vec<ResponseCurve> {
    let curve = |(place, (set_up, experiment)): (usize, (&CampaignSetUp, &Experiment))| ResponseCurve {
        place,
        look: look_of(campaign, set_up, experiment),
        label: label(campaign, set_up, experiment),
        detail: describe::set_up(set_up),
        points: means(campaign, points, (set_up, experiment), &value),
        unresolved_peak_hz: unresolved_peak_hz(campaign, points, (set_up, experiment)),
    };
    let drawn = series_of(campaign).filter(|(_, e)| group.is_none_or(|group| e.series == group));
    drawn.enumerate().map(curve).filter(|c| !c.points.is_empty()).collect()
}

/// Frequency (Hz) and X/Z (cycle maxima) of an experiment on a set-up, by their names; of its repeats the means. Empty for unknown names.
#[must_use]
pub fn mean_responses(campaign: &Campaign, points: &[ResultRow], set_up: &str, experiment: &str) -> Vec<(f64, f64)> {
    let set_up = campaign.set_ups.iter().find(|own| own.name == set_up);
    let experiment = campaign.experiments.iter().find(|own| own.name == experiment);
    let (Some(set_up), Some(experiment)) = (set_up, experiment) else { return Vec::new() };
    let points = means(campaign, points, (set_up, experiment), &x_over_z);
    points.iter().map(|p| (p.frequency_hz, p.value)).collect()
}

/// Frequency of the highest X/Z of an experiment on a set-up, Hz, if its peak is not resolved.
fn unresolved_peak_hz(
    campaign: &Campaign,
    points: &[ResultRow],
    (set_up, experiment): (&CampaignSetUp, &Experiment),
) -> Option<f64> {
    let points = mean_responses(campaign, points, &set_up.name, &experiment.name);
    let peak = Peak::measured(set_up, experiment, &points)?;
    (!peak.is_resolved()).then_some(peak.frequency_hz)
}

/// The points of an experiment on a set-up; of its repeats the mean at each frequency, settled if all are.
fn means(
    campaign: &Campaign,
    points: &[ResultRow],
    (set_up, experiment): (&CampaignSetUp, &Experiment),
    value: &impl Fn(&ResultRow) -> (f64, f64),
) -> Vec<ResponsePoint> {
    let names: Vec<&str> = experiments_of(campaign, &experiment.series).map(|e| e.name.as_str()).collect();
    let own = points.iter().filter(|p| p.set_up == set_up.name && names.contains(&p.experiment.as_str()));
    let mut all: Vec<ResponsePoint> = own
        .map(|p| {
            let (value, half_width) = value(p);
            let (frequency_hz, is_settled) = (p.frequency_hz, p.steadiness.is_settled());
            ResponsePoint { frequency_hz, value, is_settled, half_width, repeats: Vec::new() }
        })
        .collect();
    if names.len() == 1 {
        return all;
    }
    all.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let mean = |same: &[ResponsePoint]| match same {
        [one] => one.clone(),
        _ => ResponsePoint {
            frequency_hz: same[0].frequency_hz,
            value: same.iter().map(|p| p.value).sum::<f64>() / same.len() as f64,
            is_settled: same.iter().all(|p| p.is_settled),
            half_width: f64::NAN,
            repeats: same.iter().map(|p| p.value).collect(),
        },
    };
    all.chunk_by(|a, b| a.frequency_hz == b.frequency_hz).map(mean).collect()
}

/// A label of at most 48 characters: a longer one would leave no room for the curves.
pub(super) fn shortened(label: &str) -> String {
    const MAX: usize = 48;
    if label.chars().count() <= MAX {
        return label.to_string();
    }
    label.chars().take(MAX - 1).chain(['…']).collect()
}

/// The natural frequency of all set-ups, Hz, if it is the same.
fn common_natural_hz<'a>(campaigns: impl Iterator<Item = &'a Campaign>) -> Option<f64> {
    let natural: Vec<f64> = campaigns.flat_map(|c| &c.set_ups).map(CampaignSetUp::natural_frequency_hz).collect();
    natural.first().copied().filter(|first| natural.iter().all(|f| (f - first).abs() < 1e-9 * first))
}

fn curves(
    campaign: &Campaign,
    (points, group): (&[ResultRow], Option<&str>),
    (quantity, about): (&Ordinate, &str),
    breadth: Breadth,
    value: impl Fn(&ResultRow) -> (f64, f64),
) -> Picture {
    let curves = response_curves(campaign, (points, group), value);
    let common = common_natural_hz(std::iter::once(campaign));
    let drawn = campaign.experiments.iter().filter(|e| group.is_none_or(|group| e.series == group));
    let mut how: Vec<String> = drawn
        .filter_map(Experiment::base_driven)
        .map(|e| {
            let start = if e.start == PointStart::FromRest { "from rest" } else { "motion carried over" };
            let until = match e.longest_dwell_s() {
                longest_s if longest_s > e.dwell_s => format!(" until steady, up to {} s", trimmed(longest_s, 3)),
                _ => String::new(),
            };
            format!("{} s at each frequency{until}, {start}", trimmed(e.dwell_s, 3))
        })
        .collect();
    how.sort();
    how.dedup();
    let caption = format!("{about}. {}.", how.join("; "));
    draw(&curves, quantity, &ResponseNotes { natural_frequency_hz: common, caption }, breadth)
}

type Histories = BTreeMap<(String, String), Vec<(f64, f64)>>;

/// x over time of all playbacks, impulses and free vibrations; `None` if x was not recorded.
///
/// # Errors
/// Unreadable samples.
pub fn transients(campaign: &Campaign, folder: &Path, rows: &[TransientRow]) -> Result<Option<Picture>, Failure> {
    if rows.is_empty() {
        return Ok(None);
    }
    let run = RunFolder::open(folder).map_err(Failure::undrawn)?;
    let wanted: BTreeMap<(&str, &str), (String, u64, u64)> = rows
        .iter()
        .map(|r| ((r.set_up.as_str(), r.experiment.as_str()), (r.segment.to_string(), r.start_tick, r.end_tick)))
        .collect();
    let (mut x, mut z) = (Histories::new(), Histories::new());
    for batch in run.samples() {
        let batch = batch.map_err(Failure::undrawn)?;
        let names = (texts(&batch, "set_up"), texts(&batch, "experiment"), texts(&batch, "segment"));
        let (Ok(set_ups), Ok(experiments), Ok(segments)) = names else { continue };
        let (Ok(ticks), Ok(times)) = (numbers(&batch, "tick"), numbers(&batch, "t_s")) else { continue };
        for (column, into) in [("x_m", &mut x), ("z_m", &mut z)] {
            let Ok(values) = numbers(&batch, column) else { continue };
            for n in 0..values.len() {
                let Some((segment, start, end)) = wanted.get(&(set_ups[n].as_str(), experiments[n].as_str())) else {
                    continue;
                };
                if segments[n] == *segment && (*start as f64..*end as f64).contains(&ticks[n]) {
                    let key = (set_ups[n].clone(), experiments[n].clone());
                    into.entry(key).or_default().push((times[n], values[n]));
                }
            }
        }
    }
    let panels: Vec<HistoryPanel> = campaign
        .experiments
        .iter()
        .filter(|e| e.stepped_sine().is_none() && e.repeat == 0)
        .filter_map(|experiment| {
            // Time from the start of the experiment.
            let history = |all: &Histories, name: &str| -> Option<Vec<(f64, f64)>> {
                let points = all.get(&(name.to_string(), experiment.name.clone()))?;
                let from = points.first()?.0;
                Some(points.iter().map(|(t, value)| (t - from, *value)).collect())
            };
            let set_ups: Vec<_> = experiment.set_ups.iter().filter_map(|i| campaign.set_ups.get(*i)).collect();
            let curves: Vec<HistoryCurve> = set_ups
                .iter()
                .filter_map(|s| {
                    let look = Look { set_up: place_of(campaign, s), run: 0 };
                    Some(HistoryCurve { look, label: shortened(&s.label), points: history(&x, &s.name)? })
                })
                .collect();
            let base = experiment.playback().and(set_ups.first()).and_then(|s| history(&z, &s.name));
            let about = match &experiment.kind {
                ExperimentKind::Playback(playback) => playback.about.clone(),
                _ => "free vibration".into(),
            };
            (!curves.is_empty()).then(|| HistoryPanel { title: format!("{}: {about}", experiment.name), curves, base })
        })
        .collect();
    Ok((!panels.is_empty()).then(|| time_histories::draw(&panels)))
}
