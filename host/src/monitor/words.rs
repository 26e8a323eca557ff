//! Texts for people that several sources share.

use damprig_core::control::fault::Fault;
use damprig_core::control::friction_spring::SpringEvent;
use damprig_core::control::safety::SafeStage;

use super::action::Injection;
use crate::report::numbers::{phase_in_degrees, significant};
use crate::run_folder::ResultRow;
use crate::run_folder::schema::results::steadiness_text;
use crate::runner::fault_text::cause_text;

/// A text as a sentence: with a capital and a full stop.
#[must_use]
pub(super) fn sentence(text: &str) -> String {
    let mut rest = text.chars();
    let Some(first) = rest.next() else { return String::new() };
    let stop = if text.ends_with(['.', '!', '?']) { "" } else { "." };
    format!("{}{}{stop}", first.to_uppercase(), rest.as_str())
}

/// An event of the friction damper's spring in words.
#[must_use]
pub fn spring(event: &SpringEvent) -> String {
    match event {
        SpringEvent::Homed => "The spring is homed.".into(),
        SpringEvent::Touched(_) => "The spring has touched the structure: its zero reading is known.".into(),
        SpringEvent::OnTarget { force_n } => format!("The spring is on target: {force_n:.2} N."),
        SpringEvent::Fault(fault) => sentence(&cause_text(fault.cause, fault.value, fault.limit)),
    }
}

/// A measured point in words.
pub(super) fn measured(row: &ResultRow) -> String {
    let hz = significant(row.frequency_hz, 5);
    let [x, z] = [row.x_amplitude_m, row.z_amplitude_m].map(|amplitude_m| significant(f64::from(amplitude_m) * 1e3, 4));
    let (ratio, phase) = (significant(row.x_over_z_lock_in(), 4), phase_in_degrees(row.phase_rad));
    let (set_up, experiment, steadiness) = (&row.set_up, &row.experiment, steadiness_text(row.steadiness));
    format!(
        "Set-up {set_up}, experiment {experiment}: {hz} Hz, X/Z {ratio}, phase {phase:.1}° (X {x} mm, Z {z} mm; lock-in), {steadiness}."
    )
}

/// A fault of a rig as it is now: its drive, the cause, value and limit if it has them.
pub(super) fn fault(fault: &Fault, stage: SafeStage) -> String {
    let drive = match stage {
        SafeStage::Fading => "The drive fades out",
        // A fault of the spring alone finds the drive off.
        SafeStage::Clear | SafeStage::Ringing | SafeStage::Safe => "The drive is off",
    };
    sentence(&format!("{drive}: {}", cause_text(fault.cause, fault.value, fault.limit)))
}

/// Adds an injected fault to the list of what is injected, or removes it.
pub(super) fn note_injection(list: &mut Vec<(&'static str, &'static str)>, fault: &Injection) {
    let (what, how) = fault.in_words();
    list.retain(|(known, _)| *known != what);
    list.extend(how.map(|how| (what, how)));
}

/// The injected faults in words.
pub(super) fn injected(list: &[(&str, &str)]) -> Vec<String> {
    list.iter().map(|(what, how)| format!("{what} is {how}")).collect()
}
