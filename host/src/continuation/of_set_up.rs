//! Periodic motions of a set-up over the frequency of its base, as `damprig continue` follows them.

use std::f64::consts::TAU;

use damprig_continuation::{Steps, System, Task, Ties};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Initial, SetUp};

use super::found::FoundBranches;
use super::keys::{MAX_PERIODS, MAX_RESTARTS};
use crate::simulation::parameters::PARAMETERS;

/// Follows the motions at a base amplitude (m) over a range of frequencies (Hz), from the first of its ends and its middle at which
/// the motion repeats.
///
/// # Errors
/// Why there is none to start from.
pub fn over_frequency(
    name: &str,
    set_up: &SetUp,
    base_amplitude_m: f64,
    range_hz: (f64, f64),
    initial: Initial,
) -> Result<FoundBranches, String> {
    let key = PARAMETERS.iter().find(|known| known.key == "base.frequency_hz").ok_or("no frequency of the base")?;
    let (low, high) = range_hz;
    let mut why = String::new();
    for start_at in [high, low, 0.5 * (low + high)] {
        let angular_frequency_rad_per_s = TAU * start_at;
        let excitation =
            Excitation::Sine { amplitude_m: base_amplitude_m, angular_frequency_rad_per_s, phase_rad: 0.0 };
        let system = System::new(set_up, &excitation, Ties::default()).map_err(|invalid| invalid.to_string())?;
        let task = Task {
            parameter: key.parameter,
            range: range_hz,
            start_at,
            initial,
            phase_rad: 0.0,
            most_periods: MAX_PERIODS,
            switch: false,
            most_restarts: MAX_RESTARTS,
            steps: Steps::default(),
        };
        match system.explore(&task) {
            Ok(diagram) => return Ok(FoundBranches::of(name, key, "Z", &diagram)),
            Err(no_start) => why = format!("at {start_at} Hz: {no_start}"),
        }
    }
    Err(why)
}
