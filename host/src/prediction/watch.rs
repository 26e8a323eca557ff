//! How the board would detect the impacts of a predicted motion ([`damprig_motion::watch`]).

use damprig_core::measure::impacts::ImpactConfig;
use damprig_motion::watch::Detection;
use damprig_simulator::plant::walls::WallSensors;

use crate::settings::number_of;

/// Contact time with a hard wall, which turns an impulse into a force: that of the simulated rig, s.
#[must_use]
pub fn contact_s() -> f64 {
    number_of(WallSensors::default().contact_s)
}

/// The board's settings, with the simulated rig's contact time.
pub(crate) fn detection(of: &ImpactConfig) -> Detection {
    Detection {
        threshold_n: number_of(of.threshold_n),
        refractory_s: number_of(of.refractory_s),
        ringing: number_of(of.ringing),
        contact_s: contact_s(),
    }
}
