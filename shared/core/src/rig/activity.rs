//! Activity of the rig, its main state: idle, running an experiment, or faulted. Each state holds its own data.

use super::RigState;
use crate::control::experiment::ExperimentRunner;
use crate::control::fault::Fault;

/// Activity of the rig.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // There is no allocator, so a variant cannot be boxed.
pub(super) enum Activity {
    /// No experiment; the drive is off.
    Idle,
    /// An experiment; its drive is on or fades out.
    Experiment { runner: ExperimentRunner, phase: ActivityPhase },
    /// Faulted, with the drive off, until the fault is cleared.
    Faulted(Fault),
}

/// Phase of an experiment.
#[derive(Clone, Copy, Debug)]
pub(super) enum ActivityPhase {
    /// The experiment runs.
    Running,
    /// The drive fades out. The experiment is complete, or was stopped before.
    Stopping { is_complete: bool },
    /// The drive fades out after a fault.
    Faulted(Fault),
}

impl Activity {
    /// The state that is reported to a host.
    pub fn state(&self) -> RigState {
        match self {
            Self::Idle => RigState::Idle,
            Self::Experiment { runner, phase: ActivityPhase::Running } => RigState::Running(runner.stage()),
            Self::Experiment { phase: ActivityPhase::Stopping { .. }, .. } => RigState::Stopping,
            Self::Experiment { phase: ActivityPhase::Faulted(_), .. } | Self::Faulted(_) => RigState::Faulted,
        }
    }

    /// The fault that ended the experiment, or that was detected while the rig was idle.
    pub fn fault(&self) -> Option<Fault> {
        match self {
            Self::Faulted(fault) | Self::Experiment { phase: ActivityPhase::Faulted(fault), .. } => Some(*fault),
            _ => None,
        }
    }

    /// The experiment in progress.
    pub fn runner(&self) -> Option<&ExperimentRunner> {
        if let Self::Experiment { runner, .. } = self { Some(runner) } else { None }
    }

    /// Holds a running stepped sine at its present point, or releases it. Returns false when none is running.
    pub fn hold(&mut self, held: bool) -> bool {
        if let Self::Experiment { runner, phase: ActivityPhase::Running } = self { runner.hold(held) } else { false }
    }

    /// Lets the drive of a running experiment fade out.
    pub fn stop(&mut self, is_complete: bool) {
        if let Self::Experiment { runner, phase } = self {
            if !is_complete {
                runner.release_drive();
            }
            if let ActivityPhase::Running = phase {
                *phase = ActivityPhase::Stopping { is_complete };
            }
        }
    }

    /// Notes a fault and lets the drive fade out.
    pub fn trip(&mut self, fault: Fault) {
        match self {
            Self::Experiment { runner, phase } => {
                runner.release_drive();
                *phase = ActivityPhase::Faulted(fault);
            }
            Self::Idle | Self::Faulted(_) => *self = Self::Faulted(fault),
        }
    }
}
