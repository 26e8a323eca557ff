//! The experiments that a rig can be given, and what they have in common: one is planned outside the tick, then
//! carried out a tick at a time.
//!
//! [`Experiment`] is what has been checked, [`ExperimentRunner`] what is in progress; here is only the choice between the kinds.

use super::outcome::{ExperimentStage, Outcome, TickInputs};
use super::stepped_sine::{self, DriveMode};
use super::transient::free_vibration;
use super::transient::playback::{self, RecordId};
use crate::io::DriveRange;
use crate::measure::running::DriveReference;

/// A checked experiment.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum Experiment {
    /// One frequency after another.
    SteppedSine(stepped_sine::SteppedSinePlan),
    /// An uploaded record.
    Playback(playback::PlaybackPlan),
    /// A structure that is held and released.
    FreeVibration(free_vibration::FreeVibrationPlan),
}

impl Experiment {
    /// The record that has to be there for it.
    #[must_use]
    pub fn record(&self) -> Option<RecordId> {
        match self {
            Self::Playback(plan) => Some(plan.playback().record),
            Self::SteppedSine(_) | Self::FreeVibration(_) => None,
        }
    }

    /// The largest drive that it asks for, m, with the name of the parameter that says so: the amplitude at constant drive, the
    /// limit of a closed loop, the peak of a record, of which `record_peak_counts` is the largest |sample|. `None` where nothing
    /// is driven or the record is not there yet.
    #[must_use]
    pub fn largest_drive_m(&self, record_peak_counts: Option<u16>) -> Option<(&'static str, f32)> {
        match self {
            Self::SteppedSine(plan) => Some(match &plan.sine().drive {
                DriveMode::Constant => ("amplitude_m", plan.sine().amplitude_m),
                DriveMode::ClosedLoop(parameters) => ("drive.drive_limit_m", parameters.drive_limit_m),
            }),
            Self::Playback(plan) => {
                record_peak_counts.map(|counts| ("record peak (m)", f32::from(counts) * plan.playback().scale_m))
            }
            Self::FreeVibration(_) => None,
        }
    }
}

/// An experiment in progress. Its [`Experiment`] is the caller's: every call wants the same one.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)]
pub enum ExperimentRunner {
    /// One frequency after another.
    SteppedSine(stepped_sine::SteppedSineRunner),
    /// An uploaded record.
    Playback(playback::PlaybackRunner),
    /// A structure that is held and released.
    FreeVibration(free_vibration::FreeVibrationRunner),
}

/// What the drive of an experiment does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Driving {
    /// It is on.
    pub on: bool,
    /// The base is meant to move visibly.
    pub swinging: bool,
    /// It was at its limit in the last tick.
    pub saturated: bool,
}

/// The same question to whichever runner it is.
macro_rules! ask {
    ($runner:expr, $own:ident => $answer:expr) => {
        match $runner {
            ExperimentRunner::SteppedSine($own) => $answer,
            ExperimentRunner::Playback($own) => $answer,
            ExperimentRunner::FreeVibration($own) => $answer,
        }
    };
}

impl ExperimentRunner {
    /// At the beginning; `drive` is what can be delivered.
    #[must_use]
    pub fn new(experiment: &Experiment, drive: &DriveRange) -> Self {
        match experiment {
            Experiment::SteppedSine(plan) => Self::SteppedSine(stepped_sine::SteppedSineRunner::new(plan, drive)),
            Experiment::Playback(_) => Self::Playback(playback::PlaybackRunner::new(drive)),
            Experiment::FreeVibration(_) => Self::FreeVibration(free_vibration::FreeVibrationRunner::default()),
        }
    }

    /// One tick: this tick's readings in; the demanded base displacement (m) out, and what the tick led to. `record` is what a
    /// playback plays.
    pub fn tick(&mut self, experiment: &Experiment, record: &[i16], now: &TickInputs) -> (f32, Outcome) {
        match (self, experiment) {
            (Self::SteppedSine(runner), Experiment::SteppedSine(plan)) => runner.tick(plan, now),
            (Self::Playback(runner), Experiment::Playback(plan)) => runner.tick(plan, record, now),
            (Self::FreeVibration(runner), Experiment::FreeVibration(plan)) => (0.0, runner.tick(plan, now)),
            // Not of this runner: nothing moves.
            _ => (0.0, Outcome::Running),
        }
    }

    /// The drive for this tick, m, without measuring: for the fade after a stop.
    pub fn fade(&mut self, experiment: &Experiment, record: &[i16]) -> f32 {
        match (self, experiment) {
            (Self::SteppedSine(runner), Experiment::SteppedSine(plan)) => runner.fade(plan),
            (Self::Playback(runner), Experiment::Playback(plan)) => runner.fade(plan, record),
            _ => 0.0,
        }
    }

    /// Where it stands.
    #[must_use]
    pub fn stage(&self) -> ExperimentStage {
        ask!(self, own => own.stage())
    }

    /// The present drive frequency, Hz; 0 where there is none.
    #[must_use]
    pub fn frequency_hz(&self) -> f32 {
        match self {
            Self::SteppedSine(own) => own.frequency_hz(),
            _ => 0.0,
        }
    }

    /// The drive's reference in the last tick; none without a drive frequency.
    #[must_use]
    pub fn reference(&self) -> Option<DriveReference> {
        match self {
            Self::SteppedSine(own) => own.reference(),
            Self::Playback(_) | Self::FreeVibration(_) => None,
        }
    }

    /// A cycle of the drive ended in the last tick.
    #[must_use]
    pub fn cycle_ended(&self) -> bool {
        match self {
            Self::SteppedSine(own) => own.cycle_ended(),
            _ => false,
        }
    }

    /// What the drive does.
    #[must_use]
    pub fn driving(&self) -> Driving {
        match self {
            Self::SteppedSine(own) => {
                Driving { on: own.is_driving(), swinging: own.is_swinging(), saturated: own.is_saturated() }
            }
            Self::Playback(own) => {
                Driving { on: own.is_driving(), swinging: own.is_swinging(), saturated: own.is_saturated() }
            }
            Self::FreeVibration(_) => Driving::default(),
        }
    }

    /// The place of the point that begins from rest in this tick: a simulated plant goes back to its start.
    #[must_use]
    pub fn begins_from_rest(&self) -> Option<u16> {
        ask!(self, own => own.begins_from_rest())
    }

    /// Lets the drive fade out, whatever comes after.
    pub fn release_drive(&mut self) {
        match self {
            Self::SteppedSine(own) => own.release_drive(),
            Self::Playback(own) => own.release_drive(),
            Self::FreeVibration(_) => {}
        }
    }

    /// The drive has faded out.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        match self {
            Self::SteppedSine(own) => own.is_silent(),
            Self::Playback(own) => own.is_silent(),
            Self::FreeVibration(_) => true,
        }
    }
}
