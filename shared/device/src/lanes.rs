//! What control has to say, and where it puts that: as short as it can be told. Its words are made where the line is, which
//! has the time.

use crate::orders::Chosen;
use damprig_core::rig::{Refusal, Signals};
use damprig_protocol::{Answer, FromDevice, Happening};

/// What goes out before telemetry.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // No allocator: a box is not to be had.
pub enum Saying {
    /// To the request of this number.
    Reply {
        /// The request's number.
        seq: u16,
        /// The answer, or why there is none.
        answer: Result<Answer, Refusal>,
    },
    /// Something happened.
    Event {
        /// Counts events since power-on.
        seq: u16,
        /// In which tick.
        tick: u32,
        /// What.
        event: Happening,
    },
}

impl From<Saying> for FromDevice {
    fn from(saying: Saying) -> Self {
        match saying {
            Saying::Reply { seq, answer } => Self::Reply { seq, answer: answer.map_err(Into::into) },
            Saying::Event { seq, tick, event } => Self::Event { seq, tick, event },
        }
    }
}

/// One row of telemetry; `V` is how it has its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Row<V = Signals> {
    /// Its tick.
    pub tick: u32,
    /// Ticks between rows.
    pub every_ticks: u16,
    /// The signals that are asked for: taken out where there is more time than in a tick.
    pub chosen: Chosen,
    /// All of them.
    pub values: V,
    /// Nothing follows soon: do not wait for more rows before sending.
    pub last: bool,
}

impl Row<&Signals> {
    /// With values of its own.
    #[must_use]
    #[inline]
    pub fn copied(&self) -> Row {
        let Self { tick, every_ticks, chosen, values, last } = *self;
        Row { tick, every_ticks, chosen, values: *values, last }
    }
}

/// Where control puts what it has to say. Neither may wait: a full lane says no, and control counts it.
pub trait Lanes {
    /// Replies and events; how many wait now.
    ///
    /// # Errors
    /// There is no room.
    #[allow(clippy::result_unit_err)] // The only failure is "full", and the caller counts it.
    fn urgent(&mut self, saying: Saying) -> Result<usize, ()>;

    /// Telemetry, to copy once; how many rows wait now.
    ///
    /// # Errors
    /// There is no room.
    #[allow(clippy::result_unit_err)]
    fn row(&mut self, row: Row<&Signals>) -> Result<usize, ()>;
}
