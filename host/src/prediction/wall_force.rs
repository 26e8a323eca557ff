//! Compares the predicted forces on the particle's walls with the limit in force.
//!
//! The model's impacts on hard walls take no time; the force follows from the impulse J and the contact time τ of a half-sine
//! pulse, F = πJ/(2τ). The simulated rig's contacts last [`damprig_simulator::plant::walls::WallSensors::contact_s`]. Those of a
//! real wall may be several times longer, so only a force far beyond the limit is refused; above the limit there is a warning.
//! The force of a soft wall is that of its spring and dashpot: above the limit it is refused. Each wall is judged as what it is.

use super::Prediction;
use super::loops::LoopPrediction;
use super::transient::Expected;
use super::watch;
use crate::campaign::{Campaign, CampaignSetUp, Experiment, ExperimentKind};
use crate::failure::Failure;
use crate::input::Problem;
use crate::settings::number_of;

/// A contact this many times longer than the simulated rig's still exceeds the limit.
const FAR_BEYOND: f64 = 4.0;

/// The larger force at each side.
pub(super) fn larger(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].max(b[0]), a[1].max(b[1])]
}

/// Warnings on forces above the limit.
///
/// # Errors
/// Forces on hard walls of more than four times the limit, on soft walls above it: one message for all, each with the line of the
/// set-up's base amplitude.
pub fn check(
    campaign: &Campaign,
    predictions: &[Prediction],
    held: &[LoopPrediction],
    expected: &[Expected],
) -> Result<Vec<String>, Failure> {
    // Forces on the set-ups' walls: in stepped sines, and in other experiments.
    let sines = predictions.iter().map(|p| (p.set_up, None, p.swing.wall_force_n));
    let others = expected.iter().map(|e| (e.set_up, e.experiment, e.outlook.wall_force_n));
    let others = held.iter().map(|e| (e.set_up, e.experiment, e.swing.wall_force_n)).chain(others);
    let others = others.map(|(set_up, place, force_n)| (set_up, Some(&campaign.experiments[place]), force_n));
    let forces: Vec<(usize, Option<&Experiment>, [f64; 2])> = sines.chain(others).collect();
    let limit_n = number_of(campaign.rig.acting.wall_force_n);
    let mut warnings = Vec::new();
    for (index, set_up) in campaign.set_ups.iter().enumerate() {
        let kinds = set_up.model().particle.map_or([false; 2], |particle| particle.walls().map(|wall| wall.is_soft()));
        let most_n = |is_soft| if is_soft { limit_n } else { FAR_BEYOND * limit_n };
        let own = forces.iter().filter(|(of, ..)| *of == index).flat_map(|(_, experiment, forces)| {
            let sides = kinds.iter().zip(forces).filter(|(_, force_n)| **force_n > limit_n);
            sides.map(|(is_soft, force_n)| (*experiment, *is_soft, *force_n))
        });
        let share = |(_, is_soft, force_n): &(_, bool, f64)| force_n / most_n(*is_soft);
        let Some((experiment, is_soft, force_n)) = own.max_by(|a, b| share(a).total_cmp(&share(b))) else { continue };
        let contact =
            if is_soft { " with the soft wall".into() } else { format!(" of {} ms", watch::contact_s() * 1e3) };
        let during = experiment.map_or(String::new(), |experiment| format!(" in experiment {:?}", experiment.name));
        let what = format!(
            "set-up {:?} would reach the limit of the force on a wall{during}: predicted {force_n:.0} N in a contact{contact}, \
             limit {limit_n} N",
            set_up.name,
        );
        if force_n > most_n(is_soft) {
            campaign.source.report(problem(set_up, experiment, what, is_soft));
        } else {
            warnings.push(format!("{what}; the rig stops there"));
        }
    }
    campaign.source.verdict().map(|()| warnings)
}

fn problem(set_up: &CampaignSetUp, experiment: Option<&Experiment>, title: String, is_soft: bool) -> Problem {
    let wall = if is_soft { "a wall of smaller stiffness or damping" } else { "a smaller coefficient of restitution" };
    let mass = set_up.model().particle.map_or(0.0, |particle| particle.mass_kg);
    let (span, key) = match experiment.map(|experiment| &experiment.kind) {
        Some(ExperimentKind::FreeVibration(free)) => (free.span.clone(), "start_m"),
        Some(ExperimentKind::Playback(playback)) => (playback.span.clone(), playback.key),
        Some(ExperimentKind::SteppedSine(sine)) if let Some((key, own)) = sine.largest_amplitude() => {
            (own.span.clone(), key)
        }
        _ => (set_up.base_amplitude_span.clone(), set_up.amplitude_key()),
    };
    Problem {
        title,
        span,
        allowed: format!("with this `{key}` and a particle of {} kg", super::trim(mass)),
        help: Some(format!("write a smaller `{key}`, a lighter particle or {wall}")),
    }
}
