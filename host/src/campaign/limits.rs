//! Limits of a campaign: keys of `[rig]` that tighten the board's limits while its experiments run.
//!
//! The core decides whether a limit is tighter ([`SafetyConfig::tightened`]), for the board and the host alike; this module
//! says which setting each key tightens, and reports a looser limit with its place in the file.

use damprig_core::control::safety::{ExperimentLimits, LimitsRejected, Looser, SafetyConfig};

use super::keys::rig as keys;
use crate::input::key::KeyedQuantity;
use crate::input::{Number, Problem, Section, Source};
use crate::settings::decimal;

/// A limit as a campaign states it.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedLimit {
    /// The key in `[rig]`.
    pub key: &'static str,
    /// The board's setting that it tightens.
    pub setting: &'static str,
    number: Number,
}

/// The limits that a campaign states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CampaignLimits {
    stated: Vec<StatedLimit>,
}

const STRUCTURE: &str = "safety.limits.structure_m";
const BASE: &str = "safety.limits.base_m";
const AHEAD: &str = "safety.half_cycles_ahead";
const WALL: &str = "safety.wall_force_n";
const SATURATED: &str = "safety.saturated_s";
const SILENT: &str = "safety.host_silent_s";
const BRAKE: &str = "safety.brake_n";

/// Each limit of a campaign, and the settings of the board that it tightens.
const LIMITS: [(KeyedQuantity, &[&str]); 8] = [
    (keys::STRUCTURE_LIMIT, &[STRUCTURE]),
    (keys::BASE_LIMIT, &[BASE]),
    (keys::DISPLACEMENT_LIMIT, &[STRUCTURE, BASE]),
    (keys::HALF_CYCLES_AHEAD, &[AHEAD]),
    (keys::WALL_FORCE_LIMIT, &[WALL]),
    (keys::SATURATED, &[SATURATED]),
    (keys::HOST_SILENT, &[SILENT]),
    (keys::BRAKE, &[BRAKE]),
];

impl CampaignLimits {
    /// The keys of `[rig]`.
    pub(super) fn read(rig: &Section) -> Self {
        let mut stated = Vec::new();
        for (quantity, settings) in &LIMITS {
            let Some(number) = rig.placed(quantity) else { continue };
            let key = quantity.name();
            stated.extend(settings.iter().map(|&setting| StatedLimit { key, setting, number: number.clone() }));
        }
        Self { stated }
    }

    /// As the device's request has them.
    #[must_use]
    pub fn of_experiment(&self) -> ExperimentLimits {
        let mut limits = ExperimentLimits::default();
        self.stated.iter().for_each(|stated| stated.put_into(&mut limits));
        limits
    }

    /// The key of the campaign that tightens a setting of the board, if one does.
    #[must_use]
    pub fn key_of(&self, setting: &str) -> Option<&'static str> {
        self.stated.iter().find(|stated| stated.setting == setting).map(|stated| stated.key)
    }

    /// The board's settings, tightened; a looser limit is reported and left out.
    pub(super) fn acting(&self, source: &Source, board: &SafetyConfig) -> SafetyConfig {
        let mut acting = *board;
        for stated in &self.stated {
            let mut alone = ExperimentLimits::default();
            stated.put_into(&mut alone);
            match acting.tightened(&alone) {
                Ok(tightened) => acting = tightened,
                Err(rejected) => source.report(stated.problem(rejected)),
            }
        }
        acting
    }
}

impl StatedLimit {
    fn put_into(&self, limits: &mut ExperimentLimits) {
        let place = match self.setting {
            STRUCTURE => &mut limits.structure_m,
            BASE => &mut limits.base_m,
            AHEAD => &mut limits.half_cycles_ahead,
            WALL => &mut limits.wall_force_n,
            SATURATED => &mut limits.saturated_s,
            SILENT => &mut limits.host_silent_s,
            _ => &mut limits.brake_n,
        };
        *place = Some(self.number.value as f32);
    }

    fn problem(&self, rejected: LimitsRejected) -> Problem {
        let Self { key, number, .. } = self;
        let (allowed, help) = match rejected {
            LimitsRejected::Looser(Looser { setting, board, .. }) => (
                format!("looser than the board's {setting} = {}; a campaign may only tighten a limit", decimal(board)),
                Some(format!(
                    "write {key} = {} or tighter, or leave it out; `damprig settings set {setting}=…` changes the board's own",
                    decimal(board)
                )),
            ),
            LimitsRejected::Invalid(invalid) => {
                let value = decimal(invalid.value as f32);
                (format!("with it {} = {value}: must be {}", invalid.parameter, invalid.allowed), None)
            }
        };
        let title = format!("`rig.{key}` = {} is not allowed", number.value);
        Problem { title, span: number.span.clone(), allowed, help }
    }
}
