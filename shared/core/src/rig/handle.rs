//! Commands to the rig: checks each against the present state and carries it out.

use super::activity::{Activity, ActivityPhase};
use super::command::{Brake, Command, RigState};
use super::{Rejected, Rig};
use crate::control::experiment::{Experiment, ExperimentRunner};
use crate::control::friction_spring::{FrictionSpring, SpringCommand, SpringStage};
use crate::control::safety::ExperimentLimits;
use crate::settings::{Prepared, Settings};
use crate::twin::Twin;

impl Rig {
    /// Rejects a request that needs an idle rig.
    ///
    /// # Errors
    /// The rig is not idle. The error holds its state and what to do.
    pub fn must_be_idle(&self) -> Result<(), Rejected> {
        let state = self.state();
        match state {
            RigState::Idle => Ok(()),
            RigState::Faulted => Err(Rejected::wrong_state(state, "clear the fault first")),
            _ => Err(Rejected::wrong_state(state, "stop the experiment first")),
        }
    }

    /// Carries out a command.
    ///
    /// # Errors
    /// A parameter is out of range, or the command is not allowed in this state; the rig is unchanged.
    pub fn handle(&mut self, command: Command) -> Result<(), Rejected> {
        match command {
            Command::SetLimits(limits) => {
                self.must_be_idle()?;
                if self.experiment.is_none() {
                    let advice = "configure an experiment first";
                    return Err(Rejected::wrong_state(self.state(), advice));
                }
                self.settings.safety.tightened(&limits)?;
                self.limits = limits;
            }
            Command::SetSpring(set_up) => {
                self.must_be_idle()?;
                self.dampers.spring = FrictionSpring::new(&self.settings.spring.for_set_up(&set_up))?;
            }
            Command::SetTwin(config) => {
                self.must_be_idle()?;
                self.dampers.twin = config.as_ref().map(Twin::new).transpose()?;
            }
            Command::Configure(experiment) => {
                self.must_be_idle()?;
                self.check_drive(&experiment, None)?;
                self.experiment = Some(experiment);
                self.limits = ExperimentLimits::default();
            }
            Command::SetSettings(settings) => self.set_settings(&settings)?,
            Command::ReplaceSpring => {
                self.must_be_idle()?;
                self.dampers.spring = FrictionSpring::new(&self.settings.spring)?;
            }
            Command::Start => self.start()?,
            Command::Stop => self.activity.stop(false),
            Command::Hold(held) => {
                if !self.activity.hold(held) {
                    let advice = "only a running stepped sine can be held";
                    return Err(Rejected::wrong_state(self.state(), advice));
                }
            }
            Command::ClearFault => self.clear_fault()?,
            Command::Spring(command) => self.handle_spring(command)?,
            Command::ArmSnippet => self.dampers.meter.arm_snippet(),
        }
        Ok(())
    }

    /// Checks that the drive can deliver what an experiment demands. `record_peak_counts` is the largest |sample| of
    /// the record that it plays, if the record is loaded.
    ///
    /// # Errors
    /// The experiment demands more.
    pub fn check_drive(&self, experiment: &Experiment, record_peak_counts: Option<u16>) -> Result<(), Rejected> {
        match experiment.largest_drive_m(record_peak_counts) {
            Some((parameter, amplitude_m)) => Ok(self.drive.allow(parameter, amplitude_m)?),
            None => Ok(()),
        }
    }

    fn set_settings(&mut self, settings: &Settings) -> Result<(), Rejected> {
        let prepared = Prepared::new(settings)?;
        if !matches!(self.activity, Activity::Faulted(_)) {
            self.must_be_idle()?;
        }
        self.drive = settings.calibration.drive.range();
        self.safety.adopt(&prepared.safety);
        if settings.spring != self.settings.spring {
            self.dampers.spring = prepared.spring;
        }
        self.dampers.meter.adopt(&prepared.impacts);
        self.settings = *settings;
        Ok(())
    }

    /// Puts the board's own settings in force again.
    pub(super) fn end_experiment(&mut self) {
        self.safety.end_experiment();
        self.dampers.spring.end_set_up(&self.settings.spring);
    }

    /// The configured experiment, if it could start now. `record_peak_counts` is the largest |sample| of the loaded
    /// record.
    ///
    /// # Errors
    /// As [`Rig::handle`] with [`Command::Start`].
    pub fn could_start(&self, record_peak_counts: Option<u16>) -> Result<&Experiment, Rejected> {
        self.must_be_idle()?;
        let Some(experiment) = &self.experiment else {
            return Err(Rejected::wrong_state(self.state(), "configure an experiment first"));
        };
        // The settings may have changed since the experiment was configured.
        self.check_drive(experiment, record_peak_counts)?;
        match self.dampers.spring.stage() {
            SpringStage::Faulted => Err(Rejected::wrong_stage(SpringStage::Faulted, "clear the spring's fault first")),
            stage @ (SpringStage::Homing | SpringStage::TouchingOff | SpringStage::Releasing) => {
                Err(Rejected::wrong_stage(stage, "wait until it is done, or halt"))
            }
            _ => Ok(experiment),
        }
    }

    fn start(&mut self) -> Result<(), Rejected> {
        let runner = ExperimentRunner::new(self.could_start(None)?, &self.drive);
        // The board's settings may have changed since the limits were set.
        self.safety.tighten(&self.limits)?;
        self.activity = Activity::Experiment { runner, phase: ActivityPhase::Running };
        self.tick = 0;
        self.points = 0;
        self.results.clear();
        self.transient = None;
        self.largest_drive_m = 0.0;
        self.safety.restart();
        self.dampers.restart();
        Ok(())
    }

    fn clear_fault(&mut self) -> Result<(), Rejected> {
        let state = self.state();
        self.safety.clear().map_err(|not_safe| Rejected::wrong_state(state, not_safe.advice))?;
        if state == RigState::Faulted {
            self.activity = Activity::Idle;
            self.brake = Brake::Open;
            self.dampers.let_go();
            self.end_experiment();
        }
        Ok(())
    }

    fn handle_spring(&mut self, command: SpringCommand) -> Result<(), Rejected> {
        let searches = matches!(command, SpringCommand::Home | SpringCommand::TouchOff);
        let moves = command.moves();
        let state = self.state();
        if self.emergency_stop && (moves || command == SpringCommand::Release) {
            return Err(Rejected::wrong_state(state, "release the emergency stop first"));
        }
        if self.brake != Brake::Open && matches!(command, SpringCommand::Release | SpringCommand::Halt) {
            return Err(Rejected::wrong_state(state, "the brake closes: clear the fault first"));
        }
        match state {
            RigState::Running(_) | RigState::Stopping if searches => self.must_be_idle()?,
            RigState::Faulted if moves => self.must_be_idle()?,
            _ => {}
        }
        Ok(self.dampers.spring.handle(command)?)
    }
}
