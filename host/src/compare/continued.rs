//! Periodic motions of the model behind the sheets of a run, as `damprig continue` follows them.

use damprig_core::model::Initial;
use serde::Serialize;

use crate::campaign::{Campaign, CampaignSetUp};
use crate::continuation::{FoundBranch, over_frequency};

/// The motions of a set-up at its base amplitude over the frequencies of its sheets.
#[derive(Clone, Debug, Serialize)]
pub struct Continued {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment as written.
    pub experiment: String,
    /// The base amplitude, m.
    pub base_amplitude_m: f64,
    /// Branches of motions that repeat with the drive.
    pub branches: Vec<FoundBranch>,
    /// Why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without: Option<String>,
}

impl Continued {
    /// The folds: frequency (Hz) and max |x| (m) of each.
    pub fn folds(&self) -> impl Iterator<Item = (f64, f64)> {
        let all = self.branches.iter().flat_map(|branch| &branch.special_points);
        all.filter(|special| special.kind == "fold").map(|special| (special.parameter, special.max_abs_x_m))
    }
}

/// Follows the motions behind the sheets of every response-controlled experiment with points; `model_of` gives the set-up that is
/// simulated in place of one of the campaign. `go_on`: whether to go on.
pub(super) fn behind_sheets(
    campaign: &Campaign,
    has_points: impl Fn(&CampaignSetUp, &str) -> bool,
    model_of: impl Fn(&CampaignSetUp) -> Option<CampaignSetUp>,
    go_on: impl Fn() -> bool,
) -> Vec<Continued> {
    let mut all = Vec::new();
    for (place, own) in campaign.set_ups.iter().enumerate() {
        let mut numbers = Vec::new();
        for experiment in campaign.experiments.iter().filter(|experiment| experiment.set_ups.contains(&place)) {
            let Some(sine) = experiment.response_controlled() else { continue };
            if numbers.contains(&experiment.number) || !has_points(own, &experiment.name) || !go_on() {
                continue;
            }
            numbers.push(experiment.number);
            let Some(simulated) = model_of(own) else { continue };
            let low = sine.frequencies_hz.iter().copied().fold(f64::INFINITY, f64::min);
            let high = sine.frequencies_hz.iter().copied().fold(0.0, f64::max);
            let found = if simulated.plant.is_some() {
                Err("its motions are those of a structure with several places: `damprig continue` follows them from a case".into())
            } else if low < high {
                let base_amplitude_m = own.base_amplitude_m;
                let initial = Initial { y_m: simulated.spec.particle_start_m(base_amplitude_m), ..Initial::default() };
                let model = simulated.model_at(base_amplitude_m);
                over_frequency(&own.name, &model, base_amplitude_m, (low, high), initial)
            } else {
                Err("its sheets have one frequency".into())
            };
            let (branches, without) = match found {
                Ok(found) => (found.branches, None),
                Err(why) => (Vec::new(), Some(why)),
            };
            all.push(Continued {
                set_up: own.name.clone(),
                experiment: experiment.written.clone(),
                base_amplitude_m: own.base_amplitude_m,
                branches,
                without,
            });
        }
    }
    all
}
