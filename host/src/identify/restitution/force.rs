//! Contact time and restitution from a force record: J = m·v·(1 + e) of an impact with the approach velocity v.

use super::Approach;
use crate::identify::contact::FORCE;
use crate::identify::statistics::Value;
use crate::identify::table::Table;
use crate::identify::{CannotIdentify, Estimate};

const IMPULSE: &str = "force record: impulse and approach velocity";

/// Share of the peak above which a force counts as contact.
const CONTACT: f64 = 0.05;

/// Contact time, and restitution where the approach is known.
pub(super) fn of_force(table: &Table, approach: Option<Approach>) -> Result<Vec<Estimate>, CannotIdentify> {
    let (t, force) = (table.times()?, table.column(&FORCE)?);
    let mut sorted = force.clone();
    sorted.sort_by(f64::total_cmp);
    let rest = sorted[sorted.len() / 2];
    let peak = sorted.last().copied().unwrap_or(rest) - rest;
    let clipped = force.windows(3).find(|w| w[0] - rest > 0.9 * peak && w[0] == w[1] && w[1] == w[2]);
    if let Some(clipped) = clipped {
        return Err(table.refuse(format!(
            "the force sensor is saturated: it stays at {} N at the peak\n  drop from less high, or use a sensor of larger \
             range",
            clipped[0]
        )));
    }
    let level = rest + CONTACT * peak;
    let (mut durations, mut impulses, mut start) = (Vec::new(), Vec::new(), None);
    for n in 1..t.len() {
        let cross = || t[n - 1] + (t[n] - t[n - 1]) * (level - force[n - 1]) / (force[n] - force[n - 1]);
        if force[n - 1] <= level && force[n] > level {
            start = Some((cross(), n));
        } else if force[n - 1] > level
            && force[n] <= level
            && let Some((since, from)) = start.take()
            && force[from..n].iter().any(|f| f - rest > 0.5 * peak)
        {
            durations.push(cross() - since);
            let ends = from.saturating_sub(3)..(n + 3).min(t.len());
            impulses.push(
                ends.clone()
                    .skip(1)
                    .map(|m| 0.5 * (force[m] + force[m - 1] - 2.0 * rest) * (t[m] - t[m - 1]))
                    .sum::<f64>(),
            );
        }
    }
    let Some(contact) = Value::mean(&durations) else {
        return Err(table.refuse(format!(
            "{} impacts were found in the force; at least 2 are needed for an uncertainty",
            durations.len()
        )));
    };
    let mut all =
        vec![Estimate::new("contact time", "s", "force record: time above 5 % of the largest peak", &contact)];
    if let Some(Approach { mass_kg, velocity_m_per_s }) = approach {
        let values: Vec<f64> = impulses.iter().map(|impulse| impulse / (mass_kg * velocity_m_per_s) - 1.0).collect();
        if let Some(wrong) = values.iter().find(|e| !(0.0..=super::MAX).contains(*e)) {
            return Err(table.refuse(format!(
                "a coefficient of restitution of {wrong:.3} is not possible: it is 0 to 1\n  check --mass-kg and --approach-m-per-s"
            )));
        }
        let mean =
            Value::mean(&values).ok_or_else(|| table.refuse("one impact has no uncertainty: give at least two"))?;
        all.insert(0, super::constant(IMPULSE, &mean));
    }
    Ok(all)
}
