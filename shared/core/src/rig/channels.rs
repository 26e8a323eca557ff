//! The five sensors of a rig, and what a block of samples says about the converter's rails.
//!
//! Every sensor has a live zero: its signal without a load lies well inside the converter's span, so an open input, which
//! reads a rail, is no measurement. Samples within [`RAIL_SHARE`] of the span from either end count as *at a rail*. The
//! board finds them in the converter's counts, a simulated plant in its sensors' SI readings; both give the same [`Rail`].
//! What follows from it is decided in [`crate::control::safety::rails`].

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Share of a converter's span at either end within which a sample is at a rail. 3 mV on an open input are 0.1 %.
pub const RAIL_SHARE: f32 = 0.01;

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
    /// All of them; a sensor's place is `sensor as usize`.
    pub const ALL: [Self; SENSORS] = [Self::X, Self::Z, Self::SpringForce, Self::WallLow, Self::WallHigh];

    /// Its name, for people.
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

/// Some of the sensors.
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

    /// The sensor is one of them.
    #[must_use]
    pub fn contains(self, sensor: Sensor) -> bool {
        self.0 & 1 << sensor as u8 != 0
    }

    /// There is none.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// The names, separated by commas.
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

/// The part of a channel's span between the rails: a sample at or beyond either end is at a rail. `T` is `u16` for counts, `f32`
/// for SI readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usable<T> {
    /// Lower end.
    pub low: T,
    /// Upper end.
    pub high: T,
}

impl<T: Copy + PartialOrd> Usable<T> {
    /// The sample is at a rail. Not a number is at none.
    #[inline]
    #[must_use]
    pub fn is_at_rail(&self, sample: T) -> bool {
        sample <= self.low || sample >= self.high
    }
}

impl Usable<u16> {
    /// Of a converter that gives 0 to `full_scale`.
    #[must_use]
    pub const fn of_counts(full_scale: u16) -> Self {
        let margin = (full_scale as f32 * RAIL_SHARE) as u16;
        Self { low: margin, high: full_scale - margin }
    }

    /// In the unit of a sensor.
    #[must_use]
    pub fn map(&self, to_si: impl Fn(u16) -> f32) -> Usable<f32> {
        let (low, high) = (to_si(self.low), to_si(self.high));
        // A sensor may look the other way.
        if low < high { Usable { low, high } } else { Usable { low: high, high: low } }
    }
}

impl Usable<f32> {
    /// Of a span from `low` to `high`.
    #[must_use]
    pub fn of_span(low: f32, high: f32) -> Self {
        let margin = RAIL_SHARE * (high - low);
        Self { low: low + margin, high: high - margin }
    }

    /// The largest amplitude about zero that stays inside; negative if zero lies outside.
    #[must_use]
    pub fn amplitude(&self) -> f32 {
        self.high.min(-self.low)
    }

    /// What a block comes to of which `at_rail` of `samples` samples are at a rail, and whose mean is this.
    #[must_use]
    pub fn rail(&self, at_rail: usize, samples: usize, mean: f32) -> Rail {
        if at_rail == 0 {
            return Rail::Clear;
        } else if at_rail < samples {
            return Rail::Some;
        }
        let edge = if mean - self.low < self.high - mean { self.low } else { self.high };
        Rail::All { reading: mean, edge }
    }
}

/// How much of a tick's block of samples is at a rail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Rail {
    /// No sample.
    #[default]
    Clear,
    /// Some samples: the signal is clipped.
    Some,
    /// Every sample: this is no signal.
    All {
        /// Mean of the block, in the sensor's unit.
        reading: f32,
        /// The end of the usable span that it is beyond.
        edge: f32,
    },
}

impl Rail {
    /// Every sample is at a rail.
    #[must_use]
    pub fn is_all(self) -> bool {
        matches!(self, Self::All { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundredth_of_the_span_at_either_end_is_rail() {
        let counts = Usable::of_counts(4_095);
        assert_eq!((counts.low, counts.high), (40, 4_055));
        assert!(
            counts.is_at_rail(40) && counts.is_at_rail(4_055) && !counts.is_at_rail(41) && !counts.is_at_rail(4_054)
        );
        let metres = Usable::of_span(-0.08, 0.08);
        assert!((metres.low + 0.0784).abs() < 1e-8 && (metres.amplitude() - 0.0784).abs() < 1e-8);
        assert!(metres.is_at_rail(f32::INFINITY) && !metres.is_at_rail(f32::NAN));
        // A sensor that looks the other way.
        let reversed = counts.map(|counts| -f32::from(counts));
        assert_eq!((reversed.low, reversed.high), (-4_055.0, -40.0));
    }

    #[test]
    fn a_block_is_clear_clipped_or_lost() {
        let usable = Usable::of_span(0.0, 100.0);
        assert_eq!(usable.rail(0, 10, 50.0), Rail::Clear);
        assert_eq!(usable.rail(9, 10, 99.0), Rail::Some);
        assert_eq!(usable.rail(10, 10, 0.1), Rail::All { reading: 0.1, edge: 1.0 });
        assert_eq!(usable.rail(10, 10, 99.9), Rail::All { reading: 99.9, edge: 99.0 });
    }

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
