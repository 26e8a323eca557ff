//! Sets the friction damper's spring before an experiment: home, touch off, set the target.
//!
//! A friction ratio is set in two steps: first the normal force that it means at the demanded base amplitude, while the rig
//! is at rest; then the ratio itself, which the rig keeps by the measured amplitude while it drives.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use damprig_core::control::fault::Fault;
use damprig_core::control::friction_spring::{SpringCommand, SpringEvent, SpringStage, Target};
use damprig_protocol::{Event, PlantKind, Request};

use super::context::Run;
use super::error::RunError;
use super::wire_mapping;
use crate::campaign::{CampaignSetUp, SpringSpec, SpringTarget};
use crate::client::session::DeviceReport;

/// Time limit of a step, longer than the whole travel there and back at the search rate and the readings.
const LONGEST_STEP: Duration = Duration::from_secs(300);

impl Run<'_> {
    /// Sets the spring of a set-up that has one. A friction ratio is kept by the measured amplitude only if `keeps_ratio`; an
    /// experiment without a base amplitude keeps the force.
    pub(super) fn set_spring(
        &mut self,
        set_up: &CampaignSetUp,
        spring: &SpringSpec,
        keeps_ratio: bool,
    ) -> Result<(), RunError> {
        self.session.execute("take the set-up's spring", Request::SetSpring(wire_mapping::spring(set_up, spring)))?;
        self.step(set_up, SpringCommand::Home, |happening| matches!(happening, SpringEvent::Homed))?;
        self.step(set_up, SpringCommand::TouchOff, |happening| matches!(happening, SpringEvent::OnTarget { .. }))?;
        let on_target = |happening: &SpringEvent| matches!(happening, SpringEvent::OnTarget { .. });
        self.step(set_up, SpringCommand::Set(first_target(set_up, spring)), on_target)?;
        if let (SpringTarget::FrictionRatio(ratio), true) = (spring.target, keeps_ratio) {
            let target = Target::FrictionRatio { ratio: ratio as f32 };
            self.session.execute("keep a friction ratio", Request::Spring(SpringCommand::Set(target)))?;
        }
        Ok(())
    }

    /// Releases the spring for a set-up whose friction, if any, does not come from it.
    pub(super) fn release_spring(&mut self, set_up: &CampaignSetUp) -> Result<(), RunError> {
        if self.session.description.plant != PlantKind::Real {
            // The simulated plant is newly configured, with its spring released.
            return Ok(());
        }
        let begun = Instant::now();
        let mut asked = false;
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            let (status, _) = self.session.status()?;
            match status.spring.stage {
                SpringStage::Ready | SpringStage::Setting | SpringStage::Holding if !asked => {
                    asked = true;
                    self.session.execute("release the spring", Request::Spring(SpringCommand::Release))?;
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

    /// Sends a command to the spring and waits until it is done.
    fn step(
        &mut self,
        set_up: &CampaignSetUp,
        command: SpringCommand,
        is_done: impl Fn(&SpringEvent) -> bool,
    ) -> Result<(), RunError> {
        self.session.execute("move the friction damper's spring", Request::Spring(command))?;
        let begun = Instant::now();
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            self.show_values()?;
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
        // So the tick of the next command does not depend on the speed of the link, and no older reports are left.
        self.session.use_up_credit()?;
        while let Some(report) = self.session.report_at_hand() {
            self.spring_report(set_up, report)?;
        }
        Ok(())
    }

    /// The spring's event, if `report` is one.
    fn spring_report(&mut self, set_up: &CampaignSetUp, report: DeviceReport) -> Result<Option<SpringEvent>, RunError> {
        match report {
            DeviceReport::Event { event: Event::Spring(happening), .. } => {
                self.watcher.spring(&happening);
                match happening {
                    SpringEvent::Fault(fault) => Err(spring_error(set_up, fault)),
                    other => Ok(Some(other)),
                }
            }
            DeviceReport::Event { event: Event::Fault(fault), .. } => Err(wire_mapping::fault_error(set_up, fault)),
            _ => Ok(None),
        }
    }
}

/// The target that the spring is set to at rest. A friction ratio means a normal force at the demanded base amplitude.
pub(super) fn first_target(set_up: &CampaignSetUp, spring: &SpringSpec) -> Target {
    let stiffness = set_up.model().structure.stiffness_n_per_m;
    let force_n = spring.normal_force_n(stiffness, set_up.base_amplitude_m) as f32;
    match spring.target {
        SpringTarget::Deflection(deflection) => Target::Deflection { deflection_m: deflection as f32 },
        SpringTarget::NormalForce(_) | SpringTarget::FrictionRatio(_) => Target::Force { force_n },
    }
}

fn spring_error(set_up: &CampaignSetUp, fault: Fault) -> RunError {
    let Fault { cause, value, limit, .. } = fault;
    RunError::Spring { set_up: set_up.name.clone(), cause, value, limit }
}
