//! Says in words what predicted and measured numbers are and where they may differ, for tables that show both.

use damprig_core::control::stepped_sine::DriveMode;

use super::numbers::significant;
use crate::campaign::Campaign;
use crate::prediction::contact_s;
use crate::settings::number_of;

/// What predicted numbers are, in a line of the terminal.
pub const IN_A_LINE: &str = "Predicted: a simulation of the same set-up and times, without noise, on a base that moves as demanded; \
     `damprig help predicted` says where a measurement differs";

/// One sentence or two for each reason that the campaign has.
#[must_use]
pub fn predicted_and_measured(campaign: &Campaign) -> Vec<String> {
    let sines = || campaign.experiments.iter().filter_map(|e| e.stepped_sine());
    let mut notes =
        vec!["Predicted: a simulation of the same set-up and times, without noise, on a base that moves exactly as demanded.".to_string()];
    if campaign.set_ups.iter().any(|s| s.model().is_force_driven) {
        notes.push(
            "Set-ups with a force P: their base rests, and what is called z, Z or the base is P/k, the force over the structure's \
             stiffness; X/Z is the magnification X·k/P."
                .into(),
        );
    }
    if sines().any(|sine| sine.settle_s > 0.0 || sine.longest_dwell_s() > sine.dwell_s) {
        notes.push(
            "Before the run the largest |x| is predicted from the start of each point, after it for the dwell alone, as measured."
                .into(),
        );
    }
    if sines().any(|sine| sine.longest_dwell_s() > sine.dwell_s) {
        notes.push("A point that is measured until it is steady is predicted in its last possible dwell.".into());
    }
    if campaign.rig.shaker.is_some() && sines().any(|sine| sine.drive == DriveMode::Constant) {
        notes.push(
            "At constant drive the structure reduces the base amplitude near its resonance, which the prediction leaves out: \
             less is measured than predicted there."
                .into(),
        );
    }
    if sines().any(|sine| sine.response_loop().is_some() || sine.tracked.is_some()) {
        notes.push(
            "An experiment that keeps the response or follows a resonance is predicted with the controller's own loops, on a base \
             that moves exactly as they demand."
                .into(),
        );
    }
    if sines().any(|sine| matches!(sine.drive, DriveMode::ClosedLoop(_))) {
        notes.push(
            "A closed loop waits until its base is within the tolerance, which the prediction leaves out: a point from rest lasts \
             longer, so a motion that still grows is measured larger."
                .into(),
        );
    }
    if campaign.experiments.iter().any(|e| e.free_vibration().is_some()) {
        notes.push(
            "A release is detected when |x| has fallen by a tenth of x0: RMS and impacts, predicted ones too, begin there; \
             largest |x| has x0."
                .into(),
        );
    }
    notes.extend(campaign.set_ups.iter().flat_map(|s| {
        let both = [s.hertz_as_hard(), s.moves_as_plant().map(|text| format!("in the prediction {text}"))];
        both.into_iter().flatten().map(|text| format!("Set-up {:?}: {text}.", s.name))
    }));
    if campaign.set_ups.iter().any(|s| s.model().particle.is_some()) {
        notes.push(format!(
            "Impacts are predicted as the board counts them: pulses above {} N (of a hard wall in a contact of {} ms), of a \
             chatter only those apart; the sensor's noise lifts a long contact that stays just below. A motion with impacts \
             may be chaotic: then noise changes single maxima and counts, and both may be right.",
            significant(number_of(campaign.rig.board.impacts.threshold_n), 3),
            significant(contact_s() * 1e3, 3)
        ));
    }
    notes
}
