//! Waiting for the structure to come to rest before an experiment drives it.

use crate::io::TICK_HZ;

/// How long |x| must stay below the rest level, s.
pub const REST_HOLD_S: f32 = 0.5;

/// How long the structure may take to come to rest, s: a structure of ζ = 0.0038 needs about 80 s from 50 mm.
const REST_TIMEOUT_S: f32 = 600.0;

const REST_HOLD_TICKS: u32 = (REST_HOLD_S * TICK_HZ) as u32;
const REST_TIMEOUT_TICKS: u32 = (REST_TIMEOUT_S * TICK_HZ) as u32;

/// What a tick of waiting has shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waited {
    /// The structure still moves, or has not been quiet for long enough.
    NotYet,
    /// The first tick of waiting: a simulated plant is to be put back to its start.
    Begun,
    /// It is at rest.
    Quiet,
    /// It took too long.
    TimedOut,
}

/// The wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RestWait {
    ticks: u32,
    quiet_ticks: u32,
}

impl RestWait {
    /// One tick: largest |x| in it and the level below which it is quiet, m.
    pub fn tick(&mut self, x_peak_m: f32, level_m: f32) -> Waited {
        self.ticks += 1;
        // The samples of the tick in which a plant is put back are still of the motion before.
        let begun = self.ticks == 1;
        let quiet = x_peak_m < level_m && !begun;
        self.quiet_ticks = if quiet { self.quiet_ticks + 1 } else { 0 };
        if self.quiet_ticks >= REST_HOLD_TICKS {
            Waited::Quiet
        } else if self.ticks > REST_TIMEOUT_TICKS {
            Waited::TimedOut
        } else if begun {
            Waited::Begun
        } else {
            Waited::NotYet
        }
    }
}
