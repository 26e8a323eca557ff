//! Compares a run with simulations of its own set-ups: on the base motion that the campaign commands, and on the one that the run
//! measured. Every quantity has an expanded uncertainty on both sides and a normalised error.
//!
//! Simulation and measurement cover the same ticks from the same start, and the board's own code measures both, so a point need not be
//! steady to be compared. `base` has the base motions, `motion` the simulation, `metric` the quantities, `uncertainty` that of
//! the sensors, `ensemble` that of the prediction; `comparison` is the answer. docs/COMPARE.md derives the uncertainties.

mod base;
mod comparison;
mod continued;
mod ensemble;
pub mod metric;
mod point;
mod prediction;
mod recorded;
mod source;
mod spring;
mod transient;
mod uncertainty;

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use damprig_core::measure::impacts::ImpactRecord;
use damprig_motion::read_run::TICK_S;
use damprig_motion::watch::Detection;

use crate::campaign::{Campaign, CampaignSetUp, Experiment};
use crate::failure::Failure;
use crate::host_time::plain;
use crate::identify::sensors::{self, Sensors};
use crate::prediction::{contact_s, watch};
use crate::run_folder::RunFolder;
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::schema::segment_id::SegmentId;
use crate::run_folder::schema::set_up_parameters::parameters;
pub use comparison::{
    COVERAGE_FACTOR, ComparedExperiment, ComparedMetric, ComparedPoint, Comparison, PointHistory, PredictedQuantity,
    Residual, UncertainValue, Verdict,
};
pub use continued::Continued;
use ensemble::Models;
use metric::{WallKind, Walls};

use recorded::AllRecorded;

/// What to compare with, and how to report progress.
#[derive(Clone, Copy, Debug)]
pub struct CompareOptions<'a> {
    /// Relative standard uncertainty of the scales of both displacement sensors; by default from the rig's data sheet, or assumed.
    pub scale_uncertainty: Option<f64>,
    /// Points that are done; grows while the comparison runs.
    pub done: &'a AtomicUsize,
    /// Set to stop the comparison.
    pub stop: &'a AtomicBool,
}

/// A run with all that its points are compared with.
struct ComparedRun<'a> {
    campaign: &'a Campaign,
    state: JournalState,
    recorded: AllRecorded,
    is_every_tick: bool,
    is_simulated: bool,
    sensors: Sensors,
    detection: Detection,
    options: &'a CompareOptions<'a>,
}

/// Compares a run. `set_ups_from`: a campaign whose set-ups are simulated instead of the run's own of the same names.
///
/// # Errors
/// A run without results or without a readable campaign; set-ups that do not fit; an interruption.
pub fn compare(
    run: &RunFolder,
    mut set_ups_from: Option<Campaign>,
    options: &CompareOptions,
) -> Result<Comparison, Failure> {
    let (campaign, state, mut unreadable) = source::read(run)?;
    let manifest = run.manifest();
    let is_simulated = manifest.device.as_ref().is_some_and(|device| device.simulated);
    if let Some(other) = &mut set_ups_from {
        // Only its set-ups are used, not its limits.
        let _ = other.on_board(&campaign.rig.board, is_simulated);
    }
    let model = set_ups_from.as_ref().unwrap_or(&campaign);
    let sensors = sensors::of(&campaign.rig, is_simulated).stated(options.scale_uncertainty);
    let mut assumptions = vec![format!(
        "Sensors: relative standard uncertainty of the scales of x and z {:.3} % ({}).",
        100.0 * sensors.scale,
        sensors.scale_from
    )];
    let varied = ensemble::varied_set_ups(model, is_simulated);
    assumptions.push(ensemble::about_parameters(model, &varied));
    let varied = varied.unwrap_or_default().set_ups;
    let go_on = || !options.stop.load(Ordering::Relaxed);
    let recorded = AllRecorded::of(run, go_on)?;
    unreadable.extend(recorded.unreadable.iter().cloned());
    let missing = source::missing(run, &campaign, &state);
    let compared = ComparedRun {
        campaign: &campaign,
        state,
        recorded,
        is_every_tick: manifest.every_ticks() == Some(1),
        is_simulated,
        sensors,
        detection: watch::detection(&campaign.rig.board.impacts),
        options,
    };
    let mut experiments = Vec::new();
    for (place, own) in campaign.set_ups.iter().enumerate() {
        let simulated = ensemble::model_of(own, model)?;
        let models = Models::new(own, &simulated, &varied, is_simulated && !own.spec.is_start_unknown(), sensors.scale);
        for experiment in campaign.experiments.iter().filter(|experiment| experiment.set_ups.contains(&place)) {
            let points = if experiment.stepped_sine().is_some() {
                compared.stepped_sine(own, experiment, &models)
            } else {
                compared.transient(own, experiment, &models)
            };
            if compared.is_stopped() {
                return Err(Failure::Interrupted("the comparison was interrupted".into()));
            }
            if !points.is_empty() {
                experiments.push(ComparedExperiment {
                    set_up: own.name.clone(),
                    label: own.label.clone(),
                    experiment: experiment.name.clone(),
                    kind: kind_of(experiment),
                    parameters: parameters(&simulated.model()),
                    notes: compared.notes(own, &models),
                    points,
                });
            }
        }
    }
    let has_points = |own: &CampaignSetUp, experiment: &str| {
        compared.state.rows().iter().any(|row| row.set_up == own.name && row.experiment == experiment)
    };
    let model_of = |own: &CampaignSetUp| ensemble::model_of(own, model).ok();
    let continued = continued::behind_sheets(&campaign, has_points, model_of, || !compared.is_stopped());
    let set_ups_from = set_ups_from.as_ref().map(|other| other.source.name().to_string());
    Ok(Comparison {
        run: run.id(),
        campaign: campaign.name.clone(),
        started: plain(&manifest.started).to_string(),
        state: manifest.ending_text(),
        set_ups_from: set_ups_from.unwrap_or_else(|| "the run's campaign".into()),
        damprig: crate::VERSION_LINE,
        coverage_factor: COVERAGE_FACTOR,
        assumptions,
        missing,
        unreadable,
        experiments,
        continued,
    })
}

fn kind_of(experiment: &Experiment) -> &'static str {
    match (experiment.playback(), experiment.free_vibration()) {
        (Some(playback), _) => playback.kind,
        (None, Some(_)) => "free_vibration",
        (None, None) => "stepped_sine",
    }
}

impl ComparedRun<'_> {
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
        notes.extend(models.set_up.hertz_as_hard().map(|text| format!("In the simulation {text}.")));
        notes.extend(models.set_up.moves_as_plant().map(|text| format!("In the simulation {text}.")));
        if models.set_up.spring().is_some() {
            notes.push(
                "The friction force comes from the spring that the rig adjusts: as it was measured, or its target with the tolerance \
                 of its controller."
                    .into(),
            );
        }
        let is_start_unknown = own.spec.is_start_unknown() || !self.is_simulated;
        if model.particle.is_some() && is_start_unknown {
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

    /// The impacts that the board measured in these ticks.
    fn impacts_in(&self, id: &SegmentId, ticks: &Range<u64>) -> impl Iterator<Item = &ImpactRecord> + Clone {
        let impacts = self.state.impacts.iter().filter(move |some| some.id == *id).flat_map(|some| &some.impacts);
        impacts.filter(move |impact| ticks.contains(&u64::from(impact.tick)))
    }

    /// Their number, and the largest force and impulse.
    fn measured_walls(&self, id: &SegmentId, ticks: &Range<u64>) -> Walls {
        let impacts = self.impacts_in(id, ticks);
        let largest = |value: fn(&ImpactRecord) -> f32| {
            impacts.clone().map(|impact| f64::from(value(impact))).fold(0.0, f64::max)
        };
        Walls {
            impacts: impacts.clone().count() as u32,
            force_n: largest(|impact| impact.peak_n),
            impulse_n_s: largest(|impact| impact.impulse_n_s),
        }
    }

    /// Times (s after the first of these ticks) and sides of the measured impacts in them.
    fn measured_impacts(&self, id: &SegmentId, ticks: &Range<u64>) -> Vec<(f64, i8)> {
        let time_s = |tick: u32, centre: f32| (f64::from(tick) - ticks.start as f64 + f64::from(centre)) * TICK_S;
        self.impacts_in(id, ticks).map(|impact| (time_s(impact.tick, impact.centre_ticks), impact.side)).collect()
    }

    /// Walls of a set-up: whether they are soft, `None` without a particle or where the simulated structure is bare.
    fn walls_of(models: &Models) -> WallKind {
        let model = models.set_up.model();
        model.particle.map(|particle| particle.walls().iter().all(|wall| wall.is_soft()))
    }

    /// Whether a person stopped the comparison.
    fn is_stopped(&self) -> bool {
        self.options.stop.load(Ordering::Relaxed)
    }

    /// Counts a point as done.
    fn done(&self) {
        self.options.done.fetch_add(1, Ordering::Relaxed);
    }
}
