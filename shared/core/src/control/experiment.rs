//! The kinds of experiment and their common interface: an experiment is planned outside the tick and then run one tick
//! at a time.
//!
//! [`Experiment`] is a checked plan and [`ExperimentRunner`] is an experiment in progress. This module only dispatches
//! to the kinds.

use super::outcome::{ExperimentStage, Outcome, StageProgress, TickInputs};
use super::stepped_sine::{self, DriveMode};
use super::transient::free_vibration;
use super::transient::playback::{self, RecordId};
use crate::io::DriveRange;
use crate::measure::running::DriveReference;

/// A checked experiment.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub enum Experiment {
    /// A stepped sine: one frequency after another.
    SteppedSine(stepped_sine::SteppedSinePlan),
    /// Playback of an uploaded record.
    Playback(playback::PlaybackPlan),
    /// Free vibration of a structure that is held and released.
    FreeVibration(free_vibration::FreeVibrationPlan),
}

impl Experiment {
    /// The record that the experiment plays; it must be loaded before the start.
    #[must_use]
    pub fn record(&self) -> Option<RecordId> {
        match self {
            Self::Playback(plan) => Some(plan.playback().record),
            Self::SteppedSine(_) | Self::FreeVibration(_) => None,
        }
    }

    /// The largest drive that the experiment demands, m, with the name of the parameter that sets it: the amplitude at
    /// constant drive, the limit of a closed loop, or the peak of a record. `record_peak_counts` is the largest
    /// |sample| of the record. `None` if the experiment has no drive or the record is not loaded yet.
    #[must_use]
    pub fn largest_drive_m(&self, record_peak_counts: Option<u16>) -> Option<(&'static str, f32)> {
        match self {
            Self::SteppedSine(plan) => Some(match &plan.sine().drive {
                DriveMode::Constant => ("amplitude_m", plan.sine().largest_amplitude_m()),
                DriveMode::ClosedLoop(parameters) => ("drive.drive_limit_m", parameters.drive_limit_m),
                DriveMode::Response(parameters) => ("drive.drive_limit_m", parameters.drive_limit_m),
            }),
            Self::Playback(plan) => {
                record_peak_counts.map(|counts| ("record peak (m)", f32::from(counts) * plan.playback().scale_m))
            }
            Self::FreeVibration(_) => None,
        }
    }
}

/// An experiment in progress, with its plan.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)]
pub enum ExperimentRunner {
    /// A stepped sine: one frequency after another.
    SteppedSine(stepped_sine::SteppedSineRunner),
    /// Playback of an uploaded record.
    Playback(playback::PlaybackRunner),
    /// Free vibration of a structure that is held and released.
    FreeVibration(free_vibration::FreeVibrationRunner),
}

/// State of an experiment's drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Driving {
    /// The drive is on.
    pub on: bool,
    /// The drive is strong enough for the base to move visibly.
    pub swinging: bool,
    /// The drive was at its limit in the last tick.
    pub saturated: bool,
    /// Base amplitude that the response's loop demands now, m; `None` of other drives.
    pub demanded_m: Option<f32>,
    /// Base amplitude that the response's loop demands next, m; 0 of other drives.
    pub base_foreseen_m: f32,
}

/// Calls the same method on the runner of any kind.
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
    /// A runner at the beginning of the experiment. `drive` is the range that the drive can deliver.
    #[must_use]
    pub fn new(experiment: &Experiment, drive: &DriveRange) -> Self {
        match experiment {
            Experiment::SteppedSine(plan) => Self::SteppedSine(stepped_sine::SteppedSineRunner::new(plan, drive)),
            Experiment::Playback(plan) => Self::Playback(playback::PlaybackRunner::new(plan, drive)),
            Experiment::FreeVibration(plan) => Self::FreeVibration(free_vibration::FreeVibrationRunner::new(plan)),
        }
    }

    /// Runs one tick. Takes this tick's readings; returns the demanded base displacement (m) and the outcome of the
    /// tick. `record` is the record that a playback plays.
    pub fn tick(&mut self, record: &[i16], now: &TickInputs) -> (f32, Outcome) {
        match self {
            Self::SteppedSine(runner) => runner.tick(now),
            Self::Playback(runner) => runner.tick(record, now),
            Self::FreeVibration(runner) => (0.0, runner.tick(now)),
        }
    }

    /// The drive for this tick, m, without measuring. Used for the fade after a stop.
    pub fn fade(&mut self, record: &[i16]) -> f32 {
        match self {
            Self::SteppedSine(runner) => runner.fade(),
            Self::Playback(runner) => runner.fade(record),
            Self::FreeVibration(_) => 0.0,
        }
    }

    /// The present stage.
    #[must_use]
    pub fn stage(&self) -> ExperimentStage {
        ask!(self, own => own.stage())
    }

    /// How far it is in its present point.
    #[must_use]
    pub fn progress(&self) -> StageProgress {
        match self {
            Self::SteppedSine(own) => own.progress(),
            Self::Playback(_) | Self::FreeVibration(_) => StageProgress::default(),
        }
    }

    /// The present drive frequency, Hz; 0 if there is none.
    #[must_use]
    pub fn frequency_hz(&self) -> f32 {
        match self {
            Self::SteppedSine(own) => own.frequency_hz(),
            _ => 0.0,
        }
    }

    /// The drive's reference in the last tick; `None` without a drive frequency.
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

    /// State of the drive.
    #[must_use]
    pub fn driving(&self) -> Driving {
        match self {
            Self::SteppedSine(own) => Driving {
                on: own.is_driving(),
                swinging: own.is_swinging(),
                saturated: own.is_saturated(),
                demanded_m: own.demanded_m(),
                base_foreseen_m: own.base_foreseen_m(),
            },
            Self::Playback(own) => Driving {
                on: own.is_driving(),
                swinging: own.is_swinging(),
                saturated: own.is_saturated(),
                ..Driving::default()
            },
            Self::FreeVibration(_) => Driving::default(),
        }
    }

    /// Index of the point that begins from rest in this tick. A simulated plant is reset to its start.
    #[must_use]
    pub fn begins_from_rest(&self) -> Option<u16> {
        ask!(self, own => own.begins_from_rest())
    }

    /// Holds a stepped sine at its present point, or releases it. Returns false for the other kinds, which cannot be
    /// held.
    pub fn hold(&mut self, held: bool) -> bool {
        let Self::SteppedSine(own) = self else { return false };
        own.hold(held);
        true
    }

    /// The present point is held.
    #[must_use]
    pub fn is_held(&self) -> bool {
        matches!(self, Self::SteppedSine(own) if own.is_held())
    }

    /// Starts the final fade-out of the drive.
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
