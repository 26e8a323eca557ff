//! Observes the progress of a run, for people.

use damprig_core::control::friction_spring;
use damprig_core::measure::impacts::ImpactRecord;

use super::error::RunError;
use crate::campaign::CampaignSetUp;
use crate::run_folder::ResultRow;
use crate::run_folder::schema::transients::TransientRow;

/// Observes the progress of a run.
pub trait Watcher {
    /// Returns when the set-up is mounted on the rig. On a real rig a person mounts it.
    ///
    /// # Errors
    /// The mounting was not confirmed, or the program runs without a terminal.
    fn mount(&mut self, set_up: &CampaignSetUp, simulated: bool) -> Result<(), RunError>;

    /// Rig time of the whole run so far, s.
    fn progress(&mut self, rig_s: f64);

    /// A point has been taken.
    fn point(&mut self, row: &ResultRow);

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
    fn mount(&mut self, _: &CampaignSetUp, _: bool) -> Result<(), RunError> {
        Ok(())
    }

    fn progress(&mut self, _: f64) {}

    fn point(&mut self, _: &ResultRow) {}

    fn link(&mut self, _: &str) {}
}
