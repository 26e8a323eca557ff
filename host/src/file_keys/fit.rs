//! Base amplitudes of a new campaign whose set-ups stay within the range of the sensors.

use super::new_file::{Fitted, MountedDamper};
use crate::campaign::Campaign;
use crate::campaign::transient::two_digits_down;
use crate::failure::Failure;
use crate::prediction::predict;

/// Largest |x| that a new campaign aims at, m: two thirds of the board's limit as delivered.
const AIM_M: f64 = 0.053;

/// The set-ups that stepped sines would move beyond the aim, with an amplitude that is smaller in proportion. That one fits if all lengths
/// of the damper are ratios to Z; with soft walls it may have to be fitted again. `dampers` are those of the set-ups, in their order.
///
/// # Errors
/// As [`predict`].
pub fn too_large(campaign: &Campaign, dampers: &[MountedDamper]) -> Result<Vec<Fitted>, Failure> {
    let (predictions, _) = predict(campaign)?;
    let fitted = predictions.iter().filter(|p| p.swing.max_x_m > AIM_M).filter_map(|prediction| {
        let (set_up, max_x_m) = (campaign.set_ups.get(prediction.set_up)?, prediction.swing.max_x_m);
        let base_amplitude_m = two_digits_down(set_up.base_amplitude_m * AIM_M / max_x_m);
        Some(Fitted { damper: *dampers.get(prediction.set_up)?, base_amplitude_m, max_x_m })
    });
    Ok(fitted.collect())
}
