//! Contact time and restitution from a force record: J = m·v·(1 + e) of an impact with the approach velocity v.

use super::Approach;
use crate::failure::Failure;
use crate::identify::Estimate;
use crate::identify::force_record::pulses;
use crate::identify::statistics::Value;
use crate::identify::table::NumberTable;

const IMPULSE: &str = "force record: impulse and approach velocity";

/// Share of the largest peak below which a pulse is a rebound.
const REBOUND: f64 = 0.5;

/// Contact time, and restitution where the approach is known.
pub(super) fn of_force(table: &NumberTable, approach: Option<Approach>) -> Result<Vec<Estimate>, Failure> {
    let mut impacts = pulses(table)?;
    let peak_n = impacts.iter().map(|pulse| pulse.peak_n).fold(0.0, f64::max);
    impacts.retain(|pulse| pulse.peak_n > REBOUND * peak_n);
    let times: Vec<f64> = impacts.iter().map(|pulse| pulse.time_s).collect();
    let Some(contact) = Value::mean(&times) else {
        return Err(table.refuse(format!(
            "{} impacts were found in the force; at least 2 are needed for an uncertainty",
            times.len()
        )));
    };
    let mut all = vec![Estimate::new("contact time", "s", "force record: half-sine fitted to each pulse", &contact)];
    if let Some(Approach { mass_kg, velocity_m_per_s }) = approach {
        let values: Vec<f64> =
            impacts.iter().map(|pulse| pulse.impulse_n_s / (mass_kg * velocity_m_per_s) - 1.0).collect();
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
