//! Compares a run with simulations of its own set-ups: on the base motion that the campaign commands, and on the one that the run
//! measured. Every quantity has an expanded uncertainty on both sides and a normalised error.
//!
//! Simulation and measurement cover the same ticks from the same start, and the board's own code measures both, so a point need not be
//! steady to be compared. `base` has the base motions, `motion` the simulation, `metric` the quantities, `uncertainty` that of
//! the sensors, `ensemble` that of the prediction. docs/COMPARE.md derives the uncertainties.

mod base;
mod ensemble;
pub mod metric;
mod motion;
mod point;
mod prediction;
mod recorded;
mod transient;
mod uncertainty;

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use damprig_core::measure::impacts::ImpactConfig;
use serde::Serialize;

use crate::campaign::{Campaign, CampaignSetUp, Experiment};
use crate::input::Source;
use crate::prediction::contact_s;
use crate::run_folder::RunFolder;
use crate::run_folder::journal::{self, JOURNAL};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::segment_id::SegmentId;
use ensemble::Models;
pub use metric::Metric;
use metric::{Values, WallKind, Walls};
use motion::{SimulatedMotion, TICK_S};
use prediction::Prediction;
use recorded::AllRecorded;
use uncertainty::Sensors;

/// Coverage factor of the expanded uncertainties: 95 % of a normal distribution.
pub const COVERAGE_FACTOR: f64 = 2.0;

/// Why nothing can be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CannotCompare {
    /// The run cannot be read, or has no results.
    #[error("{0}")]
    Run(String),
    /// The campaign with other set-ups is wrong, or does not fit the run.
    #[error("{0}")]
    Campaign(String),
    /// A person stopped the comparison.
    #[error("the comparison was interrupted")]
    Stopped,
}

/// What to compare with, and how to report progress.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Relative standard uncertainty of the scales of both displacement sensors; by default from the rig's data sheet, or assumed.
    pub scale_uncertainty: Option<f64>,
    /// Points that are done; grows while the comparison runs.
    pub done: &'a AtomicUsize,
    /// Set to stop the comparison.
    pub stop: &'a AtomicBool,
}

/// A run compared with its simulations.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Name of the run folder.
    pub run: String,
    /// Name of its campaign.
    pub campaign: String,
    /// How the run ended, in words.
    pub state: String,
    /// Where the simulated set-ups are from.
    pub set_ups_from: String,
    /// Program that compared.
    pub damprig: &'static str,
    /// Factor of the expanded uncertainties.
    pub coverage_factor: f64,
    /// What the uncertainties rest on, in words.
    pub assumptions: Vec<String>,
    /// What is not compared, and why.
    pub missing: Vec<String>,
    /// Files of the run that could not be read.
    pub unreadable: Vec<String>,
    /// Each experiment on each set-up, in the order of the campaign.
    pub experiments: Vec<ComparedExperiment>,
}

/// An experiment on a set-up.
#[derive(Clone, Debug, Serialize)]
pub struct ComparedExperiment {
    /// Name of the set-up.
    pub set_up: String,
    /// Its name for people.
    pub label: String,
    /// Name of the experiment.
    pub experiment: String,
    /// `stepped_sine`, `playback`, `impulse` or `free_vibration`.
    pub kind: &'static str,
    /// What has to be known about the comparison.
    pub notes: Vec<String>,
    /// Its points; one of a record, a pulse or a free vibration.
    pub points: Vec<ComparedPoint>,
}

/// A compared point.
#[derive(Clone, Debug, Serialize)]
pub struct ComparedPoint {
    /// Drive frequency, Hz; none without a drive frequency.
    pub frequency_hz: Option<f64>,
    /// Neighbouring starts part: maxima and time histories of two runs differ, their statistics are compared.
    pub is_sensitive: bool,
    /// Why the simulation on the measured base motion is missing.
    pub without_measured_base: Option<String>,
    /// What may explain a difference.
    pub remarks: Vec<String>,
    /// The quantities.
    pub metrics: Vec<ComparedMetric>,
    /// Measured less simulated x, tick by tick; none without samples of every tick.
    pub residual: Option<Residual>,
    /// Time histories for figures.
    #[serde(skip)]
    pub history: Option<History>,
}

impl ComparedPoint {
    /// A quantity of the point.
    #[must_use]
    pub fn metric(&self, metric: Metric) -> Option<&ComparedMetric> {
        self.metrics.iter().find(|own| own.metric == metric)
    }
}

/// A value with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Uncertain {
    /// The value, in the quantity's SI unit.
    pub value: f64,
    /// Expanded uncertainty, k = 2.
    pub expanded: f64,
}

/// A prediction of a quantity beside its measured value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Predicted {
    /// The prediction.
    #[serde(flatten)]
    pub value: Uncertain,
    /// Normalised error: measured less predicted, over the root of the sum of both expanded uncertainties squared.
    pub normalised_error: f64,
}

impl Predicted {
    /// Whether measurement and prediction agree within their uncertainties.
    #[must_use]
    pub fn agrees(&self) -> bool {
        self.normalised_error.abs() <= 1.0
    }
}

/// A compared quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedMetric {
    /// The quantity.
    pub metric: Metric,
    /// Its unit.
    pub unit: &'static str,
    /// The measured value.
    pub measured: Uncertain,
    /// Simulated on the measured base motion.
    pub on_measured_base: Option<Predicted>,
    /// Simulated on the commanded base motion.
    pub on_ideal_base: Option<Predicted>,
    /// Of the prediction that decides.
    pub verdict: Verdict,
}

/// Whether a measured and a predicted value agree within their uncertainties.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// |E_n| is at most 1.
    Agrees,
    /// |E_n| is above 1.
    Differs,
    /// There is no prediction.
    NotCompared,
}

impl Verdict {
    /// In words.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs => "differs",
            Self::NotCompared => "not compared",
        }
    }

    fn of(predicted: Option<&Predicted>) -> Self {
        match predicted {
            Some(predicted) if predicted.agrees() => Self::Agrees,
            Some(_) => Self::Differs,
            None => Self::NotCompared,
        }
    }
}

impl ComparedMetric {
    /// The prediction that decides: on the measured base motion, if there is one.
    #[must_use]
    pub fn predicted(&self) -> Option<&Predicted> {
        self.on_measured_base.as_ref().or(self.on_ideal_base.as_ref())
    }
}

/// Measured less simulated x over the measured ticks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// Its RMS, m.
    pub rms_m: f64,
    /// RMS of the measured x, m.
    pub x_rms_m: f64,
    /// RMS noise of a reading of x, m.
    pub noise_rms_m: f64,
}

/// Measured and simulated x of the end of a point, or of a transient.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Time of the first reading after the start of the measurement, s.
    pub from_s: f64,
    /// Readings per second.
    pub rate_hz: f64,
    /// Measured x, m; empty without samples of every tick.
    pub measured_m: Vec<f32>,
    /// Simulated x, m.
    pub simulated_m: Vec<f32>,
    /// Times (s after the start of the measurement) and sides of measured and of simulated impacts.
    pub measured_impacts: Vec<(f64, i8)>,
    /// Of the simulated ones.
    pub simulated_impacts: Vec<(f64, i8)>,
    /// Whether the base was the measured one.
    pub on_measured_base: bool,
}

impl Comparison {
    /// Numbers of compared quantities: all, and those that agree.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        let points = self.experiments.iter().flat_map(|experiment| &experiment.points);
        let predicted = || points.clone().flat_map(|point| &point.metrics).filter_map(ComparedMetric::predicted);
        (predicted().count(), predicted().filter(|predicted| predicted.agrees()).count())
    }
}

/// A run with all that its points are compared with.
struct Compared<'a> {
    campaign: &'a Campaign,
    state: JournalState,
    recorded: AllRecorded,
    is_every_tick: bool,
    is_simulated: bool,
    sensors: Sensors,
    detection: ImpactConfig,
    options: &'a Options<'a>,
}

/// Compares a run. `set_ups_from`: a campaign whose set-ups are simulated instead of the run's own of the same names.
///
/// # Errors
/// A run without results or without a readable campaign; set-ups that do not fit; an interruption.
pub fn compare(
    run: &RunFolder,
    mut set_ups_from: Option<Campaign>,
    options: &Options,
) -> Result<Comparison, CannotCompare> {
    let (campaign, state, mut unreadable) = read(run)?;
    let manifest = run.manifest();
    let is_simulated = manifest.device.as_ref().is_some_and(|device| device.simulated);
    if let Some(other) = &mut set_ups_from {
        // Only its set-ups are used, not its limits.
        let _ = other.on_board(&campaign.rig.board, is_simulated);
    }
    let model = set_ups_from.as_ref().unwrap_or(&campaign);
    let sensors = Sensors::of(&campaign.rig, is_simulated, options.scale_uncertainty);
    let mut assumptions = vec![format!(
        "Sensors: relative standard uncertainty of the scales of x and z {:.3} % ({}).",
        100.0 * sensors.scale,
        sensors.scale_from
    )];
    let varied = ensemble::varied_set_ups(model, is_simulated);
    assumptions.push(about_parameters(model, &varied));
    let varied = varied.unwrap_or_default();
    let recorded = AllRecorded::of(run);
    unreadable.extend(recorded.unreadable.iter().cloned());
    let missing = missing(run, &campaign, &state);
    let compared = Compared {
        campaign: &campaign,
        state,
        recorded,
        is_every_tick: manifest.every_ticks() == Some(1),
        is_simulated,
        sensors,
        detection: campaign.rig.board.impacts,
        options,
    };
    let mut experiments = Vec::new();
    for (place, own) in campaign.set_ups.iter().enumerate() {
        let simulated = model_of(own, model)?;
        let models = Models::new(&simulated, &varied, is_simulated, sensors.scale);
        for experiment in campaign.experiments.iter().filter(|experiment| experiment.set_ups.contains(&place)) {
            let points = if experiment.stepped_sine().is_some() {
                compared.stepped_sine(own, experiment, &models)
            } else {
                compared.transient(own, experiment, &models)
            };
            if options.stop.load(Ordering::Relaxed) {
                return Err(CannotCompare::Stopped);
            }
            if !points.is_empty() {
                experiments.push(ComparedExperiment {
                    set_up: own.name.clone(),
                    label: own.label.clone(),
                    experiment: experiment.name.clone(),
                    kind: kind_of(experiment),
                    notes: compared.notes(own, &models),
                    points,
                });
            }
        }
    }
    let set_ups_from = set_ups_from.as_ref().map(|other| other.source.name().to_string());
    Ok(Comparison {
        run: run.id(),
        campaign: campaign.name.clone(),
        state: manifest.ending_text(),
        set_ups_from: set_ups_from.unwrap_or_else(|| "the run's campaign".into()),
        damprig: crate::VERSION_LINE,
        coverage_factor: COVERAGE_FACTOR,
        assumptions,
        missing,
        unreadable,
        experiments,
    })
}

fn kind_of(experiment: &Experiment) -> &'static str {
    match (experiment.playback(), experiment.free_vibration()) {
        (Some(playback), _) => playback.kind,
        (None, Some(_)) => "free_vibration",
        (None, None) => "stepped_sine",
    }
}

/// The campaign as run, the journal's sum, and what cannot be read.
fn read(run: &RunFolder) -> Result<(Campaign, JournalState, Vec<String>), CannotCompare> {
    let failed = |error: String| CannotCompare::Run(format!("{}: {error}", run.path().display()));
    let lines = journal::read(run.path()).map_err(|error| CannotCompare::Run(error.to_string()))?;
    let mut unreadable = Vec::new();
    if !lines.damaged.is_empty() {
        let list: Vec<String> = lines.damaged.iter().map(usize::to_string).collect();
        unreadable.push(format!("{JOURNAL}: line {}", list.join(", ")));
    }
    let state = JournalState::of(&lines.entries);
    let Some(begin) = state.begun.last() else {
        return Err(failed(format!("{JOURNAL} has no beginning of the run: it is damaged, or of an older version")));
    };
    if state.points() == 0 {
        return Err(failed("no point has been measured: there is nothing to compare".into()));
    }
    let (board, is_simulated) = (begin.device.settings.clone(), begin.device.simulated);
    let source =
        Source::read(&run.path().join("campaign.toml")).map_err(|error| CannotCompare::Run(error.to_string()))?;
    let mut campaign = Campaign::parse(source.recorded()).map_err(|error| CannotCompare::Run(error.to_string()))?;
    if let Some(board) = &board {
        // Limits were checked before the run.
        let _ = campaign.on_board(&board.settings, is_simulated);
    }
    Ok((campaign, state, unreadable))
}

/// The set-up to simulate for one of the run.
fn model_of(own: &CampaignSetUp, model: &Campaign) -> Result<CampaignSetUp, CannotCompare> {
    let found = model.set_ups.iter().find(|other| other.name == own.name);
    found.cloned().ok_or_else(|| {
        let names: Vec<&str> = model.set_ups.iter().map(|other| other.name.as_str()).collect();
        CannotCompare::Campaign(format!(
            "{}: it has no set-up {:?} of the run; it has {}\n  give its set-ups the names of the run's",
            model.source.name(),
            own.name,
            names.join(", ")
        ))
    })
}

/// What is said about the uncertainty of the parameters.
fn about_parameters(model: &Campaign, varied: &Result<Vec<Vec<CampaignSetUp>>, String>) -> String {
    match (varied, &model.set_up_file) {
        (Err(why), _) => format!("Parameters: their uncertainty is not included: {why}."),
        (Ok(varied), Some(file)) if !varied.is_empty() => {
            let keys: Vec<&str> = file.identified.iter().map(|value| value.key.as_str()).collect();
            format!(
                "Parameters: identified with uncertainty: {} ({}); all others count as exact.",
                keys.join(", "),
                file.file
            )
        }
        _ => "Parameters: their uncertainty is not included: none was identified (`damprig identify`, `set_up_file`)."
            .into(),
    }
}

/// Points that are planned and not measured, and a run that goes on.
fn missing(run: &RunFolder, campaign: &Campaign, state: &JournalState) -> Vec<String> {
    let manifest = run.manifest();
    let mut missing = Vec::new();
    if !manifest.is_complete() {
        let (taken, planned) = (state.points(), campaign.points());
        missing.push(format!(
            "the run is not complete ({}): {taken} of {planned} points are compared",
            manifest.ending_text()
        ));
    }
    missing
}

impl Compared<'_> {
    /// Notes on all points of an experiment on a set-up.
    fn notes(&self, own: &CampaignSetUp, models: &Models) -> Vec<String> {
        let mut notes = Vec::new();
        if own.has_unmodelled_damper {
            notes.push(if self.is_simulated {
                "The damper has no model; on this simulated rig the bare structure moved, and is simulated.".into()
            } else {
                "The damper has no model: the bare structure is simulated, so a difference is the damper's effect."
                    .into()
            });
        }
        let model = models.set_up.model();
        if models.set_up.spring().is_some() {
            notes.push(
                "The friction force is that of the spring's target; the error of the spring is not included.".into(),
            );
        }
        if model.particle.is_some() && !self.is_simulated {
            notes.push(
                "The particle's start is not known: the prediction is the mean over starts anywhere between the walls."
                    .into(),
            );
        }
        if model.particle.is_some() && !model.has_soft_walls() && !self.is_simulated {
            let contact_ms = 1e3 * contact_s();
            notes
                .push(format!("Impacts on hard walls are counted in the simulation for a contact of {contact_ms} ms."));
        }
        notes
    }

    /// Impacts and the largest force that the board measured in these ticks.
    fn measured_walls(&self, id: &SegmentId, ticks: &Range<u64>) -> Walls {
        let own = || {
            let impacts = self.state.impacts.iter().filter(|some| some.id == *id).flat_map(|some| &some.impacts);
            impacts.filter(|impact| ticks.contains(&u64::from(impact.tick)))
        };
        Walls {
            impacts: own().count() as u32,
            force_n: own().map(|impact| f64::from(impact.peak_n)).fold(0.0, f64::max),
            impulse_n_s: own().map(|impact| f64::from(impact.impulse_n_s)).fold(0.0, f64::max),
        }
    }

    /// Times (s after the first of these ticks) and sides of the measured impacts in them.
    fn measured_impacts(&self, id: &SegmentId, ticks: &Range<u64>) -> Vec<(f64, i8)> {
        let impacts = self.state.impacts.iter().filter(|some| some.id == *id).flat_map(|some| &some.impacts);
        let own = impacts.filter(|impact| ticks.contains(&u64::from(impact.tick)));
        let time_s = |tick: u32, centre: f32| (f64::from(tick) - ticks.start as f64 + f64::from(centre)) * TICK_S;
        own.map(|impact| (time_s(impact.tick, impact.centre_ticks), impact.side)).collect()
    }

    /// Walls of a set-up: whether they are soft, `None` without a particle or where the simulated structure is bare.
    fn walls_of(models: &Models) -> WallKind {
        let model = models.set_up.model();
        model.particle.map(|_| model.has_soft_walls())
    }

    /// Counts a point as done; whether to stop.
    fn is_stopped(&self) -> bool {
        self.options.stop.load(Ordering::Relaxed)
    }

    fn done(&self) {
        self.options.done.fetch_add(1, Ordering::Relaxed);
    }
}

/// The compared quantities of a point.
fn metrics(
    measured: &Values,
    of_measured: &Values,
    on_measured: Option<&Prediction>,
    on_ideal: Option<&Prediction>,
) -> Vec<ComparedMetric> {
    let compared = |(metric, value): (&Metric, &f64)| {
        let own = Uncertain {
            value: *value,
            expanded: COVERAGE_FACTOR * of_measured.get(metric).copied().unwrap_or(f64::NAN),
        };
        let beside = |prediction: Option<&Prediction>| predicted(*metric, own, prediction?);
        let (on_measured_base, on_ideal_base) = (beside(on_measured), beside(on_ideal));
        ComparedMetric {
            metric: *metric,
            unit: metric.unit(),
            measured: own,
            on_measured_base,
            on_ideal_base,
            verdict: Verdict::of(on_measured_base.as_ref().or(on_ideal_base.as_ref())),
        }
    };
    measured.iter().filter(|(_, value)| value.is_finite()).map(compared).collect()
}

fn predicted(metric: Metric, measured: Uncertain, prediction: &Prediction) -> Option<Predicted> {
    let (value, u) = (*prediction.values.get(&metric)?, *prediction.uncertainties.get(&metric)?);
    let expanded = COVERAGE_FACTOR * u;
    let normalised_error = metric.difference(measured.value, value) / measured.expanded.hypot(expanded);
    (value.is_finite() && normalised_error.is_finite())
        .then_some(Predicted { value: Uncertain { value, expanded }, normalised_error })
}

/// RMS of the difference between measured and simulated readings of x, m.
fn residual_rms_m(measured_m: &[f32], motion: &SimulatedMotion, ticks: &Range<usize>) -> Option<f64> {
    let simulated = motion.readings.get(ticks.clone())?;
    let squares = measured_m.iter().zip(simulated).map(|(m, s)| f64::from(m - s.x_m).powi(2));
    (measured_m.len() == simulated.len() && !measured_m.is_empty())
        .then(|| (squares.sum::<f64>() / measured_m.len() as f64).sqrt())
}

fn rms_m(x_m: &[f32]) -> f64 {
    (x_m.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x_m.len().max(1) as f64).sqrt()
}
