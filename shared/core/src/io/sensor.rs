//! The five sensors of the rig by name, and sets of sensors.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Number of sensors.
pub const SENSORS: usize = 5;

/// A sensor of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Sensor {
    /// Structure displacement.
    X,
    /// Base displacement.
    Z,
    /// Force in the friction damper's spring.
    SpringForce,
    /// Force on the wall at −d.
    WallLow,
    /// Force on the wall at +d.
    WallHigh,
}

impl Sensor {
    /// All sensors. The index of a sensor is `sensor as usize`.
    pub const ALL: [Self; SENSORS] = [Self::X, Self::Z, Self::SpringForce, Self::WallLow, Self::WallHigh];

    /// The sensor's name for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Z => "z",
            Self::SpringForce => "spring force",
            Self::WallLow => "wall at −d",
            Self::WallHigh => "wall at +d",
        }
    }
}

/// A set of sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct SensorSet(u8);

impl SensorSet {
    /// Adds a sensor.
    pub fn insert(&mut self, sensor: Sensor) {
        self.0 |= 1 << sensor as u8;
    }

    /// Adds the sensors of another set.
    pub fn extend(&mut self, other: Self) {
        self.0 |= other.0;
    }

    /// The set contains the sensor.
    #[must_use]
    pub fn contains(self, sensor: Sensor) -> bool {
        self.0 & 1 << sensor as u8 != 0
    }

    /// The set is empty.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// Writes the names, separated by commas.
impl core::fmt::Display for SensorSet {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mut separator = "";
        for sensor in Sensor::ALL.into_iter().filter(|sensor| self.contains(*sensor)) {
            write!(f, "{separator}{}", sensor.text())?;
            separator = ", ";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_names_its_sensors() {
        let mut set = SensorSet::default();
        assert!(set.is_empty() && !set.contains(Sensor::X));
        set.insert(Sensor::WallHigh);
        set.insert(Sensor::X);
        let mut text = heapless::String::<32>::new();
        core::fmt::write(&mut text, format_args!("{set}")).unwrap();
        assert_eq!(text, "x, wall at +d");
        for (place, sensor) in Sensor::ALL.into_iter().enumerate() {
            assert_eq!(sensor as usize, place);
        }
    }
}
