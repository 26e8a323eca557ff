//! Before an experiment with a friction damper whose spring the rig tunes: home, touch off, set.
//!
//! A friction ratio is set in two steps: first the normal force that it means at the demanded base amplitude, while nothing
//! moves; then the ratio itself, which the rig keeps by the measured amplitude once it drives.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use damprig_core::control::fault::Fault;
use damprig_core::control::friction_spring::{SpringCommand, SpringEvent, SpringStage, Target};
use damprig_protocol::{Ask, Happening as Event, PlantKind};

use super::{Run, RunError, convert};
use crate::campaign::{CampaignSetUp, SpringSpec, SpringTarget};
use crate::session::Report;

/// Longer than any of the steps takes, s: the whole travel there and back at the search rate, and the readings.
const LONGEST_STEP: Duration = Duration::from_secs(300);

impl Run<'_> {
    /// Tunes the spring of a set-up that has one.
    ///
    /// A friction ratio is kept by the measured amplitude only if `keeps_ratio`: where the drive has none, the force stays.
    pub(super) fn tune(
        &mut self,
        set_up: &CampaignSetUp,
        spring: &SpringSpec,
        keeps_ratio: bool,
    ) -> Result<(), RunError> {
        self.session.tell("take the set-up's spring", Ask::SetSpring(convert::spring(set_up, spring)))?;
        self.step(set_up, SpringCommand::Home, |happening| matches!(happening, SpringEvent::Homed))?;
        self.step(set_up, SpringCommand::TouchOff, |happening| matches!(happening, SpringEvent::OnTarget { .. }))?;
        let on_target = |happening: &SpringEvent| matches!(happening, SpringEvent::OnTarget { .. });
        let stiffness = set_up.model().structure.stiffness_n_per_m;
        let force_n = spring.normal_force_n(stiffness, set_up.base_amplitude_m) as f32;
        match spring.target {
            SpringTarget::Deflection(deflection) => {
                let target = Target::Deflection { deflection_m: deflection as f32 };
                self.step(set_up, SpringCommand::Set(target), on_target)
            }
            SpringTarget::NormalForce(_) => self.step(set_up, SpringCommand::Set(Target::Force { force_n }), on_target),
            SpringTarget::FrictionRatio(ratio) => {
                self.step(set_up, SpringCommand::Set(Target::Force { force_n }), on_target)?;
                if !keeps_ratio {
                    return Ok(());
                }
                let target = Target::FrictionRatio { ratio: ratio as f32 };
                Ok(self.session.tell("keep a friction ratio", Ask::Spring(SpringCommand::Set(target)))?)
            }
        }
    }

    /// Nothing presses on the structure of a set-up whose friction, if any, is none of the spring's.
    pub(super) fn free(&mut self, set_up: &CampaignSetUp) -> Result<(), RunError> {
        if self.session.description.plant != PlantKind::Real {
            // The simulated plant is a new one, and so is its spring.
            return Ok(());
        }
        let begun = Instant::now();
        let mut asked = false;
        loop {
            let (status, _) = self.session.status()?;
            match status.spring.stage {
                SpringStage::Ready | SpringStage::Setting | SpringStage::Holding if !asked => {
                    asked = true;
                    self.session.tell("release the spring", Ask::Spring(SpringCommand::Release))?;
                }
                SpringStage::Releasing | SpringStage::Ready if asked && begun.elapsed() > LONGEST_STEP => {
                    return Err(RunError::SpringLost { set_up: set_up.name.clone(), stage: status.spring.stage });
                }
                SpringStage::Releasing => {}
                _ => return Ok(()),
            }
            self.session.next_report()?;
        }
    }

    /// Asks the spring for something and waits until it is done.
    fn step(
        &mut self,
        set_up: &CampaignSetUp,
        command: SpringCommand,
        is_done: impl Fn(&SpringEvent) -> bool,
    ) -> Result<(), RunError> {
        self.session.tell("move the friction damper's spring", Ask::Spring(command))?;
        let begun = Instant::now();
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            let Some(report) = self.session.next_report()? else {
                // The event may have been lost.
                if begun.elapsed() > LONGEST_STEP {
                    let (status, _) = self.session.status()?;
                    return Err(match status.spring.fault {
                        Some(fault) => spring_error(set_up, fault),
                        None => RunError::SpringLost { set_up: set_up.name.clone(), stage: status.spring.stage },
                    });
                }
                continue;
            };
            if self.spring_report(set_up, report)?.as_ref().is_some_and(&is_done) {
                break;
            }
        }
        // The next command comes at a tick that does not depend on how fast the link is, and finds no older reports.
        self.session.use_up_credit()?;
        while let Some(report) = self.session.report_at_hand() {
            self.spring_report(set_up, report)?;
        }
        Ok(())
    }

    /// What the spring reports, if `report` is the spring's.
    fn spring_report(&mut self, set_up: &CampaignSetUp, report: Report) -> Result<Option<SpringEvent>, RunError> {
        match report {
            Report::Event { event: Event::Spring(happening), .. } => {
                self.watcher.spring(&happening);
                match happening {
                    SpringEvent::Fault(fault) => Err(spring_error(set_up, fault)),
                    other => Ok(Some(other)),
                }
            }
            Report::Event { event: Event::Fault(fault), .. } => Err(convert::fault_error(set_up, fault)),
            _ => Ok(None),
        }
    }
}

fn spring_error(set_up: &CampaignSetUp, fault: Fault) -> RunError {
    let Fault { cause, value, limit, .. } = fault;
    RunError::Spring { set_up: set_up.name.clone(), cause, value, limit }
}
