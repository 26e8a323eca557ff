//! Limits of a campaign: keys of `[rig]` that tighten the board's limits while its experiments run.
//!
//! The core decides whether a limit is tighter ([`SafetyConfig::tightened`]), for the board and the host alike; this module
//! has the keys, and reports a looser limit with its place in the file.

use damprig_core::control::safety::{ExperimentLimits, LimitsRejected, Looser, SafetyConfig};

use crate::input::{Number, Problem, Section, Source};
use crate::settings::decimal;

/// A limit as a campaign states it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    /// The key in `[rig]`.
    pub key: &'static str,
    /// The board's setting that it tightens.
    pub setting: &'static str,
    number: Number,
}

/// The limits that a campaign states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CampaignLimits {
    stated: Vec<Stated>,
}

const STRUCTURE: &str = "safety.limits.structure_m";
const BASE: &str = "safety.limits.base_m";
const AHEAD: &str = "safety.half_cycles_ahead";
const WALL: &str = "safety.wall_force_n";
const SATURATED: &str = "safety.saturated_s";
const SILENT: &str = "safety.host_silent_s";
const BRAKE: &str = "safety.brake_n";

impl CampaignLimits {
    /// The keys of `[rig]`.
    pub(super) fn read(rig: &Section) -> Self {
        let mut stated = Vec::new();
        let mut add = |key, settings: &[&'static str], number: Option<Number>| {
            let Some(number) = number else { return };
            stated.extend(settings.iter().map(|setting| Stated { key, setting, number: number.clone() }));
        };
        let both = rig.positive("displacement_limit_m");
        for (key, setting) in [("structure_limit_m", STRUCTURE), ("base_limit_m", BASE)] {
            let number = rig.positive(key);
            if let (Some(number), true) = (&number, both.is_some()) {
                let help = Some(format!("leave out `displacement_limit_m` or `{key}`"));
                rig.refuse(key, &number.span, "`displacement_limit_m` is given too, and limits both |x| and |z|", help);
            }
            add(key, &[setting], number);
        }
        add("displacement_limit_m", &[STRUCTURE, BASE], both);
        let ahead = rig.number_if("half_cycles_ahead", |v| (0.0..=20.0).contains(&v), "from 0 to 20");
        add("half_cycles_ahead", &[AHEAD], ahead);
        add("wall_force_limit_n", &[WALL], rig.positive("wall_force_limit_n"));
        add("saturated_s", &[SATURATED], rig.positive("saturated_s"));
        // This program sends a message every second. 0 is compared with the board's settings, which refuse it.
        let silent = rig.number_if("host_silent_s", |v| v == 0.0 || (5.0..=3600.0).contains(&v), "from 5 to 3600");
        add("host_silent_s", &[SILENT], silent);
        add("brake_n", &[BRAKE], rig.not_negative("brake_n"));
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

impl Stated {
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
