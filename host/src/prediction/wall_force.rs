//! Compares the predicted forces on the particle's walls with the limit in force.
//!
//! The model's impacts on hard walls take no time; the force follows from the impulse J and the contact time τ of a half-sine
//! pulse, F = πJ/(2τ). The simulated rig's contacts last [`damprig_simulator::plant::walls::WallSensors::contact_s`]. Those of a
//! real wall may be several times longer, so only a force far beyond the limit is refused; above the limit there is a warning.
//! The force of a soft wall is that of its spring and dashpot: above the limit it is refused.

use damprig_core::model::Wall;

use super::Prediction;
use super::transient::Expected;
use super::watch;
use crate::campaign::{Campaign, CampaignSetUp};
use crate::input::{Problem, Refusal};
use crate::settings::number_of;

/// A contact this many times longer than the simulated rig's still exceeds the limit.
const FAR_BEYOND: f64 = 4.0;

/// Warnings on forces above the limit.
///
/// # Errors
/// Forces more than four times the limit: one message for all, each with the line of the set-up's base amplitude.
pub fn check(campaign: &Campaign, predictions: &[Prediction], expected: &[Expected]) -> Result<Vec<String>, Refusal> {
    let forces = predictions.iter().map(|p| (p.set_up, p.swing.wall_force_n));
    let forces: Vec<(usize, f64)> = forces.chain(expected.iter().map(|e| (e.set_up, e.outlook.wall_force_n))).collect();
    let limit_n = number_of(campaign.rig.acting.wall_force_n);
    let mut warnings = Vec::new();
    for (index, set_up) in campaign.set_ups.iter().enumerate() {
        let force_n = forces.iter().filter(|(of, _)| *of == index).map(|(_, force_n)| *force_n).fold(0.0, f64::max);
        if force_n <= limit_n {
            continue;
        }
        let is_soft = set_up.model().particle.is_some_and(|p| matches!(p.wall, Wall::Voigt { .. }));
        let (contact, most_n) = if is_soft {
            (" with the soft wall".into(), limit_n)
        } else {
            (format!(" of {} ms", watch::contact_s() * 1e3), FAR_BEYOND * limit_n)
        };
        let what = format!(
            "set-up {:?} would reach the limit of the force on a wall: predicted {force_n:.0} N in a contact{contact}, limit {limit_n} N",
            set_up.name,
        );
        if force_n > most_n {
            campaign.source.report(problem(set_up, what, is_soft));
        } else {
            warnings.push(format!("{what}; the rig stops there"));
        }
    }
    campaign.source.verdict().map(|()| warnings)
}

fn problem(set_up: &CampaignSetUp, title: String, is_soft: bool) -> Problem {
    let wall = if is_soft {
        "or `law = \"contact\"` for the wall, which gives a weaker dashpot"
    } else {
        "or a smaller coefficient of restitution"
    };
    let mass = set_up.model().particle.map_or(0.0, |particle| particle.mass_kg);
    Problem {
        title,
        span: set_up.base_amplitude_span.clone(),
        allowed: format!("with this base amplitude and a particle of {} kg", super::trim(mass)),
        help: Some(format!("write a smaller base amplitude, a lighter particle, {wall}")),
    }
}
