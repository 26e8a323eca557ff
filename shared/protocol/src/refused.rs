//! Why a request was not carried out, as it goes over the line.

use damprig_core::control::friction_spring as spring;
use damprig_core::control::safety::Looser;
use damprig_core::io::{AboveLimit, Invalid};
use damprig_core::rig::{Refusal, State};
use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Why a request was not carried out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Refused {
    /// A parameter is out of range.
    Invalid {
        /// Its name with its unit.
        parameter: String<40>,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: String<96>,
    },
    /// A limit of an experiment is looser than the board's.
    Looser {
        /// The board's setting.
        setting: String<40>,
        /// What was asked for.
        value: f32,
        /// The board's value.
        board: f32,
    },
    /// It makes no sense in this state.
    WrongState {
        /// The state.
        state: State,
        /// What to do.
        advice: String<48>,
    },
    /// It makes no sense at this stage of the friction damper's spring.
    WrongStage {
        /// The stage.
        stage: spring::SpringStage,
        /// What to do.
        advice: String<48>,
    },
    /// This board cannot do it.
    NotHere {
        /// Why.
        why: String<64>,
    },
    /// A value is above a limit of the board's settings.
    AboveLimit {
        /// Its name with its unit.
        parameter: String<40>,
        /// Its value.
        value: f32,
        /// The limit.
        limit: f32,
        /// What to do.
        advice: String<96>,
    },
}

/// As much of `text` as fits.
#[must_use]
pub fn clipped<const N: usize>(text: &str) -> String<N> {
    String::try_from(start_of(text, N)).unwrap_or_default()
}

/// The whole characters of `text` within its first `most` bytes.
fn start_of(text: &str, most: usize) -> &str {
    let end = (0..=most.min(text.len())).rev().find(|&end| text.is_char_boundary(end));
    end.and_then(|end| text.get(..end)).unwrap_or_default()
}

impl From<Refusal> for Refused {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Invalid(Invalid { parameter, value, allowed }) => {
                Self::Invalid { parameter: clipped(parameter), value, allowed: clipped(allowed) }
            }
            Refusal::Looser(Looser { setting, value, board }) => {
                Self::Looser { setting: clipped(setting), value, board }
            }
            Refusal::WrongState { state, advice } => Self::WrongState { state, advice: clipped(advice) },
            Refusal::WrongStage { stage, advice } => Self::WrongStage { stage, advice: clipped(advice) },
            Refusal::NotHere(why) => Self::NotHere { why: clipped(why) },
            Refusal::AboveLimit(AboveLimit { parameter, value, limit, advice }) => {
                Self::AboveLimit { parameter: clipped(parameter), value, limit, advice: clipped(advice) }
            }
        }
    }
}

impl core::fmt::Display for Refused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Invalid { parameter, value, allowed } => {
                write!(f, "{parameter} = {value} is not allowed: must be {allowed}")
            }
            Self::Looser { setting, value, board } => {
                write!(
                    f,
                    "{setting} = {value} would loosen the board's {board}: an experiment may only tighten a limit"
                )
            }
            Self::WrongState { state, advice } => write!(f, "not while the rig is {}: {advice}", state.text()),
            Self::WrongStage { stage, advice } => {
                write!(f, "not while the friction damper's spring is {}: {advice}", stage.text())
            }
            Self::NotHere { why } => f.write_str(why),
            Self::AboveLimit { parameter, value, limit, advice } => {
                write!(f, "{parameter} = {value} is above the limit of {limit}: {advice}")
            }
        }
    }
}
