//! The error of a rejected request, as it is sent to the host.

use super::RigState;
use crate::control::friction_spring as spring;
use crate::control::safety::{LimitsRejected, Looser};
use crate::io::{AboveLimit, Invalid};
use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Why a request was rejected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Rejected {
    /// A parameter is out of range.
    Invalid {
        /// The parameter's name with its unit.
        parameter: String<40>,
        /// Value of the parameter.
        value: f64,
        /// What is allowed.
        allowed: String<96>,
    },
    /// A limit of an experiment is looser than the board's.
    Looser {
        /// Name of the board's setting.
        setting: String<40>,
        /// The requested value.
        value: f32,
        /// The board's value.
        board: f32,
    },
    /// The request is not possible in this state.
    WrongState {
        /// State of the rig.
        state: RigState,
        /// What to do.
        advice: String<48>,
    },
    /// The request is not possible at this stage of the friction damper's spring.
    WrongStage {
        /// Stage of the spring.
        stage: spring::SpringStage,
        /// What to do.
        advice: String<48>,
    },
    /// This board does not support the request.
    NotHere {
        /// The reason.
        why: String<64>,
    },
    /// A value is above a limit of the board's settings.
    AboveLimit {
        /// The parameter's name with its unit.
        parameter: String<40>,
        /// Value of the parameter.
        value: f32,
        /// The limit.
        limit: f32,
        /// What to do.
        advice: String<96>,
    },
}

/// The start of `text` that fits into `N` bytes.
#[must_use]
pub fn clipped<const N: usize>(text: &str) -> String<N> {
    String::try_from(start_of(text, N)).unwrap_or_default()
}

/// The longest start of `text` that ends at a character boundary within `most` bytes.
fn start_of(text: &str, most: usize) -> &str {
    let end = (0..=most.min(text.len())).rev().find(|&end| text.is_char_boundary(end));
    end.and_then(|end| text.get(..end)).unwrap_or_default()
}

impl Rejected {
    /// The request is not possible in this state of the rig.
    #[must_use]
    pub fn wrong_state(state: RigState, advice: &str) -> Self {
        Self::WrongState { state, advice: clipped(advice) }
    }

    /// The request is not possible at this stage of the friction damper's spring.
    #[must_use]
    pub fn wrong_stage(stage: spring::SpringStage, advice: &str) -> Self {
        Self::WrongStage { stage, advice: clipped(advice) }
    }

    /// The request is not possible on this board, or not now.
    #[must_use]
    pub fn not_here(why: &str) -> Self {
        Self::NotHere { why: clipped(why) }
    }
}

impl From<AboveLimit> for Rejected {
    fn from(AboveLimit { parameter, value, limit, advice }: AboveLimit) -> Self {
        Self::AboveLimit { parameter: clipped(parameter), value, limit, advice: clipped(advice) }
    }
}

impl From<Invalid> for Rejected {
    fn from(Invalid { parameter, value, allowed }: Invalid) -> Self {
        Self::Invalid { parameter: clipped(parameter), value, allowed: clipped(allowed) }
    }
}

impl From<LimitsRejected> for Rejected {
    fn from(rejected: LimitsRejected) -> Self {
        match rejected {
            LimitsRejected::Looser(Looser { setting, value, board }) => {
                Self::Looser { setting: clipped(setting), value, board }
            }
            LimitsRejected::Invalid(invalid) => invalid.into(),
        }
    }
}

impl From<spring::SpringRejected> for Rejected {
    fn from(rejected: spring::SpringRejected) -> Self {
        match rejected {
            spring::SpringRejected::Invalid(invalid) => invalid.into(),
            spring::SpringRejected::WrongStage { stage, advice } => Self::wrong_stage(stage, advice),
        }
    }
}

impl core::fmt::Display for Rejected {
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
