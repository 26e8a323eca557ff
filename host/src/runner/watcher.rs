//! Observes the progress of a run, for people, and brings what they ask of it.

use damprig_core::control::friction_spring;
use damprig_core::io::SensorSet;
use damprig_core::measure::impacts::ImpactRecord;
use damprig_simulator::plant::InjectedFault;

use super::error::RunError;
use super::rest_check::RestFinding;
use super::time_left::TimeLeft;
use crate::campaign::{CampaignSetUp, Experiment};
use crate::run_folder::ResultRow;
use crate::run_folder::journal::Losses;
use crate::run_folder::schema::journal_state::Planned;
use crate::run_folder::schema::peak_points::PeakPoints;
use crate::run_folder::schema::transients::TransientRow;

/// What a person asks of a run in progress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunAction {
    /// Turn the drive off until [`RunAction::Resume`]; the interrupted point is repeated.
    Pause,
    /// Go on after a pause.
    Resume,
    /// Stay at the present point, or go on.
    Hold(bool),
    /// Nothing is left to do but to note in the journal what was done.
    Noted(&'static str),
    /// Inject a fault into the simulated rig, or end it.
    Inject {
        /// The fault.
        fault: InjectedFault,
        /// What it acts on, in words.
        what: &'static str,
        /// What is wrong with it, in words; none when the fault ends.
        how: Option<&'static str>,
    },
}

/// What a person decides about a rig that is not at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestAnswer {
    /// Measure again.
    Again,
    /// Go on anyway.
    GoOn,
    /// Stop the run; it can be resumed.
    Stop,
}

/// A start of the device, as a watcher sees it.
#[derive(Clone, Copy, Debug)]
pub struct WatchedStart<'a> {
    /// The set-up.
    pub set_up: &'a CampaignSetUp,
    /// The experiment.
    pub experiment: &'a Experiment,
    /// Rig time of its tick 0, s.
    pub from_s: f64,
    /// Places in the device's signal table of the values in a row.
    pub places: &'a [usize],
    /// Ticks from row to row.
    pub every_ticks: u16,
}

/// Observes the progress of a run. No method but [`Watcher::mount`], [`Watcher::instruct`] and [`Watcher::not_at_rest`] may wait.
pub trait Watcher {
    /// Returns when the set-up is mounted on the rig, and whether a person confirmed it. On a real rig a person mounts it.
    ///
    /// # Errors
    /// The mounting was not confirmed, or the program runs without a terminal.
    fn mount(&mut self, set_up: &CampaignSetUp, simulated: bool) -> Result<bool, RunError>;

    /// Returns when a person has done what an experiment on a real rig needs before it starts, and whether it was confirmed.
    ///
    /// # Errors
    /// As [`Watcher::mount`].
    fn instruct(&mut self, experiment: &Experiment, instruction: &str) -> Result<bool, RunError> {
        let _ = (experiment, instruction);
        Ok(false)
    }

    /// A person has changed a real rig, and it is not at rest. Returns what is to be done about it.
    ///
    /// # Errors
    /// As [`Watcher::mount`].
    fn not_at_rest(&mut self, finding: &RestFinding) -> Result<RestAnswer, RunError> {
        let _ = finding;
        Ok(RestAnswer::GoOn)
    }

    /// Rig time of the whole run so far, s.
    fn progress(&mut self, rig_s: f64);

    /// The device has started an experiment, or a part of it.
    fn started(&mut self, start: &WatchedStart) {
        let _ = start;
    }

    /// Rows of telemetry of the present start: their ticks, and their values row after row.
    fn rows(&mut self, ticks: &[u32], values: &[f32]) {
        let _ = (ticks, values);
    }

    /// Whether [`Watcher::values`] is wanted: about ten times a second of host time.
    fn wants_values(&self) -> bool {
        false
    }

    /// Values of all signals of the device's table at this rig time, s, and what was lost so far.
    fn values(&mut self, rig_s: f64, values: &[f32], losses: &Losses) {
        let _ = (rig_s, values, losses);
    }

    /// What the run still takes; it is told again and again while the run goes on, and not while it waits for a person.
    fn time_left(&mut self, left: TimeLeft) {
        let _ = left;
    }

    /// The sensors without a signal while the run is paused.
    fn lost_sensors(&mut self, lost: SensorSet) {
        let _ = lost;
    }

    /// What a person asks of the run; each action gets one [`Watcher::answer`].
    fn action(&mut self) -> Option<RunAction> {
        None
    }

    /// The answer to the last action: what was done, or why not.
    fn answer(&mut self, result: Result<&str, &str>) {
        let _ = result;
    }

    /// A point has been taken.
    fn point(&mut self, row: &ResultRow);

    /// The points around a measured peak are known, and with them what the whole run is to measure.
    fn peak_points(&mut self, points: &PeakPoints, planned: &Planned) {
        let _ = (points, planned);
    }

    /// A record, a pulse or a free vibration has been taken.
    fn transient(&mut self, row: &TransientRow) {
        let _ = row;
    }

    /// The particle hit a wall.
    fn impact(&mut self, impact: &ImpactRecord) {
        let _ = impact;
    }

    /// An event of the friction damper's spring.
    fn spring(&mut self, happening: &friction_spring::SpringEvent) {
        let _ = happening;
    }

    /// A change of the link's state, in words.
    fn link(&mut self, state: &str);
}

/// Nobody watches; every set-up counts as mounted.
impl Watcher for () {
    fn mount(&mut self, _: &CampaignSetUp, _: bool) -> Result<bool, RunError> {
        Ok(false)
    }

    fn progress(&mut self, _: f64) {}

    fn point(&mut self, _: &ResultRow) {}

    fn link(&mut self, _: &str) {}
}
