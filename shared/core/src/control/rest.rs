//! Rest detection: waits until the structure is at rest before an experiment drives it.

use crate::io::TICK_HZ;

/// Time for which |x| must stay below the rest level, s.
pub const REST_HOLD_S: f32 = 0.5;

/// Longest wait for the structure to come to rest, s. A structure of ζ = 0.0038 needs about 80 s from 50 mm.
const REST_TIMEOUT_S: f32 = 600.0;

const REST_HOLD_TICKS: u32 = (REST_HOLD_S * TICK_HZ) as u32;
const REST_TIMEOUT_TICKS: u32 = (REST_TIMEOUT_S * TICK_HZ) as u32;

/// Result of one tick of waiting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waited {
    /// The structure still moves, or has not been at rest for long enough.
    NotYet,
    /// First tick of the wait: a simulated plant is reset to its start.
    Begun,
    /// The structure is at rest.
    Quiet,
    /// The wait has exceeded its longest time.
    TimedOut,
}

/// A wait for rest in progress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RestWait {
    ticks: u32,
    quiet_ticks: u32,
}

impl RestWait {
    /// Takes one tick: the largest |x| in it, and the level below which the structure is at rest, m.
    pub fn tick(&mut self, max_abs_x_m: f32, level_m: f32) -> Waited {
        self.ticks += 1;
        // In the tick in which a plant is reset, the samples still belong to the motion before the reset.
        let begun = self.ticks == 1;
        let quiet = max_abs_x_m < level_m && !begun;
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
