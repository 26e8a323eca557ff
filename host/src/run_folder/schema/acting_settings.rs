//! The settings that acted in a run, each with its origin: the board's limits, tightened by the campaign, and the spring
//! properties that set-ups state for their friction damper. Every other setting acted with the board's value.

use serde::{Deserialize, Serialize};

use super::device::BoardSettings;
use crate::campaign::{Campaign, CampaignSetUp};
use crate::settings::{entries, number_of};
use damprig_core::settings::Settings;

/// A setting that acted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActingSetting {
    /// Its path in the board's settings: `safety.wall_force_n`.
    pub setting: String,
    /// The set-up for which it acted; none for all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set_up: Option<String>,
    /// Its value.
    pub value: f64,
    /// The board with the source of its settings, or the campaign with its key.
    pub origin: String,
    /// The board's value, where the campaign's replaced it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub board_value: Option<f64>,
}

/// The limits in force, then the spring of each set-up whose spring the rig adjusts. Empty when the board's settings are
/// unknown.
#[must_use]
pub fn acting_settings(campaign: &Campaign, board: Option<&BoardSettings>) -> Vec<ActingSetting> {
    let Some(board) = board else { return Vec::new() };
    let of_board = format!("board ({})", board.source);
    let acting = entries(&Settings { safety: campaign.rig.acting, ..board.settings });
    let own = entries(&board.settings);
    let one = |setting: &str, set_up: Option<&CampaignSetUp>, value: f32, board_value: f32, key: Option<String>| {
        let is_stated = key.is_some();
        ActingSetting {
            setting: setting.to_string(),
            set_up: set_up.map(|set_up| set_up.name.clone()),
            value: number_of(value),
            origin: key.map_or_else(|| of_board.clone(), |key| format!("campaign ({key})")),
            board_value: is_stated.then_some(number_of(board_value)),
        }
    };
    let is_limit = |place: &[String]| place.first().is_some_and(|table| table == "safety");
    let mut list: Vec<ActingSetting> = acting
        .iter()
        .zip(&own)
        .filter(|((place, _), _)| is_limit(place))
        .map(|((place, value), (_, board_value))| {
            let setting = place.join(".");
            let key = campaign.rig.limits.key_of(&setting).map(|key| format!("rig.{key}"));
            one(&setting, None, *value, *board_value, key)
        })
        .collect();
    let spring = &board.settings.spring;
    for set_up in &campaign.set_ups {
        let Some(own) = set_up.spring() else { continue };
        let [friction, stiffness] = own.stated();
        let key = |name: &str| Some(format!("set_up {:?}, {name}", set_up.name));
        let structure = set_up.model().structure.stiffness_n_per_m as f32;
        for (setting, value, board_value, key) in [
            (
                "spring.stiffness_n_per_m",
                own.stiffness_n_per_m as f32,
                spring.stiffness_n_per_m,
                stiffness.and_then(|_| key("spring.stiffness_n_per_m")),
            ),
            (
                "spring.friction_coefficient",
                own.friction_coefficient as f32,
                spring.friction_coefficient,
                friction.and_then(|_| key("spring.friction_coefficient")),
            ),
            ("spring.structure_stiffness_n_per_m", structure, spring.structure_stiffness_n_per_m, key("structure")),
        ] {
            list.push(one(setting, Some(set_up), value, board_value, key));
        }
    }
    list
}
