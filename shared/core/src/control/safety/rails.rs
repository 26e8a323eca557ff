//! Check that each sensor is connected: a signal at a rail for [`RAIL_TICKS`] is a sensor fault, on every scale.
//!
//! An open input, a broken supply and a shorted cable all read a rail. A signal that only touches a rail is clipped,
//! which is recorded and reported. [`Rail`] is defined in [`crate::io`]; [`super::Safety`] decides which sensors end an
//! experiment.

use crate::io::{Rail, SENSORS, Sensor, SensorSet};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Consecutive ticks with every sample at a rail after which a sensor counts as lost: 5 ms.
pub const RAIL_TICKS: u8 = 5;

/// Verdict on a sensor in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SensorVerdict {
    /// The sensor gives a signal.
    #[default]
    Reads,
    /// Every sample is at a rail, for fewer than [`RAIL_TICKS`] ticks.
    AtRail,
    /// The sensor is unplugged, without supply or shorted.
    Lost {
        /// Mean reading, in the sensor's unit.
        reading: f32,
        /// The end of the usable span that the reading is beyond.
        edge: f32,
    },
}

/// Health of the sensors, for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct SensorHealth {
    /// Sensors at a rail now, for [`RAIL_TICKS`] or longer.
    pub lost: SensorSet,
    /// Sensors with at least one sample at a rail since the last start.
    pub clipped: SensorSet,
}

/// Checks every sensor for rails.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RailWatch {
    ticks: [u8; SENSORS],
    verdicts: [SensorVerdict; SENSORS],
    health: SensorHealth,
    clipped_now: SensorSet,
}

impl RailWatch {
    /// Takes one tick's rails, in the order of [`Sensor::ALL`].
    pub fn push(&mut self, rails: &[Rail; SENSORS]) {
        self.clipped_now = SensorSet::default();
        self.health.lost = SensorSet::default();
        for (sensor, rail) in Sensor::ALL.into_iter().zip(rails) {
            let (ticks, verdict) = (&mut self.ticks[sensor as usize], &mut self.verdicts[sensor as usize]);
            if *rail != Rail::Clear {
                self.clipped_now.insert(sensor);
            }
            let Rail::All { reading, edge } = *rail else {
                (*ticks, *verdict) = (0, SensorVerdict::Reads);
                continue;
            };
            *ticks = ticks.saturating_add(1);
            *verdict = SensorVerdict::AtRail;
            if *ticks >= RAIL_TICKS {
                *verdict = SensorVerdict::Lost { reading, edge };
                self.health.lost.insert(sensor);
            }
        }
        self.health.clipped.extend(self.clipped_now);
    }

    /// Verdict on a sensor in this tick.
    #[must_use]
    pub fn verdict(&self, sensor: Sensor) -> SensorVerdict {
        self.verdicts[sensor as usize]
    }

    /// The first lost sensor, its reading and the end of its usable span.
    #[must_use]
    pub fn first_lost(&self) -> Option<(Sensor, f32, f32)> {
        Sensor::ALL.into_iter().find_map(|sensor| match self.verdict(sensor) {
            SensorVerdict::Lost { reading, edge } => Some((sensor, reading, edge)),
            SensorVerdict::Reads | SensorVerdict::AtRail => None,
        })
    }

    /// Sensors with a sample at a rail in this tick.
    #[must_use]
    pub fn clipped_now(&self) -> SensorSet {
        self.clipped_now
    }

    /// Health of the sensors.
    #[must_use]
    pub fn health(&self) -> SensorHealth {
        self.health
    }

    /// Starts an experiment: clipping is recorded from now on.
    pub fn restart(&mut self) {
        self.health.clipped = SensorSet::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT_RAIL: Rail = Rail::All { reading: 0.0, edge: 0.01 };

    fn ticks(watch: &mut RailWatch, rail: Rail, count: u8) -> SensorVerdict {
        let mut rails = [Rail::Clear; SENSORS];
        rails[Sensor::SpringForce as usize] = rail;
        (0..count).for_each(|_| watch.push(&rails));
        watch.verdict(Sensor::SpringForce)
    }

    #[test]
    fn a_sensor_at_a_rail_for_five_milliseconds_is_lost_and_for_less_is_clipped() {
        let mut watch = RailWatch::default();
        assert_eq!(ticks(&mut watch, AT_RAIL, 4), SensorVerdict::AtRail);
        assert_eq!(ticks(&mut watch, Rail::Some, 1), SensorVerdict::Reads);
        assert_eq!(watch.first_lost(), None);
        assert!(watch.health().clipped.contains(Sensor::SpringForce) && watch.health().lost.is_empty());
        assert_eq!(ticks(&mut watch, AT_RAIL, 5), SensorVerdict::Lost { reading: 0.0, edge: 0.01 });
        assert_eq!(watch.first_lost(), Some((Sensor::SpringForce, 0.0, 0.01)));
        assert!(watch.health().lost.contains(Sensor::SpringForce) && !watch.health().lost.contains(Sensor::X));
        assert_eq!(ticks(&mut watch, Rail::Clear, 1), SensorVerdict::Reads);
        assert!(watch.health().lost.is_empty() && watch.clipped_now().is_empty());
    }
}
