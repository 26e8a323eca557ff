//! Sensor inputs of a tick: reduced displacements and spring force, every wall-force sample, and the switches.

use super::rate::WALL_SUBSAMPLES;
use super::reading::{Reading, Readings};
use super::scale::ForceScale;

/// All sensor values since the last tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Displacements and the spring force.
    pub readings: Readings,
    /// Forces on the walls at −d and +d in converter counts, on the rig's [`ForceScale`].
    pub walls: [WallCounts; WALL_SUBSAMPLES],
    /// The spring's limit switch is closed.
    pub at_limit: bool,
    /// The emergency stop is pressed.
    pub emergency_stop: bool,
}

impl Default for Sensors {
    /// All sensors at rest.
    fn default() -> Self {
        let resting = ForceScale::default().zero_counts as u16;
        Self {
            readings: Readings { x: Reading::still(0.0), z: Reading::still(0.0), ..Readings::default() },
            walls: [WallCounts::new(resting, resting); WALL_SUBSAMPLES],
            at_limit: false,
            emergency_stop: false,
        }
    }
}

impl Sensors {
    /// The input for a lost block: both displacements are NaN, so a running experiment ends with a sensor fault.
    #[must_use]
    pub fn lost() -> Self {
        let nan = Reading { mean_m: f32::NAN, peak_m: f32::NAN, ..Reading::default() };
        Self { readings: Readings { x: nan, z: nan, ..Readings::default() }, ..Self::default() }
    }
}

/// One sample of both walls, laid out as a converter that samples one wall after the other leaves them in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct WallCounts([u16; 2]);

impl WallCounts {
    /// Counts on the wall at −d and at +d.
    #[must_use]
    pub const fn new(low: u16, high: u16) -> Self {
        Self([low, high])
    }

    /// The counts of wall 0 (at −d) or wall 1 (at +d).
    #[must_use]
    #[inline]
    pub fn of(&self, wall: usize) -> u16 {
        self.0[wall & 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_displacements_of_a_lost_block_are_nan() {
        let readings = Sensors::lost().readings;
        assert!(readings.x.peak_m.is_nan() && readings.z.mean_m.is_nan());
    }
}
